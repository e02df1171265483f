"""Outlines of bar, hand and base column in the throw's plane, and distances between them."""

from __future__ import annotations

import math

import numpy as np

from ...models import Array, Tool
from ...problems import Scene, ThrownObject


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


def _from_box(
    first: float, last: float, half: float, pose: Array, points: Array
) -> tuple[Array, Array]:
    """Distance (N,) of the nearest of points (2, N, k) from boxes, and how far all are beyond it.

    A box lies from `first` to `last` along the axis of its pose (3, N), `half` to either side.
    How far: beyond the edge that they are farthest beyond, below 0 where they are beyond none.
    """
    along, across = seen_from(pose, points)
    over, aside = np.maximum(first - along, along - last), np.abs(across) - half
    distance = np.hypot(np.maximum(over, 0.0), np.maximum(aside, 0.0)).min(axis=1)
    beyond = [along.min(axis=1) - last, first - along.max(axis=1)]
    beyond += [across.min(axis=1) - half, -half - across.max(axis=1)]
    return distance, np.max(beyond, axis=0)


def palm_distance(bar: ThrownObject, tool: Tool, com: Array, hand: Array) -> Array:
    """Distance [m] (N,) between bar and hand body; how deep they overlap, below 0, where they do.

    Two boxes that do not overlap are apart along an axis of one of them, and a corner of one is
    nearest to the other.
    """
    palm = (-tool.palm_back, -tool.palm_front, tool.palm_half_width)
    held = (-bar.com, bar.length - bar.com, bar.width / 2)
    from_bar, aside = _from_box(*palm, hand, bar_outline(bar, com))
    from_palm, ahead = _from_box(*held, com, palm_corners(tool, hand))
    beyond = np.maximum(aside, ahead)
    return np.where(beyond > 0.0, np.minimum(from_bar, from_palm), beyond)


def column_distance(bar: ThrownObject, com: Array, radius: float, height: float) -> Array:
    """Signed distance [m] (N,) of the bar from the base column, aside or above; negative inside.

    The least of max(|x| - radius, z - height) on the outline: on an edge that is at an end or
    where two of the three planes meet. Infinite where the column is out of the bar's reach.
    """
    away = np.maximum(np.abs(com[0]) - radius, com[1] - height)
    near = np.flatnonzero(away < reach_of_bar(bar))
    begin = bar_outline(bar, com[:, near])
    end = np.roll(begin, -1, axis=2)
    planes = [
        np.array([x, x - radius - z + height, -x - radius - z + height]) for x, z in (begin, end)
    ]
    with np.errstate(divide="ignore", invalid="ignore"):
        meet = np.nan_to_num(planes[0] / (planes[0] - planes[1])).clip(0.0, 1.0)
    shares = np.concatenate([np.zeros_like(meet[:1]), meet])
    x, z = begin[:, None] + shares * (end - begin)[:, None]
    distance = np.full(com.shape[1], np.inf)
    distance[near] = np.maximum(np.abs(x) - radius, z - height).min(axis=(0, 2))
    return distance


def tool_speeds(tool: Tool, pose: Array, twist: Array) -> Array:
    """The higher speed [m/s] (N,) of flange and pads' centre; pose, twist (3, N): the hand's."""
    turning = tool.tcp * twist[2]
    behind = twist[0] + turning * np.sin(pose[2]), twist[1] - turning * np.cos(pose[2])
    return np.asarray(np.maximum(np.hypot(*twist[:2]), np.hypot(*behind)))


def column_of(scene: Scene) -> tuple[float, float] | None:
    """Half the width [m] of the base column where the bar meets it, and its height.

    None without one, and for an arm that throws beside it.
    """
    workspace, target = scene.workspace, scene.target
    if workspace is None or workspace.column_radius is None or workspace.column_height is None:
        return None
    lateral = 0.0 if target is None else abs(target.lateral)
    beside = max(lateral - scene.object.width / 2, 0.0)
    if beside >= workspace.column_radius:
        return None
    return math.sqrt(workspace.column_radius**2 - beside**2), workspace.column_height


def held_bar(scene: Scene, hand: Array) -> Array:
    """CoM poses (3, N) of the held bar for hand poses (3, N)."""
    theta, h = hand[2] + scene.grasp.angle, scene.com_offset
    return np.array([hand[0] + h * np.cos(theta), hand[1] + h * np.sin(theta), theta])
