"""Pictures: errors of a validation (Figs. 17 and 18 of the paper), fit of an identification."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models import Array
from ...models.release import MODELS
from ..show import BLACK, BLUE, GREEN, GREY, new_figure
from .grid import MISSED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .belief import Belief
    from .validation import Validation

Style = dict[str, Any]

#: Pictures of a validation and their captions.
PICTURES = {
    "errors": "Predicted less measured landing of every throw of the batch.",
    "boxes": "Absolute errors: median, quartiles, outliers.",
}
#: A model is off the common axes if its median error exceeds the least one by this factor.
FAR = 6.0
#: Errors and their units.
QUANTITIES = (("v_x", "mm/s"), ("ω", "deg/s"), ("x", "mm"), ("θ", "deg"))
#: From metres and radians to metres, or millimetres, and degrees.
DEGREES = np.array([1.0, math.degrees(1.0)])
ERRORS = np.array([1e3, math.degrees(1.0)])


def validation_pictures(found: Validation) -> dict[str, Figure]:
    """The pictures by name."""
    return {"errors": _errors(found), "boxes": _boxes(found)}


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
        largest = [v.max(initial=0.0) for m, v in zip(models, values, strict=True) if m not in far]
        axis.set_xticks(range(len(models)), models, rotation=35, ha="right")
        axis.set(ylim=(0.0, 1.08 * max(largest) or 1.0), ylabel=f"|{name} error| [{unit}]")
        axis.grid(alpha=0.25, axis="y")
    cut = f"; {', '.join(far)} cut off" if far else ""
    _title(figure, found, f"absolute errors, quartiles{cut}")
    return figure


def contact_picture(
    title: str,
    truth: Mapping[str, float],
    prior: Belief | None,
    fit: Belief,
) -> Figure:
    """The prior and the fit with 95 % regions over mu and r_p.

    truth: what a synthetic data set was made with, else empty.
    """
    figure = new_figure(7.6, 6.0)
    axis = figure.add_subplot()
    if prior is not None:
        _belief(axis, prior, "prior, 95 % region", GREY)
    _belief(axis, fit, "fit, 95 % region", GREEN)
    limits = axis.get_xlim(), axis.get_ylim()
    x = np.geomspace(max(limits[0][0], 1e-3), max(limits[0][1], 2e-3), 200)
    axis.plot(x, 1e3 * fit.product / x, color=GREY, ls=":", lw=1, label="equal μ r_p")
    axis.set(xlim=limits[0], ylim=limits[1])
    if {"friction", "patch_radius"} <= set(truth):
        mu = truth["friction"] * truth.get("grip_scale", 1.0)
        style: Style = {"color": BLUE, "ms": 14, "mec": "white", "ls": "none", "label": "truth"}
        axis.plot(mu, 1e3 * truth["patch_radius"], "*", **style)
    axis.set(xlabel="friction μ", ylabel="patch radius r_p [mm]")
    words = f"fit: μ r_p {1e3 * fit.product:.3f} mm ± {100 * fit.product_deviation:.1f} %"
    axis.set_title(f"{title}\n{words}", loc="left", fontsize=10)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _belief(axis: Axes, belief: Belief, label: str, colour: str) -> None:
    """A belief's mean and 95 % region."""
    known = belief.effective
    outline = known.ellipse()
    axis.plot(outline[:, 0], 1e3 * outline[:, 1], color=colour, lw=1.8, zorder=4)
    place = known.value("friction"), 1e3 * known.value("patch_radius")
    axis.plot(*place, "o-", color=colour, ms=7, mec="white", label=label, zorder=5)
