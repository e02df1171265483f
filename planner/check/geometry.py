"""Outlines of bar, hand and base column in the throw's plane, and distances between them."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ...models import Tool
from ...problems import Scene, ThrownObject

Array = npt.NDArray[np.float64]

#: Points along each long edge of the bar for distances to what is not straight.
EDGE_POINTS = 14


def bar_outline(bar: ThrownObject, com: Array, points: int = 2) -> Array:
    """Points (2, N, 2 * points) on the bar's two long edges for CoM poses (3, N).

    With two points an edge: the four corners.
    """
    along = np.linspace(-bar.com, bar.length - bar.com, points)
    along = np.concatenate([along, along[::-1]])
    across = np.repeat([-bar.width / 2, bar.width / 2], points)
    return _placed(com, along, across)


def lowest_of_bar(bar: ThrownObject, com: Array) -> Array:
    """Height [m] (N,) of the bar's lowest corner for CoM poses (3, N)."""
    sin, cos = np.sin(com[2]), np.cos(com[2])
    end = np.minimum(-bar.com * sin, (bar.length - bar.com) * sin)
    return np.asarray(com[1] + end - bar.width / 2 * np.abs(cos))


def reach_of_bar(bar: ThrownObject) -> float:
    """Distance [m] of the bar's farthest corner from the CoM."""
    return math.hypot(max(bar.com, bar.length - bar.com), bar.width / 2)


def palm_corners(tool: Tool, hand: Array) -> Array:
    """Corners (2, N, 4) of the hand's body for hand poses (3, N)."""
    along = -np.array([tool.palm_back, tool.palm_front, tool.palm_front, tool.palm_back])
    across = tool.palm_half_width * np.array([-1, -1, 1, 1])
    return _placed(hand, along, across)


def _placed(pose: Array, along: Array, across: Array) -> Array:
    """Points given along and across an axis, at poses (3, N): (2, N, points)."""
    cos, sin = np.cos(pose[2])[:, None], np.sin(pose[2])[:, None]
    x = pose[0][:, None] + cos * along - sin * across
    z = pose[1][:, None] + sin * along + cos * across
    return np.array([x, z])


def seen_from(pose: Array, points: Array) -> tuple[Array, Array]:
    """Coordinates (along, across) of points (2, N, k) in the frames of poses (3, N)."""
    dx, dz = points[0] - pose[0][:, None], points[1] - pose[1][:, None]
    cos, sin = np.cos(pose[2])[:, None], np.sin(pose[2])[:, None]
    return cos * dx + sin * dz, -sin * dx + cos * dz


def distance_to_bar(bar: ThrownObject, com: Array, points: Array) -> Array:
    """Distance [m] (N, k) of points (2, N, k) from the bar, 0 inside it."""
    along, across = seen_from(com, points)
    over = np.maximum(np.maximum(-bar.com - along, along - (bar.length - bar.com)), 0.0)
    aside = np.maximum(np.abs(across) - bar.width / 2, 0.0)
    return np.asarray(np.hypot(over, aside))


def palm_distance(bar: ThrownObject, tool: Tool, com: Array, hand: Array) -> Array:
    """Distance [m] (N,) between bar and hand body; 0 where they overlap."""
    along, across = seen_from(hand, bar_outline(bar, com, EDGE_POINTS))
    over = np.maximum(np.maximum(-tool.palm_back - along, along + tool.palm_front), 0.0)
    aside = np.maximum(np.abs(across) - tool.palm_half_width, 0.0)
    from_bar = np.hypot(over, aside).min(axis=1)
    from_palm = distance_to_bar(bar, com, palm_corners(tool, hand)).min(axis=1)
    return np.asarray(np.minimum(from_bar, from_palm))


def column_distance(bar: ThrownObject, com: Array, radius: float, height: float) -> Array:
    """Signed distance [m] (N,) of the bar from the base column, aside or above; negative inside.

    Infinite where the column is out of the bar's reach.
    """
    away = np.maximum(np.abs(com[0]) - radius, com[1] - height)
    near = np.flatnonzero(away < reach_of_bar(bar))
    x, z = bar_outline(bar, com[:, near], EDGE_POINTS)
    distance = np.full(com.shape[1], np.inf)
    distance[near] = np.maximum(np.abs(x) - radius, z - height).min(axis=1)
    return distance


def column_of(scene: Scene) -> tuple[float, float] | None:
    """Radius and height [m] of the base column, None without one."""
    workspace = scene.workspace
    if workspace is None or workspace.column_radius is None or workspace.column_height is None:
        return None
    return workspace.column_radius, workspace.column_height


def held_bar(scene: Scene, hand: Array) -> Array:
    """CoM poses (3, N) of the held bar for hand poses (3, N)."""
    theta, h = hand[2] + scene.grasp.angle, scene.com_offset
    return np.array([hand[0] + h * np.cos(theta), hand[1] + h * np.sin(theta), theta])
