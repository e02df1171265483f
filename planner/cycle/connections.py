"""Motions between picks and throws, each the fastest that the verdict allows."""

from __future__ import annotations

import functools
import itertools
import math
import operator
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models import Array
from ..clearance import SpatialScene
from ..result import Plan, joint_samples, part_thrown, sent_throw
from ..throw import TICK, Samples, State, Throw, Transfer, joint_limits, transfer
from ..verdict import Finding, first_finding, flight_findings, flight_gaps
from .cycle import UnsolvedError
from .inverse_kinematics import joint_rates
from .slowing import slowed_transfer

#: Shares of the limits on velocity, and on acceleration and jerk, that are tried.
SHARES = (
    *((share, 1.0) for share in (1.0, 0.98, 0.95, 0.92, 0.88, 0.8, 0.7)),
    *((share, 0.8) for share in (1.0, 0.9, 0.8)),
    *((0.7, 0.6), (1.0, 0.6), (0.6, 0.45), (0.5, 0.3), (0.4, 0.2), (0.3, 0.1)),
    *((0.3, 0.05), (0.2, 0.02)),
)

#: Routes: direct, by a raised pose, after the throw's brake, by lifted poses.
DIRECT, RAISED, BRAKED, LIFTED = (0,), (1,), (2,), (3,)
#: Heights [m] above the pick to which the hand lifts an object over others, or comes over them; and
#: the step in which they are reached.
LIFTS, LIFT_STEP = (0.3, 0.15), 0.01


def state_at(samples: Samples, k: int) -> State:
    """The state of a sample."""
    return State(samples.q[k], samples.dq[k], samples.ddq[k])


def at_rest(joints: Array | Sequence[float]) -> State:
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
        return sent_throw(self.plan)

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
        return joined([Samples(*own), still(at_rest(own[0][-1]), max(rest, 0))])

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
    motions that differ in their speed only; route: of motions that lead past the same places."""

    duration: float
    make: Callable[[], Samples]
    join: int = 0
    family: tuple[int, ...] = ()
    speed: float = 1.0
    route: tuple[int, ...] = ()

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

    Which motion is allowed depends on the objects that wait at their picks meanwhile: sets of
    picks, as of `WaitingObjects`. options: motions that are tried first; others: makes those that
    are tried after them; hit: the picks whose objects a motion comes too near to; blocked: those
    whose objects let none pass.
    """

    def __init__(
        self,
        options: Iterator[Option],
        others: Callable[[], Iterator[Option]],
        judge: Callable[[Option], Finding | None],
        hit: Callable[[Option], int],
        blocked: int,
    ) -> None:
        self._blocked = blocked
        self._options = sorted(options, key=lambda option: option.duration)
        self._others: Callable[[], Iterator[Option]] | None = others
        self._judge, self._hit = judge, hit
        #: Allowed motions, the fastest first, and the picks whose objects each would hit.
        self._allowed = list[tuple[Option, int]]()
        #: Why the slowest motion that was judged was refused.
        self.trouble = ""
        if not self._options:
            self._fill()

    def _fill(self) -> None:
        if self._others is not None:
            self._options = sorted(self._others(), key=lambda option: option.duration)
            self._others = None

    @property
    def hits(self) -> int:
        """Picks whose objects may change the time."""
        return functools.reduce(operator.or_, (hit for _, hit in self._allowed), self._blocked)

    def best(self, waiting: int = 0) -> Option | None:
        """The fastest motion that is not refused while the objects of these picks wait."""
        if waiting & self._blocked:
            return None
        free = (option for option, hit in self._allowed if not hit & waiting)
        found = [*itertools.islice(free, 1), *self._options[:1]]
        return min(found, key=lambda option: option.duration, default=None)

    def time(self, waiting: int = 0) -> float:
        """Its duration [s]; infinite if all are refused."""
        best = self.best(waiting)
        if best is not None:
            return best.duration
        # Others are hardly faster than those that were tried.
        none = self._others is None or waiting & self._blocked
        return math.inf if none else self._allowed[-1][0].duration

    def settle(self, waiting: int = 0) -> bool:
        """Judge, until a motion is allowed; returns whether the time stays."""
        before = self.time(waiting)
        while True:
            best = self.best(waiting)
            if best is None and self._others is not None and not waiting & self._blocked:
                self._fill()
            elif best is None or not self._options or best is not self._options[0]:
                return self.time(waiting) == before
            else:
                self._judge_next()

    def _judge_next(self) -> None:
        """Judge the fastest motion that is not judged."""
        option = self._options.pop(0)
        broken = self._judge(option)
        if broken is not None:
            self.trouble = broken.words
            self._refuse(option, broken)
            if not self._options and not self._allowed:
                self._fill()
            return
        hit = self._hit(option)
        self._allowed.append((option, hit))
        self._allowed.sort(key=lambda each: each[0].duration)
        if hit and option.route:
            # A slower motion on the same route hits the same.
            self._options = [o for o in self._options if o.route != option.route]

    def _refuse(self, refused: Option, broken: Finding) -> None:
        """Leave out motions of the same family that are hardly slower.

        Accelerations grow with the square of the speed, so an excess takes its root at least.
        """
        if refused.family and broken.value > broken.limit > 0.0:
            slow = refused.speed * math.sqrt(broken.limit / broken.value)
            self._options = [
                o for o in self._options if o.family != refused.family or o.speed <= slow
            ]


