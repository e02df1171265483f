"""The factor analysis as one picture (Fig. 20): landings by pairs, and errors as bars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .factors import SIGNIFICANT, FactorRow
from .validation import Validation
from .validation_pictures import BLACK, GREY, colours, far_off, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

#: Conditions A and B: marker, colour of measured landings, and how light the model's are.
CONDITIONS = (("o", "#9ecae1", 0.45), ("s", "#2166ac", 1.0))
#: Models whose pairs are drawn, the first that is there.
DRAWN = ("sp", "ls-step", "sp-paper", "ils", "ls")
PER_LINE = 3


def factors_picture(found: Validation) -> Figure:
    """Per factor a scatter of measured and predicted landings, and bars of MAE and STD."""
    from matplotlib.figure import Figure

    groups, far = found.factors, far_off(found)
    model = next((name for name in DRAWN if name in found.checks), next(iter(found.checks)))
    columns = min(PER_LINE, len(groups))
    lines = math.ceil(len(groups) / columns)
    figure = Figure(figsize=(0.6 + 5.0 * columns, 0.9 + 6.6 * lines), layout="constrained")
    parts = np.atleast_2d(figure.subfigures(lines, columns, squeeze=False))
    limits = _limits(found, model)
    for number, group in enumerate(groups):
        part = parts[number // columns, number % columns]
        cells = part.subplot_mosaic([["pairs", "pairs"], ["x", "theta"]], height_ratios=(1.5, 1))
        _pairs(cells["pairs"], found, model, group[0])
        cells["pairs"].set(xlim=limits[0], ylim=limits[1])
        _bars(cells["x"], group, 0, far)
        _bars(cells["theta"], group, 1, far)
        a, b = group[0].comparison.labels
        name = f"({chr(97 + number)}) {group[0].comparison.name}: {a} → {b}"
        part.suptitle(name, fontsize=11)
    words = f"landings measured and by {model}; bars: MAE and STD in A (light) and B"
    if far:
        words += f", cut off for {', '.join(far)}"
    words = title(found, f"{words}; * p < {SIGNIFICANT}")
    figure.suptitle(words, x=0.01, ha="left", fontsize=11)
    return figure


def _limits(found: Validation, model: str) -> list[tuple[float, float]]:
    """Common axes of all scatters: x [m], theta [deg]."""
    rows = np.concatenate(
        [[*g[0].comparison.first, *g[0].comparison.second] for g in found.factors]
    )
    real = found.truth.landing[rows.astype(int)]
    both = np.vstack([real, real + found.checks[model].landing[rows.astype(int)]])
    both = both[np.isfinite(both).all(axis=1)] * [1.0, math.degrees(1.0)]
    low, high = both.min(axis=0), both.max(axis=0)
    room = 0.06 * np.maximum(high - low, [0.05, 5.0])
    return [(low[i] - room[i], high[i] + room[i]) for i in range(2)]


def _pairs(axis: Axes, found: Validation, model: str, row: FactorRow) -> None:
    """Measured landings joined with the model's of the same throws."""
    compared, shade = row.comparison, colours(list(found.checks))[model]
    scale = np.array([1.0, math.degrees(1.0)])
    sides = zip((compared.first, compared.second), compared.labels, CONDITIONS, strict=True)
    for rows, label, (marker, blue, alpha) in sides:
        real = found.truth.landing[rows] * scale
        guess = real + found.checks[model].landing[rows] * scale
        for a, b in zip(real, guess, strict=True):
            axis.plot([a[0], b[0]], [a[1], b[1]], color=GREY, lw=0.6, zorder=1)
        style: dict[str, Any] = {"s": 20, "lw": 0.4, "zorder": 2}
        axis.scatter(
            *guess.T,
            color=shade,
            marker=marker,
            alpha=alpha,
            ec=BLACK,
            label=f"{model}, {label}",
            **style,
        )
        axis.scatter(
            *real.T, color=blue, marker=marker, ec=BLACK, label=f"measured, {label}", **style
        )
    axis.set(xlabel="landing x [m]", ylabel="landing θ [deg]")
    axis.legend(
        loc="upper center",
        bbox_to_anchor=(0.5, -0.16),
        ncols=4,
        fontsize=7.5,
        handletextpad=0.1,
        columnspacing=0.9,
    )
    axis.grid(alpha=0.25)


def _bars(axis: Axes, group: Sequence[FactorRow], quantity: int, far: Sequence[str]) -> None:
    """MAE with STD in A (light) and B of every model; a star where they differ.

    The bars of models that are far off are cut off, with their heights written in.
    """
    factor = 1.0 if quantity == 0 else math.degrees(1.0)
    shades = colours([row.model for row in group])
    near = [row for row in group if row.model not in far] or group
    top = 1.3 * max(_top(row, quantity, factor) for row in near) or 1.0
    for place, row in enumerate(group):
        for side in range(2):
            height, spread = factor * row.mean[side, quantity], factor * row.std[side, quantity]
            if not np.isfinite(height):
                continue
            at, shade, alpha = place + (side - 0.5) * 0.38, shades[row.model], CONDITIONS[side][2]
            axis.bar(at, min(height, top), 0.36, color=shade, alpha=alpha, ec=BLACK, lw=0.5)
            if height + spread > top:
                words = f"{height:.3f}" if quantity == 0 else f"{height:.0f}"
                axis.text(at, 0.06 * top, words, rotation=90, ha="center", fontsize=8)
                continue
            # A standard deviation below zero says nothing of an absolute error.
            down = [[min(spread, height)], [spread]]
            axis.errorbar(at, height, down, color=BLACK, capsize=2, lw=0.9)
        if row.p[quantity] < SIGNIFICANT:
            high = min(_top(row, quantity, factor), 0.9 * top)
            axis.text(place, high, "*", ha="center", fontsize=14)
    axis.set_ylim(0, top)
    axis.set_xticks(range(len(group)), [row.model for row in group], rotation=40, ha="right")
    axis.tick_params(labelsize=8)
    axis.set_ylabel("|x error| [m]" if quantity == 0 else "|θ error| [deg]")
    axis.grid(alpha=0.25, axis="y")
    axis.set_axisbelow(True)


def _top(row: FactorRow, quantity: int, factor: float) -> float:
    """Upper end of the higher error bar, 0 where there is none."""
    return float(np.nan_to_num(factor * (row.mean + row.std)[:, quantity]).max())
