"""Joints of an arm that hold the hand in a pose: numerically, for any arm."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from ..models import Array
from ..planner import Samples, SpatialScene, motion_verdict
from ..problems import Arm, InputError

#: Distance [rad] of solutions from the ends of the joints' ranges.
MARGIN = 0.05
#: Residual [m; 1] of a solution: of the pads' centre and of their axes.
CLOSE = 1e-9
#: Angle [rad] of a hand that points down, in a throw's plane.
DOWN = -math.pi / 2
#: Number of starts besides the seed, random and the same each time.
STARTS = 40
#: Steps from one start, and the largest one [rad] of a joint.
STEPS, LONGEST = 60, 0.5
#: Least damping of a step, and of a step far from the place, as a share of the squared residual.
DAMPING = 1e-15, 1e-4


@dataclass(frozen=True)
class HandPose:
    """Where a hand holds the middle of its pads, and how it points.

    place (3,) [m]: in the base frame. turn [rad]: of the hand about the vertical, from x to y; at 0
    the pads lie in the plane of a throw along x; None: any, for a hand that points down. angle
    [rad]: of the hand in the plane so turned, as in a throw.
    """

    place: Sequence[float]
    turn: float | None = None
    angle: float = DOWN

    def __str__(self) -> str:
        x, y, z = np.round(self.place, 9) + 0.0
        turned = "" if self.turn is None else f", turn_deg = {math.degrees(self.turn):g}"
        return f"hand pose x = {x:g}, y = {y:g}, z = {z:g}{turned}"


def inverse_kinematics(
    space: SpatialScene, pose: HandPose, seed: Sequence[float], *, held: bool = False
) -> Array:
    """Joints (joints,) [rad] that hold the hand in a pose.

    seed (joints,) [rad]: the solution next to it is preferred, then of those from random starts the
    one whose joints that do not throw are nearest, from where throws start at once. At rest there,
    arm and, if `held`, object break no limit of `motion_verdict`: own body, obstacles, floor, grip,
    torques.

    InputError if there are no such joints, saying whether the place is out of reach, or what is in
    the way.
    """
    search, found = _PoseSearch(space, pose, np.array(seed, float), held=held), list[Array]()
    for is_near, q in search.solutions():
        if is_near:
            return q
        found.append(search.as_thrown(q))
    return min(search.nearest(found), key=lambda q: round(search.aside(q), 1))


@dataclass
class _PoseSearch:
    """Solutions of a hand pose in which nothing is in the way.

    trouble: why the first solution that breaks a limit is none.
    """

    space: SpatialScene
    pose: HandPose
    seed: Array
    held: bool
    trouble: str = ""

    @property
    def arm(self) -> Arm:
        """The arm."""
        return self.space.kinematics.arm

    @cached_property
    def ends(self) -> tuple[Array, Array]:
        """Lowest and highest joints [rad] that are taken."""
        limits = self.arm.limits
        low, high = np.array(limits.position_min), np.array(limits.position_max)
        inset = np.minimum(MARGIN, (high - low) / 2)
        return low + inset, high - inset

    def solutions(self) -> Iterator[tuple[bool, Array]]:
        """Joints (joints,) from each start in turn, and whether that is the seed."""
        for number, first in enumerate(_starts(self.space, self.pose, self.seed)):
            q = self._solved(first)
            if q is None:
                continue
            words = _trouble(self.space, q, self.held)
            self.trouble = self.trouble or words
            if not words:
                yield number == 0, q

    def as_thrown(self, q: Array) -> Array:
        """The same pose without whole turns: of joints that do not throw those away from the seed;
        of those that do, if the others are near it, those beyond the hand's angle in the plane,
        from which the landing's angle counts."""
        (low, high), turn, kinematics = self.ends, 2 * math.pi, self.space.kinematics
        throwing = np.array(kinematics.throwing_joints) - 1
        other = q - turn * np.round((q - self.seed) / turn)
        other[throwing] = q[throwing]
        beyond = kinematics.theta + kinematics.link_angles(list(q[throwing]))[-1] - self.pose.angle
        if self.aside(other) < turn / 4:
            for joint, sign in zip(throwing, kinematics.signs, strict=True):
                unwound = q[joint] - sign * turn * round(beyond / turn)
                if low[joint] <= unwound <= high[joint]:
                    other[joint] = unwound
                    break
        return np.where((low <= other) & (other <= high), other, q)

    def aside(self, q: Array) -> float:
        """Largest distance [rad] from the seed of a joint that does not throw."""
        throwing = np.array(self.space.kinematics.throwing_joints) - 1
        return float(np.abs(np.delete(q - self.seed, throwing)).max())

    def nearest(self, found: list[Array]) -> list[Array]:
        """Solutions by the time in which the slowest joint gets there from the seed; InputError if
        there are none."""
        if found:
            velocity = np.array(self.arm.limits.velocity)
            return sorted(found, key=lambda q: float((np.abs(q - self.seed) / velocity).max()))
        why = f"out of reach of {self.arm.name}"
        if self.trouble:
            why = f"where {self.arm.name} reaches it: {self.trouble}"
        raise InputError(f"{self.pose}: {why}")

    def _solved(self, start: Array) -> Array | None:
        """Joints of the pose by damped Newton steps from a start; None if these do not reach it."""
        (low, high), pose = self.ends, self.pose
        function, turn = _residual(self.arm, pose.turn is None), pose.turn or 0.0
        q = np.clip(start, low, high)
        for _ in range(STEPS):
            found = function(q, np.array(pose.place, float), turn, pose.angle)
            residual, slope, facing = (np.array(part) for part in found)
            off = residual.ravel()
            if np.abs(off).max() < CLOSE:
                # The residual is also zero with axes reversed.
                return q if facing.min() > 0.0 else None
            least, share = DAMPING
            damping = (least + share * float(off @ off)) * np.eye(len(off))
            step = -slope.T @ np.linalg.solve(slope @ slope.T + damping, off)
            q = np.clip(q + step * min(1.0, LONGEST / float(np.abs(step).max())), low, high)
        return None


