"""Joints of an arm that hold the hand in a pose: numerically, for any arm."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from ...models import Array
from ...models.robot import Arm
from ...problems import InputError, check_arguments
from ..clearance import SpatialScene
from ..throw import Samples
from ..verdict import motion_verdict

#: Distance [rad] of solutions from the ends of the joints' ranges.
MARGIN = 0.05
#: Residual [m; 1] of a solution: of the pads' centre and of their axes.
CLOSE = 1e-9
#: Angle [rad] of a hand that points down, in a throw's plane.
DOWN = -math.pi / 2
#: Number of starts besides the seed, random and the same each time.
STARTS = 40
#: Number of solutions of which the nearest to the seed is taken.
ENOUGH = 5
#: Solutions [rad] that differ by less are one.
ALIKE = 0.01
#: Steps from one start, and the largest one [rad] of a joint.
STEPS, LONGEST = 60, 0.5
#: Least damping of a step, and of a step far from the place, as a share of the squared residual.
DAMPING = 1e-15, 1e-4


@check_arguments
def inverse_kinematics(
    space: SpatialScene,
    place: Sequence[float],
    turn: float | None,
    seed: Sequence[float],
    *,
    angle: float = DOWN,
    held: bool = False,
    margin: float = MARGIN,
) -> Array:
    """Joints (joints,) [rad] that hold the pads' centre at a place, the hand pointing down.

    place (3,) [m]: in the base frame. turn [rad]: of the hand about the vertical, from x to y;
    at 0 the pads lie in the plane of a throw along x; None: any, for a hand that points down.
    angle [rad]: of the hand in the plane so turned, as in a throw. seed (joints,) [rad]: the
    solution next to it is preferred, then the nearest of those from random starts. margin [rad]:
    from the ends of the joints' ranges. At rest there, arm and, if `held`, object break no limit of
    `motion_verdict`: own body, obstacles, floor, grip, torques.

    InputError if there are no such joints, saying whether the place is out of reach, or what is in
    the way.
    """
    search = _PoseSearch.of(space, place, turn, seed, angle, held, margin)
    found = list[Array]()
    for is_near, q in search.solutions():
        if is_near:
            return q
        found.append(q)
        if len(found) == ENOUGH:
            break
    return search.nearest(found)[0]


def hand_poses(
    space: SpatialScene,
    place: Sequence[float],
    turn: float | None,
    seed: Sequence[float],
    *,
    angle: float = DOWN,
    held: bool = False,
    margin: float = MARGIN,
) -> list[Array]:
    """All joints that `inverse_kinematics` finds from its starts, the nearest to the seed first."""
    search, found = _PoseSearch.of(space, place, turn, seed, angle, held, margin), list[Array]()
    for _, q in search.solutions():
        if all(np.abs(q - other).max() > ALIKE for other in found):
            found.append(q)
    return search.nearest(found)


def throwing_pose(
    space: SpatialScene, place: Sequence[float], turn: float | None, seed: Sequence[float]
) -> Array:
    """Joints as of `inverse_kinematics` with the object in a hand that points down; of several the
    one whose joints that do not throw are next to the seed, from where throws start at once."""
    search = _PoseSearch.of(space, place, turn, seed, DOWN, held=True, margin=MARGIN)
    found = list[Array]()
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
    reach: _Reach
    seed: Array
    held: bool
    trouble: str = ""

    @classmethod
    def of(
        cls,
        space: SpatialScene,
        place: Sequence[float],
        turn: float | None,
        seed: Sequence[float],
        angle: float,
        held: bool,
        margin: float,
    ) -> _PoseSearch:
        """InputError for arguments that are none; see `inverse_kinematics`."""
        arm, goal, start = space.kinematics.arm, np.array(place, float), np.array(seed, float)
        if goal.shape != (3,) or not np.isfinite(goal).all():
            raise InputError("hand pose: x, y, z must be 3 finite numbers, in m")
        if start.shape != (arm.joints,) or not np.isfinite(start).all():
            raise InputError(f"seed: must be {arm.joints} finite numbers, the joints of {arm.name}")
        if turn is None and angle != DOWN:
            raise InputError("turn: None only for a hand that points down")
        return cls(space, _Reach(arm, goal, turn, angle, margin), start, held)

    def solutions(self) -> Iterator[tuple[bool, Array]]:
        """Joints (joints,) from each start in turn, and whether that is the seed."""
        for number, first in enumerate(_starts(self.space, self.reach.place, self.seed)):
            q = self.reach.solved(first)
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
        (low, high), turn, kinematics = self.reach.ends, 2 * math.pi, self.space.kinematics
        throwing = np.array(kinematics.throwing_joints) - 1
        other = q - turn * np.round((q - self.seed) / turn)
        other[throwing] = q[throwing]
        beyond = kinematics.theta + kinematics.link_angles(list(q[throwing]))[-1] - self.reach.angle
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
        arm, turn = self.reach.arm, self.reach.turn
        if found:
            velocity = np.array(arm.limits.velocity)
            return sorted(found, key=lambda q: float((np.abs(q - self.seed) / velocity).max()))
        x, y, z = np.round(self.reach.place, 9) + 0.0
        where = f"hand pose x = {x:g}, y = {y:g}, z = {z:g}"
        if turn is not None:
            where += f", turn_deg = {math.degrees(turn):g}"
        why = f"out of reach of {arm.name}"
        if self.trouble:
            why = f"where {arm.name} reaches it: {self.trouble}"
        raise InputError(f"{where}: {why}")


@dataclass(frozen=True)
class _Reach:
    """A hand pose and the joints' ranges for it; arguments as of `inverse_kinematics`."""

    arm: Arm
    place: Array
    turn: float | None
    angle: float
    margin: float

    @property
    def ends(self) -> tuple[Array, Array]:
        """Lowest and highest joints [rad] that are taken."""
        limits = self.arm.limits
        low, high = np.array(limits.position_min), np.array(limits.position_max)
        inset = np.minimum(self.margin, (high - low) / 2)
        return low + inset, high - inset

    def solved(self, start: Array) -> Array | None:
        """Joints of the pose by damped Newton steps from a start; None if these do not reach it."""
        low, high = self.ends
        function, turn = _residual(self.arm, self.turn is None), self.turn or 0.0
        q = np.clip(start, low, high)
        for _ in range(STEPS):
            found = function(q, self.place, turn, self.angle)
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


def _starts(space: SpatialScene, place: Array, seed: Array) -> Iterator[Array]:
    """The seed; then random joints in turn with postures of throws towards the place."""
    yield seed
    arm, random = space.kinematics.arm, np.random.default_rng(0)
    moving = [joint - 1 for joint in (*space.kinematics.throwing_joints, arm.joints)]
    towards = math.atan2(place[1], place[0])
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
