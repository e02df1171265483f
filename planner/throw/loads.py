"""Loads of a motion with the held object on the grip and on an arm's joints: of a throw in its plane,
of any motion in space."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ...core import TorquesC
from ...models import (
    Array,
    HandSamples,
    PinchUse,
    ReadOnly,
    Trajectory,
    held_wrench,
    pinch_use,
    read_only,
)
from ...models.robot import (
    Arm,
    LinkInertia,
    PlanarArm,
    PlanarDynamics,
    arm_torques,
    frame_motions,
)
from ...problems import Scene, Torque
from .manipulator import Manipulator
from .sending import TICK, Samples

#: Torque limits of a scene without [torque].
BASE = Torque()
_dynamics = lru_cache(maxsize=8)(PlanarDynamics)


def friction_use(scene: Scene, hand: HandSamples) -> Array:
    """Use (K,) of the full grip's limit surface by a held bar; above 1 it slips."""
    wrench = held_wrench(scene.body, scene.gravity, hand.motion, scene.grasp.angle)
    full = scene.gripper.profile().full
    use = scene.patch.utilisation_squared(*wrench, full, hand.pose[2])
    return np.asarray(np.sqrt(use))


@dataclass(frozen=True)
class Torques(ReadOnly):
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
        during = np.where(after, free, np.maximum(held, free))
        return read_only(np.where(before, held, during) / self.limits)

    @cached_property
    def rate(self) -> float:
        """Highest rate of change [N m/s] of any joint, from sample to sample.

        While the pads open, the load on the hand is assumed to fall linearly.
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
    """Torques at every sample of a motion whose grip force starts to fall at `opening` [s]."""
    limits, times = torque_limits(scene), np.arange(0.0, path.end + TICK / 2, TICK)
    assert limits is not None
    hand = manipulator.hand(path).at(times)
    load = held_wrench(scene.body, scene.gravity, hand.motion, scene.grasp.angle)
    held, free = (_torques(scene, manipulator, path, times, on).T for on in (load, None))
    return Torques(times, held, free, opening, opening + scene.gripper.profile().opening, limits)


def load_torques(
    scene: Scene, manipulator: Manipulator, path: Trajectory, times: Array
) -> tuple[Array, Array]:
    """Torques (n, K) [N m] with an empty hand at times (K,) [s], and how they grow (3, n, K) with
    force along x, along z [per N] and torque [per N m] that the hand gives to an object."""
    free = _torques(scene, manipulator, path, times, None)
    units = np.eye(3)[..., None] * np.ones(len(times))
    return free, np.array([_torques(scene, manipulator, path, times, u) - free for u in units])


def _torques(
    scene: Scene, manipulator: Manipulator, path: Trajectory, times: Array, load: Any
) -> Array:
    """Torques (n, K) [N m] at times (K,) [s]; load: as of `PlanarDynamics.torques`."""
    kinematics = manipulator.kinematics
    assert isinstance(kinematics, PlanarArm)
    angles, rates, turns = map(kinematics.link_angles, path.at(times))
    torques = _dynamics(kinematics).torques(angles, rates, turns, scene.gravity, load)
    return np.array(torques)


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


# In space.


@dataclass(frozen=True, eq=False)
class ArmLoads(ReadOnly):
    """What a motion of all an arm's joints takes, at each of its N samples.

    grip: use of the pads' force, None for an empty hand. torque [N m]: of each joint (N, joints),
    and its limits (joints,); None for an arm without masses. speed (N,) [m/s]: the higher one of
    flange and pads' centre.
    """

    grip: PinchUse | None
    torque: Array | None
    limits: Array
    speed: Array

    @classmethod
    def of(cls, scene: Scene, samples: Samples, *, held: bool) -> ArmLoads:
        """Loads of a scene's arm by samples of all its joints; held: with the object in the hand,
        which the full grip presses."""
        arm = scene.arm
        assert arm is not None  # checked by the caller
        frames = frame_motions(arm, samples.q, samples.dq, samples.ddq)
        carried, grip = held_link(scene) if held else None, None
        if carried is not None:
            axes, full = _hand_axes(arm), scene.gripper.profile().full
            wrench = frames[-1].wrench(carried, scene.gravity)
            force, torque = (axes @ frames[-1].seen(part).T for part in wrench)
            grip = pinch_use(scene.patch, force, torque, full)
        torques = arm_torques(arm, frames, scene.gravity, carried) if arm.links else None
        speed = np.max([np.linalg.norm(frame.velocity, axis=1) for frame in frames[-2:]], axis=0)
        return cls(grip, torques, _all_limits(scene, arm), speed)


def _all_limits(scene: Scene, arm: Arm) -> Array:
    """Torque limits (joints,) [N m] of all joints."""
    limits = np.array(arm.limits.torque)
    if scene.torque is not None:
        throwing = [joint - 1 for joint in arm.throwing_joints]
        limits[throwing] = scene.torque.of(arm, arm.throwing_joints)
    return limits


@lru_cache(maxsize=8)
def _hand_axes(arm: Arm) -> Array:
    """Directions along the hand, across it in the pads' plane, and along the pads' normal, as rows
    (3, 3) in the pads' frame.

    In a throw they are those of its plane: the second one is the first turned from x to z.
    """
    side = np.sign(arm.placed(arm.posture)[-1][1, 1])
    return read_only(np.array([[0.0, 0.0, 1.0], [-side, 0.0, 0.0], [0.0, -side, 0.0]]))


def held_link(scene: Scene) -> LinkInertia:
    """The held object in the pads' frame.

    [object] inertia is that about the pads' normal. A bar has the same about the axis across it,
    and mass width^2 / 6 about its own, as a uniform one of square section.
    """
    assert scene.arm is not None
    bar, angle, body = scene.object, scene.grasp.angle, scene.body
    direction = np.array([np.cos(angle), np.sin(angle), 0.0]) @ _hand_axes(scene.arm)
    own = min(bar.mass * bar.width**2 / 6, 2 * body.inertia)
    along = np.outer(direction, direction)
    tensor = body.inertia * (np.eye(3) - along) + own * along
    com = tuple((body.com_offset * direction).tolist())
    return LinkInertia(body.mass, com, tuple(tensor[np.triu_indices(3)].tolist()))
