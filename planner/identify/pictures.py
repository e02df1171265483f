"""Pictures of a validation: one throw, errors, factors (Figs. 16, 17, 18 and 20)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import MODELS, SLIDING_PIVOT, STEPPED_SURFACE, land, sticking_state
from ..show import BLACK, GREY, new_figure
from .factors import SIGNIFICANT, FactorRow
from .grid import MISSED
from .measured import velocities
from .predict import parameter_sets

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .validation import Validation

Array = npt.NDArray[np.float64]
Style = dict[str, Any]

#: Pictures of a validation with what is to be seen.
PICTURES = {
    "case": "One throw in detail: measured, and by every model.",
    "errors": "Predicted less measured landing of every throw of the batch.",
    "boxes": "Absolute errors: median, quartiles, outliers.",
    "factors": "What a factor does: landings measured and predicted, errors in both conditions.",
}
#: Models whose median error is above so many times the least are cut off or have own axes.
FAR = 6.0
#: Errors and their units.
QUANTITIES = (("v_x", "m/s"), ("ω", "deg/s"), ("x", "m"), ("θ", "deg"))
#: From metres and radians to metres and degrees.
DEGREES = np.array([1.0, math.degrees(1.0)])
#: The case's zoom lasts so long from the command on [s]; samples of its flight; sampling
#: before the opening [s]; instants at which the bar is drawn.
ZOOM, FLIGHT, STEP, BARS = 0.15, 120, 0.002, 8
DASHES = ("-", (0, (5, 2)), (0, (2, 1.5)), (0, (6, 2, 1.5, 2)))
TRACK: Style = {"color": BLACK, "lw": 4.5, "alpha": 0.35, "zorder": 2}
#: Conditions A and B of a factor: marker, colour of measured landings, lightness of the model's.
CONDITIONS = (("o", "#9ecae1", 0.45), ("s", "#2166ac", 1.0))
#: Models whose landings are drawn against the measured ones, the first that is there.
DRAWN = (SLIDING_PIVOT, STEPPED_SURFACE, *MODELS)


def validation_pictures(found: Validation) -> dict[str, Figure]:
    """The pictures that the data allow, by name."""
    figures: dict[str, Figure] = {}
    row = median_throw(found)
    if row is not None:
        figures["case"] = _case(found, row)
    figures |= {"errors": _errors(found), "boxes": _boxes(found)}
    if found.factors:
        figures["factors"] = _factors(found)
    return figures


def colours(models: Sequence[str]) -> dict[str, str]:
    """A colour for every model."""
    return {model: MODELS[model].colour for model in models}


def _title(figure: Figure, found: Validation, words: str) -> None:
    """One line over a picture; says so if nothing was measured."""
    more = " (synthetic data)" if found.data.shared.synthetic else ""
    figure.suptitle(f"{found.data.name}: {words}{more}", x=0.01, ha="left", fontsize=11)


def _far_off(found: Validation) -> list[str]:
    """Models that err many times more than the best one: on their scale no other shows."""
    errors = {m: np.nan_to_num(found.scaled(m)[found.batch], nan=MISSED) for m in found.checks}
    typical = {model: float(np.median(values)) for model, values in errors.items()}
    return [model for model, value in typical.items() if value > FAR * min(typical.values())]


def _signed_errors(found: Validation) -> dict[str, list[Array]]:
    """Predicted less measured v_x, omega, x, theta of the batch, in QUANTITIES' units."""
    out = {}
    for model, check in found.checks.items():
        off = np.hstack([check.twist * DEGREES, check.landing * DEGREES])[found.batch]
        out[model] = [column[np.isfinite(column)] for column in off.T]
    return out


