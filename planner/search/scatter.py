"""How far a throw lands from its own landing when the gripper opens early or late."""

from __future__ import annotations

import math

from ...problems import Pose
from ..check import throw
from ..ocp import window_of
from ..result import PlannedThrow


def scatter(thrown: PlannedThrow, target: Pose) -> float:
    """Largest scaled error [m] about the throw's own landing over the window's delays.

    Exact throws of the motion that counts; infinite if one never comes down to the target's
    height. target: says whether theta counts.
    """
    scene, mover = thrown.scene, thrown.mover
    motion = thrown.planned if thrown.sent is None else thrown.samples
    base, worst = thrown.final.landing, 0.0
    for delay in window_of(scene).delays:
        at = max(thrown.opening_time + float(delay), 0.0)
        found = throw(scene, mover, motion, at, target.z).landing
        turn = 0.0 if target.theta is None else found.theta - base.theta
        error = abs(found.x - base.x) + abs(turn) * scene.object.length / 2
        worst = max(worst, error if math.isfinite(error) else math.inf)
    return worst
