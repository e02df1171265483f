"""Whether sampled throws clear the hand that has just let go: the bar flies, the arm brakes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..problems.scene import Scene
from .geometry import palm_distance
from .kernel import mapped
from .mover import Mover
from .numbers import BRAKE_SHARE, PALM_TIMES

Array = npt.NDArray[np.float64]


def clears_palm(
    scene: Scene, mover: Mover, q: Array, dq: Array, detach: Array
) -> npt.NDArray[np.bool_]:
    """Whether the bar (N,) keeps the scene's clearance to the hand's body after detach.

    q, dq (N, n): coordinates and rates at detach, from where each brakes at what is counted
    on; detach (N, 6): the bar's pose and twist there. True where nothing is asked.
    """
    clear = np.ones(len(q), dtype=bool)
    workspace, arm = scene.workspace, scene.arm
    if workspace is None or workspace.palm_clearance is None or arm is None or not len(q):
        return clear
    stop_time = np.abs(dq) / (BRAKE_SHARE * mover.planning.ddq) + 1e-9
    x, z, theta, v_x, v_z, omega = detach.T
    still = np.zeros_like(q)
    for t in PALM_TIMES:
        moving = np.minimum(t / stop_time, 1.0)
        there = q + dq * stop_time * (moving - moving**2 / 2)
        hand = mapped(mover.motion)(there, still, still)[0].T
        com = np.array([x + v_x * t, z + (v_z - scene.gravity * t / 2) * t, theta + omega * t])
        clear &= palm_distance(scene.object, arm.tool, com, hand) >= workspace.palm_clearance
    return clear
