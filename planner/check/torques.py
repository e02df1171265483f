"""Torques of an arm's throwing joints along a motion, by inverse dynamics with the held object."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np

from ...core import AXES, TorquesC
from ...models import Array, Path, PlanarArm, PlanarDynamics, pivot_wrench
from ...problems import Scene, Torque
from .mover import Mover
from .sending import TICK

#: Of scenes that say nothing.
USUAL = Torque()


@dataclass(frozen=True)
class Torques:
    """Torques [N m] (N, n) at `times` (N,) [s], those with the object and with an empty hand.

    The object is held until `opening`; while the pads open, until `detach`, the hand may bear all
    of it or nothing; after that it is empty. limits (n,) [N m].
    """

    times: Array
    held: Array
    free: Array
    opening: float
    detach: float
    limits: Array

    @cached_property
    def use(self) -> Array:
        """Share (N, n) of the limits, the larger of both while the pads open."""
        before, after = (self.times < self.opening)[:, None], (self.times > self.detach)[:, None]
        held, free = np.abs(self.held), np.abs(self.free)
        return np.where(before, held, np.where(after, free, np.maximum(held, free))) / self.limits

    @cached_property
    def rate(self) -> float:
        """Highest rate of change [N m/s] of any joint, from sample to sample.

        While the pads open the load is taken to go evenly from the hand.
        """
        left = (self.detach - self.times) / (self.detach - self.opening)
        share = np.clip(left, 0.0, 1.0)[:, None]
        torques = share * self.held + (1.0 - share) * self.free
        return float(np.abs(np.diff(torques, axis=0)).max(initial=0.0) / TICK)


def torque_limits(scene: Scene) -> Array | None:
    """Limits (n,) [N m] of an arm's throwing joints; None without an arm or its masses."""
    robot, arm = scene.robot, scene.arm
    if robot is None or arm is None or not arm.links:
        return None
    section = scene.torque or USUAL
    return np.array(section.of(arm, robot.throwing_joints or arm.throwing_joints))


def torques_of(scene: Scene, mover: Mover, path: Path, opening: float) -> Torques:
    """Of a motion whose grip force starts to fall at `opening` [s], at every sample."""
    kinematics, limits = mover.kinematics, torque_limits(scene)
    assert limits is not None and isinstance(kinematics, PlanarArm)
    times = np.arange(0.0, path.end + TICK / 2, TICK)
    hand, joints = mover.hand(path).at(times), path.at(times)
    theta, h = hand.pose[2] + scene.grasp.angle, scene.com_offset
    lever = h * np.cos(theta), h * np.sin(theta)
    load = pivot_wrench(scene.body, scene.gravity, hand.motion, hand.twist[2], *lever)
    angles, rates, turns = map(kinematics.turned, joints)
    given = partial(_dynamics(kinematics).torques, angles, rates, turns, scene.gravity)
    held, free = (np.array(given(on)).T for on in (load, None))
    detach = opening + scene.gripper.profile().opening
    return Torques(times, held, free, opening, detach, limits)


def core_torques(scene: Scene, mover: Mover) -> TorquesC | None:
    """The arm's masses and limits as the compiled core takes them; None without limits."""
    kinematics, limits = mover.kinematics, torque_limits(scene)
    if limits is None or not isinstance(kinematics, PlanarArm) or len(limits) > AXES:
        return None
    found = TorquesC()
    for i, body in enumerate(_dynamics(kinematics).bodies):
        found.mass[i], found.inertia[i], found.limit[i] = body.mass, body.inertia, limits[i]
        found.along[i], found.up[i] = body.com
    return found


@lru_cache(maxsize=8)
def _dynamics(kinematics: PlanarArm) -> PlanarDynamics:
    return PlanarDynamics(kinematics)
