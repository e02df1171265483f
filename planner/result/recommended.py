"""What a throw takes beyond the recommendations of makers, and what a plan assumes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...problems import Scene, Torque
from ..throw import Throw

#: Names of recommendations: words, unit with its scale from SI, and decimals.
_WORDS = {
    "torque_rate": ("torque rate", "N m/s", 1.0, 0),
    "torque": ("joint torque", "% of its limit", 100.0, 0),
    "tool_speed": ("tool speed", "m/s", 1.0, 2),
    "grip_force": ("grip force", "N", 1.0, 0),
}


def exceeded(throw: Throw) -> dict[str, tuple[float, float]]:
    """Value and recommendation, SI units, of each that a throw exceeds: torque_rate, torque (as a
    share of the arm's limit), tool_speed, grip_force."""
    scene, arm = throw.scene, throw.scene.arm
    found = {"grip_force": (scene.gripper.profile().full, scene.gripper.continuous)}
    if arm is not None and scene.robot is not None:
        limits = arm.limits
        if limits.tool_speed is not None:
            found["tool_speed"] = throw.measured.speed.value, limits.tool_speed
        if arm.links:
            margin = Torque.MARGIN if limits.torque_margin is None else limits.torque_margin
            joints = scene.robot.throwing_joints or arm.throwing_joints
            own = np.array(limits.torque)[np.array(joints) - 1]
            use = float((throw.torques.use * throw.torques.limits / own).max())
            found["torque"] = use, 1.0 - margin
            found["torque_rate"] = throw.torques.rate, limits.torque_rate
    return {
        name: (value, most)
        for name, (value, most) in found.items()
        if most is not None and value > most * (1 + 1e-9)
    }


def exceeded_words(found: Mapping[str, tuple[float, float]]) -> str:
    """What a throw exceeds, and by how much, in one line."""
    parts = []
    for name, values in found.items():
        words, unit, scale, decimals = _WORDS[name]
        value, most = (f"{scale * each:,.{decimals}f}" for each in values)
        parts.append(f"{words} {value} instead of {most} {unit}")
    return f"more than the maker recommends: {', '.join(parts)}"


def assumed_words(scene: Scene) -> str:
    """What a plan assumes, in one line; empty if nothing."""
    names = [name.replace(".", " ").replace("_", " ") for name in scene.assumed]
    parts = [f"assumed: {', '.join(names)}"] if names else []
    if scene.robot is not None and scene.arm is not None and not scene.arm.links:
        parts.append(f"torques are not checked: arm {scene.arm.name} has no [[links]]")
    return "; ".join(parts)
