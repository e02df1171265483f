"""Motions between picks and throws, each the fastest that the verdict allows."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..models import Array
from ..planner import (
    TICK,
    Code,
    Finding,
    Limits,
    Plan,
    Samples,
    SpatialScene,
    State,
    Throw,
    Transfer,
    first_finding,
    flight_findings,
    flight_gaps,
    joint_limits,
    joint_samples,
    part_thrown,
    transfer,
)
from .inverse_kinematics import joint_rates

#: Shares of the limits on velocity, and on acceleration and jerk, that are tried.
SHARES = (
    *((share, 1.0) for share in (1.0, 0.98, 0.95, 0.92, 0.88, 0.8, 0.7)),
    *((share, 0.8) for share in (1.0, 0.9, 0.8)),
    *((0.7, 0.6), (1.0, 0.6), (0.6, 0.45), (0.5, 0.3), (0.4, 0.2), (0.3, 0.1)),
    *((0.3, 0.05), (0.2, 0.02)),
)

#: Shares of the limits on velocity, acceleration and jerk that a broken limit reduces.
REDUCED = {
    Code.TOOL_SPEED: (1, 0, 0),
    Code.JOINT_VELOCITY: (1, 0, 0),
    Code.TORQUE: (0, 1, 1),
    Code.TORQUE_RATE: (0, 0, 1),
}
#: Most motions that are judged to find one slow enough, and to quicken it again by each share.
SLOWINGS, QUICKENINGS = 30, 3
#: Share of a limit that a slowed motion is to use, and bounds of a slowing's factor.
AIM, FACTORS = 0.99, (0.5, 0.97)
#: Step [m] in which a lifted pose is reached.
LIFT_STEP = 0.01


def state_at(samples: Samples, k: int) -> State:
    """The state of a sample."""
    return State(samples.q[k], samples.dq[k], samples.ddq[k])


def standstill(joints: Array | Sequence[float]) -> State:
    """Joints (n,) [rad] at rest."""
    q = np.array(joints, float)
    return State(q, 0.0 * q, 0.0 * q)


@dataclass(frozen=True, eq=False)
class CycleThrow:
    """A planned throw that a cycle may use. pick: number of its pick; bin: name of its bin."""

    plan: Plan
    pick: int
    bin: str

    @cached_property
    def throw(self) -> Throw:
        """The throw."""
        return self.plan.sent_throw()

    @cached_property
    def space(self) -> SpatialScene:
        """Its scene with all joints of the arm."""
        return SpatialScene(self.throw.scene, self.throw.manipulator)

    @cached_property
    def samples(self) -> Samples:
        """All joints (N, joints), at rest after the brake until the landing."""
        plane = self.throw.target.plane
        own = joint_samples(self.space.kinematics, plane.azimuth, self.throw.samples)
        rest = math.ceil(self.throw.landing_time / TICK) - self.braked
        return joined([Samples(*own), still(standstill(own[0][-1]), max(rest, 0))])

    @cached_property
    def release(self) -> Throw:
        """The part from the last sample with closed pads to `free`, then a brake of its own."""
        own, opening = self.throw, self.throw.opening_time
        part = math.floor(opening / TICK), self.free, opening
        return part_thrown(own.scene, own.manipulator, self.samples, *part)

    @property
    def braked(self) -> int:
        """The sample at which the throw's own brake ends."""
        return len(self.throw.samples.q) - 1

    @cached_property
    def free(self) -> int:
        """The first sample from which on the throw's brake keeps the hand off the object: from
        there another motion may follow."""
        first = math.ceil(self.throw.detach_time / TICK)
        gaps = flight_gaps(self.space, self.throw, self.samples[first:], TICK * first)
        near = np.flatnonzero(gaps < 0.0)
        free = first if not near.size else first + int(near[-1]) + 1
        return min(free, len(self.samples.q) - 1)


@dataclass(frozen=True, eq=False)
class Option:
    """A motion that may be taken. duration [s]: with the part of the throw that it determines;
    make: its samples (N, joints); join: sample of the throw with which they end; family, speed: of
    motions that differ in their speed only."""

    duration: float
    make: Callable[[], Samples]
    join: int = 0
    family: tuple[int, ...] = ()
    speed: float = 1.0

    @cached_property
    def samples(self) -> Samples:
        """Samples (N, joints) of all parts."""
        return self.make()


