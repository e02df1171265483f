"""Pictures: errors and factors of a validation, landscape and fit of an identification.

Figs. 15, 17, 18 and 20 of the paper.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models import Array
from ...models.release import MODELS, SLIDING_PIVOT, STEPPED_SURFACE
from ..show import BLACK, BLUE, GREEN, GREY, RED, new_figure
from .factors import SIGNIFICANT, FactorRow
from .grid import MISSED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .belief import Belief
    from .grid import Grid
    from .validation import Validation

Style = dict[str, Any]

#: Pictures of a validation and their captions.
PICTURES = {
    "errors": "Predicted less measured landing of every throw of the batch.",
    "boxes": "Absolute errors: median, quartiles, outliers.",
    "factors": "Effect of each factor: landings measured and predicted, errors in both conditions.",
}
#: A model is off the common axes if its median error exceeds the least one by this factor.
FAR = 6.0
#: Errors and their units.
QUANTITIES = (("v_x", "mm/s"), ("ω", "deg/s"), ("x", "mm"), ("θ", "deg"))
#: From metres and radians to metres, or millimetres, and degrees.
DEGREES = np.array([1.0, math.degrees(1.0)])
ERRORS = np.array([1e3, math.degrees(1.0)])
#: Conditions A and B of a factor: marker, colour of measured landings, lightness of the model's.
CONDITIONS = (("o", "#9ecae1", 0.45), ("s", "#2166ac", 1.0))
#: The first of these models that was validated is drawn against the measured landings.
DRAWN = (SLIDING_PIVOT, STEPPED_SURFACE, *MODELS)


def validation_pictures(found: Validation) -> dict[str, Figure]:
    """The pictures that the data allow, by name."""
    figures = {"errors": _errors(found), "boxes": _boxes(found)}
    if found.factors:
        figures["factors"] = _factors(found)
    return figures


def colours(models: Sequence[str]) -> dict[str, str]:
    """A colour for every model."""
    return {model: MODELS[model].colour for model in models}


def _title(figure: Figure, found: Validation, words: str) -> None:
    """Title of a picture; marks synthetic data."""
    more = " (synthetic data)" if found.data.shared.synthetic else ""
    figure.suptitle(f"{found.data.name}: {words}{more}", x=0.01, ha="left", fontsize=11)


def _far_off(found: Validation) -> list[str]:
    """Models with much larger errors than the best: they would hide the others."""
    errors = {m: np.nan_to_num(found.scaled(m)[found.batch], nan=MISSED) for m in found.checks}
    typical = {model: float(np.median(values)) for model, values in errors.items()}
    return [model for model, value in typical.items() if value > FAR * min(typical.values())]


def _signed_errors(found: Validation) -> dict[str, list[Array]]:
    """Predicted less measured v_x, omega, x, theta of the batch, in QUANTITIES' units."""
    out = {}
    for model, check in found.checks.items():
        off = np.hstack([check.twist * ERRORS, check.landing * ERRORS])[found.batch]
        out[model] = [column[np.isfinite(column)] for column in off.T]
    return out


def _errors(found: Validation) -> Figure:
    """Predicted less measured landing, a panel per model on common axes (Fig. 17).

    Models with much larger errors have wider axes.
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
        reach = 1.1 * np.abs(np.vstack([*alike, [[1e-3, 1e-3]]])).max(axis=0)
        axis.set(xlim=(-reach[0], reach[0]), ylim=(-reach[1], reach[1]))
        axis.axhline(0, color=GREY, lw=0.8)
        axis.axvline(0, color=GREY, lw=0.8)
        axis.plot(*off[model].T, "o", color=shades[model], ms=4.5, mec="white", mew=0.3, alpha=0.8)
        words = "no landing"
        if len(off[model]):
            center = off[model].mean(axis=0)
            axis.plot(*center, "+", color=BLACK, ms=13, mew=2)
            words = f"mean {center[0]:+.1f} mm, {center[1]:+.2f}°".replace("-", "−")
        axis.set_title(f"{model}: {words}", loc="left", fontsize=10)
        axis.set(xlabel="x predicted − measured [mm]", ylabel="θ predicted − measured [deg]")
        axis.locator_params(axis="x", nbins=5)
        axis.grid(alpha=0.25)
    more = f"; wider axes for {', '.join(far)}" if far else ""
    _title(figure, found, f"landing errors, + the mean{more}")
    return figure


def _boxes(found: Validation) -> Figure:
    """Absolute errors by quantity and model: quartiles, whiskers of 1.5 IQR, outliers (Fig. 18).

    The axes cut off models with much larger errors.
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
    axis.margins(y=0.08)
    above: Style = {"loc": "lower center", "bbox_to_anchor": (0.5, 1.0), "frameon": False}
    axis.legend(ncols=4, fontsize=7.5, handletextpad=0.1, columnspacing=0.9, **above)
    axis.grid(alpha=0.25)


