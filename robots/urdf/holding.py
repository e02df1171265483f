"""The ranges of a URDF's joints, and the joints that a throw does not move, held still."""

from __future__ import annotations

import copy
import importlib
import math
from collections.abc import Collection, Mapping
from typing import Any

from ...problems import InputError
from .reading import origin, unit_axis

#: End [rad or m] of a range beyond which it counts as none: URDFs write 999999 for continuous.
ENDLESS = 1e3


def joint_range(joint: Any) -> tuple[float, float] | None:
    """Ends [rad or m] of a joint's range: of its limits or its controller's soft limits, whichever
    are tighter. None for a joint without a range."""
    if joint.limit is None or joint.type not in ("revolute", "prismatic"):
        return None
    low, high = float(joint.limit.lower or 0.0), float(joint.limit.upper or 0.0)
    if (soft := joint.safety_controller) is not None:
        ends = float(soft.soft_lower_limit or 0.0), float(soft.soft_upper_limit or 0.0)
        if ends[0] < ends[1]:  # else it limits the velocity only
            low, high = max(low, ends[0]), min(high, ends[1])
    return (low, high) if -ENDLESS <= low <= high <= ENDLESS else None


def hold_joints(
    robot: Any, moving: Collection[str], given: Mapping[str, float]
) -> tuple[Any, dict[str, float]]:
    """A copy of yourdfpy's robot in which all joints but the `moving` ones are held where their 0
    is, and by name the positions [rad or m] in the file at which that is.

    Held at what is given, else at 0, else at the end of the range nearest to 0; a joint that mimics
    another at what follows from that. InputError for a given position that the joint does not take.
    """
    import yourdfpy

    data = copy.deepcopy(robot.robot)
    joints = {joint.name: joint for joint in data.joints}
    for name, value in given.items():
        if name not in joints or joints[name].type == "fixed":
            raise InputError(f"--hold: no joint '{name}'{InputError.hint(name, joints)}")
        if name in moving or joints[name].mimic is not None:
            words = "is one of --joints" if name in moving else f"mimics {joints[name].mimic.joint}"
            raise InputError(f"--hold {name}: this joint {words}")
        low, high = joint_range(joints[name]) or (-math.inf, math.inf)
        if not low <= value <= high:
            span = f"{quantity(joints[name], low)} to {quantity(joints[name], high)}"
            raise InputError(f"--hold {name}: must be in its range, {span}")

    def position(joint: Any, followers: tuple[str, ...] = ()) -> float:
        leader = None if joint.mimic is None else joints.get(joint.mimic.joint)
        if leader is not None and leader.name not in followers:
            at = position(leader, (*followers, joint.name))
            return float(joint.mimic.multiplier * at + joint.mimic.offset)
        if joint.name in moving:
            return 0.0
        low, high = joint_range(joint) or (0.0, 0.0)
        return given.get(joint.name, min(max(low, 0.0), high))

    free = [j for j in data.joints if j.type != "fixed" and j.name not in moving]
    held = {joint.name: position(joint) for joint in free}
    for joint in free:
        _count_from(joint, held[joint.name])
    return yourdfpy.URDF(robot=data, load_meshes=False), held


def quantity(joint: Any, position: float) -> str:
    """A joint's position as text, with its unit."""
    turns = joint.type != "prismatic"
    return f"{math.degrees(position) if turns else position:.6g} {'deg' if turns else 'm'}"


def _count_from(joint: Any, position: float) -> None:
    """Shifts a joint's 0 to a position [rad or m]: in its frame, its range and its mimicry."""
    poses: Any = importlib.import_module("trimesh.transformations")
    axis = unit_axis(joint)
    moved = poses.rotation_matrix(position, axis)
    if joint.type == "prismatic":
        moved = poses.translation_matrix(position * axis)
    joint.origin = origin(joint) @ moved
    joint.axis, joint.safety_controller = axis, None
    if joint.limit is not None:
        for end in ("lower", "upper"):
            setattr(joint.limit, end, (getattr(joint.limit, end) or 0.0) - position)
    if joint.mimic is not None:
        joint.mimic.offset = 0.0
