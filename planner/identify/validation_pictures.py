"""Pictures of measured landings and of the models' errors (Figs. 14, 17, 18 and 19)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .factors import ordered_labels
from .grid import MISSED
from .validation import Validation

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

#: A colour per model, in this order for those that have none of their own.
COLOURS = {
    "ls": "#d1495b",
    "sp": "#e0912f",
    "sp-paper": "#8c6bb1",
    "ils": "#2a9d6f",
    "ls-step": "#4c78a8",
}
OTHERS = ("#6b705c", "#b5838d", "#118ab2", "#8a8f98")
BLACK, GREY = "#222222", "#8a8f98"
MARKERS = ("o", "^", "s", "D", "v", "P", "X", "*")
DPI = 110
#: Models whose median error is above so many times the least have a scale of their own.
FAR = 6.0
#: A signed or absolute error: key, label with unit.
QUANTITIES = (("v_x", "m/s"), ("ω", "deg/s"), ("x", "m"), ("θ", "deg"))


def colours(models: Sequence[str]) -> dict[str, str]:
    """A colour for every model."""
    free = iter(OTHERS * len(models))
    return {model: COLOURS.get(model) or next(free) for model in models}


def far_off(found: Validation) -> list[str]:
    """Models that err many times more than the best one: on their scale no other shows."""
    errors = {m: np.nan_to_num(found.scaled(m)[found.batch], nan=MISSED) for m in found.checks}
    typical = {model: float(np.median(values)) for model, values in errors.items()}
    least = min(typical.values())
    return [model for model, value in typical.items() if value > FAR * least]


def save(figure: Figure, path: Path) -> None:
    """Write the PNG file."""
    figure.savefig(path, dpi=DPI)


def signed_errors(found: Validation) -> dict[str, list[Array]]:
    """Predicted less measured v_x, omega, x, theta of the batch, in QUANTITIES' units."""
    degrees = math.degrees(1.0)
    out = {}
    for model, check in found.checks.items():
        twist, landing = check.twist[found.batch], check.landing[found.batch]
        columns = [twist[:, 0], degrees * twist[:, 1], landing[:, 0], degrees * landing[:, 1]]
        out[model] = [column[np.isfinite(column)] for column in columns]
    return out


def landings_picture(found: Validation) -> Figure:
    """Measured landing poses: marker by CoM, colour by release motion (Fig. 14)."""
    from matplotlib import colormaps
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.5, 5.6), layout="constrained")
    axis = figure.subplots()
    throws = [found.data.throws[i] for i in found.batch]
    landing = found.truth.landing[found.batch] * [1.0, math.degrees(1.0)]
    coms = ordered_labels(found.data.picked(list(found.batch)), "com") or [""]
    releases = ordered_labels(found.data.picked(list(found.batch)), "release") or [""]
    shades = dict(
        zip(releases, colormaps["viridis"](np.linspace(0, 0.95, len(releases))), strict=True)
    )
    for com, marker in zip(coms, MARKERS * len(coms), strict=False):
        mine = [i for i, t in enumerate(throws) if t.factors.get("com", "") == com]
        shade = [shades[throws[i].factors.get("release", "")] for i in mine]
        x, theta = landing[mine].T
        axis.scatter(x, theta, c=shade, marker=marker, s=36, ec=BLACK, lw=0.3, alpha=0.9)
        if com:
            axis.plot([], [], marker, mfc="none", mec=BLACK, label=f"CoM {com}")
    if len(coms) > 1:
        axis.legend(loc="best", fontsize=9)
    if len(releases) > 1:
        _release_bar(figure, axis, releases)
    axis.set(xlabel="landing x [m]", ylabel="landing θ [deg]")
    axis.grid(alpha=0.25)
    axis.set_title(
        title(found, f"measured landings of {len(throws)} throws"), loc="left", fontsize=11
    )
    return figure


def _release_bar(figure: Figure, axis: Axes, releases: Sequence[str]) -> None:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    shown = colormaps["viridis"](np.linspace(0, 0.95, len(releases)))
    scale = ScalarMappable(Normalize(-0.5, len(releases) - 0.5), ListedColormap(shown))
    bar = figure.colorbar(scale, ax=axis, label="release motion: speeding up to slowing down")
    bar.set_ticks(list(range(len(releases))), labels=list(releases))


