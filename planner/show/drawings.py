"""Bars, cups and flights drawn into given axes: the parts of all pictures of a throw's plane."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models import Array
from ...problems import Cup, InputError, ThrownObject, check_arguments
from ..clearance import bar_outline, outline_ends
from .timeline import timeline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..throw import Throw

#: Least width [m] of a drawn bar, to be visible.
LEAST_WIDTH = 0.008


def bar_corners(bar: ThrownObject, com: Array) -> Array:
    """Corners (N, 2) [m] of the drawn object for a CoM pose x, z [m], theta [rad]."""
    if bar.outline:
        ends = outline_ends(bar, com[:, None])[:, 0].T.reshape(-1, 2, 2)
        radii = bar.capsules[:, 4].tolist()
        loops = [_capsule_loop(p[0], p[1], r) for p, r in zip(ends, radii, strict=True)]
        # Back along the way from loop to loop: nothing is between them.
        return np.vstack([*loops, *[loop[:1] for loop in loops[::-1]]])
    wide = dataclasses.replace(bar, width=max(bar.width, LEAST_WIDTH))
    return np.asarray(bar_outline(wide, com[:, None])[:, 0].T)


def _capsule_loop(begin: Array, end: Array, radius: float) -> Array:
    """Corners (N, 2) [m] around a capsule, counter-clockwise; the last is the first."""
    first = np.arctan2(*(end - begin)[::-1]) - np.pi / 2
    turn = first + np.linspace(0.0, 2 * np.pi, 49)
    middle = np.where(np.arange(49)[:, None] <= 24, end, begin)
    loop = middle + radius * np.column_stack([np.cos(turn), np.sin(turn)])
    return np.vstack([loop, loop[:1]])


@check_arguments
def draw_bars(axes: Axes, bar: ThrownObject, poses: Array, **look: Any) -> None:
    """Fill the object's outline at poses (N, 3) or (3,) of its CoM: x, z [m], theta [rad].

    bar: the scene's object; look: Matplotlib's settings of a polygon. InputError for other shapes.
    """
    if poses.ndim not in (1, 2) or poses.shape[-1] != 3 or not np.isfinite(poses).all():
        raise InputError("poses: must be rows of x, z, theta, finite numbers")
    for pose in np.atleast_2d(poses):
        axes.fill(*bar_corners(bar, pose).T, **look)


def cup_profile(cup: Cup) -> Array:
    """Corners (4, 2) [m] of a cup in the throw's plane: down, along the bottom and up."""
    bottom = cup.rim - cup.depth
    sides = [cup.x - cup.radius] * 2 + [cup.x + cup.radius] * 2
    return np.column_stack([sides, [cup.rim, bottom, bottom, cup.rim]])


@check_arguments
def draw_cup(axes: Axes, cup: Cup, **look: Any) -> None:
    """A cup's walls and bottom in the throw's plane; look: Matplotlib's settings of a line."""
    usual: dict[str, Any] = {"color": "#5b4a3f", "lw": 3, "solid_capstyle": "butt", "zorder": 2}
    axes.plot(*cup_profile(cup).T, **{**usual, "label": "cup", **look})


def draw_flight(axes: Axes, throw: Throw, **look: Any) -> None:
    """The CoM from the opening to the end: thick while the pads open, a dot at detach."""
    line = timeline(throw)
    first, detach = (line.index(line.marks[name]) for name in ("opening", "detach"))
    usual: dict[str, Any] = {"color": "#222222", "lw": 1.2}
    look = usual | look
    thick = {**look, "lw": 3 * look["lw"], "alpha": 0.5, "label": None}
    axes.plot(*line.com[:2, first : detach + 1], **thick)
    axes.plot(*line.com[:2, detach:], **look)
    axes.plot(*line.com[:2, detach], "o", color=look["color"], ms=4 * look["lw"])