def joined(parts: list[Samples]) -> Samples:
    """Samples one after another; the last of each is the first of the next."""
    first, *others = (part.rows for part in parts)
    return Samples(*np.concatenate([first, *(rows[:, 1:] for rows in others)], axis=1))


class Connection:
    """The fastest allowed motion between two states; judged only when it is needed.

    options: of motions, those that are tried first, then each those that are tried if all before
    are refused; the fastest first. judge: the first broken limit of a motion; hit: the picks whose
    objects, if they wait, it comes too near to, a set as of `WaitingObjects`.
    """

    def __init__(
        self,
        options: Iterator[Iterator[Option]],
        judge: Callable[[Option], Finding | None],
        hit: Callable[[Option], int],
    ) -> None:
        self._options = list[Option]()
        self._others, self._judge, self._hit = options, judge, hit
        self._allowed = self._avoids = False
        #: Picks whose objects the allowed motion hits, and those that any one did.
        self.hits = self.hit_by_any = 0
        #: Why the slowest motion that was judged was refused.
        self.trouble = ""
        self._fill()

    def _fill(self) -> None:
        """Take other motions where none is left."""
        while not self._options and (others := next(self._others, None)) is not None:
            self._options = sorted(others, key=lambda option: option.duration)

    @property
    def best(self) -> Option | None:
        """The fastest motion that is not refused."""
        return self._options[0] if self._options else None

    @property
    def time(self) -> float:
        """Its duration [s]; infinite if all are refused."""
        return self._options[0].duration if self._options else math.inf

    def settle(self) -> None:
        """Judge, until a motion is allowed."""
        while self._options and not self._allowed:
            broken = self._judge(self._options[0])
            hits = self._hit(self._options[0]) if broken is None else 0
            self.hit_by_any |= hits
            if broken is not None:
                self.trouble = broken.words
                self._refuse(self._options[0], broken)
                self._next()
            elif hits and self._avoids:
                self._next()
            else:
                self.hits, self._allowed = hits, True

    def avoid(self) -> None:
        """Take a motion that hits no object at any pick instead of the allowed one."""
        self._avoids, self._allowed, self.hits = True, False, 0
        self._next()

    def _next(self) -> None:
        self._options.pop(0)
        self._fill()

    def _refuse(self, refused: Option, broken: Finding) -> None:
        """Leave out motions of the same family that are hardly slower.

        Accelerations grow with the square of the speed, so an excess takes its root at least.
        """
        if refused.family and broken.value > broken.limit > 0.0:
            slow = refused.speed * math.sqrt(broken.limit / broken.value)
            self._options = [
                o
                for o in self._options
                if o is refused or o.family != refused.family or o.speed <= slow
            ]


def direct(space: SpatialScene, start: State, goal: State) -> Iterator[Transfer]:
    """Motions of all joints between two states, the fastest first."""
    limits = joint_limits(space.kinematics.arm, range(1, space.kinematics.arm.joints + 1))
    for velocity, acceleration in SHARES:
        found = transfer(limits, start, goal, velocity, acceleration)
        if found is not None:
            yield found


def slowed(space: SpatialScene, start: State, goal: State) -> Transfer | None:
    """The fastest motion of all joints between two states, with an empty hand, that the verdict
    allows; None if slowing helps none.

    Ruckig's, with its limits reduced until torques and tool speed are kept, then raised again as
    far as that is allowed.
    """
    limits = joint_limits(space.kinematics.arm, range(1, space.kinematics.arm.joints + 1))
    most = limits.dq, limits.ddq, limits.jerk

    def reduced(shares: Array) -> Transfer | None:
        each = (share * limit for share, limit in zip(shares, most, strict=True))
        return transfer(Limits(limits.q_min, limits.q_max, *each), start, goal)

    shares = np.ones(3)
    for _ in range(SLOWINGS):
        found = reduced(shares)
        if found is None:
            return None
        broken = first_finding(space, found.samples, held=False)
        if broken is None:
            break
        if broken.code not in REDUCED:
            return None
        factor = np.clip(AIM * broken.limit / max(abs(broken.value), 1e-9), *FACTORS)
        shares *= factor ** np.array(REDUCED[broken.code])
    else:
        return None
    for number in (2, 1, 0):
        low, high = shares[number], 1.0
        for _ in range(QUICKENINGS if low < 1.0 else 0):
            trial = shares.copy()
            trial[number] = (low + high) / 2
            other = reduced(trial)
            if (
                other is not None
                and other.ticks < found.ticks
                and first_finding(space, other.samples, held=False) is None
            ):
                shares, found, low = trial, other, trial[number]
            else:
                high = trial[number]
    return found


