"""The release of a given motion by several models, as one picture (Figs. 6 and 10 of the paper)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import MODELS, SLIDING_PIVOT, STEPPED_SURFACE, Array
from ..check import Simulation, case_of, given_hand
from .style import PHASES, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ...models import Release, ReleaseCase, ReleaseModel
    from ...problems import Scene


#: What is plotted over time.
FOUR = ("v_z of the CoM [m/s]", "ω [rad/s]", "friction f_z [N]", "friction torque [N mm]")


def draw_releases(scene: Scene, runs: Mapping[str, Simulation], path: Path) -> None:
    """CoM and friction over time by each model; areas: the modes of the sliding pivot.

    Below, v_z and ω less those of the time stepping, for models that do not chatter. A run
    without numbers is only named.
    """
    case = case_of(scene, given_hand(scene))
    figure = new_figure(9.1, 8.9)
    grid = figure.subplots(3, 2)
    known = {name: runs[name].release for name in (SLIDING_PIVOT, STEPPED_SURFACE) if name in runs}
    pivot, stepped = (
        known.get(name) or MODELS[name].release(case) for name in (SLIDING_PIVOT, STEPPED_SURFACE)
    )
    for name, run in runs.items():
        _draw_run(grid, MODELS[name], run.release, stepped)
    _draw_hand(grid[0], case)
    for axes, words in zip(grid.ravel(), (*FOUR, *FOUR), strict=False):
        axes.set(ylabel=words, xlabel="t [ms]", xlim=(0.0, 1e3 * case.grip.opening))
        axes.grid(alpha=0.25)
        _shade(axes, pivot, case.grip.opening)
    for axes in grid[2]:
        axes.set_title("difference to the time stepping", loc="left", fontsize=9)
    title = f"{scene.name}: release, CoM offset {1e3 * float(case.body.com_offset):.3g} mm"
    figure.suptitle(f"{title} (areas: modes of the sliding pivot)", fontsize=11)
    entries = grid[0, 0].get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower center", ncols=3, fontsize=9)
    save(figure, path)


def _draw_run(grid: npt.NDArray[Any], model: ReleaseModel, run: Release, stepped: Release) -> None:
    """One model's curves."""
    if not np.isfinite(run.com_twist).all():
        grid[0, 0].plot([], [], color=model.colour, label=f"{model.title}: {run.trouble}")
        return
    style: dict[str, Any] = {"color": model.colour, "label": model.title, "lw": 1.6}
    if model.chatters:
        style |= {"lw": 0.7, "alpha": 0.6, "zorder": 1}
    for axes, values in zip(grid[:2].ravel(), _values(run), strict=True):
        axes.plot(1e3 * run.times, values, **style)
    for axes, values, truth in zip(grid[2], _values(run), _values(stepped), strict=False):
        if not model.chatters:
            off = values - np.interp(run.times, stepped.times, truth)
            axes.plot(1e3 * run.times, off, **style)


def _values(run: Release) -> tuple[Array, ...]:
    """The values of FOUR over time; friction NaN where a model gives none."""
    wrench = np.full_like(run.com_twist, np.nan) if run.wrench is None else run.wrench
    return run.com_twist[1], run.com_twist[2], wrench[1], 1e3 * wrench[2]


def _draw_hand(axes: npt.NDArray[Any], case: ReleaseCase) -> None:
    """What a body fixed in the hand would do, where the hand moves."""
    times = np.linspace(0.0, case.grip.opening, 101)
    hand, h = case.hand.at(times), case.body.com_offset
    if np.abs(hand.twist).max() > 0:
        v_z = hand.twist[1] + hand.twist[2] * h * np.cos(hand.pose[2] + case.grasp_angle)
        for axis, fixed in zip(axes, (v_z, hand.twist[2]), strict=True):
            axis.plot(1e3 * times, fixed, color="#999999", lw=1, zorder=0, label="fixed in hand")


def _shade(axes: Axes, run: Release, opening: float) -> None:
    """Areas of stick, pivot and slide, from the onsets of a run."""
    slide = opening if run.slide is None else run.slide
    pivot = slide if run.pivot is None else min(run.pivot, slide)
    spans = {"stick": (0.0, pivot), "pivot": (pivot, slide), "slide": (slide, opening)}
    for name, (begin, end) in spans.items():
        if begin < end:
            axes.axvspan(1e3 * begin, 1e3 * end, color=PHASES[name], alpha=0.16, lw=0, label=name)
