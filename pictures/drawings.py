"""Bars, cups and flights drawn into given axes: the parts of all pictures of a throw's plane."""

from __future__ import annotations

import functools
import pathlib
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models import Array
from ..planner import Plan, throw_of, timeline
from ..problems import Bin, Cup, InputError, Object

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.path import Path

    from ..planner import Throw

#: Least width [m] of a drawn bar, to be visible.
LEAST_WIDTH = 0.008
#: Cells along the longer side of an outline's grid.
GRID = 240


def bar_path(bar: Object, com: Array) -> Path:
    """Outline [m] of the drawn object for a CoM pose x, z [m], theta [rad]: one or more loops."""
    from matplotlib.path import Path

    cos, sin = np.cos(com[2]), np.sin(com[2])
    turn = np.array([[cos, sin], [-sin, cos]])
    loops = _loops(bar.capsules.tobytes(), bar.com) if bar.outline else (_rectangle(bar),)
    return Path.make_compound_path(*(Path(com[:2] + p @ turn, closed=True) for p in loops))


def _rectangle(bar: Object) -> Array:
    """Corners (5, 2) [m] around a bar, along and across its axis from the CoM."""
    begin, end, half = -bar.com, bar.length - bar.com, max(bar.width, LEAST_WIDTH) / 2
    return np.array([[begin, -half], [end, -half], [end, half], [begin, half], [begin, -half]])


@functools.lru_cache(maxsize=16)
def _loops(capsules: bytes, com: float) -> tuple[Array, ...]:
    """Loops (N, 2) [m] around the union of the capsules, along and across the axis from the CoM.

    They are the contour at distance 0 on a grid of GRID cells along the longer side.
    """
    from contourpy import contour_generator

    rows = np.frombuffer(capsules).reshape(-1, 5)
    begin, end, radius = rows[:, :2], rows[:, 2:4], rows[:, 4]
    corners = np.vstack([begin, end])
    low = corners.min(axis=0) - 1.05 * radius.max()
    high = corners.max(axis=0) + 1.05 * radius.max()
    cell = (high - low).max() / GRID
    x, z = (np.arange(a, b + cell, cell) for a, b in zip(low, high, strict=True))
    points = np.stack(np.meshgrid(x, z), axis=-1)[..., None, :] - begin
    axis = end - begin
    share = (points * axis).sum(axis=-1) / np.maximum((axis**2).sum(axis=-1), 1e-12)
    away = np.linalg.norm(points - np.clip(share, 0.0, 1.0)[..., None] * axis, axis=-1)
    lines = contour_generator(x, z, (away - radius).min(axis=-1)).lines(0.0)
    return tuple(np.asarray(line) - [com, 0.0] for line in lines)


def draw_bars(axes: Axes, bar: Object, poses: Array, **look: Any) -> None:
    """Fill the object's outline at poses (N, 3) or (3,) of its CoM: x, z [m], theta [rad].

    bar: the scene's object; look: Matplotlib's settings of a patch. InputError for other shapes.
    """
    poses = np.asarray(poses, float)
    if poses.ndim not in (1, 2) or poses.shape[-1] != 3 or not np.isfinite(poses).all():
        raise InputError("poses: must be rows of x, z, theta, finite numbers")
    from matplotlib.patches import PathPatch

    for pose in np.atleast_2d(poses):
        axes.add_patch(PathPatch(bar_path(bar, pose), **look))
    axes.autoscale_view()


def cup_profile(cup: Cup | Bin) -> Array:
    """Corners (4, 2) [m] of a cup or bin in the throw's plane: down, along the bottom and up."""
    bottom, half = cup.rim - cup.depth, cup.half_opening()
    sides = [cup.plane_x - half] * 2 + [cup.plane_x + half] * 2
    return np.column_stack([sides, [cup.rim, bottom, bottom, cup.rim]])


def draw_cup(axes: Axes, cup: Cup | Bin, **look: Any) -> None:
    """Walls and bottom of a cup or bin in the throw's plane; look: Matplotlib's settings."""
    usual: dict[str, Any] = {"color": "#5b4a3f", "lw": 3, "solid_capstyle": "butt", "zorder": 2}
    axes.plot(*cup_profile(cup).T, **{**usual, "label": cup.KIND, **look})


def draw_flight(axes: Axes, plan: Plan | Throw | str | pathlib.Path, **look: Any) -> None:
    """The path of the object's CoM from the opening to its end, in axes of your own.

    Thick while the pads open, with a dot at detach. plan: a plan, a throw, or the path of a
    plan.json or of its folder; look: Matplotlib's settings of a line. InputError without a throw.
    """
    line = timeline(throw_of(plan))
    first, detach = (line.index(line.marks[name]) for name in ("opening", "detach"))
    usual: dict[str, Any] = {"color": "#222222", "lw": 1.2}
    look = usual | look
    thick = {**look, "lw": 3 * look["lw"], "alpha": 0.5, "label": None}
    axes.plot(*line.com[:2, first : detach + 1], **thick)
    axes.plot(*line.com[:2, detach:], **look)
    axes.plot(*line.com[:2, detach], "o", color=look["color"], ms=4 * look["lw"])
