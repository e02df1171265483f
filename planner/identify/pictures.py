"""Pictures of identification (Fig. 15) and of validation (Figs. 14 and 16 to 20)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import MODELS, SLIDING_PIVOT, STEPPED_SURFACE, land, sticking_state
from ..show import BLACK, BLUE, GREEN, GREY, RED, new_figure, save
from .factors import SIGNIFICANT, FactorRow, ordered_labels
from .grid import MISSED
from .measured import velocities
from .predict import parameter_sets

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .belief import Belief
    from .identified import Identified
    from .validation import Validation

Array = npt.NDArray[np.float64]
Style = dict[str, Any]

#: Pictures of a validation with what is to be seen.
PICTURES = {
    "landings": "Measured landing poses of the batch.",
    "case": "One throw closely: measured, and by every model.",
    "errors": "Predicted less measured landing of every throw of the batch.",
    "boxes": "Absolute errors: median, quartiles, outliers.",
    "violins": "Signed errors: density, quartiles, median.",
    "factors": "What a factor does: landings measured and predicted, errors in both conditions.",
}
MARKERS = ("o", "^", "s", "D", "v", "P", "X", "*")
#: Products mu r_p [m] whose lines are drawn.
PRODUCTS = np.array([1.25, 2.5, 5.0, 10.0]) * 1e-3
#: Models whose median error is above so many times the least are cut off or have own axes.
FAR = 6.0
#: Errors and their units.
QUANTITIES = (("v_x", "m/s"), ("ω", "deg/s"), ("x", "m"), ("θ", "deg"))
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


def save_pictures(figures: Mapping[str, Figure], folder: Path) -> None:
    """Write the PNG files."""
    for name, figure in figures.items():
        save(figure, folder / f"{name}.png")


# Identification.


def grid_picture(found: Identified) -> Figure:
    """Mean scaled error over mu and r_p, the lowest 10 % hatched, with the fit."""
    from matplotlib.patches import Rectangle

    grid = found.grid
    assert grid is not None
    figure = new_figure(7.6, 6.0)
    axis = figure.add_subplot()
    mu, radius = grid.friction, 1e3 * grid.patch_radius
    shown = 100 * grid.error.T
    top = float(np.quantile(shown, 0.98))
    mesh = axis.pcolormesh(mu, radius, shown, cmap="inferno", vmax=top, shading="nearest")
    size = float(np.diff(mu)[0]), float(np.diff(radius)[0])
    hatched: Style = {"fill": False, "hatch": "////", "edgecolor": "white", "lw": 0}
    for i, j in np.argwhere(grid.lowest):
        corner = mu[i] - size[0] / 2, radius[j] - size[1] / 2
        axis.add_patch(Rectangle(corner, *size, **hatched))
    limits = axis.get_xlim(), axis.get_ylim()
    x = np.linspace(mu[0], mu[-1], 200)
    axis.plot(x, 1e3 * PRODUCTS / x[:, None], color="white", lw=0.9, ls=":", alpha=0.8)
    axis.plot([], [], color=GREY, lw=0.9, ls=":", label="μ r_p = 1.25, 2.5, 5, 10 mm")
    style: Style = {"ms": 11, "mec": "white", "mew": 1.2, "ls": "none", "zorder": 5}
    best = grid.optimum
    axis.plot(best[0], 1e3 * best[1], "X", color=RED, label="lowest mean error", **style)
    if found.fit is not None:
        _belief(axis, found.posterior, "fit, 95 % region", GREEN)
    _true_contact(axis, found)
    axis.set(xlim=limits[0], ylim=limits[1], xlabel="friction μ", ylabel="patch radius r_p [mm]")
    figure.colorbar(mesh, label="mean scaled error [cm]", extend="max")
    entries = axis.get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower center", ncols=4, fontsize=9)
    words = f"{found.model}, {grid.throws} throws: least {100 * grid.error.min():.2f} cm at "
    words += f"μ {best[0]:.2f}, r_p {1e3 * best[1]:.1f} mm, μ r_p {1e3 * grid.product:.2f} mm"
    if grid.delay or grid.grip_scale != 1.0:
        words += f"\nopening {1e3 * grid.delay:+.1f} ms late, grip force x {grid.grip_scale:.3f}"
    words += "; hatched: lowest 10 %"
    lost = int(grid.missed.sum())
    if lost:
        words += f"\n{lost} of {grid.predictions} predictions do not land (count as {MISSED:g} m)"
    axis.set_title(words, loc="left", fontsize=10)
    return figure


def fit_picture(found: Identified) -> Figure:
    """The fit's confidence region and the prior's, on the ridge of equal mu r_p."""
    figure, belief = new_figure(7.0, 5.2), found.posterior
    axis = figure.add_subplot()
    _belief(axis, belief, "fit and 95 % region", GREEN)
    if found.prior is not None:
        _belief(axis, found.prior, "prior and 95 % region", GREY)
    _true_contact(axis, found)
    limits = axis.get_xlim(), axis.get_ylim()
    low = max(limits[0][0], 1e-3)
    x = np.geomspace(low, max(limits[0][1], 1.1 * low), 200)
    axis.plot(x, 1e3 * belief.product / x, color=BLACK, ls=":", lw=1, label="same μ r_p")
    axis.set(xlim=limits[0], ylim=limits[1], xlabel="friction μ", ylabel="patch radius r_p [mm]")
    parts = [f"{found.model}, {len(found.data.throws)} throws\n"]
    for name, label, unit, scale in (
        ("friction", "μ", "", 1.0),
        ("patch_radius", "r_p", " mm", 1e3),
    ):
        value, deviation = scale * belief.value(name), 100 * belief.deviation(name)
        parts.append(f"{label} {value:.3g}{unit} ± {deviation:.1f} %, ")
    parts.append(f"μ r_p {1e3 * belief.product:.3f} mm ± {100 * belief.product_deviation:.1f} %")
    axis.set_title("".join(parts), loc="left", fontsize=10)
    axis.legend(loc="best", fontsize=9)
    axis.grid(alpha=0.25)
    return figure


def _belief(axis: Axes, belief: Belief, label: str, colour: str) -> None:
    """A belief's mean and 95 % region."""
    known = belief.effective
    outline = known.ellipse()
    axis.plot(outline[:, 0], 1e3 * outline[:, 1], color=colour, lw=1.8, zorder=4)
    place = known.value("friction"), 1e3 * known.value("patch_radius")
    axis.plot(*place, "o-", color=colour, ms=7, mec="white", label=label, zorder=5)


