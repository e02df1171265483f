"""What a motion with the held object asks of the grip and of an arm's throwing joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache, partial

import numpy as np

from ...core import TorquesC
from ...models import Array, HandSamples, Trajectory, held_wrench
from ...models.robot import PlanarArm, PlanarDynamics
from ...problems import Scene, Torque
from .manipulator import Manipulator
from .sending import TICK

#: Of scenes that say nothing.
BASE = Torque()


def friction_use(scene: Scene, hand: HandSamples, hand_error: float = 0.0) -> tuple[Array, Array]:
    """Wrench that sticking needs, over the full grip's limits: (force share, torque share).

    For a held bar; shares above 1 slip. hand_error [rad]: its angle's against the samples.
    """
    angle = scene.grasp.angle + hand_error
    f_x, f_z, torque = held_wrench(scene.body, scene.gravity, hand.motion, angle)
    limit = scene.patch.force_limit(scene.gripper.profile().full)
    return np.hypot(f_x, f_z) / limit, np.abs(torque) / (limit * scene.patch.torsion_arm)


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
    limits = _limits(scene)
    return None if limits is None else np.array(limits)


def _limits(scene: Scene) -> tuple[float, ...] | None:
    robot, arm = scene.robot, scene.arm
    if robot is None or arm is None or not arm.links:
        return None
    section = scene.torque or BASE
    return section.of(arm, robot.throwing_joints or arm.throwing_joints)


def torques_of(scene: Scene, manipulator: Manipulator, path: Trajectory, opening: float) -> Torques:
    """Of a motion whose grip force starts to fall at `opening` [s], at every sample."""
    kinematics, limits = manipulator.kinematics, torque_limits(scene)
    assert limits is not None and isinstance(kinematics, PlanarArm)
    times = np.arange(0.0, path.end + TICK / 2, TICK)
    hand, joints = manipulator.hand(path).at(times), path.at(times)
    load = held_wrench(scene.body, scene.gravity, hand.motion, scene.grasp.angle)
    angles, rates, turns = map(kinematics.link_angles, joints)
    given = partial(_dynamics(kinematics).torques, angles, rates, turns, scene.gravity)
    held, free = (np.array(given(on)).T for on in (load, None))
    detach = opening + scene.gripper.profile().opening
    return Torques(times, held, free, opening, detach, limits)


def load_torques(
    scene: Scene, manipulator: Manipulator, path: Trajectory, times: Array
) -> tuple[Array, Array]:
    """Torques (n, K) [N m] with an empty hand at times (K,) [s], and how they grow (3, n, K) with
    force along x, along z [per N] and torque [per N m] that the hand gives to an object."""
    kinematics, joints = manipulator.kinematics, path.at(times)
    assert isinstance(kinematics, PlanarArm)
    angles, rates, turns = map(kinematics.link_angles, joints)
    given = partial(_dynamics(kinematics).torques, angles, rates, turns, scene.gravity)
    one, none = np.ones(len(times)), np.zeros(len(times))
    free = np.array(given(None))
    units = ((one, none, none), (none, one, none), (none, none, one))
    return free, np.array([np.array(given(unit)) - free for unit in units])


def core_torques(scene: Scene, manipulator: Manipulator) -> TorquesC | None:
    """The arm's masses and limits as the compiled core takes them; None without limits."""
    kinematics, limits = manipulator.kinematics, _limits(scene)
    if limits is None or not isinstance(kinematics, PlanarArm):
        return None
    return _core_torques(kinematics, limits)


@lru_cache(maxsize=8)
def _core_torques(kinematics: PlanarArm, limits: tuple[float, ...]) -> TorquesC:
    found = TorquesC()
    for i, body in enumerate(_dynamics(kinematics).bodies):
        found.mass[i], found.inertia[i], found.limit[i] = body.mass, body.inertia, limits[i]
        found.along[i], found.up[i] = body.com
    return found


@lru_cache(maxsize=8)
def _dynamics(kinematics: PlanarArm) -> PlanarDynamics:
    return PlanarDynamics(kinematics)
