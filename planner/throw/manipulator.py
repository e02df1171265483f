"""The manipulator, arm or free hand, of a scene: coordinates, kinematics and limits as numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...core import Structure, array, library, out
from ...models import Array, MovedHand, ReadOnly, Trajectory
from ...models.robot import (
    Arm,
    ArmCapsules,
    PlanarArm,
    PlanarDynamics,
    PlanarHand,
    about_z,
    hand_motion,
)
from ...problems import Hand, InputError, Robot, Scene

#: Least cosine between the pads' closing and the normal of the throwing plane: 0.08 deg.
SQUARE = 1 - 1e-6
#: Rounding of a state [SI units] and of a frame's entries [m, 1].
ROUNDING = 1e-9
#: Share of [torque] rate that the jerks' limits leave to all else, and number of poses [-] at which
#: the arm's inertia is computed.
RATE_RESERVE, RATE_POSES = 0.15, 500
#: Jerk over acceleration [1/s] of a free hand where the scene gives no jerk.
JERK_RATE = 100.0


@dataclass(frozen=True)
class Limits(ReadOnly):
    """Limits of the planned coordinates, margins taken off; SI units, each (n,).

    slowing: deceleration, offset, upper, lower (4, n) as in `models.robot.Slowing`; None if the
    velocity limits do not depend on the position.
    """

    q_min: Array
    q_max: Array
    dq: Array
    ddq: Array
    jerk: Array
    slowing: Array | None = None

    @cached_property
    def core(self) -> Structure:
        """The limits as the compiled core takes them."""
        found = Structure("limits", slows=self.slowing is not None)
        for name in ("q_min", "q_max", "dq", "ddq", "jerk"):
            setattr(found, name, getattr(self, name).tolist())
        if self.slowing is not None:
            found.slowing = self.slowing.tolist()
        return found

    @cached_property
    def longest_brake(self) -> float:
        """Longest time [s] of a brake within these limits, from any rate and acceleration."""
        return float((self.dq / self.ddq + 3 * self.ddq / self.jerk).max())

    def velocity(self, q: Array) -> tuple[Array, Array]:
        """Lowest and highest velocity [rad/s; m/s] at positions q (..., n)."""
        if self.slowing is None:
            return -self.dq, self.dq
        low, high = np.empty(q.shape), np.empty(q.shape)
        rows, n = np.ascontiguousarray(q, float), q.shape[-1]
        found = (out(values, q.size) for values in (low, high))
        library().velocity_limits(self.core, n, q.size // n, array(rows, q.size), *found)
        return low, high


class HandError(NamedTuple):
    """Error of a hand: constant in x, z [m] and theta [rad], and, from the opening's start on, in
    its velocities [m/s, rad/s]."""

    x: float = 0.0
    z: float = 0.0
    theta: float = 0.0
    v_x: float = 0.0
    v_z: float = 0.0
    omega: float = 0.0


#: A hand without error.
EXACT_HAND = HandError()


@dataclass(frozen=True, eq=False)
class State(ReadOnly):
    """A motion at an instant: joints, rates and accelerations, each (n,), of the throwing joints
    [rad, rad/s, rad/s^2]; of a hand x, z and, where it turns, theta [m, rad and per s, s^2]."""

    q: Array
    dq: Array
    ddq: Array

    def checked(self, manipulator: Manipulator) -> State:
        """The state as arrays; InputError if it does not fit the manipulator or its limits."""
        limits, found = manipulator.hard, list[Array]()
        for name, most in (("q", None), ("dq", limits.dq), ("ddq", limits.ddq)):
            try:
                values = np.array(getattr(self, name), float)
            except (TypeError, ValueError):
                raise InputError(f"State {name}: must be numbers") from None
            if values.shape != (manipulator.size,) or not np.isfinite(values).all():
                raise InputError(f"State {name}: must be {manipulator.size} finite numbers")
            low, high = (limits.q_min, limits.q_max) if most is None else (-most, most)
            for joint, value, least, greatest in zip(
                manipulator.joints, values, low, high, strict=True
            ):
                if not least - ROUNDING <= value <= greatest + ROUNDING:
                    allowed = f"must be {least:.6g} to {greatest:.6g}"
                    raise InputError(f"State {name}: {joint} at {value:.6g}: {allowed}")
            found.append(values)
        return State(*found)


@dataclass(frozen=True)
class Manipulator(ReadOnly):
    """The planned coordinates q (n,) of a scene and how they move the hand.

    motion: (q, dq, ddq), each (n, K) -> pose, twist, acceleration of the hand, each (3, K).
    planning: limits with margins, for the NLP; hard: the real ones, for the check.
    under_way: rates and accelerations (n,) at the given start; None: it is at rest.
    """

    kinematics: PlanarArm | PlanarHand
    motion: Callable[..., list[Array]]
    planning: Limits
    hard: Limits
    start: Array | None
    under_way: tuple[Array, Array] | None = None

    def from_state(self, state: State) -> Manipulator:
        """This manipulator, beginning in a state of motion."""
        return replace(self, start=state.q, under_way=(state.dq, state.ddq))

    @property
    def initial_motion(self) -> tuple[Array, Array]:
        """Rates and accelerations (n,) at the start."""
        zero = np.zeros(self.size)
        return (zero, zero) if self.under_way is None else self.under_way

    def hand(self, path: Trajectory, turning: float = 0.0) -> MovedHand:
        """The hand that a path of the coordinates moves; turning [rad/s]: as of `MovedHand`."""
        return MovedHand(path, self.motion, self.kinematics.core, turning)

    @cached_property
    def capsules(self) -> ArmCapsules | None:
        """The arm's shape; None for a hand, and for an arm whose data have no shape."""
        arm = self.kinematics
        return ArmCapsules.of(arm) if isinstance(arm, PlanarArm) and arm.arm.capsules else None

    @property
    def size(self) -> int:
        """Number of planned coordinates."""
        return self.kinematics.coordinates

    @property
    def turns(self) -> bool:
        """Whether the hand can turn."""
        return isinstance(self.kinematics, PlanarArm) or self.kinematics.coordinates == 3

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the coordinates, for messages."""
        if isinstance(self.kinematics, PlanarArm):
            return tuple(f"joint {j}" for j in self.kinematics.throwing_joints)
        return ("hand x", "hand z", "hand theta")[: self.size]


def make_manipulator(scene: Scene) -> Manipulator:
    """The manipulator of a scene with a hand or a robot; InputError for one without."""
    if scene.robot is not None:
        return _arm_manipulator(scene)
    if scene.hand is not None:
        return _hand_manipulator(scene.hand)
    words = "has a given [motion] and no [hand] or [robot] to plan with"
    raise InputError(f"{scene.place}: {words}; `throwplan simulate` takes it")


def _hand_manipulator(hand: Hand) -> Manipulator:
    """With the usual margins of an arm, but none of position."""
    kinematics = PlanarHand(hand.turns, hand.theta[0])
    n = kinematics.coordinates
    low, high = np.array([hand.x, hand.z, hand.theta]).T[:, :n]
    speed = np.array([hand.speed, hand.speed, hand.angular_speed or 0.0])[:n]
    rate = np.array([hand.acceleration, hand.acceleration, hand.angular_acceleration or 0.0])[:n]
    given = np.array([hand.jerk, hand.jerk, hand.angular_jerk], float)[:n]
    start = None if hand.start is None else np.array([*hand.start, hand.start_theta or 0.0])[:n]
    hard = Limits(low, high, speed, rate, np.where(np.isnan(given), JERK_RATE * rate, given))
    planning = Limits(
        low,
        high,
        speed * (1 - Robot.velocity_margin),
        rate * (1 - Robot.acceleration_margin),
        hard.jerk * (1 - Robot.jerk_margin),
    )
    return Manipulator(kinematics, hand_motion(kinematics), planning, hard, start)


def _check_plane(kinematics: PlanarArm) -> None:
    """ValueError unless the pads close across the throwing plane and the azimuth joint turns it.

    Checked with the arm's 3-D kinematics at random postures; the axis is the base's z axis.
    """
    arm, random = kinematics.arm, np.random.default_rng(0)
    for value in random.uniform(-2, 2, (4, kinematics.coordinates)):
        here, azimuth = kinematics.placed(value)[-1], random.uniform(-2, 2)
        across = min(abs(here[1, 1]), 1.0)
        if across < SQUARE:
            askew = math.degrees(math.acos(across))
            raise ValueError(
                f"arm {arm.name}: posture holds the pads {askew:.1f} deg askew: they must close "
                "across the throwing plane"
            )
        turned = arm.placed(kinematics.all_joints(value, azimuth).tolist())[-1]
        turn = np.eye(4)
        turn[:3, :3] = about_z(azimuth)
        if np.abs(turned - turn @ here).max() > ROUNDING:
            raise ValueError(
                f"arm {arm.name}: azimuth_joint = {arm.azimuth_joint} does not turn the throwing "
                "plane about the base's z axis"
            )


def _arm_manipulator(scene: Scene) -> Manipulator:
    robot, arm = scene.robot, scene.arm
    assert robot is not None and arm is not None  # checked by Scene
    try:
        kinematics = PlanarArm(arm, robot.throwing_joints)
        _check_plane(kinematics)
    except ValueError as error:
        raise InputError(f"{scene.place}: [robot] {error}") from None
    hard = _with_torque_rate(scene, kinematics, joint_limits(arm, kinematics.throwing_joints))
    share, slower = 1 - robot.velocity_margin, None
    if hard.slowing is not None:
        # Velocity limits reduced to `share` at all positions.
        slower = hard.slowing * np.array([[share**2], [share], [1.0], [1.0]])
    planning = Limits(
        hard.q_min + robot.position_margin,
        hard.q_max - robot.position_margin,
        hard.dq * share,
        hard.ddq * (1 - robot.acceleration_margin),
        hard.jerk * (1 - robot.jerk_margin),
        slower,
    )
    return Manipulator(
        kinematics,
        hand_motion(kinematics),
        planning,
        hard,
        start=None if robot.start is None else np.array(robot.start),
    )


def _with_torque_rate(scene: Scene, kinematics: PlanarArm, limits: Limits) -> Limits:
    """The limits with jerks by which the arm's inertia keeps the torque rate in random poses.

    The torque of a joint changes with the jerks by its row of the mass matrix, at worst by the sum
    of their sizes; gravity, velocities and the object's release get `RATE_RESERVE`.
    """
    rate = scene.torque_rate
    if rate is None:
        return limits
    dynamics, n = PlanarDynamics(kinematics), len(limits.jerk)
    random = np.random.default_rng(0)
    q = random.uniform(limits.q_min, limits.q_max, (RATE_POSES, n)).T
    still, most = np.zeros_like(q), np.zeros_like(q)
    for j, jerk in enumerate(limits.jerk):
        turning = still.copy()
        turning[j] = jerk
        angles, rates, turns = map(kinematics.link_angles, (q, still, turning))
        most += np.abs(np.array(dynamics.torques(angles, rates, turns, 0.0)))
    share = min((1 - RATE_RESERVE) * rate / most.max(), 1.0)
    return replace(limits, jerk=share * limits.jerk)


def joint_limits(arm: Arm, joints: Sequence[int]) -> Limits:
    """The real limits of some of an arm's joints, numbered from 1."""
    limits, index = arm.limits, [j - 1 for j in joints]
    ends = limits.position_min, limits.position_max
    rates = limits.velocity, limits.acceleration, limits.jerk
    low, high, dq, ddq, jerk = np.array([*ends, *rates])[:, index]
    curves = None if limits.slowing is None else np.array(astuple(limits.slowing))[:, index]
    return Limits(low, high, dq, ddq, jerk, curves)


def outline(manipulator: Manipulator, q: Array) -> tuple[Array, Array]:
    """Hand poses (3, N), and heights (N,) of the lowest moving joint or hand, at q (n, N)."""
    pose = manipulator.motion(q, 0 * q, 0 * q)[0]
    heights = [pose[1]]
    if isinstance(manipulator.kinematics, PlanarArm):
        heights += manipulator.kinematics.heights(manipulator.kinematics.link_angles(q))
    return pose, np.min(heights, axis=0)