def _true_contact(axis: Axes, found: Identified) -> None:
    """The truth of synthetic throws."""
    truth = found.data.truth
    if {"friction", "patch_radius"} <= set(truth):
        mu = truth["friction"] * truth.get("grip_scale", 1.0)
        style: Style = {"color": BLUE, "ms": 14, "mec": "white", "ls": "none", "label": "truth"}
        axis.plot(mu, 1e3 * truth["patch_radius"], "*", **style)


# Validation.


def validation_pictures(found: Validation) -> dict[str, Figure]:
    """The pictures that the data allow, by name."""
    figures = {"landings": landings_picture(found)}
    row = median_throw(found)
    if row is not None:
        figures["case"] = case_picture(found, row)
    figures["errors"] = errors_picture(found)
    figures["boxes"] = spread_picture(found, signed=False)
    figures["violins"] = spread_picture(found, signed=True)
    if found.factors:
        figures["factors"] = factors_picture(found)
    return figures


def colours(models: Sequence[str]) -> dict[str, str]:
    """A colour for every model."""
    return {model: MODELS[model].colour for model in models}


def _title(figure: Figure, found: Validation, words: str) -> None:
    """One line over a picture; says so if nothing was measured."""
    more = " (synthetic data)" if found.data.shared.synthetic else ""
    figure.suptitle(f"{found.data.name}: {words}{more}", x=0.01, ha="left", fontsize=11)


def far_off(found: Validation) -> list[str]:
    """Models that err many times more than the best one: on their scale no other shows."""
    errors = {m: np.nan_to_num(found.scaled(m)[found.batch], nan=MISSED) for m in found.checks}
    typical = {model: float(np.median(values)) for model, values in errors.items()}
    least = min(typical.values())
    return [model for model, value in typical.items() if value > FAR * least]


def signed_errors(found: Validation) -> dict[str, list[Array]]:
    """Predicted less measured v_x, omega, x, theta of the batch, in QUANTITIES' units."""
    out = {}
    for model, check in found.checks.items():
        off = np.hstack([check.twist * DEGREES, check.landing * DEGREES])[found.batch]
        out[model] = [column[np.isfinite(column)] for column in off.T]
    return out


