"""Outlines of bar, hand and base column in the throw's plane, and distances between them."""

from __future__ import annotations

import math

import numpy as np

from ....core import Structure, array, library, out
from ....models import Array, lowest_point, sticking_state
from ....models.robot import Tool, flange_velocity
from ....problems import Object, Scene


def bar_outline(bar: Object, com: Array, points: int = 2) -> Array:
    """Points (2, N, 2 * points) on the bar's two long edges for CoM poses (3, N).

    With two points an edge: the four corners.
    """
    along = np.linspace(-bar.com, bar.length - bar.com, points)
    along = np.concatenate([along, along[::-1]])
    return _placed(com, along, np.repeat([-bar.width / 2, bar.width / 2], points))


def outline_ends(bar: Object, com: Array) -> Array:
    """Ends (2, N, 2 * K) of the K capsules of an outline for CoM poses (3, N)."""
    along, across = bar.capsules[:, :4].reshape(-1, 2).T
    return _placed(com, along - bar.com, across)


def lowest_of_bar(bar: Object, com: Array) -> Array:
    """Height [m] (N,) of the object's lowest point for CoM poses (3, N)."""
    if bar.outline:
        heights = outline_ends(bar, com)[1] - np.repeat(bar.capsules[:, 4], 2)
        return np.asarray(heights.min(axis=1))
    ends = -bar.com, bar.length - bar.com
    return np.asarray(lowest_point(com[1], np.cos(com[2]), np.sin(com[2]), ends, bar.width / 2))


def reach_of_bar(bar: Object) -> float:
    """Distance [m] of the bar's farthest corner from the CoM."""
    return math.hypot(max(bar.com, bar.length - bar.com), bar.width / 2)


def palm_corners(tool: Tool, hand: Array) -> Array:
    """Corners (2, N, 4) of the hand's body for hand poses (3, N)."""
    along = -np.array([tool.palm_back, tool.palm_front, tool.palm_front, tool.palm_back])
    return _placed(hand, along, tool.palm_half_width * np.array([-1, -1, 1, 1]))


def _placed(pose: Array, along: Array, across: Array) -> Array:
    """Points given along and across an axis, at poses (3, N): (2, N, points)."""
    cos, sin = np.cos(pose[2])[:, None], np.sin(pose[2])[:, None]
    x = pose[0][:, None] + cos * along - sin * across
    z = pose[1][:, None] + sin * along + cos * across
    return np.array([x, z])


def palm_distance(bar: Object, tool: Tool, com: Array, hand: Array) -> Array:
    """Distance [m] (N,) between bar and hand body; below 0, where they overlap, how deep."""
    around = _scene(bar)
    around.palm_back, around.palm_front = tool.palm_back, tool.palm_front
    around.palm_half_width = tool.palm_half_width
    n = com.shape[1]
    found, poses = np.empty(n), [array(np.ascontiguousarray(rows), 3, n) for rows in (com, hand)]
    library().palm_distances(around, n, *poses, out(found, n))
    return found


def column_distance(bar: Object, com: Array, radius: float, height: float) -> Array:
    """Signed distance [m] (N,) of the bar from the base column, aside or above; negative inside.

    The least of max(|x| - radius, z - height) on the outline. Infinite where the column is out of
    the bar's reach.
    """
    around, n = _scene(bar), com.shape[1]
    around.column_radius, around.column_height = radius, height
    poses, found = array(np.ascontiguousarray(com), 3, n), np.empty(n)
    library().column_distances(around, n, poses, out(found, n))
    return found


def _scene(bar: Object) -> Structure:
    found = Structure("scene", behind=bar.com, length=bar.length, half_width=bar.width / 2)
    if bar.outline:
        found.parts = len(bar.outline)
        found.outline = array(bar.capsules, found.parts, 5)
    return found


def tool_speeds(tool: Tool, pose: Array, twist: Array) -> Array:
    """The higher speed [m/s] (N,) of flange and pads' centre; pose, twist (3, N): the hand's."""
    flange = flange_velocity(tool.tcp, pose[2], twist)
    return np.asarray(np.maximum(np.hypot(*twist[:2]), np.hypot(*flange)))


def held_bar(scene: Scene, hand: Array) -> Array:
    """CoM poses (3, N) of the held bar for hand poses (3, N)."""
    return np.array(sticking_state(hand, np.zeros(3), scene.grasp.angle, scene.com_offset)[:3])


def grasp_distance(scene: Scene) -> float:
    """Distance [m] between the object as gripped and the body of an arm's hand, which has one;
    below 0, where they overlap, how deep."""
    assert scene.arm is not None
    hand = np.zeros((3, 1))
    return float(palm_distance(scene.object, scene.arm.tool, held_bar(scene, hand), hand)[0])


def bar_ends(bar: Object, com: Array) -> Array:
    """Ends (K, 2, 3, N) of the axes of the object's K capsules, one for a bar, for CoM poses
    (3, N)."""
    if bar.outline:
        placed = outline_ends(bar, com).reshape(2, com.shape[1], -1, 2).transpose(2, 3, 0, 1)
        return np.stack([placed[:, :, 0], np.zeros_like(placed[:, :, 0]), placed[:, :, 1]], axis=2)
    ends, along = np.zeros((1, 2, 3, com.shape[1])), np.array([-bar.com, bar.length - bar.com])
    ends[0, :, ::2] = _placed(com, along, np.zeros(2)).transpose(2, 0, 1)
    return ends
