"""The release of a given motion by several models, as one picture (Figs. 6 and 10 of the paper)."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..models import MODELS, SLIDING_PIVOT, STEPPED_SURFACE, Array
from ..planner import Simulation, case_of, given_hand
from .drawings import draw_bars
from .style import ARM, PHASES, new_figure, own_style
from .throw_picture import hand_corners

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..models import Release, ReleaseCase, ReleaseModel
    from ..problems import Scene

#: Labels of the quantities over time.
QUANTITIES = ("v_z of the CoM [m/s]", "ω [rad/s]", "friction f_z [N]", "friction torque [N mm]")


@own_style()
def draw_releases(scene: Scene, runs: Mapping[str, Simulation]) -> Figure:
    """The bar as it drops; CoM and friction over time by each model.

    Areas show the modes of the sliding pivot. The last row has the differences of v_z and ω to the
    time stepping, for convergent models. A failed run appears in the legend only.
    """
    case = case_of(scene, given_hand(scene))
    title = f"{scene.name}: release, CoM offset {1e3 * float(case.body.com_offset):.3g} mm"
    figure = new_figure(9.1, 9.9, f"{title} (areas: modes of the sliding pivot)")
    parts = figure.add_gridspec(4, 2, height_ratios=(1.3, 1, 1, 1))
    stage = figure.add_subplot(parts[0, :])
    grid = np.array([[figure.add_subplot(parts[i, j]) for j in (0, 1)] for i in (1, 2, 3)])
    pivot, stepped = (
        runs[name].release if name in runs else MODELS[name].release(case)
        for name in (SLIDING_PIVOT, STEPPED_SURFACE)
    )
    _draw_bars(stage, scene, case, stepped, pivot)
    # Convergent models come first: their curves set the axes' limits.
    for name in sorted(runs, key=lambda name: MODELS[name].nonconvergent):
        if MODELS[name].nonconvergent and grid[0, 0].lines:
            for axes in grid[:2].ravel():
                axes.set_ylim(axes.get_ylim())
        _draw_run(grid, MODELS[name], runs[name].release, stepped)
    _draw_hand(grid[0], case)
    for axes, words in zip(grid.ravel(), itertools.cycle(QUANTITIES), strict=False):
        axes.set(ylabel=words, xlabel="t [ms]", xlim=(0.0, 1e3 * case.grip.opening))
        axes.grid(alpha=0.25)
        _shade(axes, pivot, case.grip.opening)
    for axes in grid[2]:
        axes.set_title("difference to the time stepping", loc="left", fontsize=9)
    entries = grid[0, 0].get_legend_handles_labels()
    legend = figure.legend(*entries, loc="outside lower center", ncols=3, fontsize=9)
    for line in legend.get_lines():  # Chatter is drawn too thin to be seen here.
        line.set(alpha=1.0, linewidth=1.5)
    return figure


def _draw_bars(
    axes: Axes, scene: Scene, case: ReleaseCase, stepped: Release, pivot: Release
) -> None:
    """Hand and bar by the time stepping during the opening, then in free flight twice as long."""
    opening, bars = case.grip.opening, 7
    starts = {"stick": 0.0, "pivot": pivot.pivot, "slide": pivot.slide, "flight": opening}
    named = set()
    for time in np.linspace(0.0, 3 * opening, bars).tolist():
        late = max(0.0, time - opening)
        com = np.array([np.interp(time, stepped.times, row) for row in stepped.com])
        if late:
            com = scene.flight.after(stepped.detach, late).pose
        phase = [name for name, begin in starts.items() if begin is not None and begin <= time][-1]
        colour, label = PHASES[phase], None if phase in named else phase
        named.add(phase)
        look: dict[str, Any] = {"fc": (colour, 0.3), "ec": colour, "lw": 1.2, "label": label}
        draw_bars(axes, scene.object, com, **look)
    for time, alpha in ((0.0, 0.3), (opening, 0.8)):
        hand = hand_corners(scene, np.ravel(case.hand.at(np.array([time])).pose))
        axes.fill(*hand.T, color=ARM, alpha=alpha, lw=0, zorder=0)
    axes.autoscale_view()
    axes.set(aspect="equal", xlabel="x [m]", ylabel="z [m]")
    axes.grid(alpha=0.25)
    words = f"every {1e3 * 3 * opening / (bars - 1):.0f} ms by the limit surface, time stepping"
    axes.set_title(f"hand and bar {words}", loc="left", fontsize=9)
    axes.legend(fontsize=8, loc="center left", bbox_to_anchor=(1.02, 0.5), frameon=False)


def _draw_run(grid: npt.NDArray[Any], model: ReleaseModel, run: Release, stepped: Release) -> None:
    """One model's curves."""
    if not np.isfinite(run.com_twist).all():
        grid[0, 0].plot([], [], color=model.colour, label=f"{model.title}: {run.trouble}")
        return
    style: dict[str, Any] = {"color": model.colour, "label": model.title, "lw": 1.6}
    if model.nonconvergent:
        style |= {"lw": 0.5, "alpha": 0.25, "zorder": 1}
    for axes, values in zip(grid[:2].ravel(), _values(run), strict=True):
        axes.plot(1e3 * run.times, values, **style)
    if model.nonconvergent:
        return
    for axes, values, truth in zip(grid[2], _values(run), _values(stepped), strict=False):
        off = values - np.interp(run.times, stepped.times, truth)
        axes.plot(1e3 * run.times, off, **style)


def _values(run: Release) -> tuple[Array, ...]:
    """The values of QUANTITIES over time; friction is NaN for a model without one."""
    wrench = np.full_like(run.com_twist, np.nan) if run.wrench is None else run.wrench
    return run.com_twist[1], run.com_twist[2], wrench[1], 1e3 * wrench[2]


def _draw_hand(axes: npt.NDArray[Any], case: ReleaseCase) -> None:
    """Rates of a body fixed in the hand, if the hand moves."""
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
