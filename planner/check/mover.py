"""What moves the hand in a scene: its coordinates, kinematics and limits as numbers."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import MovedHand, Path, PlanarArm, PlanarHand, Slowing, hand_motion
from ...problems import Hand, InputError, Scene
from ..compile import MappedKernel, mapped

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Limits:
    """Limits of the planned coordinates, margins taken off; SI units, each (n,).

    slowing: deceleration, offset, upper, lower (4, n) as in `models.arm.Slowing`; None where
    the velocity limits are the same at all positions.
    """

    q_min: Array
    q_max: Array
    dq: Array
    ddq: Array
    jerk: Array | None
    slowing: Array | None = None

    def velocity(self, q: Array) -> tuple[Array, Array]:
        """Lowest and highest velocity [rad/s; m/s] at positions q (..., n)."""
        if self.slowing is None:
            return -self.dq, self.dq
        deceleration, offset, upper, lower = self.slowing
        down, up = (
            np.clip(np.sqrt(2 * deceleration * np.maximum(way, 0.0)) - offset, 0.0, self.dq)
            for way in (q - lower, upper - q)
        )
        return -down, up


@dataclass(frozen=True)
class Mover:
    """The planned coordinates q (n,) of a scene and how they move the hand.

    motion: CasADi function (q, dq, ddq) -> pose, twist, acceleration of the hand.
    planning: limits with margins, for the NLP; hard: the real ones, for the check.
    jerk_control: whether the acceleration is a state and the jerk the control.
    """

    kinematics: PlanarArm | PlanarHand
    motion: ca.Function
    planning: Limits
    hard: Limits
    start: Array | None
    jerk_control: bool

    def hand(self, path: Path) -> MovedHand:
        """The hand that a path of the coordinates moves."""
        return MovedHand(path, self._moved)

    def _moved(self, *coordinates: Array) -> list[Array]:
        return [rows.T for rows in mapped(self.motion)(*(rows.T for rows in coordinates))]

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


def make_mover(scene: Scene) -> Mover:
    """The mover of a scene with a hand or a robot; InputError for one without."""
    if scene.robot is not None:
        return _arm_mover(scene)
    if scene.hand is not None:
        return _hand_mover(scene.hand)
    raise InputError(f"{scene.place}: has a given [motion] and no [hand] or [robot] to plan with")


def _hand_mover(hand: Hand) -> Mover:
    kinematics = PlanarHand(hand.turns, hand.theta[0])
    low, high = [hand.x[0], hand.z[0]], [hand.x[1], hand.z[1]]
    speed, acceleration = [hand.speed] * 2, [hand.acceleration] * 2
    start = list(hand.start) if hand.start is not None else None
    if hand.angular_speed is not None and hand.angular_acceleration is not None:
        low.append(hand.theta[0])
        high.append(hand.theta[1])
        speed.append(hand.angular_speed)
        acceleration.append(hand.angular_acceleration)
        if start is not None and hand.start_theta is not None:
            start.append(hand.start_theta)
    limits = Limits(np.array(low), np.array(high), np.array(speed), np.array(acceleration), None)
    return Mover(
        kinematics,
        hand_motion(kinematics),
        planning=limits,
        hard=limits,
        start=None if start is None else np.array(start),
        jerk_control=False,
    )


def _arm_mover(scene: Scene) -> Mover:
    robot, arm = scene.robot, scene.arm
    assert robot is not None and arm is not None  # checked by Scene
    try:
        kinematics = PlanarArm(arm, robot.throwing_joints)
    except ValueError as error:
        raise InputError(f"{scene.place}: [robot] {error}") from None
    index = [j - 1 for j in kinematics.throwing_joints]
    limits = arm.limits
    hard = Limits(
        np.array(limits.position_min)[index],
        np.array(limits.position_max)[index],
        np.array(limits.velocity)[index],
        np.array(limits.acceleration)[index],
        np.array(limits.jerk)[index],
        _slowing(limits.slowing, index),
    )
    assert hard.jerk is not None
    planning = Limits(
        hard.q_min + robot.position_margin,
        hard.q_max - robot.position_margin,
        hard.dq * (1 - robot.velocity_margin),
        hard.ddq * (1 - robot.acceleration_margin),
        hard.jerk * (1 - robot.jerk_margin),
        _slower(hard.slowing, 1 - robot.velocity_margin),
    )
    return Mover(
        kinematics,
        hand_motion(kinematics),
        planning=planning,
        hard=hard,
        start=None if robot.start is None else np.array(robot.start),
        jerk_control=robot.control == "jerk",
    )


def _slowing(slowing: Slowing | None, index: list[int]) -> Array | None:
    """The velocity curves of some joints, (4, n)."""
    if slowing is None:
        return None
    curves = [slowing.deceleration, slowing.offset, slowing.upper, slowing.lower]
    return np.array(curves)[:, index]


def _slower(slowing: Array | None, share: float) -> Array | None:
    """The curves whose velocity is `share` of the given ones' everywhere."""
    return None if slowing is None else slowing * np.array([[share**2], [share], [1.0], [1.0]])


@lru_cache(maxsize=16)
def outline_kernel(motion: ca.Function, kinematics: PlanarArm | PlanarHand) -> MappedKernel:
    """q -> hand pose (3,) and the height of the lowest joint beyond the shoulder."""
    q = ca.SX.sym("q", kinematics.coordinates)
    zero = ca.SX.zeros(kinematics.coordinates)
    pose = motion(q, zero, zero)[0]
    joints = kinematics.points(q)[1, 2:] if isinstance(kinematics, PlanarArm) else pose[1]
    return MappedKernel(ca.Function("outline", [q], [pose, ca.mmin(joints)]))
