"""The motions between picks and throws, and the fastest way through them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ...models import Array
from ...problems import Jobs
from ..throw import State
from .connections import Connection, CycleThrow, at_rest, leave_connection, rest_connection
from .cycle import UnsolvedError
from .entrance import enter_connection
from .order import Times, best_order


class Network:
    """Motions between all picks and throws, with their times."""

    def __init__(self, jobs: Jobs, throws: Sequence[CycleThrow]) -> None:
        self.jobs, self.throws = jobs, throws
        self.picks = [at_rest(pick.joints or ()) for pick in jobs.picks]
        self.home = None if jobs.home is None else at_rest(jobs.home)
        self._connections: dict[tuple[object, ...], Connection] = {}

    def first(self, pick: int) -> Connection | None:
        """From home to a pick; None where the cycle begins at a pick."""
        if self.home is None:
            return None
        home, goal, space = self.home, self.picks[pick], self.throws[0].space
        return self._connection(
            ("first", pick), lambda: rest_connection(space, home, goal, held=False)
        )

    def enter(self, pick: int, throw: int, *, stop: bool = False) -> Connection:
        """From a pick into a throw; stop: to rest at the throw's start."""
        one, start = self.throws[throw], self.picks[pick]
        if stop:
            goal = at_rest(one.samples.q[0])
            return self._connection(
                ("enter at rest", pick, throw),
                lambda: rest_connection(one.space, start, goal, held=True),
            )
        return self._connection(("enter", pick, throw), lambda: enter_connection(one, start))

    def leave(self, throw: int, goal: int, *, stop: bool = False) -> Connection:
        """From a throw to a pick, or to home for -1; stop: from rest after the throw's brake."""
        one, end = self.throws[throw], self.end(goal)
        if stop:
            start = at_rest(one.samples.q[-1])
            return self._connection(
                ("leave at rest", throw, goal),
                lambda: rest_connection(one.space, start, end, held=False),
            )
        return self._connection(("leave", throw, goal), lambda: leave_connection(one, end))

    def end(self, goal: int) -> State:
        """A pick at rest, or home for -1."""
        found = self.picks[goal] if goal >= 0 else self.home
        assert found is not None
        return found

    def _connection(self, key: tuple[object, ...], make: Callable[[], Connection]) -> Connection:
        if key not in self._connections:
            self._connections[key] = make()
        return self._connections[key]

    def _times(self, begin: int) -> Times:
        """Times of all motions: of the fastest one of each that is not refused, judged or not."""
        picks, throws = range(len(self.picks)), range(len(self.throws))
        waits = np.array([pick.grasp_time for pick in self.jobs.picks])
        enter: Array = np.full((len(picks), len(throws)), np.inf)
        for p in picks:
            for c in throws:
                if self.throws[c].pick == p:
                    enter[p, c] = self.enter(p, c).time
        leave = np.array([[self.leave(c, p).time for p in picks] for c in throws]) + waits
        connections = [self.first(p) for p in picks]
        first = (
            np.array([0.0 if connection is None else connection.time for connection in connections])
            + waits
        )
        end = -1 if self.home is not None else begin
        last = np.array([self.leave(c, end).time for c in throws])
        return Times(first, enter, leave, last)

    def fastest(self) -> tuple[list[int], list[int]]:
        """Picks and throws of the fastest order whose motions are all allowed.

        Motions are judged only where the fastest order uses them. Raises UnsolvedError without one.
        """
        given = list(range(len(self.picks))) if self.jobs.order == "given" else None
        begin = 0 if self.home is None else None
        while True:
            times = self._times(0)
            if given is not None:
                total, chosen = times.least_time(given)
                order = given
            else:
                total, order, chosen = best_order(times, begin)
            if not math.isfinite(total):
                raise UnsolvedError(self._why())
            stay = [connection.settle() for connection in self.connections(order, chosen)]
            if all(stay):
                return order, chosen

    def connections(
        self, order: Sequence[int], chosen: Sequence[int], *, stop: bool = False
    ) -> list[Connection]:
        """The motions of an order, in turn: from home, then into and out of each throw."""
        first = self.first(order[0])
        found = [] if first is None else [first]
        ends = [*order[1:], -1 if self.home is not None else order[0]]
        for pick, throw, end in zip(order, chosen, ends, strict=True):
            found += [self.enter(pick, throw, stop=stop), self.leave(throw, end, stop=stop)]
        return found

    def with_stops(self, order: Sequence[int], chosen: Sequence[int]) -> float:
        """Time [s] of the same throws one after another, each from rest to rest."""
        connections = self.connections(order, chosen, stop=True)
        for connection in connections:
            connection.settle()
        swings = sum(float(self.throws[c].throw.samples.times[-1]) for c in chosen)
        waits = sum(pick.grasp_time for pick in self.jobs.picks)
        return sum(connection.time for connection in connections) + swings + waits

    def _why(self) -> str:
        """Why there is no order: the first pick that cannot be thrown or reached."""
        refused, numbers = list[Connection](), range(len(self.throws))
        for p, pick in enumerate(self.jobs.picks):
            own = [c for c in numbers if self.throws[c].pick == p]
            ways = [self.enter(p, c) for c in own]
            if all(connection.best is None for connection in ways):
                return f"{pick.name}: no motion from the pick into a throw: {_words(ways)}"
            # The way back from its own throw to a pick is used if there is no other.
            back = [self.leave(c, p) for c in numbers if c not in own or len(own) == len(numbers)]
            is_end = self.home is None or len(self.jobs.picks) > 1
            if is_end and all(connection.best is None for connection in back):
                return f"{pick.name}: no motion from a throw to the pick: {_words(back)}"
            refused += (each for each in (*ways, *back) if each.best is None)
        if self.home is not None:
            ends = [self.leave(c, -1) for c in numbers]
            if all(connection.best is None for connection in ends):
                return f"no motion from a throw to home: {_words(ends)}"
            refused += (each for each in ends if each.best is None)
        return f"no order of the picks joins all motions: {_words(refused)}"


def _words(connections: Sequence[Connection]) -> str:
    return next(
        (connection.trouble for connection in connections if connection.trouble),
        "beyond the arm's limits",
    )
