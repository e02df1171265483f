"""Torques of the throwing joints along a motion, against their limits."""

from __future__ import annotations

from functools import lru_cache

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import PlanarArm, PlanarDynamics, pivot_wrench
from ...problems import Scene
from ..compile import MappedKernel
from .motion import TICK, Motion
from .mover import Mover
from .rollout import hand_samples

Array = npt.NDArray[np.float64]


def torque_use(
    scene: Scene, mover: Mover, motion: Motion, end: float, opening_time: float
) -> tuple[Array, Array]:
    """Times (N,) [s] and torques over their limits (N, n), the larger with and without load.

    The object is held until the opening starts; while the pads open the hand may bear all
    of it or nothing; after that its hand is empty.
    """
    assert scene.torque is not None and isinstance(mover.kinematics, PlanarArm)
    limits = scene.torque.of(mover.kinematics.arm, mover.kinematics.throwing_joints)
    times = np.arange(0.0, end + TICK / 2, TICK)
    hand = hand_samples(mover, motion, times)
    theta, h = hand.pose[2] + scene.grasp.angle, scene.com_offset
    load = np.array(
        pivot_wrench(
            scene.body,
            scene.gravity,
            hand.motion,
            hand.twist[2],
            h * np.cos(theta),
            h * np.sin(theta),
        )
    ).T
    kernel = torque_kernel(mover.kinematics)
    coordinates = [rows.T for rows in motion.at(times)]
    gravity = np.full((len(times), 1), scene.gravity)
    held = kernel(*coordinates, gravity, load)[0]
    free = kernel(*coordinates, gravity, 0.0 * load)[0]
    detach = opening_time + scene.gripper.profile().opening
    before, after = (times < opening_time)[:, None], (times > detach)[:, None]
    most = np.where(before, np.abs(held), np.maximum(np.abs(held), np.abs(free)))
    most = np.where(after, np.abs(free), most)
    return times, np.asarray(most / np.array(limits))


@lru_cache(maxsize=8)
def torque_kernel(kinematics: PlanarArm) -> MappedKernel:
    """q, dq, ddq, gravity and load -> torques of the throwing joints."""
    n = kinematics.coordinates
    values = [ca.SX.sym(name, n) for name in ("q", "dq", "ddq")]
    gravity, load = ca.SX.sym("gravity"), ca.SX.sym("load", 3)
    angles, rates, turns = map(kinematics.turned, values)
    held = (load[0], load[1], load[2])
    found = PlanarDynamics(kinematics).torques(angles, rates, turns, gravity, held)
    return MappedKernel(ca.Function("torques", [*values, gravity, load], [ca.vertcat(*found)]))
