"""The motions between picks and throws, and the fastest way through them."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from ..models import Indices
from ..planner import Finding, Samples, SpatialScene, approach_findings
from .approach import approach_of
from .connections import Connection, CycleThrow, connection_between, standstill, still
from .cycle import UnsolvedError
from .entrance import enter_connection
from .job_files import Jobs
from .order import best_order
from .waiting import WaitingObjects

#: Number of home, beside those of the picks.
HOME = -1
#: Times [s] that differ by less are equal.
SAME = 1e-9


class Network:
    """Motions between all picks and throws, with their times."""

    def __init__(self, jobs: Jobs, throws: Sequence[CycleThrow], objects: WaitingObjects) -> None:
        self.jobs, self.throws, self._objects = jobs, throws, objects
        self.picks = [standstill(pick.joints or ()) for pick in jobs.picks]
        self._home = None if jobs.home is None else still(standstill(jobs.home), 0)
        self._approaches = [approach_of(jobs, pick) for pick in jobs.picks]
        self._connections: dict[tuple[int, int], Connection] = {}

    def end_after(self, order: Sequence[int]) -> int:
        """Where a cycle ends: at home, or at its first pick."""
        return order[0] if self._home is None else HOME

    def first(self, pick: int) -> Connection | None:
        """From home to a pick; None where the cycle begins at a pick."""
        if self._home is None:
            return None
        ends = self._approaches[pick].space, self._home, self._ends(pick)
        tests = self._come(pick), self._hit(ends[0], pick)
        return self._kept((HOME, pick), lambda: connection_between(*ends, *tests))

    def enter(self, throw: int) -> Connection:
        """From its pick into a throw."""
        return self._kept((throw, throw), lambda: self.entering(self.throws[throw]))

    def leave(self, throw: int, goal: int) -> Connection:
        """From a throw to a pick, or home."""
        key = len(self.throws) + throw, goal
        return self._kept(key, lambda: self.leaving(self.throws[throw], goal))

    def entering(self, one: CycleThrow) -> Connection:
        """From its pick into any throw."""
        objects = self._objects
        thrown = functools.cache(lambda: objects.hit_by_throw(one.release, one.pick))

        def hit(samples: Samples) -> int:
            return objects.hit(one.space, samples, one.pick, held=True) | thrown()

        return enter_connection(one, self._approaches[one.pick], hit)

    def leaving(self, one: CycleThrow, goal: int) -> Connection:
        """From any throw to a pick, or home."""
        ends = one.space, one.samples[one.free : one.free + 1], self._ends(goal)
        return connection_between(*ends, self._come(goal), self._hit(one.space, goal), one)

    def _hit(self, space: SpatialScene, goal: int) -> Callable[[Samples], int]:
        """The picks whose objects a motion to a pick or home hits with an empty hand."""
        return lambda samples: self._objects.hit(space, samples, goal, held=False)

    def _come(self, pick: int) -> Callable[[Samples], tuple[Finding, ...]]:
        """What a motion to a pick touches there; nothing at home."""
        if pick == HOME:
            return lambda samples: ()
        approach = self._approaches[pick]
        return lambda samples: approach_findings(approach.space, samples, approach.joints)

    def _ends(self, goal: int) -> list[Samples]:
        """Motions to rest at a pick, or home."""
        if goal >= 0:
            return self._approaches[goal].towards
        assert self._home is not None
        return [self._home]

    def _kept(self, key: tuple[int, int], make: Callable[[], Connection]) -> Connection:
        if key not in self._connections:
            self._connections[key] = make()
        return self._connections[key]

    def fastest(self) -> list[int]:
        """Throws in turn of the fastest order whose motions are all allowed.

        Motions are judged only where the fastest order uses them. Where no order lets those pass
        that hit waiting objects, these are replaced. Raises UnsolvedError without an order.
        """
        best, before = self._best_order(), None
        while best != before or not best[1]:
            before = best
            hitting = [way for way in self._connections.values() if way.hits]
            if best[1]:
                for way in self.connections(best[1]):
                    way.settle()
            elif hitting:
                for way in hitting:
                    way.avoid()
            else:
                raise UnsolvedError(self._why())
            best = self._best_order()
        return best[1]

    def _best_order(self) -> tuple[float, list[int]]:
        """Time [s] and throws of the fastest order by motions that are not refused, judged or
        not."""
        waits = np.array([pick.grasp_time for pick in self.jobs.picks])
        picks, numbers = range(len(self.picks)), range(len(self.throws))
        enter, own = [self.enter(c) for c in numbers], np.array([one.pick for one in self.throws])
        leave = [[self.leave(c, p) for p in picks] for c in numbers]
        into = waits[own] + [way.time for way in enter]
        back = np.array([[way.time for way in row] for row in leave])
        enter_hits = np.array([way.hits for way in enter])
        way_hits = np.array([[way.hits for way in row] for row in leave])[:, own] | enter_hits
        hits, step, given = (enter_hits, way_hits), back[:, own] + into, self.jobs.order == "given"
        if self._home is not None:
            ways = [self.first(pick) for pick in picks]
            start = np.array([math.inf if way is None else way.time for way in ways])[own] + into
            start_hits = np.array([0 if way is None else way.hits for way in ways])[own]
            end = np.array([self.leave(c, HOME).time for c in numbers])
            hits = start_hits | enter_hits, way_hits
            return best_order(start, step, end, own, hits, given=given)

        def round_from(pick: int, hits: tuple[Indices, Indices]) -> tuple[float, list[int]]:
            start = np.where(own == pick, into, math.inf)
            return best_order(start, step, back[:, pick], own, hits, given=given)

        # From each of its picks on a round takes as long, but for what waits.
        least, found = round_from(0, (0 * enter_hits, 0 * way_hits))[0], round_from(0, hits)
        for pick in picks[1:] if not given else ():
            if found[0] > least + SAME:
                found = min(found, round_from(pick, hits))
        return found

    def connections(self, chosen: Sequence[int]) -> list[Connection]:
        """The motions through throws in turn: from home, then into and out of each throw."""
        order = [self.throws[c].pick for c in chosen]
        first = self.first(order[0])
        found = [] if first is None else [first]
        for throw, end in zip(chosen, [*order[1:], self.end_after(order)], strict=True):
            found += [self.enter(throw), self.leave(throw, end)]
        return found

    def _why(self) -> str:
        """Why there is no order: the first pick that cannot be thrown or reached."""
        for p, pick in enumerate(self.jobs.picks):
            own = [c for c, one in enumerate(self.throws) if one.pick == p]
            others = [c for c, one in enumerate(self.throws) if one.pick != p] or own
            ways = {"from the pick into a throw": [self.enter(c) for c in own]}
            if self._home is None or len(self.jobs.picks) > 1:
                ways["from a throw to the pick"] = [self.leave(c, p) for c in others]
            for words, each in ways.items():
                if all(way.best is None for way in each):
                    return f"{pick.name}: no motion {words}: {_words(each)}"
        hits = 0
        for way in self._connections.values():
            hits |= way.hit_by_any
        names = [pick.name for p, pick in enumerate(self.jobs.picks) if hits >> p & 1]
        words = f"objects that wait at their picks are in the way: {', '.join(names)}"
        words = words if names else _words(self._connections.values())
        return f"no order of the picks joins all motions: {words}"


def _words(connections: Iterable[Connection]) -> str:
    refused = (way.trouble for way in connections if way.best is None and way.trouble)
    return next(refused, "beyond the arm's limits")
