"""Whether a target fits a scene."""

from __future__ import annotations

import math

from ...models.robot import Arm
from ...problems import InputError, Pose, Scene


def checked_target(scene: Scene, target: Pose | None) -> Pose:
    """The target to plan for: the given one or the scene's; InputError if it does not fit."""
    target = target or scene.target
    if target is None:
        raise InputError(f"{scene.place}: section [target] is missing")
    if not isinstance(target, Pose):
        raise InputError(f"target = {target!r}: must be a Pose")
    if scene.robot is None and target.y != 0.0:
        raise InputError("target y: only for a scene with [robot]")
    least = scene.gripper.profile().dwell + scene.gripper.profile().opening
    if target.window[1] <= least:
        raise InputError(
            f"target: arrival = {target.window[1]:g}: must be above {least:g} s, "
            "the gripper's dwell and opening"
        )
    if scene.cup is not None and target.theta is None:
        raise InputError("[cup] needs a target with theta_deg, to know which end goes in")
    if scene.arm is not None:
        target = target.with_lateral(scene.arm.lateral)
        _check_azimuth(scene.arm, target)
    return target


def _check_azimuth(arm: Arm, target: Pose) -> None:
    """InputError unless the joint that turns the throw's plane can turn it there."""
    joint = arm.azimuth_joint - 1
    low, high = arm.limits.position_min[joint], arm.limits.position_max[joint]
    angle = arm.azimuth_angle(target.plane.azimuth)
    if not low <= angle <= high:
        raise InputError(
            f"target: its azimuth {math.degrees(angle):.1f} deg is outside joint "
            f"{joint + 1}'s range [{math.degrees(low):.1f}, {math.degrees(high):.1f}] deg"
        )
