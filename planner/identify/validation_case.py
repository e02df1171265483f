"""One throw closely: measured track and predictions from the command to the landing (Fig. 16)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import land, sticking_state
from ..check import MODELS
from .measured import velocities
from .validation import Validation
from .validation_pictures import BLACK, GREY, colours, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

#: The zoom lasts so long from the opening command on [s]; samples of the flight.
ZOOM, FLIGHT = 0.15, 120
#: Sampling before the opening [s].
STEP = 0.002
#: Instants at which the flying bar is drawn.
BARS = 8


Style = dict[str, Any]
#: Models whose twist jumps from step to step are drawn thin and behind the others.
JITTERING = ("ls", "ls-smooth")
DASHES = ("-", (0, (5, 2)), (0, (2, 1.5)), (0, (6, 2, 1.5, 2)))
MEASURED: Style = {"color": BLACK, "lw": 4.5, "alpha": 0.35, "zorder": 2}


@dataclass(frozen=True)
class Course:
    """times (K,) [s] from the opening command on; states (6, K): pose and twist of the CoM."""

    times: Array
    states: Array


def middling_throw(found: Validation) -> int | None:
    """The tracked throw of the batch whose mean error over all models is the median."""
    rows = [int(i) for i in found.batch if found.data.throws[i].track is not None]
    if not rows:
        return None
    errors = np.array([found.scaled(model)[rows] for model in found.checks])
    mean = np.where(np.isfinite(errors), errors, 0.0).mean(axis=0)
    return rows[int(np.argsort(mean, kind="stable")[len(rows) // 2])]


def measured_course(found: Validation, row: int) -> Course:
    """The track with its rates, from the command on."""
    throw = found.data.throws[row]
    assert throw.track is not None
    states = np.column_stack([throw.track[:, 1:], velocities(throw.track)]).T
    times = throw.track[:, 0] - throw.command
    keep = (times >= 0) & (states[1] >= found.data.shared.landing_height - 0.02)
    return Course(times[keep], states[:, keep])


def predicted_course(found: Validation, model: str, row: int) -> Course:
    """Held in the hand, released by the model, flying until it lands."""
    check, shared = found.checks[model], found.data.shared
    predictor = found.predictor
    throw, hand = predictor.data.throws[row], predictor.hands[row]
    pair = check.parameters[check.surface[row]]
    case = predictor.case(throw, hand, (*pair, 0.0, 1.0))
    earliest = max(-throw.grip.dwell, float(throw.times[0]) - throw.opening)
    before = np.arange(earliest, 0.0, STEP)
    held = hand.at(before)
    offset = throw.object.com - throw.grasp.offset
    sticking = sticking_state(held.pose, held.twist, throw.grasp.angle, offset)
    release = MODELS[model].release(case)
    during = np.vstack([release.com, release.com_twist])
    x, z, theta, v_x, v_z, omega = during[:, -1]
    time = float(land(during[None, :, -1], shared.landing_height, shared.gravity)[0, 2])
    t = np.linspace(0.0, time if np.isfinite(time) else 0.0, FLIGHT)
    still = np.ones_like(t)
    g = shared.gravity
    flight = np.array(
        [
            x + v_x * t,
            z + v_z * t - g * t * t / 2,
            theta + omega * t,
            v_x * still,
            v_z - g * t,
            omega * still,
        ]
    )
    times = np.concatenate([before, release.times, throw.grip.opening + t])
    states = np.hstack([np.array(np.broadcast_arrays(*sticking)), during, flight])
    return Course(times + throw.grip.dwell, states)


#: Panels: rows of the state, factor to the unit shown, label.
PANELS: tuple[tuple[tuple[int, ...], float, str], ...] = (
    ((0, 1), 1.0, "position [m]"),
    ((2,), 180 / np.pi, "θ [deg]"),
    ((3,), 1.0, "v_x [m/s]"),
    ((5,), 180 / np.pi, "ω [deg/s]"),
)


def case_picture(found: Validation, row: int) -> Figure:
    """x and z, theta, v_x and omega over time: the whole throw, and the first 150 ms; below
    the bar as it flies."""
    from matplotlib.figure import Figure

    real = measured_course(found, row)
    courses = {model: predicted_course(found, model, row) for model in found.checks}
    shades = colours(list(courses))
    figure = Figure(figsize=(11, 14.5), layout="constrained")
    grid = figure.add_gridspec(
        len(PANELS) + 1, 2, width_ratios=(1.4, 1), height_ratios=[1.0] * len(PANELS) + [1.9]
    )
    axes = [[figure.add_subplot(grid[i, j]) for j in range(2)] for i in range(len(PANELS))]
    _flight(figure.add_subplot(grid[-1, :]), found, row, courses, real, shades)
    grip = found.data.throws[row].grip
    for line, (rows, factor, label) in enumerate(PANELS):
        for axis, zoomed in zip(axes[line], (False, True), strict=True):
            axis.axvspan(grip.dwell, grip.dwell + grip.opening, color=GREY, alpha=0.2, lw=0)
            for model, course in courses.items():
                _curve(axis, course, rows, factor, zoomed, _style(model, shades))
            _curve(axis, real, rows, factor, zoomed, MEASURED)
            axis.grid(alpha=0.25)
            axis.margins(x=0.01)
            if not zoomed:
                axis.set_ylabel(label)
    _name_positions(axes[0], real)
    axes[-1][0].set_xlabel("time from the opening command [s]")
    axes[-1][1].set_xlabel("the first 150 ms: time [s]")
    _legend(figure, axes[0][0], shades)
    throw = found.data.throws[row]
    words = f"throw {throw.name} (middling error), grey: the grip force falls"
    figure.suptitle(title(found, words), x=0.01, ha="left", fontsize=11)
    return figure


def _flight(
    axis: Axes,
    found: Validation,
    row: int,
    courses: dict[str, Course],
    real: Course,
    shades: dict[str, str],
) -> None:
    """The bar on its way, measured and by every model, at the same instants (Fig. 16(c))."""
    throw = found.data.throws[row]
    ends = np.array([-throw.object.com, throw.object.length - throw.object.com])
    end = min(float(course.times[-1]) for course in (real, *courses.values()))
    instants = np.linspace(max(float(real.times[0]), 0.0), end, BARS)
    drawn = [(real, MEASURED), *((c, _style(m, shades)) for m, c in courses.items())]
    for course, style in drawn:
        x, z, theta = (np.interp(instants, course.times, course.states[i]) for i in range(3))
        along = x + np.cos(theta) * ends[:, None], z + np.sin(theta) * ends[:, None]
        axis.plot(*along, **style)
        axis.plot(course.states[0], course.states[1], **style | {"lw": 0.8, "ls": ":"})
    axis.set_aspect("equal", adjustable="datalim")
    axis.set(xlabel="x [m]", ylabel="z [m]")
    axis.set_title(f"the bar at {BARS} instants, dots: its CoM", loc="left", fontsize=10)
    axis.grid(alpha=0.25)


def _curve(
    axis: Axes,
    course: Course,
    rows: Sequence[int],
    factor: float,
    zoomed: bool,
    style: dict[str, Any],
) -> None:
    keep = course.times <= (ZOOM if zoomed else np.inf)
    for row in rows:
        axis.plot(course.times[keep], factor * course.states[row, keep], **style)


def _name_positions(axes: Sequence[Axes], real: Course) -> None:
    """Writes x and z beside the measured curves."""
    for axis, last in zip(axes, (real.times[-1], min(ZOOM, real.times[-1])), strict=True):
        k = int(np.searchsorted(real.times, 0.62 * last))
        for row, name in ((0, "x"), (1, "z")):
            place = (real.times[k], real.states[row, k])
            axis.annotate(name, place, (0, 7), textcoords="offset points", fontsize=12)


def _style(model: str, shades: dict[str, str]) -> Style:
    """A model's line: dashes of its own, for curves that lie on each other."""
    if model in JITTERING:
        return {"color": shades[model], "lw": 0.6, "zorder": 1.8}
    smooth = [name for name in shades if name not in JITTERING]
    dashes = DASHES[smooth.index(model) % len(DASHES)]
    return {"color": shades[model], "lw": 1.6, "ls": dashes, "zorder": 2.2}


def _legend(figure: Figure, axis: Axes, shades: dict[str, str]) -> None:
    for model in shades:
        axis.plot([], [], label=model, **_style(model, shades) | {"lw": 2})
    axis.plot([], [], label="measured", **MEASURED)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=6)
