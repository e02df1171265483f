"""Pictures of a validation: errors and factors (Figs. 17, 18 and 20)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import MODELS, SLIDING_PIVOT, STEPPED_SURFACE
from ..show import BLACK, GREY, new_figure
from .factors import SIGNIFICANT, FactorRow
from .grid import MISSED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .validation import Validation

Array = npt.NDArray[np.float64]
Style = dict[str, Any]

#: Pictures of a validation with what is to be seen.
PICTURES = {
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
#: Conditions A and B of a factor: marker, colour of measured landings, lightness of the model's.
CONDITIONS = (("o", "#9ecae1", 0.45), ("s", "#2166ac", 1.0))
#: Models whose landings are drawn against the measured ones, the first that is there.
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
