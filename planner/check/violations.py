"""What a throw breaks, and the poses of bar, hand and arm along it that show it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import PlanarArm, PlanarDynamics, PlanarHand, pivot_wrench
from ...problems import Scene
from ..compile import MappedKernel
from .check import Thrown
from .geometry import held_bar, palm_corners
from .motion import TICK, Motion
from .mover import Mover
from .rollout import hand_samples

Array = npt.NDArray[np.float64]

#: Name of rows that an NLP leaves out until the check has seen that they are needed.
Guard = str
#: Flight samples for the workspace.
FLIGHT_SAMPLES = 400


@dataclass(frozen=True)
class Margin:
    """A distance [m] or share of a limit that an NLP keeps beyond its usual one, where the check
    found that it takes more: what was missing and `more`, `most` in all."""

    name: str
    more: float
    most: float


@dataclass(frozen=True)
class Violation:
    """What is broken, in words; what the NLP can do about it beyond what it does at first.

    guard: rows that it leaves out at first, "" for none; then: the guard after that one. margin,
    depth [m; share of a limit]: what is too small, and by how much. between: every NLP has rows
    against it, at its nodes.
    """

    words: str
    guard: Guard = ""
    margin: Margin | None = None
    depth: float = 0.0
    between: bool = False
    then: Guard = ""


@dataclass(frozen=True)
class CheckedThrow:
    """A motion of a scene's mover and its exact throw, with the poses along it.

    until [s]: when the motion comes to rest.
    """

    scene: Scene
    mover: Mover
    motion: Motion
    until: float
    opening_time: float
    final: Thrown

    @property
    def lands(self) -> bool:
        """Whether the object comes down to the target's height."""
        return math.isfinite(self.final.landing.flight_time)

    @cached_property
    def _arm(self) -> tuple[Array, Array, Array]:
        """Times (N,), hand poses (3, N) and heights (N,) of the lowest joint, each tick."""
        times = np.arange(0.0, self.until + TICK, TICK)
        outline = outline_kernel(self.mover.motion, self.mover.kinematics)
        pose, lowest = outline(self.motion.at(times)[0].T)
        return times, pose.T, lowest

    @property
    def lowest_of_arm(self) -> float:
        """Height [m] of the lowest point of joints, hand and its body, to the end."""
        _, hand, joint = self._arm
        lowest = min(joint.min(), hand[1].min())
        if self.scene.arm is not None:
            lowest = min(lowest, palm_corners(self.scene.arm.tool, hand)[1].min())
        return float(lowest)

    @cached_property
    def held(self) -> Array:
        """CoM poses (3, N) of the bar from rest to detach."""
        times, hand, _ = self._arm
        carried = held_bar(self.scene, hand[:, times < self.opening_time])
        return np.hstack([carried, self.final.release.com])

    @cached_property
    def flight_times(self) -> Array:
        """Times (K,) [s] after detach, to the landing."""
        return np.linspace(0.0, self.final.landing.flight_time, FLIGHT_SAMPLES)

    @cached_property
    def flying(self) -> Array:
        """CoM poses (3, K) of the bar at these times."""
        return flight_poses(self.scene, self.final, self.flight_times)

    @cached_property
    def hand_in_flight(self) -> Array:
        """Hand poses (3, K) at these times."""
        detach = self.opening_time + self.final.release.times[-1]
        return hand_samples(self.mover, self.motion, detach + self.flight_times).pose


def throw_violations(throw: CheckedThrow) -> list[Violation]:
    """What a throw breaks in any scene: the grip, the release, the way down."""
    final, found = throw.final, []
    if final.grip_use > 1.0:
        words = f"slip before the opening (grip use {final.grip_use:.2f})"
        found.append(Violation(words, guard="carry"))
    if final.release.trouble:
        found.append(Violation(final.release.trouble))
    if not throw.lands:
        found.append(Violation("the object never comes down to the target's height"))
    return found


def flight_poses(scene: Scene, thrown: Thrown, times: Array) -> Array:
    """CoM poses (3, N) at `times` after detach."""
    state = thrown.release.detach.after(times, scene.gravity)
    return np.array([state.x, state.z, state.theta])


@lru_cache(maxsize=16)
def outline_kernel(motion: ca.Function, kinematics: PlanarArm | PlanarHand) -> MappedKernel:
    """q -> hand pose (3,) and the height of the lowest joint beyond the shoulder."""
    q = ca.SX.sym("q", kinematics.coordinates)
    zero = ca.SX.zeros(kinematics.coordinates)
    pose = motion(q, zero, zero)[0]
    joints = kinematics.points(q)[1, 2:] if isinstance(kinematics, PlanarArm) else pose[1]
    return MappedKernel(ca.Function("outline", [q], [pose, ca.mmin(joints)]))


def torque_use(throw: CheckedThrow) -> tuple[Array, Array]:
    """Times (N,) [s] and torques over their limits (N, n), the larger with and without load.

    The object is held until the opening starts; while the pads open the hand may bear all
    of it or nothing; after that its hand is empty.
    """
    scene, mover, motion = throw.scene, throw.mover, throw.motion
    assert scene.torque is not None and isinstance(mover.kinematics, PlanarArm)
    limits = scene.torque.of(mover.kinematics.arm, mover.kinematics.throwing_joints)
    times = np.arange(0.0, throw.until + TICK / 2, TICK)
    hand = hand_samples(mover, motion, times)
    theta, h = hand.pose[2] + scene.grasp.angle, scene.com_offset
    x, z = h * np.cos(theta), h * np.sin(theta)
    wrench = pivot_wrench(scene.body, scene.gravity, hand.motion, hand.twist[2], x, z)
    load = np.array(wrench).T
    kernel = torque_kernel(mover.kinematics)
    coordinates = [rows.T for rows in motion.at(times)]
    gravity = np.full((len(times), 1), scene.gravity)
    held, free = (np.abs(kernel(*coordinates, gravity, some)[0]) for some in (load, 0.0 * load))
    detach = throw.opening_time + scene.gripper.profile().opening
    before, after = (times < throw.opening_time)[:, None], (times > detach)[:, None]
    most = np.where(before, held, np.where(after, free, np.maximum(held, free)))
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
