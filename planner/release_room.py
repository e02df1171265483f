"""Whether sampled throws clear the base column on their way and the hand that lets go.

A planner that starts from a run-up through the column mostly ends with one.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..problems.scene import Scene
from .geometry import column_distance, column_of, held_bar, palm_distance, reach_of_bar
from .kernel import mapped
from .mover import Mover
from .numbers import BRAKE_SHARE, PALM_TIMES
from .run_up import polynomial

Array = npt.NDArray[np.float64]

#: Instants of the run-up at which the held bar is held against the column.
INSTANTS = 24


def column_room(
    scene: Scene, mover: Mover, path: list[Array], duration: Array, instants: int = INSTANTS
) -> Array:
    """Least signed room [m] (N,) of the held bar from the base column on N run-ups.

    path: coefficients (N, n) as `run_up` gives them; duration (N, 1) [s]. Infinite where the
    column is out of the bar's reach all along, and in a scene without one.
    """
    room = np.full(len(duration), np.inf)
    column = column_of(scene)
    if column is None or not room.size:
        return room
    radius, height = column
    for share in np.linspace(0.0, 1.0, instants):
        q = polynomial(path, share * duration)
        com = held_bar(scene, mapped(mover.motion)(q, 0 * q, 0 * q)[0].T)
        away = np.maximum(np.abs(com[0]) - radius, com[1] - height)
        near = np.flatnonzero(away < reach_of_bar(scene.object))
        found = column_distance(scene.object, com[:, near], radius, height)
        room[near] = np.minimum(room[near], found)
    return room


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