def landings_picture(found: Validation) -> Figure:
    """Measured landing poses: marker by CoM, colour by release motion (Fig. 14)."""
    from matplotlib import colormaps

    figure = new_figure(8.5, 5.6)
    axis, batch = figure.add_subplot(), found.data.picked(found.batch)
    landing = found.truth.landing[found.batch] * DEGREES
    coms = ordered_labels(batch, "com") or [""]
    releases = ordered_labels(batch, "release") or [""]
    shades = colormaps["viridis"](np.linspace(0, 0.95, len(releases)))
    for com, marker in zip(coms, MARKERS * len(coms), strict=False):
        for release, shade in zip(releases, shades, strict=True):
            known = {"com": com, "release": release}
            mine = [
                i
                for i, throw in enumerate(batch.throws)
                if all(throw.factors.get(name, "") == label for name, label in known.items())
            ]
            style: Style = {"color": shade, "marker": marker, "ec": BLACK, "lw": 0.3, "alpha": 0.9}
            x, theta = landing[mine].T
            axis.scatter(x, theta, s=36, **style)
        if com:
            axis.plot([], [], marker, mfc="none", mec=BLACK, label=f"CoM {com}")
    for release, shade in zip(releases, shades, strict=True):
        if release:
            axis.plot([], [], "s", color=shade, label=f"release {release}")
    if len(coms) * len(releases) > 1:
        axis.legend(loc="best", fontsize=9)
    axis.set(xlabel="landing x [m]", ylabel="landing θ [deg]")
    axis.grid(alpha=0.25)
    _title(figure, found, f"measured landings of {len(batch.throws)} throws")
    return figure


def errors_picture(found: Validation) -> Figure:
    """Predicted less measured landing, a panel per model on common axes (Fig. 17).

    Models that are far off have wider axes.
    """
    models, far = list(found.checks), far_off(found)
    columns = min(3, len(models))
    lines = math.ceil(len(models) / columns)
    figure = new_figure(0.6 + 3.7 * columns, 0.7 + 3.3 * lines)
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    shades, errors = colours(models), signed_errors(found)
    off = {model: np.column_stack(errors[model][2:]) for model in models}
    for axis, model in zip(axes, models, strict=False):
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
    for axis in axes[len(models) :]:
        axis.set_axis_off()
    more = f"; wider axes for {', '.join(far)}" if far else ""
    _title(figure, found, f"landing errors, + the mean{more}")
    return figure


def spread_picture(found: Validation, signed: bool) -> Figure:
    """Errors by quantity and model: signed as densities (Fig. 19), or absolute as boxes of
    quartiles with whiskers of 1.5 IQR and outliers (Fig. 18). Models far off are cut off."""
    models, far, errors = list(found.checks), far_off(found), signed_errors(found)
    quantities = [0, 1, 2, 3] if found.tracked else [2, 3]
    figure = new_figure(0.5 + max(3.1, 0.8 + 0.5 * len(models)) * len(quantities), 4.2)
    shades = colours(models)
    for quantity, axis in zip(quantities, figure.subplots(1, len(quantities)), strict=True):
        name, unit = QUANTITIES[quantity]
        near = [np.abs(errors[m][quantity]).max(initial=0.0) for m in models if m not in far]
        top = 1.08 * max(near, default=0.0) or 1.0
        for place, model in enumerate(models):
            values = errors[model][quantity]
            _violin(axis, place, values, shades[model]) if signed else _box(
                axis, place, np.abs(values), shades[model]
            )
        axis.set_xticks(range(len(models)), models, rotation=35, ha="right")
        axis.set_ylim(-top if signed else 0.0, top)
        axis.set_ylabel(f"{name} error [{unit}]" if signed else f"|{name} error| [{unit}]")
        axis.axhline(0, color=GREY, lw=0.9)
        axis.grid(alpha=0.25, axis="y")
        axis.set_axisbelow(True)
    what = "errors, predicted − measured, density" if signed else "absolute errors, quartiles"
    more = f"; {', '.join(far)} cut off" if far else ""
    _title(figure, found, what + more)
    return figure


def _box(axis: Axes, place: int, values: Array, colour: str) -> None:
    """Quartiles, whiskers and outliers."""
    drawn = axis.boxplot(
        [values],
        positions=[place],
        widths=0.6,
        patch_artist=True,
        manage_ticks=False,
        medianprops={"color": BLACK, "lw": 1.6},
        flierprops={"marker": "o", "ms": 3, "mec": GREY, "alpha": 0.7},
    )
    for box in drawn["boxes"]:
        box.set(facecolor=colour, alpha=0.75)


def _violin(axis: Axes, place: int, values: Array, colour: str) -> None:
    """One density with median and quartiles; a density needs values that differ."""
    if values.size == 0:
        return
    if values.size > 2 and np.ptp(values) > 1e-9:
        drawn = axis.violinplot([values], positions=[place], widths=0.8, showextrema=False)
        for body in drawn["bodies"]:  # type: ignore[attr-defined]
            body.set(facecolor=colour, edgecolor=BLACK, linewidth=0.6, alpha=0.75)
    low, middle, high = np.quantile(values, (0.25, 0.5, 0.75))
    axis.plot([place, place], [low, high], color=BLACK, lw=2)
    axis.plot([place], [middle], "o", mfc="white", mec=BLACK, ms=5)