@functools.lru_cache(maxsize=16)
def _residual(arm: Arm, any_turn: bool) -> ca.Function:
    """Function of joints, place, turn and angle: residual of the hand pose, its Jacobian, and
    cosines between axes of the pads and the wanted ones."""
    q, place = ca.SX.sym("q", arm.joints), ca.SX.sym("place", 3)
    turn, angle = ca.SX.sym("turn"), ca.SX.sym("angle")
    pads, ahead = arm.frames(q)[-1], ca.vertcat(ca.cos(turn), ca.sin(turn), 0) * ca.cos(angle)
    ahead[2] = ca.sin(angle)
    # In a throw along x the pads' y axis is the base's, or its opposite.
    side = float(np.sign(arm.placed(arm.posture)[-1][1, 1]))
    closing = side * ca.vertcat(-ca.sin(turn), ca.cos(turn), 0)
    wanted = [ahead] if any_turn else [ahead, closing, ca.cross(closing, ahead)]
    axes = [pads[:3, 2], pads[:3, 1], pads[:3, 0]][: len(wanted)]
    turned = ca.SX.zeros(3)
    for axis, aim in zip(axes, wanted, strict=True):
        turned += ca.cross(axis, aim)
    residual = ca.vertcat(pads[:3, 3] - place, turned[:2] if any_turn else turned / 2)
    facing = ca.vertcat(*(ca.dot(axis, aim) for axis, aim in zip(axes, wanted, strict=True)))
    outputs = [residual, ca.jacobian(residual, q), facing]
    return ca.Function("pose", [q, place, turn, angle], list(map(ca.densify, outputs)))


def _starts(space: SpatialScene, pose: HandPose, seed: Array) -> Iterator[Array]:
    """The seed; then random joints in turn with postures of throws towards the place."""
    yield seed
    arm, random = space.kinematics.arm, np.random.default_rng(0)
    moving = [joint - 1 for joint in (*space.kinematics.throwing_joints, arm.joints)]
    towards = math.atan2(pose.place[1], pose.place[0])
    for number in range(STARTS):
        uniform = random.uniform(arm.limits.position_min, arm.limits.position_max)
        if number % 2:
            yield uniform
            continue
        posture = np.array(arm.posture)
        posture[moving] = uniform[moving]
        posture[arm.azimuth_joint - 1] = arm.azimuth_angle(towards)
        yield posture


def _trouble(space: SpatialScene, q: Array, held: bool) -> str:
    """Limits that the arm breaks at rest in joints q (joints,), in words."""
    # Two instants at rest: the core measures between instants.
    still = Samples(*(np.array([rows, rows]) for rows in (q, 0 * q, 0 * q)))
    found = motion_verdict(space, still, held=held).findings
    return "; ".join(dict.fromkeys(dataclasses.replace(each, time=None).words for each in found))


def joint_rates(space: SpatialScene, q: Array, velocity: Array) -> Array:
    """Least joint rates (joints,) [rad/s] that move the pads at a velocity (3,) [m/s], unturned."""
    unit = np.eye(len(q))
    pads = space.spatial.pads(np.tile(q, (len(q), 1)), unit, 0.0 * unit)
    rows = np.vstack([pads.velocity.T, pads.omega.T])
    return np.asarray(np.linalg.pinv(rows) @ np.append(velocity, np.zeros(3)))