def direct(space: SpatialScene, start: State, goal: State) -> Iterator[Transfer]:
    """Motions of all joints between two states, the fastest first."""
    limits = joint_limits(space.kinematics.arm, range(1, space.kinematics.arm.joints + 1))
    for velocity, acceleration in SHARES:
        found = transfer(limits, start, goal, velocity, acceleration)
        if found is not None:
            yield found


def raised_pose(space: SpatialScene, joints: Array) -> State:
    """Joints with the shoulder in the middle of its range: the arm upright."""
    limits, raised = space.kinematics.arm.limits, joints.copy()
    shoulder = space.kinematics.throwing_joints[0] - 1
    raised[shoulder] = (limits.position_min[shoulder] + limits.position_max[shoulder]) / 2
    return at_rest(raised)


def by_raised(space: SpatialScene, start: State, goal: State) -> Iterator[tuple[Transfer, ...]]:
    """Motions by a raised pose, where they stop."""
    rest = start if not start.dq.any() else goal
    middle = raised_pose(space, rest.q)
    ways = (list(direct(space, *ends)) for ends in ((start, middle), (middle, goal)))
    yield from itertools.product(*ways)


def lifted_pose(space: SpatialScene, joints: Array, height: float) -> State:
    """Joints with the hand straight above its place, turned as it is."""
    q, steps = joints, math.ceil(height / LIFT_STEP)
    for _ in range(steps):
        q = q + joint_rates(space, q, np.array([0.0, 0.0, height / steps]))
    return at_rest(q)


def turned_above(
    space: SpatialScene, start: State, goal: State, above: Array, height: float
) -> Iterator[tuple[Transfer, ...]]:
    """Motions by lifted poses over start and `above` (joints,), where they stop; in between the arm
    turns above what stands there."""
    lifted = (lifted_pose(space, q, height) for q in (start.q, above))
    states = start, *lifted, goal
    yield from zip(*(direct(space, *ends) for ends in itertools.pairwise(states)), strict=False)


def still(state: State, ticks: int) -> Samples:
    """Samples at rest, one more than ticks."""
    return Samples(*(np.tile(row, (ticks + 1, 1)) for row in (state.q, state.dq, state.ddq)))


def option_of(
    parts: Sequence[Transfer | Samples], route: tuple[int, ...], after: int = 0, join: int = 0
) -> Option:
    """Motions one after another, and the number of samples of the throw that follow."""
    ticks = sum(p.ticks if isinstance(p, Transfer) else len(p.q) - 1 for p in parts) + after

    def make() -> Samples:
        return joined([p.samples if isinstance(p, Transfer) else p for p in parts])

    return Option(TICK * ticks, make, join, route=route)