# One throw closely.


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


def case_picture(found: Validation, row: int) -> Figure:
    """The release: x and z, theta, v_x and omega over time; beside it the whole throw (Fig. 16)."""
    shades, throw = colours(list(found.checks)), found.data.throws[row]
    drawn = [(predicted_course(found, m, row), _line_style(m, shades)) for m in found.checks]
    drawn.append((measured_course(found, row), TRACK))
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


def factors_picture(found: Validation) -> Figure:
    """Per factor measured and predicted landings, and bars of MAE and STD (Fig. 20)."""
    groups, far = found.factors, far_off(found)
    model = next((name for name in DRAWN if name in found.checks), next(iter(found.checks)))
    columns = min(3, len(groups))
    lines = math.ceil(len(groups) / columns)
    figure = new_figure(0.6 + 5.0 * columns, 0.9 + 6.6 * lines)
    parts = np.atleast_2d(figure.subfigures(lines, columns, squeeze=False)).ravel()
    for part, group in zip(parts, groups, strict=False):
        cells = part.subplot_mosaic([["pairs", "pairs"], ["x", "theta"]], height_ratios=(1.5, 1))
        _pairs(cells["pairs"], found, model, group[0])
        _bars(cells["x"], group, 0, far)
        _bars(cells["theta"], group, 1, far)
        a, b = group[0].comparison.labels
        part.suptitle(f"{group[0].comparison.name}: {a} → {b}", fontsize=11)
    words = f"landings measured and by {model}; bars: MAE and STD in A (light) and B"
    more = f", cut off for {', '.join(far)}" if far else ""
    _title(figure, found, f"{words}{more}; * p < {SIGNIFICANT}")
    return figure


def _pairs(axis: Axes, found: Validation, model: str, row: FactorRow) -> None:
    """Measured landings joined with the model's of the same throws."""
    compared, shade = row.comparison, colours(list(found.checks))[model]
    sides = zip((compared.first, compared.second), compared.labels, CONDITIONS, strict=True)
    for rows, label, (marker, blue, alpha) in sides:
        real = found.truth.landing[rows] * DEGREES
        guess = real + found.checks[model].landing[rows] * DEGREES
        axis.plot(*np.stack([real, guess]).transpose(2, 0, 1), color=GREY, lw=0.6, zorder=1)
        style: Style = {"s": 20, "lw": 0.4, "zorder": 2, "marker": marker, "ec": BLACK}
        axis.scatter(*guess.T, color=shade, alpha=alpha, label=f"{model}, {label}", **style)
        axis.scatter(*real.T, color=blue, label=f"measured, {label}", **style)
    axis.set(xlabel="landing x [m]", ylabel="landing θ [deg]")
    axis.legend(loc="best", ncols=2, fontsize=7.5, handletextpad=0.1, columnspacing=0.9)
    axis.grid(alpha=0.25)


def _bars(axis: Axes, group: Sequence[FactorRow], quantity: int, far: Sequence[str]) -> None:
    """MAE with STD in A (light) and B of every model; a star where they differ.

    The bars of models that are far off are cut off, with their heights written in.
    """
    factor, shades = DEGREES[quantity], colours([row.model for row in group])
    tops = {
        row.model: float(np.nan_to_num(factor * (row.mean + row.std)[:, quantity]).max())
        for row in group
    }
    top = 1.3 * max([tops[m] for m in tops if m not in far] or tops.values()) or 1.0
    for place, row in enumerate(group):
        for side in range(2):
            height, spread = factor * row.mean[side, quantity], factor * row.std[side, quantity]
            if not np.isfinite(height):
                continue
            at, shade, alpha = place + (side - 0.5) * 0.38, shades[row.model], CONDITIONS[side][2]
            axis.bar(at, min(height, top), 0.36, color=shade, alpha=alpha, ec=BLACK, lw=0.5)
            if height + spread > top:
                words = f"{height:.3g}"
                axis.text(at, 0.06 * top, words, rotation=90, ha="center", fontsize=8)
                continue
            # A standard deviation below zero says nothing of an absolute error.
            down = [[min(spread, height)], [spread]]
            axis.errorbar(at, height, down, color=BLACK, capsize=2, lw=0.9)
        if row.p[quantity] < SIGNIFICANT:
            axis.text(place, min(tops[row.model], 0.9 * top), "*", ha="center", fontsize=14)
    axis.set_ylim(0, top)
    axis.set_xticks(range(len(group)), tops, rotation=40, ha="right", fontsize=8)
    axis.set_ylabel("|x error| [m]" if quantity == 0 else "|θ error| [deg]")
    axis.grid(alpha=0.25, axis="y")
    axis.set_axisbelow(True)