def _errors(found: Validation) -> Figure:
    """Predicted less measured landing, a panel per model on common axes (Fig. 17).

    Models that are far off have wider axes.
    """
    models, far = list(found.checks), _far_off(found)
    columns = min(3, len(models))
    lines = math.ceil(len(models) / columns)
    figure = new_figure(0.6 + 3.7 * columns, 0.7 + 3.3 * lines)
    shades, errors = colours(models), _signed_errors(found)
    off = {model: np.column_stack(errors[model][2:]) for model in models}
    for number, model in enumerate(models):
        axis = figure.add_subplot(lines, columns, number + 1)
        alike = [off[name] for name in models if (name in far) == (model in far)]
        reach = 1.1 * np.abs(np.vstack([*alike, [[1e-6, 1e-6]]])).max(axis=0)
        axis.set(xlim=(-reach[0], reach[0]), ylim=(-reach[1], reach[1]))
        axis.axhline(0, color=GREY, lw=0.8)
        axis.axvline(0, color=GREY, lw=0.8)
        axis.plot(*off[model].T, "o", color=shades[model], ms=4.5, mec="white", mew=0.3, alpha=0.8)
        words = "no landing"
        if len(off[model]):
            center = off[model].mean(axis=0)
            axis.plot(*center, "+", color=BLACK, ms=13, mew=2)
            words = f"mean {1e3 * center[0]:+.1f} mm, {center[1]:+.2f}°".replace("-", "−")
        axis.set_title(f"{model}: {words}", loc="left", fontsize=10)
        axis.set(xlabel="x predicted − measured [m]", ylabel="θ predicted − measured [deg]")
        axis.locator_params(axis="x", nbins=5)
        axis.grid(alpha=0.25)
    more = f"; wider axes for {', '.join(far)}" if far else ""
    _title(figure, found, f"landing errors, + the mean{more}")
    return figure


def _boxes(found: Validation) -> Figure:
    """Absolute errors by quantity and model: quartiles, whiskers of 1.5 IQR, outliers (Fig. 18).

    Models that are far off are cut off.
    """
    models, far, errors = list(found.checks), _far_off(found), _signed_errors(found)
    quantities = [0, 1, 2, 3] if found.tracked else [2, 3]
    figure = new_figure(0.5 + max(3.1, 0.8 + 0.5 * len(models)) * len(quantities), 4.2)
    style: Style = {"widths": 0.6, "patch_artist": True, "medianprops": {"color": BLACK, "lw": 1.6}}
    style["flierprops"] = {"marker": "o", "ms": 3, "mec": GREY, "alpha": 0.7}
    for quantity, axis in zip(quantities, figure.subplots(1, len(quantities)), strict=True):
        name, unit = QUANTITIES[quantity]
        values = [np.abs(errors[model][quantity]) for model in models]
        drawn = axis.boxplot(values, positions=range(len(models)), **style)
        for box, shade in zip(drawn["boxes"], colours(models).values(), strict=True):
            box.set(facecolor=shade, alpha=0.75)
        near = [v.max(initial=0.0) for m, v in zip(models, values, strict=True) if m not in far]
        axis.set_xticks(range(len(models)), models, rotation=35, ha="right")
        axis.set(ylim=(0.0, 1.08 * max(near) or 1.0), ylabel=f"|{name} error| [{unit}]")
        axis.grid(alpha=0.25, axis="y")
    cut = f"; {', '.join(far)} cut off" if far else ""
    _title(figure, found, f"absolute errors, quartiles{cut}")
    return figure


# One throw in detail.


@dataclass(frozen=True)
class Course:
    """times (K,) [s] from the opening command on; states (6, K): pose and twist of the CoM."""

    times: Array
    states: Array


