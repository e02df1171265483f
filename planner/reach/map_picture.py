"""map.png: landing poses in reach, coloured by the margin to the limits."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .reach_map import ReachMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patheffects import AbstractPathEffect

Array = npt.NDArray[np.float64]

BLUE, TEAL, RED, BLACK = "#4c78a8", "#2a788e", "#d1495b", "#222222"
#: Contour lines of the number of throws in a decade, and how many of the highest are drawn.
LEVELS, LINES = (1.0, 2.0, 5.0), 3
#: Fewer throws than this are no line: one by chance more would move it far.
LEAST = 4.0


def draw_map(found: ReachMap, path: Path) -> None:
    """The map as a picture: over x and theta, or over x alone where theta is open."""
    if found.theta_edges is None:
        _draw_line(found, path)
    else:
        _draw_plane(found, found.theta_edges, path)


def _title(found: ReachMap) -> str:
    """What is shown, in two lines."""
    wide, angle = found.widths
    size = f"{100 * wide:g} cm" + ("" if angle is None else f" × {math.degrees(angle):g}°")
    cup = ", with the cup there" if found.scene.cup is not None else ""
    return (
        f"{found.scene.name}: landing poses in reach at z = {found.z:g} m{cup}\n"
        f"{found.x.size:,} landings of {found.samples:,} sampled states, bins of {size}; "
        "blank: not hit"
    )


def _draw_plane(found: ReachMap, theta_edges: Array, path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 5.8), layout="constrained")
    axis = figure.subplots()
    x, theta = found.x_edges, np.degrees(theta_edges)
    top = max(float(np.nanmax(found.margin)), 0.05)
    mesh = axis.pcolormesh(
        x,
        theta,
        100 * found.margin.T,
        cmap="viridis",
        vmin=0.0,
        vmax=100 * top,
        rasterized=True,
        zorder=1,
    )
    bar = figure.colorbar(mesh, ax=axis, pad=0.015, aspect=32)
    bar.set_label("best margin to the limits [%]")
    bar.outline.set_linewidth(0.6)
    _contours(axis, found, theta_edges)
    _mark_target(axis, found, theta)
    _frame(axis, theta)
    axis.set(xlabel="landing x [m]", ylabel="landing θ [deg]")
    axis.set_title(_title(found), loc="left", fontsize=10)
    figure.legend(loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    figure.savefig(path, dpi=130)


def _contours(axis: Axes, found: ReachMap, theta_edges: Array) -> None:
    """Lines of equal number of different throws, smoothed over some bins."""
    from matplotlib.patheffects import withStroke

    number = found.solutions.astype(float)
    for _ in range(3):
        number = _smoothed(number)
    highest = float(number.max())
    decades = [10.0**k * m for k in range(6) for m in LEVELS]
    levels = [level for level in decades if LEAST <= level < 0.9 * highest]
    if not levels or min(number.shape) < 4:
        return
    x = (found.x_edges[1:] + found.x_edges[:-1]) / 2
    theta = np.degrees((theta_edges[1:] + theta_edges[:-1]) / 2)
    lines = axis.contour(
        x, theta, number.T, levels=levels[-LINES:], colors="white", linewidths=0.9, zorder=2
    )
    # A dark rim, for where the lines pass over white.
    rim: list[AbstractPathEffect] = [withStroke(linewidth=2.2, foreground=BLACK, alpha=0.55)]
    lines.set_path_effects(rim)
    for text in axis.clabel(lines, fmt="%g", fontsize=9, inline_spacing=3):
        text.set_path_effects(rim)
    proxy = axis.plot([], [], color="white", lw=1.2, label="number of different throws in a bin")
    proxy[0].set_path_effects(rim)


def _smoothed(values: Array) -> Array:
    """Mean over 3 x 3 neighbours (X, T), nothing beyond the border."""
    padded = np.pad(values, 1)
    rows = padded[:-2] + padded[1:-1] + padded[2:]
    return np.asarray((rows[:, :-2] + rows[:, 1:-1] + rows[:, 2:]) / 9)


def _mark_target(axis: Axes, found: ReachMap, theta: Array) -> None:
    """The scene's target, hollow where the map is of another height; its other turns."""
    target = found.scene.target
    assert target is not None and target.theta is not None  # theta is an axis of this map
    here = target.z == found.z
    label = "target" if here else f"target's x and θ (it is at z = {target.z:g} m)"
    face, edge = (RED, "white") if here else ("none", RED)
    x, angle = target.plane_x, math.degrees(target.theta)
    star: dict[str, Any] = {"ls": "", "ms": 17, "mew": 1.1, "zorder": 5, "clip_on": False}
    axis.plot([x], [angle], marker="*", mfc=face, mec=edge, label=label, **star)
    others = [angle + 360 * k for k in range(-9, 10) if k]
    others = [other for other in others if theta[0] < other < theta[-1]]
    if others:
        ring: dict[str, Any] = {"ls": "", "marker": "o", "ms": 8, "mfc": "none", "zorder": 5}
        words = "the same a full turn away"
        axis.plot([x] * len(others), others, mec=RED, mew=1.6, label=words, **ring)


def _frame(axis: Axes, theta: Array) -> None:
    """Ticks at quarter turns, and lines at full ones."""
    from matplotlib.ticker import MultipleLocator

    span = float(theta[-1] - theta[0])
    step = next((s for s in (15, 30, 45, 90, 180, 360) if span <= 10 * s), 720)
    axis.yaxis.set_major_locator(MultipleLocator(step))
    axis.grid(alpha=0.3, lw=0.6, zorder=0)
    axis.set_axisbelow(True)
    axis.use_sticky_edges = False
    axis.margins(0.02)
    axis.autoscale_view()


def _draw_line(found: ReachMap, path: Path) -> None:
    """Margin and number of throws over x."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.4, 4.8), layout="constrained")
    axes = figure.subplots(2, 1, sharex=True)
    target = found.scene.target
    assert target is not None  # a scene with a map has one
    rows = (
        ("best margin [%]", 100 * np.nan_to_num(found.margin[:, 0]), TEAL),
        ("different throws in a bin", found.solutions[:, 0].astype(float), BLUE),
    )
    for axis, (label, values, colour) in zip(axes, rows, strict=True):
        axis.stairs(values, found.x_edges, fill=True, color=colour, alpha=0.75, lw=0)
        axis.stairs(values, found.x_edges, color=colour, lw=1.2)
        words = "target" if target.z == found.z else f"target's x (it is at z = {target.z:g} m)"
        axis.axvline(target.plane_x, color=RED, lw=1.4, label=words)
        axis.set_ylabel(label)
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.25)
        axis.set_axisbelow(True)
    axes[0].legend(loc="upper left", fontsize=9)
    axes[1].set_xlabel("landing x [m]")
    axes[0].set_title(_title(found), loc="left", fontsize=10)
    figure.savefig(path, dpi=130)
