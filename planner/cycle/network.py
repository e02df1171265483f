"""The motions between picks and throws, and the fastest way through them."""

from __future__ import annotations

import functools
import itertools
import math
import operator
from collections.abc import Callable, Sequence

import numpy as np

from ...models import Array
from ...problems.job_files import Jobs
from ..clearance import SpatialScene
from ..throw import Samples
from ..verdict import Finding, approach_findings
from .approach import approach_of
from .connections import (
    Connection,
    CycleThrow,
    Ends,
    at_rest,
    leave_connection,
    rest_connection,
    still,
)
from .cycle import UnsolvedError
from .entrance import enter_connection
from .order import Passing, Times, best_order, best_round
from .waiting import WaitingObjects


class Network:
    """Motions between all picks and throws, with their times."""

    def __init__(
        self, jobs: Jobs, throws: Sequence[CycleThrow], objects: WaitingObjects | None = None
    ) -> None:
        self.jobs, self.throws, self._objects = jobs, throws, objects
        self.picks = [at_rest(pick.joints or ()) for pick in jobs.picks]
        self.home = None if jobs.home is None else at_rest(jobs.home)
        self.approaches = [approach_of(jobs, pick) for pick in jobs.picks]
        self._connections: dict[tuple[object, ...], Connection] = {}

    def first(self, pick: int) -> Connection | None:
        """From home to a pick; None where the cycle begins at a pick."""
        if self.home is None:
            return None
        ends = Ends(self.throws[0].space, [still(self.home, 0)], self.approaches[pick].towards)
        hits = self._hits(ends.space, pick, held=False)
        come = self._come(pick)
        return self._connection(("first", pick), lambda: rest_connection(ends, *hits, come))

    def enter(self, throw: int) -> Connection:
        """From its pick into a throw."""
        one = self.throws[throw]
        return self._connection(("enter", throw), lambda: self.entering(one))

    def leave(self, throw: int, goal: int) -> Connection:
        """From a throw to a pick, or to home for -1."""
        one = self.throws[throw]
        return self._connection(("leave", throw, goal), lambda: self.leaving(one, goal))

    def entering(self, one: CycleThrow) -> Connection:
        """From its pick into any throw."""
        hit, blocked = self._hits(one.space, one.pick, held=True)
        if self._objects is not None:
            blocked |= self._objects.hit_by_throw(one.release, one.pick)
        return enter_connection(one, self.approaches[one.pick], hit, blocked)

    def leaving(self, one: CycleThrow, goal: int) -> Connection:
        """From any throw to a pick, or to home for -1."""
        hits = self._hits(one.space, goal, held=False)
        return leave_connection(one, self.ends(goal), *hits, self._come(goal))

    def _come(self, pick: int) -> Callable[[Samples], tuple[Finding, ...]]:
        """What a motion to a pick touches there; nothing for home, -1."""
        if pick < 0:
            return lambda samples: ()
        approach = self.approaches[pick]
        return lambda samples: approach_findings(approach.space, samples, approach.joints)

    def _hits(
        self, space: SpatialScene, pick: int, *, held: bool
    ) -> tuple[Callable[[Samples], int], int]:
        """The picks whose objects a motion from or to a pick hits, and whose objects the hand hits
        as it takes that pick's object."""
        objects = self._objects
        if objects is None:
            return lambda samples: 0, 0
        blocked = objects.hit_at_picks[pick] if pick >= 0 else 0
        return lambda samples: objects.hit(space, samples, pick, held=held), blocked

    def ends(self, goal: int) -> list[Samples]:
        """Motions to rest at a pick, or home for -1."""
        if goal >= 0:
            return self.approaches[goal].towards
        assert self.home is not None
        return [still(self.home, 0)]

    def _connection(self, key: tuple[object, ...], make: Callable[[], Connection]) -> Connection:
        if key not in self._connections:
            self._connections[key] = make()
        return self._connections[key]

    def _times(self) -> Times:
        """Times of all motions: of the fastest one of each that is not refused, judged or not."""
        picks, throws = range(len(self.picks)), range(len(self.throws))
        waits = np.array([pick.grasp_time for pick in self.jobs.picks])
        enter: Array = np.full((len(picks), len(throws)), np.inf)
        passing = dict[int, list[Passing]](), dict[int, list[Passing]]()
        for c, one in enumerate(self.throws):
            way = self.enter(c)
            enter[one.pick, c] = way.time()
            if way.hits:
                passing[0].setdefault(one.pick, []).append((c, way.time, 0.0))
        leave: Array = np.empty((len(throws), len(picks)))
        for c, p in itertools.product(throws, picks):
            way = self.leave(c, p)
            leave[c, p] = way.time() + waits[p]
            if way.hits:
                passing[1].setdefault(p, []).append((c, way.time, float(waits[p])))
        ways, all_picks = [self.first(p) for p in picks], (1 << len(picks)) - 1
        first = [
            0.0 if way is None else way.time(all_picks & ~(1 << p)) for p, way in enumerate(ways)
        ]
        last = leave[:, 0] - waits[0]
        if self.home is not None:
            last = np.array([self.leave(c, -1).time() for c in throws])
        return Times(np.array(first) + waits, enter, leave, last, *passing)

    def fastest(self) -> tuple[list[int], list[int]]:
        """Picks and throws of the fastest order whose motions are all allowed.

        Motions are judged only where the fastest order uses them. Raises UnsolvedError without one.
        """
        given = list(range(len(self.picks))) if self.jobs.order == "given" else None
        while True:
            times = self._times()
            if given is not None:
                order = given
                total, chosen = times.least_time(given)
            elif self.home is None:
                total, order, chosen = best_round(times)
            else:
                total, order, chosen = best_order(times)
            if not math.isfinite(total):
                raise UnsolvedError(self._why())
            stay = [way.settle(waiting) for way, waiting in self.connections(order, chosen)]
            if all(stay):
                return order, chosen

    def hitting(self) -> list[CycleThrow]:
        """The throws into which every allowed motion hits an object that waits."""
        ways = [self.enter(c) for c in range(len(self.throws))]
        everything = (1 << len(self.picks)) - 1
        each = zip(self.throws, ways, strict=True)
        return [one for one, way in each if way.best() and way.time(everything) == math.inf]

    def connections(
        self, order: Sequence[int], chosen: Sequence[int]
    ) -> list[tuple[Connection, int]]:
        """The motions of an order, in turn: from home, then into and out of each throw. Each with
        the picks whose objects wait meanwhile, but the one that the hand comes for."""
        first, waiting = self.first(order[0]), sum(1 << pick for pick in order[1:])
        found = [] if first is None else [(first, waiting)]
        ends = [*order[1:], -1 if self.home is not None else order[0]]
        for throw, end in zip(chosen, ends, strict=True):
            found.append((self.enter(throw), waiting))
            waiting &= ~(1 << end) if end >= 0 else 0
            found.append((self.leave(throw, end), waiting))
        return found

    def _why(self) -> str:
        """Why there is no order: the first pick that cannot be thrown or reached."""
        refused, numbers = list[Connection](), range(len(self.throws))
        for p, pick in enumerate(self.jobs.picks):
            own = [c for c in numbers if self.throws[c].pick == p]
            ways = [self.enter(c) for c in own]
            if all(connection.best() is None for connection in ways):
                return f"{pick.name}: no motion from the pick into a throw: {_words(ways)}"
            # The way back from its own throw to a pick is used if there is no other.
            back = [self.leave(c, p) for c in numbers if c not in own or len(own) == len(numbers)]
            is_end = self.home is None or len(self.jobs.picks) > 1
            if is_end and all(connection.best() is None for connection in back):
                return f"{pick.name}: no motion from a throw to the pick: {_words(back)}"
            refused += (each for each in (*ways, *back) if each.best() is None)
        if self.home is not None:
            ends = [self.leave(c, -1) for c in numbers]
            if all(connection.best() is None for connection in ends):
                return f"no motion from a throw to home: {_words(ends)}"
            refused += (each for each in ends if each.best() is None)
        hits = functools.reduce(operator.or_, (way.hits for way in self._connections.values()), 0)
        names = [pick.name for p, pick in enumerate(self.jobs.picks) if hits >> p & 1]
        if names:
            words = f"objects that wait at their picks are in the way: {', '.join(names)}"
        else:
            words = _words(refused)
        return f"no order of the picks joins all motions: {words}"


def _words(connections: Sequence[Connection]) -> str:
    return next(
        (connection.trouble for connection in connections if connection.trouble),
        "beyond the arm's limits",
    )
