"""What a throw takes beyond the recommendations of makers."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...models import Array
from ...problems import Scene, Torque
from ..throw import Throw, torque_limits
from ..verdict import measures_of


def exceeded(throw: Throw) -> dict[str, tuple[float, float]]:
    """Value and recommendation, SI units, of each that a throw exceeds: torque_rate, torque (as a
    share of the arm's limit), tool_speed, grip_force."""
    scene, measures = throw.scene, measures_of(throw)
    speed = float(measures.value("speed")[0])
    if torque_limits(scene) is None:
        return _beyond(scene, speed)
    return _beyond(
        scene,
        speed,
        measures.torque[0][0, : len(throw.manipulator.joints)],
        float(measures.value("rate")[0]),
    )


def allowed(scene: Scene) -> dict[str, tuple[float, float]]:
    """As `exceeded`, of what a scene allows a motion."""
    return _beyond(scene, scene.tool_speed, 1.0 - scene.torque_margin, scene.torque_rate)


def _beyond(
    scene: Scene, speed: float | None, use: Array | float = 0.0, rate: float | None = None
) -> dict[str, tuple[float, float]]:
    """Of a grip as the scene's, a tool speed [m/s], a use of the scene's torque limits and a torque
    rate [N m/s] those beyond recommendations."""
    arm, own = scene.arm, torque_limits(scene)
    found: dict[str, tuple[float | None, float | None]] = {
        "grip_force": (scene.gripper.profile().full, scene.gripper.continuous)
    }
    if arm is not None and scene.robot is not None:
        limits = arm.limits
        found["tool_speed"] = speed, limits.tool_speed
        if own is not None:
            margin = Torque.MARGIN if limits.torque_margin is None else limits.torque_margin
            makers = np.array(limits.torque)[np.array(arm.throwing_joints) - 1]
            found["torque"] = float((use * own / makers).max()), 1.0 - margin
            found["torque_rate"] = rate, limits.torque_rate
    return {
        name: (value, most)
        for name, (value, most) in found.items()
        if value is not None and most is not None and value > most * (1 + 1e-9)
    }


def exceeded_entries(found: Mapping[str, tuple[float, float]]) -> dict[str, dict[str, float]]:
    """The same as JSON."""
    return {name: {"value": v, "recommended": most} for name, (v, most) in found.items()}
