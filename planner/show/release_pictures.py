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
    CaseModel,
    Contact,
    ImplicitRelease,
    KarnoppRelease,
    LimitSurface,
    Quartic,
    Release,
    ReleaseCase,
    SlidingPivotRelease,
    SteppedRelease,
    ellipsoid,
    rotated_ellipsoid,
)
from ...problems import Scene
from .contact_pictures import (
    AREAS,
    BLACK,
    BLUE,
    GREEN,
    PURPLE,
    RED,
    draw_limit_surface,
    draw_surface,
    first_slip,
    given_case,
    save,
    slide_onset,
)
from .overhang_picture import draw_overhang

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

#: Explicit steps shown one by one after their first slip.
ZOOM_STEPS = 24


@dataclass(frozen=True)
class Curve:
    """One model in a picture over time: its label and line style."""

    label: str
    model: CaseModel
    style: dict[str, Any]


def quartic(contact: Contact) -> LimitSurface:
    """The quartic limit surface of a contact."""
    return Quartic(contact)


def _ils(half_band: float, colour: str) -> Curve:
    style = {"color": colour, "lw": 1.4}
    return Curve(f"ILS, d = {half_band:g} m/s", ImplicitRelease(half_band), style)


EXPLICIT = (
    Curve("Karnopp, Euler", KarnoppRelease(), {"color": RED, "lw": 0.8, "alpha": 0.8}),
    Curve(
        "smoothed (d = 0.01 m/s), Euler",
        KarnoppRelease(half_band=0.01),
        {"color": BLUE, "lw": 0.8, "alpha": 0.8, "ls": "--"},
    ),
)
STEPPED = Curve("limit surface, time stepping", SteppedRelease(), {"color": GREEN, "lw": 1.6})
SMOOTHED = Curve("smoothed (d = 0.01 m/s), LSODA", ImplicitRelease(), {"color": PURPLE, "lw": 3})
#: The sliding pivot whose modes are shown is the last.
COMPARED = (
    _ils(0.05, "#d9c2ee"),
    _ils(0.02, "#b58fd8"),
    _ils(0.01, "#8d5bbd"),
    _ils(0.001, "#4d2478"),
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
SHAPES: dict[str, Callable[[Contact], LimitSurface]] = {
    "ellipsoid": ellipsoid,
    "rotated ellipsoid": rotated_ellipsoid,
    "quartic": quartic,
}


def draw_release_pictures(scene: Scene, folder: Path) -> list[str]:
    """Draw all pictures of a scene's given motion into `folder`; returns the names written.

    Raises InputError for a scene without [motion].
    """
    pictures = {
        "limit-surface.png": draw_limit_surface,
        "chatter.png": draw_chatter,
        "shapes.png": draw_shapes,
        "overhang.png": draw_overhang,
        "comparison.png": draw_comparison,
    }
    given_case(scene)
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in pictures.items():
        draw(scene, folder / name)
    return list(pictures)


def draw_chatter(scene: Scene, path: Path) -> None:
    """Explicit Euler against implicit and time stepping; below, its first slips step by step."""
    from matplotlib.figure import Figure

    case = given_case(scene)
    start = slide_onset(case, ellipsoid(case.contact))
    figure = Figure(figsize=(10, 9.4), layout="constrained")
    axes = figure.subplots(3, 2)
    runs = [(curve, curve.model.release(case)) for curve in (*EXPLICIT, SMOOTHED, STEPPED)]
    for curve, run in runs:
        _plot_four(axes[:2].ravel(), run, curve)
        dots = {"marker": ".", "lw": 1.0, "alpha": 1.0} if curve in EXPLICIT else {}
        for axis, i in zip(axes[2], (0, 2), strict=True):
            _plot(axis, run, i, curve.style | dots)
    _name_four(axes[:2].ravel(), case)
    model = KarnoppRelease()
    first = first_slip(case, runs[0][1], model.dead_zone)
    begin, dt = runs[0][1].times[first or 0], case.grip.opening / model.steps
    window = (1e3 * (begin - 4 * dt), 1e3 * min(begin + ZOOM_STEPS * dt, case.grip.opening))
    for axis, i in zip(axes[2], (0, 2), strict=True):
        axis.set(xlim=window, xlabel="t [ms]", ylabel=FOUR[i])
        axis.set_title("step by step from the first explicit slip", loc="left", fontsize=9)
        _fit_height(axis, window)
    for axis in axes.ravel():
        _mark(axis, start)
    title = f"{scene.name}: nothing slips before the grip is gone"
    if first is not None:
        title = f"{scene.name}: explicit steps chatter once the body slides (dashed line: onset)"
    if first is not None and start is not None and begin < start - 2 * dt:
        title += f"\nthe explicit steps drift off the moving hand at {1e3 * begin:.2f} ms already"
    _finish(figure, title, axes[0, 0], 2)
    save(figure, path)


def draw_shapes(scene: Scene, path: Path) -> None:
    """Three limit surfaces, and the release with each by explicit Euler and by time stepping."""
    from matplotlib.figure import Figure

    case = given_case(scene)
    figure = Figure(figsize=(10, 9.4), layout="constrained")
    grid = figure.add_gridspec(3, 3, height_ratios=(1.5, 1, 1))
    below = np.array([[figure.add_subplot(grid[1 + j, i]) for i in range(3)] for j in range(2)])
    for i, (name, shape) in enumerate(SHAPES.items()):
        surface = shape(case.contact)
        space = figure.add_subplot(grid[0, i], projection="3d")
        draw_surface(space, case.contact, surface, name)
        thin = {"color": RED, "lw": 0.4}
        for curve in (
            Curve("Karnopp, Euler", KarnoppRelease(shape=shape), thin),
            Curve("time stepping", SteppedRelease(shape=shape), {"color": GREEN, "lw": 2}),
        ):
            run = curve.model.release(case)
            _plot(below[0, i], run, 2, curve.style, curve.label)
            _plot(below[1, i], run, 1, curve.style, curve.label)
        for axis in below[:, i]:
            _mark(axis, slide_onset(case, surface))
            axis.set_xlim(0.0, 1e3 * case.grip.opening)
        below[1, i].set_xlabel("t [ms]")
    for row, value in zip(below, (2, 1), strict=True):
        row[0].set_ylabel(FOUR[value])
        limits = np.array([axis.get_ylim() for axis in row])
        for axis in row:
            axis.set_ylim(limits.min(), limits.max())
    title = (
        f"{scene.name}: limit surfaces per newton of normal force, up: torque [mm] "
        "(dashed ring: ellipsoid)\nand the release with each (dashed line: onset)"
    )
    _finish(figure, title, below[0, 0], 2)
    save(figure, path)


def draw_comparison(scene: Scene, path: Path) -> None:
    """Sliding pivot against the limit surface, smoothed and not; areas: the pivot's modes.

    Below: how far v_z and omega are from the time-stepping limit surface.
    """
    from matplotlib.figure import Figure

    case = given_case(scene)
    figure = Figure(figsize=(10, 9.8), layout="constrained")
    grid = figure.subplots(3, 2)
    axes, apart = grid[:2].ravel(), grid[2]
    truth = STEPPED.model.release(case)
    for curve in COMPARED:
        run = curve.model.release(case)
        _plot_four(axes, run, curve)
        for i, axis in enumerate(apart):
            reference = np.interp(run.times, truth.times, _values(truth)[i])
            axis.plot(1e3 * run.times, _values(run)[i] - reference, **curve.style)
    _name_four(axes, case)
    pivot = COMPARED[-1].model.release(case)
    for axis in grid.ravel():
        axis.set(xlabel="t [ms]", xlim=(0.0, 1e3 * case.grip.opening))
        _mark(axis, None)
        _shade(axis, pivot, case)
    for axis, name in zip(apart, FOUR, strict=False):
        axis.set_ylabel(name)
        axis.set_title("difference to the time stepping", loc="left", fontsize=9)
    h = 1e3 * float(case.body.com_offset)
    title = f"{scene.name}: sliding pivot against limit surface, CoM offset {h:.3g} mm"
    _finish(figure, f"{title} (areas: modes of the sliding pivot)", axes[0], 4)
    save(figure, path)


# Parts of the pictures over time.

FOUR = ("v_z of the CoM [m/s]", "ω [rad/s]", "friction f_z [N]", "friction torque [N mm]")


def _values(run: Release) -> tuple[Array, ...]:
    """The four values over time; friction NaN where a model gives none."""
    wrench = np.full_like(run.com_twist, np.nan) if run.wrench is None else run.wrench
    return run.com_twist[1], run.com_twist[2], wrench[1], 1e3 * wrench[2]


def _plot(axis: Axes, run: Release, i: int, style: dict[str, Any], label: str = "") -> None:
    """Value `i` of FOUR over time; a run without numbers is only named.

    A run that is not to be trusted is drawn all the same: chatter is there to be seen.
    """
    if not np.isfinite(run.com_twist).all():
        axis.plot([], [], label=label and f"{label}: {run.trouble}", **style)
    else:
        axis.plot(1e3 * run.times, _values(run)[i], label=label, **style)


def _plot_four(axes: npt.NDArray[Any], run: Release, curve: Curve) -> None:
    for i, axis in enumerate(axes):
        _plot(axis, run, i, curve.style, curve.label)


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


def _mark(axis: Axes, start: float | None) -> None:
    axis.grid(alpha=0.25)
    if start is not None:
        axis.axvline(1e3 * start, color="#555555", lw=1.0, ls="--", zorder=1)


def _finish(figure: Figure, title: str, axis: Axes, columns: int) -> None:
    """Title above, and the legend of `axis` below everything."""
    figure.suptitle(title, fontsize=11)
    entries = axis.get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower center", ncols=columns, fontsize=9)


def _fit_height(axis: Axes, window: tuple[float, float]) -> None:
    """Height of the axis for what is drawn inside `window` [ms]."""
    inside: list[float] = []
    for line in axis.get_lines():
        t, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
        inside.extend(y[(t >= window[0]) & (t <= window[1])].tolist())
    if inside:
        low, high = min(inside), max(inside)
        room = 0.06 * (high - low) + 1e-9
        axis.set_ylim(low - room, high + room)


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
        name = list(AREAS)[mode[first]]
        label = "" if name in named else name
        named.add(name)
        span = (1e3 * run.times[first], 1e3 * run.times[last])
        axis.axvspan(*span, color=AREAS[name], alpha=0.16, lw=0, zorder=0, label=label)