def raised_pose(space: SpatialScene, joints: Array) -> State:
    """Joints with the shoulder in the middle of its range: the arm upright."""
    limits, raised = space.kinematics.arm.limits, joints.copy()
    shoulder = space.kinematics.throwing_joints[0] - 1
    raised[shoulder] = (limits.position_min[shoulder] + limits.position_max[shoulder]) / 2
    return standstill(raised)


def by_raised(space: SpatialScene, start: State, goal: State) -> Iterator[tuple[Transfer, ...]]:
    """Motions by a raised pose, where they stop."""
    rest = start if not start.dq.any() else goal
    middle = raised_pose(space, rest.q)
    ways = (direct(space, *ends) for ends in ((start, middle), (middle, goal)))
    yield from zip(*ways, strict=False)


def lifted_pose(space: SpatialScene, joints: Array, height: float) -> State:
    """Joints with the hand straight above its place, turned as it is."""
    q, steps = joints, math.ceil(height / LIFT_STEP)
    for _ in range(steps):
        q = q + joint_rates(space, q, np.array([0.0, 0.0, height / steps]))
    return standstill(q)


def still(state: State, ticks: int) -> Samples:
    """Samples at rest, one more than ticks."""
    return Samples(*(np.tile(row, (ticks + 1, 1)) for row in (state.q, state.dq, state.ddq)))


def option_of(parts: Sequence[Transfer | Samples], after: int = 0, join: int = 0) -> Option:
    """Motions one after another, and the number of samples of the throw that follow."""
    ticks = sum(p.ticks if isinstance(p, Transfer) else len(p.q) - 1 for p in parts) + after

    def make() -> Samples:
        return joined([p.samples if isinstance(p, Transfer) else p for p in parts])

    return Option(TICK * ticks, make, join)


def connection_between(
    space: SpatialScene,
    begin: Samples,
    goals: Sequence[Samples],
    come: Callable[[Samples], Sequence[Finding]],
    hit: Callable[[Samples], int],
    one: CycleThrow | None = None,
) -> Connection:
    """From the end of a motion to rest, with an empty hand.

    goals: motions (N, joints) that end it, of which it takes one, the gentlest last; one sample is
    a state. come: what the open hand touches at the end. hit: as of `Connection`. one: the throw
    that was before; then `begin` is its sample `free`.
    """
    start, middle = state_at(begin, -1), raised_pose(space, goals[0].q[-1])

    def fastest() -> Iterator[Option]:
        for goal in goals:
            for found in itertools.islice(direct(space, start, state_at(goal, 0)), 1):
                yield option_of((begin, found, goal))

    def slower(*by: State) -> Iterator[Option]:
        for goal in (goals[0], goals[-1]):
            ways = itertools.pairwise((start, *by, state_at(goal, 0)))
            parts = [slowed(space, *way) for way in ways]
            if None not in parts:
                yield option_of((begin, *filter(None, parts), goal))

    def after_brake() -> Iterator[Option]:
        """After the throw's own brake, which keeps clear of what is around it: at once, and when
        the object has landed."""
        if one is None:
            return
        back = slowed(space, standstill(one.samples.q[-1]), state_at(goals[-1], 0))
        if back is not None:
            for until in (max(one.braked, one.free), len(one.samples.q) - 1):
                yield option_of((one.samples[one.free : until + 1], back, goals[-1]))

    def judge(option: Option) -> Finding | None:
        found = option.samples
        flown: tuple[Finding, ...] = ()
        broken = first_finding(space, found, held=False)
        if broken is None and one is not None:
            flown = flight_findings(one.space, one.throw, found, TICK * one.free)
        return broken or next(iter((*flown, *come(found))), None)

    options = iter([fastest(), slower(), slower(middle), after_brake()])
    return Connection(options, judge, lambda option: hit(option.samples))