def title(found: Validation, words: str) -> str:
    """One line over a picture; says so if nothing was measured."""
    more = " (synthetic data)" if found.data.shared.synthetic else ""
    return f"{found.data.name}: {words}{more}"


def errors_picture(found: Validation) -> Figure:
    """Predicted less measured landing, a panel per model on common axes (Fig. 17).

    Models that are far off have wider axes.
    """
    from matplotlib.figure import Figure

    models, far = list(found.checks), far_off(found)
    columns = min(3, len(models))
    lines = math.ceil(len(models) / columns)
    figure = Figure(figsize=(0.6 + 3.7 * columns, 0.7 + 3.3 * lines), layout="constrained")
    axes = figure.subplots(lines, columns, squeeze=False).ravel()
    shades = colours(models)
    off = {model: np.column_stack(signed_errors(found)[model][2:]) for model in models}
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
    words = title(found, f"landing errors, + the mean{more}")
    figure.suptitle(words, x=0.01, ha="left", fontsize=11)
    return figure


def _panels(found: Validation, words: str) -> tuple[Figure, list[tuple[int, Axes, list[str]]]]:
    """A panel (quantity, axes, models) for every quantity that was measured.

    Where some models are far off, a second line shows the others alone.
    """
    from matplotlib.figure import Figure

    quantities = [0, 1, 2, 3] if found.tracked else [2, 3]
    models, far = list(found.checks), far_off(found)
    rows = [models, [m for m in models if m not in far]] if far else [models]
    width = 0.5 + max(3.1, 0.8 + 0.5 * len(models)) * len(quantities)
    figure = Figure(figsize=(width, 0.4 + 3.8 * len(rows)), layout="constrained")
    axes = figure.subplots(len(rows), len(quantities), squeeze=False)
    more = f"; below without {', '.join(far)}" if far else ""
    figure.suptitle(title(found, f"{words}{more}"), x=0.01, ha="left", fontsize=11)
    panels = []
    for line, shown in zip(axes, rows, strict=True):
        for quantity, axis in zip(quantities, line, strict=True):
            axis.set_xticks(range(len(shown)), shown, rotation=35, ha="right")
            axis.grid(alpha=0.25, axis="y")
            axis.set_axisbelow(True)
            panels.append((quantity, axis, shown))
    return figure, panels


def boxes_picture(found: Validation) -> Figure:
    """Absolute errors as boxes: median, quartiles, whiskers of 1.5 IQR, outliers (Fig. 18)."""
    from matplotlib.patches import Patch

    figure, panels = _panels(found, "absolute errors, quartiles and outliers")
    shades, errors = colours(list(found.checks)), signed_errors(found)
    for quantity, axis, shown in panels:
        name, unit = QUANTITIES[quantity]
        for place, model in enumerate(shown):
            if not errors[model][quantity].size:
                continue
            drawn = axis.boxplot(
                [np.abs(errors[model][quantity])],
                positions=[place],
                widths=0.6,
                patch_artist=True,
                manage_ticks=False,
                medianprops={"color": BLACK, "lw": 1.6},
                flierprops={"marker": "o", "ms": 3, "mec": GREY, "alpha": 0.7},
            )
            for box in drawn["boxes"]:
                if isinstance(box, Patch):
                    box.set(facecolor=shades[model], alpha=0.75)
        axis.set_ylabel(f"|{name} error| [{unit}]")
        axis.set_ylim(bottom=0)
    return figure


def violins_picture(found: Validation) -> Figure:
    """Signed errors as densities with their medians (Fig. 19)."""
    from matplotlib.lines import Line2D

    figure, panels = _panels(found, "errors, predicted − measured, density")
    shades, errors = colours(list(found.checks)), signed_errors(found)
    for quantity, axis, shown in panels:
        name, unit = QUANTITIES[quantity]
        axis.axhline(0, color=GREY, lw=0.9)
        for place, model in enumerate(shown):
            _violin(axis, place, errors[model][quantity], shades[model])
        axis.set_ylabel(f"{name} error [{unit}]")
    figure.legend(
        handles=[
            Line2D([], [], color=BLACK, lw=2, label="quartiles"),
            Line2D([], [], ls="", marker="o", mfc="white", mec=BLACK, ms=5, label="median"),
        ],
        loc="outside lower right",
        ncols=2,
        fontsize=8,
    )
    return figure


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
