"""The landing poses in reach, as one picture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models import Array
from ..planner import ReachMap
from .style import BLACK, BLUE, RED, TEAL, new_figure, own_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.patheffects import AbstractPathEffect

#: Lowest level [throws] of a contour line: one throw more would move a lower line far.
MIN_LEVEL = 4.0


def draw_map(found: ReachMap) -> Figure:
    """The map over x and theta, or over x alone if theta is open."""
    if found.theta_edges is None:
        return _draw_line(found)
    return _draw_plane(found, np.degrees(found.theta_edges))


def _title(found: ReachMap) -> str:
    """What the map says, of how many throws."""
    wide, angle = found.widths
    size = f"{100 * wide:g} cm" + ("" if angle is None else f" × {math.degrees(angle):g}°")
    cup = ", with the cup there" if found.scene.cup is not None else ""
    return (
        f"{found.scene.name}: landing poses found at z = {found.z:g} m{cup}\n"
        f"{found.x.size:,} landings of {found.samples:,} sampled states, bins of {size}; "
        "blank: not found"
    )


@own_style()
def _draw_plane(found: ReachMap, theta: Array) -> Figure:
    """The best free share per bin, contours of the number of throws, and the target."""
    from matplotlib.ticker import MultipleLocator

    figure = new_figure(9.5, 6.6, _title(found))
    axes = figure.subplots()
    values, label, colours = _colours(found)
    mesh: Any
    if found.error95 is None:
        mesh = axes.pcolormesh(found.x_edges, theta, values.T, rasterized=True, zorder=1, **colours)
        _mark_library(axes, found)
    else:
        # The throws may be farther apart than the bins.
        i, j = np.nonzero(np.isfinite(values))
        x, middle = ((edges[1:] + edges[:-1]) / 2 for edges in (found.x_edges, theta))
        dots: dict[str, Any] = {"s": 22, "lw": 0, "rasterized": True, "zorder": 3, **colours}
        mesh = axes.scatter(x[i], middle[j], c=values[i, j], **dots)
    figure.colorbar(mesh, ax=axes, pad=0.015, aspect=32, label=label)
    _contours(axes, found, theta)
    _mark_target(axes, found, theta)
    span = float(theta[-1] - theta[0])
    step = next((s for s in (15, 30, 45, 90, 180, 360) if span <= 10 * s), 720)
    axes.yaxis.set_major_locator(MultipleLocator(step))
    axes.grid(alpha=0.3, lw=0.6, zorder=0)
    axes.set(axisbelow=True, xlabel="landing x [m]", ylabel="landing θ [deg]")
    axes.use_sticky_edges = False
    axes.margins(0.02)
    figure.legend(loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    return figure


def _colours(found: ReachMap) -> tuple[Array, str, dict[str, Any]]:
    """What the colours of a map say (X, T): the best free share, or the 95 % error; its label, and
    the scale of the colours."""
    if found.error95 is None:
        values, label = 100 * found.margin, "share of every limit that is free, at best [%]"
        return values, label, {"cmap": "viridis", "vmin": 0.0, "vmax": max(np.nanmax(values), 5.0)}
    values, label = 1e3 * found.error95, "95 % pose error of prepared throws, at best [mm]"
    known = values[values > 0.0]
    low, high = np.quantile(known, [0.02, 0.98]) if known.size else (1.0, 1.0)
    ends = {"vmin": low, "vmax": max(high, 2.0 * low)}
    return values, label, {"cmap": "viridis_r", "norm": "log", **ends}


def _contours(axes: Axes, found: ReachMap, theta: Array) -> None:
    """Lines of equal number of different throws, smoothed over some bins, at the 3 top levels."""
    from matplotlib.patheffects import withStroke
    from scipy.ndimage import uniform_filter

    number = found.solutions.astype(float)
    for _ in range(3):
        number = uniform_filter(number, 3, mode="constant")
    decades = [10.0**k * m for k in range(6) for m in (1.0, 2.0, 5.0)]
    levels = [level for level in decades if MIN_LEVEL <= level < 0.9 * number.max()][-3:]
    if not levels or min(number.shape) < 4:
        return
    x, middle = ((edges[1:] + edges[:-1]) / 2 for edges in (found.x_edges, theta))
    lines = axes.contour(x, middle, number.T, levels=levels, colors="white", linewidths=0.9)
    # A dark rim, for where the lines pass over white.
    rim: list[AbstractPathEffect] = [withStroke(linewidth=2.2, foreground=BLACK, alpha=0.55)]
    (entry,) = axes.plot([], [], color="white", lw=1.2, label="number of different throws in a bin")
    for artist in (lines, entry, *axes.clabel(lines, fmt="%g", fontsize=9, inline_spacing=3)):
        artist.set_path_effects(rim)


def _mark_library(axes: Axes, found: ReachMap) -> None:
    """The library's throws."""
    if found.solved.size:
        x, theta = found.solved
        dots: dict[str, Any] = {"s": 3, "lw": 0, "zorder": 3, "rasterized": True, "color": BLACK}
        axes.scatter(x, np.degrees(theta), label="solved throws of the library", **dots)


def _mark_target(axes: Axes, found: ReachMap, theta: Array) -> None:
    """The scene's target, hollow where the map is of another height; its other turns."""
    target = found.scene.aim
    assert target.theta is not None  # theta is an axis of this map
    here = target.z == found.z
    label = "target" if here else f"target's x and θ (it is at z = {target.z:g} m)"
    face, edge = (RED, "white") if here else ("none", RED)
    x, angle = target.plane_x, math.degrees(target.theta)
    if target.is_region:
        wide, high = target.half_widths[0], math.degrees(target.half_widths[1])
        ends = [x - wide, x + wide, x + wide, x - wide, x - wide]
        angles = [angle - high] * 2 + [angle + high] * 2 + [angle - high]
        axes.plot(ends, angles, color=RED, lw=1.4, zorder=4)
    mark: dict[str, Any] = {"ls": "", "zorder": 5, "clip_on": False}
    axes.plot([x], [angle], "*", ms=17, mew=1.1, mfc=face, mec=edge, label=label, **mark)
    others = [angle + 360 * k for k in range(-9, 10) if k]
    others = [other for other in others if theta[0] < other < theta[-1]]
    if others:
        words = "the same a full turn away"
        axes.plot([x] * len(others), others, "o", ms=8, mew=1.6, mfc="none", mec=RED, label=words)


@own_style()
def _draw_line(found: ReachMap) -> Figure:
    """Margin and number of throws over x."""
    figure = new_figure(9.5, 5.4, _title(found))
    target = found.scene.aim
    words = "target" if target.z == found.z else f"target's x (it is at z = {target.z:g} m)"
    above, below = figure.subplots(2, 1, sharex=True)
    best, words_of_best, _ = _colours(found)
    for axes, label, values, colour in (
        (above, words_of_best, np.nan_to_num(best[:, 0]), TEAL),
        (below, "different throws in a bin", found.solutions[:, 0].astype(float), BLUE),
    ):
        axes.stairs(values, found.x_edges, fill=True, color=colour, alpha=0.75, lw=0)
        axes.stairs(values, found.x_edges, color=colour, lw=1.2)
        ends = {target.plane_x - target.half_widths[0], target.plane_x + target.half_widths[0]}
        for number, x in enumerate(sorted(ends)):
            axes.axvline(x, color=RED, lw=1.4, label=None if number else words)
        axes.set(ylabel=label, axisbelow=True)
        axes.set_ylim(bottom=0)
        axes.grid(alpha=0.25)
    above.legend(loc="upper left", fontsize=9)
    below.set_xlabel("landing x [m]")
    return figure
