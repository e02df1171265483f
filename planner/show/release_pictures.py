"""Pictures of a given motion's release by different models, like the paper's figures.

limit-surface.png is its Fig. 5, chatter.png Fig. 6, shapes.png Fig. 8, overhang.png
Fig. 9 and comparison.png Fig. 10, each from our own runs.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import (
    MODELS,
    STEPPED_SURFACE,
    Contact,
    ImplicitRelease,
    KarnoppRelease,
    LimitSurface,
    Quartic,
    SlidingPivotRelease,
    SteppedRelease,
    ellipsoid,
    rotated_ellipsoid,
)
from ..check import case_of, given_hand
from .contact_pictures import (
    draw_limit_surface,
    draw_overhang,
    draw_surface,
    first_slip,
    slide_onset,
)
from .style import BLACK, BLUE, GREEN, PHASES, PURPLE, RED, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ...models import CaseModel, Release, ReleaseCase
    from ...problems import Scene

Array = npt.NDArray[np.float64]

#: Explicit steps shown one by one after their first slip.
ZOOM_STEPS = 24
#: What is plotted over time.
FOUR = ("v_z of the CoM [m/s]", "ω [rad/s]", "friction f_z [N]", "friction torque [N mm]")
SHAPES: dict[str, Callable[[Contact], LimitSurface]] = {
    "ellipsoid": ellipsoid,
    "rotated ellipsoid": rotated_ellipsoid,
    "quartic": Quartic,
}


@dataclass(frozen=True)
class Curve:
    """One model in a picture over time: its label and line style."""

    label: str
    model: CaseModel
    style: dict[str, Any]


EXPLICIT = (
    Curve("Karnopp, Euler", KarnoppRelease(), {"color": RED, "lw": 0.8, "alpha": 0.8}),
    Curve(
        "smoothed (d = 0.01 m/s), Euler",
        KarnoppRelease(half_band=0.01),
        {"color": BLUE, "lw": 0.8, "alpha": 0.8, "ls": "--"},
    ),
)
_STEPPED = MODELS[STEPPED_SURFACE]
STEPPED = Curve(_STEPPED.title, _STEPPED.single, {"color": GREEN, "lw": 1.6})
SMOOTHED = Curve("smoothed (d = 0.01 m/s), LSODA", ImplicitRelease(), {"color": PURPLE, "lw": 3})
#: The sliding pivot whose modes are shown is the last.
COMPARED = (
    *(
        Curve(f"ILS, d = {d:g} m/s", ImplicitRelease(d), {"color": colour, "lw": 1.4})
        for d, colour in ((0.05, "#d9c2ee"), (0.02, "#b58fd8"), (0.01, "#8d5bbd"))
    ),
    Curve("ILS, d = 0.001 m/s", ImplicitRelease(0.001), {"color": "#4d2478", "lw": 1.4}),
    Curve(STEPPED.label, STEPPED.model, {"color": GREEN, "lw": 2.4, "ls": (0, (4, 3))}),
    Curve(
        "sliding pivot, paper form",
        SlidingPivotRelease("paper", steps=500, events=True),
        {"color": RED, "lw": 1.8, "ls": ":"},
    ),
    Curve(
        "sliding pivot, continuous form",
        SlidingPivotRelease(steps=500, events=True),
        {"color": BLACK, "lw": 1.2},
    ),
)


def draw_release_pictures(scene: Scene, folder: Path) -> list[str]:
    """Draw all pictures of a scene's given motion into `folder`; returns the names written.

    Raises InputError for a scene without [motion].
    """
    pictures = {
        "limit-surface.png": draw_limit_surface,
        "chatter.png": _draw_chatter,
        "shapes.png": _draw_shapes,
        "overhang.png": draw_overhang,
        "comparison.png": _draw_comparison,
    }
    case = case_of(scene, given_hand(scene))
    folder.mkdir(parents=True, exist_ok=True)
    for file, draw in pictures.items():
        draw(scene.name, case, folder / file)
    return list(pictures)


def _draw_chatter(name: str, case: ReleaseCase, path: Path) -> None:
    """Explicit Euler against implicit and time stepping; below, its first slips step by step."""
    start = slide_onset(case, ellipsoid(case.contact))
    figure = new_figure(9.1, 8.6)
    axes = figure.subplots(3, 2)
    runs = [(curve, curve.model.release(case)) for curve in (*EXPLICIT, SMOOTHED, STEPPED)]
    explicit, dt = runs[0][1], case.grip.opening / KarnoppRelease().steps
    first = first_slip(case, explicit, KarnoppRelease().dead_zone)
    begin = explicit.times[first or 0]
    window = begin - 4 * dt, min(begin + ZOOM_STEPS * dt, case.grip.opening)
    for curve, run in runs:
        _plot_four(axes[:2].ravel(), run, curve)
        dots = {"marker": ".", "lw": 1.0, "alpha": 1.0} if curve in EXPLICIT else {}
        inside = (run.times >= window[0]) & (run.times <= window[1])
        for axis, i in zip(axes[2], (0, 2), strict=True):
            axis.plot(1e3 * run.times[inside], _values(run)[i][inside], **(curve.style | dots))
    _name_four(axes[:2].ravel(), case)
    for axis, i in zip(axes[2], (0, 2), strict=True):
        axis.set(xlim=(1e3 * window[0], 1e3 * window[1]), xlabel="t [ms]", ylabel=FOUR[i])
        axis.set_title("step by step from the first explicit slip", loc="left", fontsize=9)
    _mark(axes, start)
    title = f"{name}: nothing slips before the grip is gone"
    if first is not None:
        title = f"{name}: explicit steps chatter once the body slides (dashed line: onset)"
    if first is not None and start is not None and begin < start - 2 * dt:
        title += f"\nthe explicit steps drift off the moving hand at {1e3 * begin:.2f} ms already"
    _finish(figure, title, axes[0, 0], 2)
    save(figure, path)


def _draw_shapes(name: str, case: ReleaseCase, path: Path) -> None:
    """Three limit surfaces, and the release with each by explicit Euler and by time stepping."""
    figure = new_figure(9.1, 8.6)
    grid = figure.add_gridspec(3, 3, height_ratios=(1.5, 1, 1))
    below = np.array([[figure.add_subplot(grid[1 + j, i]) for i in range(3)] for j in range(2)])
    for i, (title, shape) in enumerate(SHAPES.items()):
        space = figure.add_subplot(grid[0, i], projection="3d")
        surface = shape(case.contact)
        draw_surface(space, case.contact, surface)
        space.set_title(title, fontsize=10, y=0.98)
        explicit, stepped = KarnoppRelease(shape=shape), SteppedRelease(shape=shape)
        for curve in (
            Curve("Karnopp, Euler", explicit, {"color": RED, "lw": 0.4}),
            Curve("time stepping", stepped, {"color": GREEN, "lw": 2}),
        ):
            run = curve.model.release(case)
            for axis, value in zip(below[:, i], (2, 1), strict=True):
                _plot(axis, run, value, curve)
        _mark(below[:, i], slide_onset(case, surface))
        below[1, i].set_xlabel("t [ms]")
    for row, value in zip(below, (2, 1), strict=True):
        row[0].set_ylabel(FOUR[value])
        limits = np.array([axis.get_ylim() for axis in row])
        for axis in row:
            axis.set(xlim=(0.0, 1e3 * case.grip.opening), ylim=(limits.min(), limits.max()))
    title = (
        f"{name}: limit surfaces per newton of normal force, up: torque [mm] "
        "(dashed ring: ellipsoid)\nand the release with each (dashed line: onset)"
    )
    _finish(figure, title, below[0, 0], 2)
    save(figure, path)


def _draw_comparison(name: str, case: ReleaseCase, path: Path) -> None:
    """Sliding pivot against the limit surface, smoothed and not; areas: the pivot's modes.

    Below: how far v_z and omega are from the time-stepping limit surface.
    """
    figure = new_figure(9.1, 8.9)
    grid = figure.subplots(3, 2)
    axes, apart = grid[:2].ravel(), grid[2]
    truth = STEPPED.model.release(case)
    runs = [curve.model.release(case) for curve in COMPARED]
    for curve, run in zip(COMPARED, runs, strict=True):
        _plot_four(axes, run, curve)
        for i, axis in enumerate(apart):
            reference = np.interp(run.times, truth.times, _values(truth)[i])
            axis.plot(1e3 * run.times, _values(run)[i] - reference, **curve.style)
    _name_four(axes, case)
    for axis in grid.ravel():
        axis.set(xlabel="t [ms]", xlim=(0.0, 1e3 * case.grip.opening))
        _shade(axis, runs[-1], case)
    _mark(grid, None)
    for axis, words in zip(apart, FOUR, strict=False):
        axis.set_ylabel(words)
        axis.set_title("difference to the time stepping", loc="left", fontsize=9)
    h = 1e3 * float(case.body.com_offset)
    title = f"{name}: sliding pivot against limit surface, CoM offset {h:.3g} mm"
    _finish(figure, f"{title} (areas: modes of the sliding pivot)", axes[0], 4)
    save(figure, path)


def _values(run: Release) -> tuple[Array, ...]:
    """The values of FOUR over time; friction NaN where a model gives none."""
    wrench = np.full_like(run.com_twist, np.nan) if run.wrench is None else run.wrench
    return run.com_twist[1], run.com_twist[2], wrench[1], 1e3 * wrench[2]


def _plot(axis: Axes, run: Release, i: int, curve: Curve) -> None:
    """Value `i` of FOUR over time; a run without numbers is only named.

    A run that is not to be trusted is drawn all the same: chatter is there to be seen.
    """
    if np.isfinite(run.com_twist).all():
        axis.plot(1e3 * run.times, _values(run)[i], label=curve.label, **curve.style)
    else:
        axis.plot([], [], label=f"{curve.label}: {run.trouble}", **curve.style)


def _plot_four(axes: npt.NDArray[Any], run: Release, curve: Curve) -> None:
    for i, axis in enumerate(axes):
        _plot(axis, run, i, curve)


def _name_four(axes: npt.NDArray[Any], case: ReleaseCase) -> None:
    """Axis labels, and what a body fixed in the hand would do, where the hand moves."""
    times = np.linspace(0.0, case.grip.opening, 101)
    hand, h = case.hand.at(times), case.body.com_offset
    if np.abs(hand.twist).max() > 0:
        v_z = hand.twist[1] + hand.twist[2] * h * np.cos(hand.pose[2] + case.grasp_angle)
        for axis, fixed in zip(axes, (v_z, hand.twist[2]), strict=False):
            axis.plot(1e3 * times, fixed, color="#999999", lw=1, zorder=0, label="fixed in hand")
    for axis, name in zip(axes, FOUR, strict=True):
        axis.set(ylabel=name, xlabel="t [ms]", xlim=(0.0, 1e3 * case.grip.opening))


def _mark(axes: npt.NDArray[Any], start: float | None) -> None:
    """A grid, and the onset [s] if there is one."""
    for axis in axes.ravel():
        axis.grid(alpha=0.25)
        if start is not None:
            axis.axvline(1e3 * start, color="#555555", lw=1.0, ls="--", zorder=1)


def _finish(figure: Figure, title: str, axis: Axes, columns: int) -> None:
    """Title above, and the legend of `axis` below everything."""
    figure.suptitle(title, fontsize=11)
    entries = axis.get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower center", ncols=columns, fontsize=9)


def _shade(axis: Axes, run: Release, case: ReleaseCase) -> None:
    """Areas of stick, pivot and slide: where a run's friction is at its limits."""
    assert run.wrench is not None
    most = np.asarray(case.contact.force_limit(case.grip.force(run.times)), float) * (1 - 1e-9)
    slides = np.hypot(run.wrench[0], run.wrench[1]) >= most
    pivots = np.abs(run.wrench[2]) >= float(case.contact.torsion_arm) * most
    mode = np.where(slides, 2, np.where(pivots, 1, 0))[:-1]
    bounds = [0, *(np.flatnonzero(np.diff(mode)) + 1).tolist(), len(mode)]
    named: set[str] = set()
    for first, last in itertools.pairwise(bounds):
        name = ("stick", "pivot", "slide")[mode[first]]
        span = (1e3 * run.times[first], 1e3 * run.times[last])
        label = "" if name in named else name
        axis.axvspan(*span, color=PHASES[name], alpha=0.16, lw=0, zorder=0, label=label)
        named.add(name)