def median_throw(found: Validation) -> int | None:
    """The tracked throw of the batch whose mean error over all models is the median."""
    rows = [int(i) for i in found.batch if found.data.throws[i].track is not None]
    if not rows:
        return None
    errors = np.array([found.scaled(model)[rows] for model in found.checks])
    mean = np.nan_to_num(errors).mean(axis=0)
    return rows[int(np.argsort(mean, kind="stable")[len(rows) // 2])]


def _measured_course(found: Validation, row: int) -> Course:
    """The track with its rates, from the command on."""
    throw = found.data.throws[row]
    assert throw.track is not None
    states = np.column_stack([throw.track[:, 1:], velocities(throw.track)]).T
    times = throw.track[:, 0] - throw.command
    keep = (times >= 0) & (states[1] >= found.data.shared.landing_height - 0.02)
    return Course(times[keep], states[:, keep])


def _predicted_course(found: Validation, model: str, row: int) -> Course:
    """Held in the hand, released by the model, flying until it lands."""
    check, shared, throw = found.checks[model], found.data.shared, found.data.throws[row]
    pair = check.parameters[check.surface[row]]
    sets = parameter_sets(*pair)[0]
    case = found.predictor.case(row, sets)
    earliest = max(-throw.grip.dwell, float(throw.times[0]) - throw.opening)
    before = np.arange(earliest, 0.0, STEP)
    held = case.hand.at(before)
    sticking = sticking_state(held.pose, held.twist, throw.grasp.angle, case.body.com_offset)
    release = found.predictor.released(model, row, sets)
    during = np.vstack([release.com, release.com_twist])
    time = float(land(during[None, :, -1], shared.landing_height, shared.gravity)[0, 2])
    t = np.linspace(0.0, time if np.isfinite(time) else 0.0, FLIGHT)
    end = release.detach.after(t, shared.gravity)
    flight = np.broadcast_arrays(end.x, end.z, end.theta, end.v_x, end.v_z, end.omega)
    times = np.concatenate([before, release.times, throw.grip.opening + t])
    states = np.hstack([np.array(np.broadcast_arrays(*sticking)), during, np.array(flight)])
    return Course(times + throw.grip.dwell, states)


#: Panels: rows of the state, factor to the unit shown, label.
PANELS = (
    ([0, 1], 1.0, "x, z [m]"),
    ([2], math.degrees(1.0), "θ [deg]"),
    ([3], 1.0, "v_x [m/s]"),
    ([5], math.degrees(1.0), "ω [deg/s]"),
)


def _case(found: Validation, row: int) -> Figure:
    """The release: x and z, theta, v_x and omega over time, and the whole throw (Fig. 16)."""
    shades, throw = colours(list(found.checks)), found.data.throws[row]
    drawn = [(_predicted_course(found, m, row), _line_style(m, shades)) for m in found.checks]
    drawn.append((_measured_course(found, row), TRACK))
    figure = new_figure(14, 9)
    grid = figure.add_gridspec(len(PANELS), 2, width_ratios=(1, 1.3))
    for line, (rows, factor, label) in enumerate(PANELS):
        axis = figure.add_subplot(grid[line, 0])
        axis.axvspan(throw.grip.dwell, throw.grip.dwell + throw.grip.opening, color="#e4e1dc")
        for course, style in drawn:
            keep = course.times <= ZOOM
            axis.plot(course.times[keep], factor * course.states[rows][:, keep].T, **style)
        axis.grid(alpha=0.25)
        axis.margins(x=0.01)
        axis.set_ylabel(label)
    axis.set_xlabel("time from the opening command [s]")
    _draw_flight(figure.add_subplot(grid[:, 1]), found, row, drawn)
    for model in found.checks:
        axis.plot([], [], label=model, **_line_style(model, shades) | {"lw": 2})
    axis.plot([], [], label="measured", **TRACK)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=6)
    _title(figure, found, f"throw {throw.name} (median error), shaded: the grip force falls")
    return figure


def _draw_flight(
    axis: Axes, found: Validation, row: int, drawn: Sequence[tuple[Course, Style]]
) -> None:
    """The bar on its way, measured and by every model, at the same instants."""
    bar = found.data.throws[row].object
    ends = np.array([-bar.com, bar.length - bar.com])
    last = min(float(course.times[-1]) for course, _ in drawn)
    instants = np.linspace(max(float(drawn[-1][0].times[0]), 0.0), last, BARS)
    for course, style in drawn:
        x, z, theta = (np.interp(instants, course.times, course.states[i]) for i in range(3))
        axis.plot(x + np.cos(theta) * ends[:, None], z + np.sin(theta) * ends[:, None], **style)
        axis.plot(course.states[0], course.states[1], **style | {"lw": 0.8, "ls": ":"})
    axis.set_aspect("equal", adjustable="datalim")
    axis.set(xlabel="x [m]", ylabel="z [m]")
    axis.set_title(f"the bar at {BARS} instants, dots: its CoM", loc="left", fontsize=10)
    axis.grid(alpha=0.25)


def _line_style(model: str, shades: dict[str, str]) -> Style:
    """A model's line: dashes of its own, for curves that lie on each other."""
    if MODELS[model].chatters:  # its twist jumps from step to step: thin, behind the others
        return {"color": shades[model], "lw": 0.6, "zorder": 1.8}
    smooth = [name for name in shades if not MODELS[name].chatters]
    dashes = DASHES[smooth.index(model) % len(DASHES)]
    return {"color": shades[model], "lw": 1.6, "ls": dashes, "zorder": 2.2}


# Factors.


def _factors(found: Validation) -> Figure:
    """Per factor measured and predicted landings, and MAE and STD of all models (Fig. 20)."""
    groups = found.factors
    model = next((name for name in DRAWN if name in found.checks), next(iter(found.checks)))
    columns = min(3, len(groups))
    lines = math.ceil(len(groups) / columns)
    figure = new_figure(0.6 + 5.0 * columns, 0.9 + 6.6 * lines)
    parts = np.atleast_2d(figure.subfigures(lines, columns, squeeze=False)).ravel()
    for part, group in zip(parts, groups, strict=False):
        cells = part.subplot_mosaic([["pairs", "pairs"], ["x", "theta"]], height_ratios=(1.5, 1))
        _pairs(cells["pairs"], found, model, group[0])
        _condition_errors(cells["x"], group, 0)
        _condition_errors(cells["theta"], group, 1)
        a, b = group[0].comparison.labels
        part.suptitle(f"{group[0].comparison.factor}: {a} → {b}", fontsize=11)
    words = f"landings measured and by {model}; below MAE and STD in A (light) and B"
    _title(figure, found, f"{words}; * p < {SIGNIFICANT}")
    return figure


def _pairs(axis: Axes, found: Validation, model: str, row: FactorRow) -> None:
    """Measured landings joined with the model's of the same throws."""
    compared, shade = row.comparison, colours(list(found.checks))[model]
    sides = zip((compared.first, compared.second), compared.labels, CONDITIONS, strict=True)
    for rows, label, (marker, blue, alpha) in sides:
        real = found.predictor.truth.landing[rows] * DEGREES
        guess = real + found.checks[model].landing[rows] * DEGREES
        axis.plot(*np.stack([real, guess]).transpose(2, 0, 1), color=GREY, lw=0.6, zorder=1)
        style: Style = {"s": 20, "lw": 0.4, "zorder": 2, "marker": marker, "ec": BLACK}
        axis.scatter(*guess.T, color=shade, alpha=alpha, label=f"{model}, {label}", **style)
        axis.scatter(*real.T, color=blue, label=f"measured, {label}", **style)
    axis.set(xlabel="landing x [m]", ylabel="landing θ [deg]")
    axis.legend(loc="best", ncols=2, fontsize=7.5, handletextpad=0.1, columnspacing=0.9)
    axis.grid(alpha=0.25)


def _condition_errors(axis: Axes, group: Sequence[FactorRow], quantity: int) -> None:
    """MAE with STD in A (light) and B of every model; a star where they differ."""
    factor, shades = DEGREES[quantity], colours([row.model for row in group])
    for place, row in enumerate(group):
        for side, (marker, _, alpha) in enumerate(CONDITIONS):
            height, spread = factor * row.mean[side, quantity], factor * row.std[side, quantity]
            style: Style = {"fmt": marker, "color": shades[row.model], "alpha": alpha, "capsize": 2}
            axis.errorbar(place + 0.3 * (side - 0.5), height, spread, ms=6, **style)
        if row.p[quantity] < SIGNIFICANT:
            axis.text(place, factor * row.mean[:, quantity].max(), "*", ha="center", fontsize=14)
    # Errors of models differ by orders of magnitude.
    axis.set_yscale("log", nonpositive="clip")
    axis.set_xticks(range(len(group)), list(shades), rotation=40, ha="right", fontsize=8)
    axis.set_ylabel("|x error| [m]" if quantity == 0 else "|θ error| [deg]")
    axis.grid(alpha=0.25, axis="y")
