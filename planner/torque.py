"""Torque limits: rows for the NLP, and what the check finds in the samples."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import numpy.typing as npt

from ..models.contact import pivot_wrench
from ..models.dynamics import PlanarDynamics
from ..models.hand import PlanarArm
from ..problems.scene import Scene
from .kernel import MappedKernel
from .motion import TICK, Motion
from .mover import Mover
from .rollout import hand_samples

if TYPE_CHECKING:
    from .context import Context
    from .ocp import Stage

Array = npt.NDArray[np.float64]


def torque_limits(scene: Scene, mover: Mover) -> Array:
    """Limits (n,) [N m] of the throwing joints, without margin."""
    assert scene.torque is not None and isinstance(mover.kinematics, PlanarArm)
    if scene.torque.limits is not None:
        return np.array(scene.torque.limits)
    index = [joint - 1 for joint in mover.kinematics.throwing_joints]
    return np.array(mover.kinematics.arm.limits.torque)[index]


def torque_rows(
    context: Context,
    stage: Stage,
    q: ca.SX,
    dq: ca.SX,
    ddq: ca.SX,
    load: tuple[ca.SX, ca.SX, ca.SX] | None = None,
) -> None:
    """Torques within their limits at q, dq, ddq, where the scene asks for it.

    load: force and torque that the hand gives to the object; None for an empty hand.
    """
    if context.dynamics is None:
        return
    turned = [context.turned(values) for values in (q, dq, ddq)]
    torques = context.dynamics.torques(*turned, context.gravity, load)
    context.limit(stage, "torque", ca.vertcat(*torques) / context.each("torque_max"))


def torque_use(
    scene: Scene, mover: Mover, motion: Motion, end: float, opening_time: float
) -> tuple[Array, Array]:
    """Times (N,) [s] and torques over their limits (N, n), the larger with and without load.

    The object is held until the opening starts; while the pads open the hand may bear all
    of it or nothing; after that its hand is empty.
    """
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
    return times, np.asarray(most / torque_limits(scene, mover))


@lru_cache(maxsize=8)
def torque_kernel(kinematics: PlanarArm) -> MappedKernel:
    """q, dq, ddq, gravity and load -> torques of the throwing joints."""
    n = kinematics.coordinates
    values = [ca.SX.sym(name, n) for name in ("q", "dq", "ddq")]
    gravity, load = ca.SX.sym("gravity"), ca.SX.sym("load", 3)
    turned = [kinematics.turned(value) for value in values]
    found = PlanarDynamics(kinematics).torques(*turned, gravity, tuple(ca.vertsplit(load)))
    return MappedKernel(ca.Function("torques", [*values, gravity, load], [ca.vertcat(*found)]))