def _condition_errors(axis: Axes, group: Sequence[FactorRow], quantity: int) -> None:
    """MAE with STD in A (light) and B of every model; a star where they differ."""
    factor, shades = ERRORS[quantity], colours([row.model for row in group])
    for place, row in enumerate(group):
        for side, (marker, _, alpha) in enumerate(CONDITIONS):
            height, spread = factor * row.mean[side, quantity], factor * row.std[side, quantity]
            style: Style = {"fmt": marker, "color": shades[row.model], "alpha": alpha, "capsize": 2}
            axis.errorbar(place + 0.3 * (side - 0.5), height, spread, ms=6, **style)
        if row.p[quantity] < SIGNIFICANT:
            axis.text(place, factor * row.mean[:, quantity].max(), "*", ha="center", fontsize=14)
    means = np.array([row.mean[:, quantity] for row in group])
    if means.max() > FAR * means.min():
        axis.set_yscale("log", nonpositive="clip")
    else:
        axis.set_ylim(bottom=0.0)
    axis.margins(x=0.2)
    axis.set_xticks(range(len(group)), list(shades), rotation=40, ha="right", fontsize=8)
    axis.set_ylabel("|x error| [mm]" if quantity == 0 else "|θ error| [deg]")
    axis.grid(alpha=0.25, axis="y")


def contact_picture(
    title: str,
    truth: Mapping[str, float],
    grid: Grid | None,
    prior: Belief | None,
    belief: Belief | None,
) -> Figure:
    """Mean pose error over mu and r_p, the prior and the fit `belief` with 95 % regions.

    truth: what a synthetic data set was made with, else empty.
    """
    figure = new_figure(7.6, 6.0)
    axis, words = figure.add_subplot(), [title]
    if grid is not None:
        words += _landscape(axis, grid)
    if prior is not None:
        _belief(axis, prior, "prior, 95 % region", GREY)
    if belief is not None:
        _belief(axis, belief, "fit, 95 % region", GREEN)
        low, high = axis.get_xlim()
        x = np.geomspace(max(low, 1e-3), max(high, 2e-3), 200)
        limits = axis.get_xlim(), axis.get_ylim()
        axis.plot(x, 1e3 * belief.product / x, color=GREY, ls=":", lw=1, label="same μ r_p")
        axis.set(xlim=limits[0], ylim=limits[1])
        spread = 100 * belief.product_deviation
        words.append(f"fit: μ r_p {1e3 * belief.product:.3f} mm ± {spread:.1f} %")
    if {"friction", "patch_radius"} <= set(truth):
        mu = truth["friction"] * truth.get("grip_scale", 1.0)
        style: Style = {"color": BLUE, "ms": 14, "mec": "white", "ls": "none", "label": "truth"}
        axis.plot(mu, 1e3 * truth["patch_radius"], "*", **style)
    axis.set(xlabel="friction μ", ylabel="patch radius r_p [mm]")
    axis.set_title("\n".join(words), loc="left", fontsize=10)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _landscape(axis: Axes, grid: Grid) -> list[str]:
    """The grid's errors, the lowest 10 % encircled; lines for the title."""
    mu, radius, shown = grid.friction, 1e3 * grid.patch_radius, 100 * grid.error.T
    top, low = (float(np.quantile(shown, share)) for share in (0.98, 0.1))
    mesh = axis.pcolormesh(mu, radius, shown, cmap="inferno", vmax=top, shading="nearest")
    axis.contour(mu, radius, shown, [low], colors="white", linewidths=1.0)
    assert axis.figure is not None
    axis.figure.colorbar(
        mesh, label="mean pose error [cm]: position plus angle times half the length", extend="max"
    )
    best, (i, j) = 100 * grid.error.min(), grid.best()
    axis.plot(mu[i], radius[j], "X", color=RED, ms=11, mec="white", label="lowest mean error")
    words = [f"least {best:.2f} cm at μ {mu[i]:.2f}, r_p {radius[j]:.1f} mm; white: lowest 10 %"]
    lost = int(grid.missed.sum())
    if lost:
        words.append(f"{lost} of {grid.predictions} do not land (count as {MISSED:g} m)")
    return words


def _belief(axis: Axes, belief: Belief, label: str, colour: str) -> None:
    """A belief's mean and 95 % region."""
    known = belief.effective
    outline = known.ellipse()
    axis.plot(outline[:, 0], 1e3 * outline[:, 1], color=colour, lw=1.8, zorder=4)
    place = known.value("friction"), 1e3 * known.value("patch_radius")
    axis.plot(*place, "o-", color=colour, ms=7, mec="white", label=label, zorder=5)
