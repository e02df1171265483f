"""From rest at a pick, with the object, into the swing of a throw, all joints at once.

The throwing joints join the swing, which starts in the pick's own pose, as early as the grip
allows: jerks at their limits start faster than the swing's polynomials. The other joints turn into
the throw's plane meanwhile, gently, for a pinch holds little against tilting, and at the latest
when the pads may open. Where both together are too fast for the tool or the grip, the first part of
the swing is stretched in time.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Callable, Iterator

import numpy as np

from ..models import Indices
from ..planner import TICK, Limits, Samples, State, Transfer, first_finding, joint_limits, transfer
from .approach import Approach
from .connections import (
    Connection,
    CycleThrow,
    Option,
    by_raised,
    direct,
    joined,
    option_of,
    standstill,
    state_at,
)

#: Shares of the time until the pads may open at which the throwing joints may join the swing.
JOINS = (0.0, 0.04, 0.08, 0.12, 0.16, 0.2, 0.25, 0.3, 0.4, 0.5, 0.6, 0.7)
#: Shares of the limits on velocity, and on acceleration and jerk, until then.
SHARES = ((1.0, 1.0), (0.85, 1.0), (0.85, 0.7), (0.7, 0.5), (0.5, 0.3), (0.35, 0.2), (0.25, 0.1))
#: Speeds of the stretched part as shares of the swing's, shares of the time until the pads may open
#: at which it ends, and time [samples] in which the speed rises to the swing's.
SPEEDS = (1.0, 0.97, 0.94, 0.91, 0.88, 0.85, 0.8, 0.75, 0.7, 0.6, 0.5, 0.35)
ENDS = (0.6, 0.8, 0.95)
RISE = 150
#: Shares of the time until the pads may open in which the other joints turn.
TURNS = (1.0, 0.85, 0.7, 0.6, 0.5, 0.4)
#: Largest rate [rad/s] of a joint at rest.
AT_REST = 1e-6
#: Least share of the limits on acceleration and jerk of a gentle motion, and the number of
#: bisections that find its share.
LEAST_SHARE, SHARE_STEPS = 0.02, 7


def enter_connection(
    one: CycleThrow, approach: Approach, hit: Callable[[Samples], int]
) -> Connection:
    """From rest at a pick into a throw; its time is until the hand may leave the throw's plane.

    hit: as of `Connection`, by what follows until the pads open.
    """
    entrance = _Entrance(one, approach)
    return Connection(
        iter([entrance.options(), entrance.stopping(), entrance.raised()]),
        lambda found: first_finding(one.space, found.samples, held=True),
        lambda found: hit(entrance.until_opening(found)),
    )


class _Entrance:
    """The motions from one pick into one throw."""

    def __init__(self, one: CycleThrow, approach: Approach) -> None:
        self.one, self.approach = one, approach
        arm = one.space.kinematics.arm
        self.throwing = np.array(one.space.kinematics.throwing_joints) - 1
        self.aside = np.setdiff1d(np.arange(arm.joints), self.throwing)
        self.limits = joint_limits(arm, (self.throwing + 1).tolist())
        self.aside_limits = joint_limits(arm, (self.aside + 1).tolist())
        #: Last sample of the throw at which the pads are closed.
        self.opens = math.floor(one.throw.opening_time / TICK)
        self._turned: dict[int, Transfer] = {}

    def until_opening(self, found: Option) -> Samples:
        """A motion and what follows of the swing, as long as the pads are closed."""
        return joined([found.samples, self._throw[found.join : self.opens + 1]])

    def options(self) -> Iterator[Option]:
        """Motions with all joints at once, from each speed behind the pick."""
        for rank, (lead, share, way) in enumerate(self.approach.leads):
            yield from self._from(rank, lead, share, state_at(way, -1))

    def _from(
        self, rank: int, lead: float, gentle: tuple[float, float], begin: State
    ) -> Iterator[Option]:
        """Motions from a state behind the pick, where the hand has the speed `lead` [m/s]."""
        start, goal = (_of(state, self.aside) for state in (begin, state_at(self._throw, 0)))
        fastest = transfer(self.aside_limits, start, goal)
        # Joints that do not throw begin at rest, as those that do where they wait.
        if fastest is None or (lead and np.abs(start.dq).max(initial=0.0) > AT_REST):
            return
        for (which, swing), speed, (place, end) in itertools.product(
            enumerate(self._swings(begin)), SPEEDS, enumerate(ENDS)
        ):
            found = _stretched(swing, speed, round(end * (len(swing.q) - 1)))
            way = self.approach.leaving(speed * lead, gentle)
            if found is None or way is None:
                continue
            wait = max(fastest.ticks - len(found.q) + 1, 0)
            if wait and lead:
                continue
            until = wait + len(found.q) - 1
            duration = TICK * (len(way.q) - 1 + until + self.one.free - self.opens)
            for number, share in enumerate(TURNS):
                turn = max(round(share * until), fastest.ticks)
                make = functools.partial(self._samples, way, found, wait, turn)
                family = rank, which, place, number
                yield Option(duration, make, self.opens, family, speed)
                if turn == fastest.ticks:
                    break

    @property
    def _throw(self) -> Samples:
        return self.one.samples

    def _swings(self, begin: State) -> list[Samples]:
        """The fastest swings from a state that are allowed in the throw's plane, one of them from
        the throw's own start; the throwing joints only.

        Until the last sample at which the pads are closed.
        """
        throw, start = self._throw, _of(begin, self.throwing)
        found, early = list[Samples](), list[Samples]()
        for share, (velocity, acceleration) in itertools.product(JOINS, SHARES):
            k = round(share * self.opens)
            joining = transfer(
                self.limits, start, _of(state_at(throw, k), self.throwing), velocity, acceleration
            )
            if joining is not None:
                rest = throw[k + 1 : self.opens + 1, self.throwing]
                rows = np.concatenate([joining.samples.rows, rest.rows], axis=1)
                found.append(Samples(*rows))
                early += found[-1:] if k == 0 else []
        ways = (sorted(some, key=lambda swing: len(swing.q)) for some in (found, early))
        fastest = (next(filter(self._holds, way), None) for way in ways)
        return [swing for swing in fastest if swing is not None]

    def _holds(self, swing: Samples) -> bool:
        """Whether a swing in the throw's plane is allowed."""
        rows = np.zeros((3, len(swing.q), self._throw.q.shape[1]))
        rows[0] = self._throw.q[0]
        rows[:, :, self.throwing] = swing.rows
        return first_finding(self.one.space, Samples(*rows), held=True) is None

    def _samples(self, way: Samples, swing: Samples, wait: int, turn: int) -> Samples:
        """All joints: straight from the pick; then the throwing ones wait and swing, the others
        turn in `turn` samples."""
        if turn not in self._turned:
            start, goal = (
                standstill(way.q[-1, self.aside]),
                _of(state_at(self._throw, 0), self.aside),
            )
            self._turned[turn] = _gentle_transfer(self.aside_limits, start, goal, turn)
        turned = self._turned[turn]
        rows = np.zeros((3, wait + len(swing.q), way.q.shape[1]))
        last = np.minimum(np.arange(rows.shape[1]), turned.ticks)
        rows[0, :wait] = way.q[-1]
        rows[:, wait:, self.throwing] = swing.rows
        rows[:, :, self.aside] = turned.samples.rows[:, last]
        return joined([way, Samples(*rows)])

    def stopping(self) -> Iterator[Option]:
        """Motions to rest at the swing's start."""
        way = self.approach.away[-1]
        for slow in direct(self.one.space, state_at(way, -1), state_at(self._throw, 0)):
            yield option_of((way, slow), self.one.free)

    def raised(self) -> Iterator[Option]:
        """Motions by a raised pose, joining the swing at its start or in its middle."""
        way = self.approach.away[-1]
        for k in (0, self.opens // 2):
            states = state_at(way, -1), state_at(self._throw, k)
            for parts in by_raised(self.one.space, *states):
                yield option_of((way, *parts), self.one.free - k, k)


def _stretched(swing: Samples, speed: float, end: int) -> Samples | None:
    """A swing whose part until sample `end` takes longer; None where that part is too short.

    Its clock runs at `speed`, and rises to the swing's in the last `RISE` samples of the part.
    """
    if speed == 1.0:
        return swing
    # A clock that rises halfway on average; whole samples, so that the rest stays as it is.
    ticks = math.ceil((end - (1.0 + speed) * RISE / 2) / speed) + RISE
    if ticks <= RISE:
        return None
    speed = (end - RISE / 2) / (ticks - RISE / 2)
    if not 0.0 < speed < 1.0:
        return None
    t = np.arange(ticks, dtype=np.float64)
    u = np.clip((t - (ticks - RISE)) / RISE, 0.0, 1.0)
    rise = 1.0 - speed
    rate = speed + rise * u**3 * (10 - 15 * u + 6 * u**2)
    change = rise * 30 * u**2 * (1 - u) ** 2 / (RISE * TICK)
    clock = speed * t + rise * RISE * u**4 * (2.5 - 3 * u + u**2)
    at = swing.path.at(TICK * clock)
    q, dq, ddq = at.pose.T, at.twist.T, at.acceleration.T
    rate, change = rate[:, None], change[:, None]
    found = np.array([q, dq * rate, ddq * rate**2 + dq * change])
    return Samples(*np.concatenate([found, swing.rows[:, end:]], axis=1))


def _gentle_transfer(limits: Limits, start: State, goal: State, ticks: int) -> Transfer:
    """The motion from rest to rest in `ticks` samples, at least those of the fastest one, with
    little acceleration."""
    low, high = math.log(LEAST_SHARE), 0.0
    for _ in range(SHARE_STEPS):
        middle = (low + high) / 2
        found = transfer(limits, start, goal, 1.0, math.exp(middle))
        low, high = (middle, high) if found is None or found.ticks > ticks else (low, middle)
    gentle = transfer(limits, start, goal, 1.0, math.exp(high), ticks)
    assert gentle is not None
    return gentle


def _of(state: State, joints: Indices) -> State:
    """The state of some joints."""
    return State(state.q[joints], state.dq[joints], state.ddq[joints])
