"""map.png: landing poses in reach, coloured by the margin to the limits."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models import Array
from ...problems import Pose
from ..show import BLACK, BLUE, RED, TEAL, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patheffects import AbstractPathEffect

#: Lowest level [throws] of a contour line: one throw more would move a lower line far.
MIN_LEVEL = 4.0


@dataclass(frozen=True, eq=False)
class MapPicture:
    """The content of map.png.

    x_edges (X + 1,) [m], theta_edges (T + 1,) [rad] or None; best margin and number of different
    throws per bin (X, T); x and theta of the library's throws solved (2, S) and of the places
    beyond (2, B) that it found to be out of reach; the target and the height z [m] of the map.
    """

    title: str
    x_edges: Array
    theta_edges: Array | None
    margin: Array
    solutions: Array
    solved: Array
    beyond: Array
    target: Pose
    z: float

    def draw(self, path: Path) -> None:
        """Draws it over x and theta, or over x alone if theta is open."""
        if self.theta_edges is None:
            _draw_line(self, path)
        else:
            _draw_plane(self, self.theta_edges, path)


def _draw_plane(found: MapPicture, theta_edges: Array, path: Path) -> None:
    """The best margin per bin, contours of the number of throws, and the target."""
    from matplotlib.ticker import MultipleLocator

    figure = new_figure(9.5, 6.6)
    axes = figure.subplots()
    theta, margin = np.degrees(theta_edges), 100 * found.margin.T
    top = max(float(np.nanmax(margin)), 5.0)
    colours: dict[str, Any] = {"cmap": "viridis", "vmin": 0.0, "vmax": top, "zorder": 1}
    mesh = axes.pcolormesh(found.x_edges, theta, margin, rasterized=True, **colours)
    figure.colorbar(mesh, ax=axes, pad=0.015, aspect=32, label="best margin to the limits [%]")
    _contours(axes, found, theta)
    _mark_library(axes, found)
    _mark_target(axes, found, theta)
    span = float(theta[-1] - theta[0])
    step = next((s for s in (15, 30, 45, 90, 180, 360) if span <= 10 * s), 720)
    axes.yaxis.set_major_locator(MultipleLocator(step))
    axes.grid(alpha=0.3, lw=0.6, zorder=0)
    axes.set(axisbelow=True, xlabel="landing x [m]", ylabel="landing θ [deg]")
    axes.use_sticky_edges = False
    axes.margins(0.02)
    axes.set_title(found.title, loc="left", fontsize=10)
    figure.legend(loc="outside lower center", ncols=3, fontsize=9, frameon=False)
    save(figure, path)


def _contours(axes: Axes, found: MapPicture, theta: Array) -> None:
    """Lines of equal number of different throws, smoothed over some bins, at the 3 top levels."""
    from matplotlib.patheffects import withStroke
    from scipy.ndimage import uniform_filter

    number = found.solutions
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


def _mark_library(axes: Axes, found: MapPicture) -> None:
    """The library's throws, and the places that it found to be out of reach."""
    dots: dict[str, Any] = {"s": 3, "lw": 0, "zorder": 3, "rasterized": True}
    for (x, theta), colour, label in (
        (found.solved, BLACK, "solved throws of the library"),
        (found.beyond, RED, "found to be out of reach"),
    ):
        if x.size:
            axes.scatter(x, np.degrees(theta), color=colour, label=label, **dots)


def _mark_target(axes: Axes, found: MapPicture, theta: Array) -> None:
    """The scene's target, hollow where the map is of another height; its other turns."""
    target = found.target
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


def _draw_line(found: MapPicture, path: Path) -> None:
    """Margin and number of throws over x."""
    figure = new_figure(9.5, 5.4)
    target = found.target
    words = "target" if target.z == found.z else f"target's x (it is at z = {target.z:g} m)"
    above, below = figure.subplots(2, 1, sharex=True)
    for axes, label, values, colour in (
        (above, "best margin [%]", 100 * np.nan_to_num(found.margin[:, 0]), TEAL),
        (below, "different throws in a bin", found.solutions[:, 0], BLUE),
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
    above.set_title(found.title, loc="left", fontsize=10)
    save(figure, path)