@dataclass(frozen=True, eq=False)
class Ends:
    """Between what a motion leads: motions (N, joints) that begin it, of which it takes one, and
    motions that end it; each the fastest first, the gentlest last. One sample is a state."""

    space: SpatialScene
    begins: Sequence[Samples]
    goals: Sequence[Samples]

    def fastest(self) -> Iterator[Option]:
        """The fastest direct motions."""
        for begin, goal in itertools.product(self.begins, self.goals):
            states = state_at(begin, -1), state_at(goal, 0)
            for found in itertools.islice(direct(self.space, *states), 1):
                yield option_of((begin, found, goal), DIRECT)

    def slower(self) -> Iterator[Option]:
        """Motions slowed until the verdict allows them, direct and by a raised pose; then by shares
        of the limits, direct and by a lifted pose over the pick."""
        pick = self.goals[0].q[-1]
        middle = raised_pose(self.space, pick)
        for rank in (0, -1):
            begin, goal = self.begins[rank], self.goals[rank]
            start, end = state_at(begin, -1), state_at(goal, 0)
            for states, route in (((start, end), DIRECT), ((start, middle, end), RAISED)):
                try:
                    parts = [
                        slowed_transfer(self.space, *pair, held=False)
                        for pair in itertools.pairwise(states)
                    ]
                except UnsolvedError:
                    continue
                yield option_of((begin, *parts, goal), route)
        for found in itertools.islice(direct(self.space, start, end), 1, None):
            yield option_of((begin, found, goal), DIRECT)
        for number, height in enumerate(LIFTS):
            lifted = lifted_pose(self.space, pick, height)
            ways = direct(self.space, start, lifted), direct(self.space, lifted, end)
            for both in zip(*ways, strict=False):
                yield option_of((begin, *both, goal), (*LIFTED, number))

    def after_brake(self, one: CycleThrow) -> Iterator[Option]:
        """Motions that stop after the throw's own brake, which keeps clear of what is around it; at
        once, and when the object has landed."""
        rest, landed = at_rest(one.samples.q[-1]), len(one.samples.q) - 1
        goal = self.goals[-1]
        for found in direct(one.space, rest, state_at(goal, 0)):
            for until in {max(one.braked, one.free), landed}:
                yield option_of((one.samples[one.free : until + 1], found, goal), BRAKED)


def rest_connection(
    ends: Ends,
    hit: Callable[[Samples], int],
    blocked: int,
    come: Callable[[Samples], Sequence[Finding]],
) -> Connection:
    """From rest to rest; hit, blocked: as of `Connection`; come: what the open hand touches at the
    end."""

    def judge(found: Option) -> Finding | None:
        broken = first_finding(ends.space, found.samples, held=False)
        return broken or next(iter(come(found.samples)), None)

    return Connection(ends.fastest(), ends.slower, judge, lambda found: hit(found.samples), blocked)


def leave_connection(
    one: CycleThrow,
    goals: Sequence[Samples],
    hit: Callable[[Samples], int],
    blocked: int,
    come: Callable[[Samples], Sequence[Finding]],
) -> Connection:
    """From the release to rest at the next pick or at home, if allowed without a stop; others: as
    of `rest_connection`."""
    ends = Ends(one.space, [one.samples[one.free : one.free + 1]], goals)

    def judge(found: Option) -> Finding | None:
        broken = first_finding(one.space, found.samples, held=False)
        flown = flight_findings(one.space, one.throw, found.samples, TICK * one.free)
        return broken or next(iter((*flown, *come(found.samples))), None)

    return Connection(
        ends.fastest(),
        lambda: itertools.chain(ends.slower(), ends.after_brake(one)),
        judge,
        lambda found: hit(found.samples),
        blocked,
    )
