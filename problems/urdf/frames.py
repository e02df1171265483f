"""Frames of a URDF's joints and links, as 4x4 poses, and as an arm data file gives them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ...models import Array
from ...models.robot import JointFrame
from ..section import InputError


class MissingOptionError(InputError):
    """Missing options of an arm, each with a value to try.

    proposals: words for the command line by option, one word or one per joint.
    """

    def __init__(self, words: str, proposals: Mapping[str, list[str]]) -> None:
        super().__init__(words)
        self.proposals = dict(proposals)


#: A link's own axes, by the names that options have for them.
AXES = {
    sign + name: (-1.0 if sign else 1.0) * np.eye(3)[i]
    for i, name in enumerate("xyz")
    for sign in ("", "-")
}


def origin(joint: Any) -> Array:
    """4x4: the joint's frame in its parent link's, at 0."""
    return np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=float)


def unit_axis(joint: Any) -> Array:
    """The joint's axis, of length 1."""
    axis = np.asarray([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
    length = float(np.linalg.norm(axis)) if axis.shape == (3,) else 0.0
    if not (math.isfinite(length) and length > 0):
        raise InputError(f"joint '{joint.name}': its axis must be three numbers, not all 0")
    return np.asarray(axis / length)


def _turn(x: Array, y: Array, z: Array) -> Array:
    """4x4: the rotation whose columns are x, y, z."""
    turn = np.eye(4)
    turn[:3, :3] = np.column_stack([x, y, z])
    return turn


def axis_turn(joint: Any) -> Array:
    """4x4: a frame whose z is the joint's axis; the link's own where that is z."""
    z = unit_axis(joint)
    y = np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    y = y / np.linalg.norm(y)
    return _turn(np.cross(y, z), y, z)


def hand_turn(approach: str, closing: str) -> Array:
    """4x4: the hand's frame in the tool link's."""
    z, y = AXES[approach], AXES[closing]
    if abs(z @ y) > 0.5:
        raise InputError(f"--closing {closing}: must not be the axis of --approach {approach}")
    return _turn(np.cross(y, z), y, z)


def frame_of(pose: Array) -> JointFrame:
    """A 4x4 pose as position and roll, pitch, yaw, good to the last digits at any pitch."""
    r = pose[:3, :3]
    level = math.hypot(r[0, 0], r[1, 0])
    yaw = math.atan2(r[1, 0], r[0, 0]) if level > 1e-12 else 0.0
    cos, sin = math.cos(yaw), math.sin(yaw)
    roll = math.atan2(sin * r[0, 2] - cos * r[1, 2], cos * r[1, 1] - sin * r[0, 1])
    x, y, z, *rpy = (
        0.0 if abs(value) < 1e-14 else float(value)
        for value in (*pose[:3, 3], roll, math.atan2(-r[2, 0], level), yaw)
    )
    return JointFrame((x, y, z), (rpy[0], rpy[1], rpy[2]))
