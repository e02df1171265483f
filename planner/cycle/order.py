"""The order of picks and the throw of each in the least time: dynamic programming.

Only the last throw and the set of picks that are done matter for what comes next: the others wait
at their picks, and motions that would hit them take another way.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ...models import Array

#: Times [s] that differ by less are equal.
SAME = 1e-9


#: A throw, the time [s] of its motion while a set of picks waits, and the time of the grasp.
Passing = tuple[int, Callable[[int], float], float]


@dataclass(frozen=True)
class Times:
    """Times [s] of P picks and C throws, infinite where something is not possible.

    first (P,): from the start of the cycle to holding a pick's object. enter (P, C): from there
    until the throw has left the hand. leave (C, P): from then to holding the next object; last
    (C,): to the end of the cycle. passing_enter, passing_leave: motions whose time depends on the
    objects that wait: by pick (that is left, or comes next) the throw, the time while a set of
    picks waits (1 << k has pick k), and that of the grasp.
    """

    first: Array
    enter: Array
    leave: Array
    last: Array
    passing_enter: Mapping[int, Sequence[Passing]]
    passing_leave: Mapping[int, Sequence[Passing]]

    def ending_at(self, begin: int) -> Times:
        """Times of orders that end at rest at this pick, with an empty hand."""
        first = np.full_like(self.first, np.inf)
        first[begin] = self.first[begin]
        last = self.leave[:, begin] - self.first[begin]
        return dataclasses.replace(self, first=first, last=last)

    def enter_from(self, pick: int, waiting: int) -> Array:
        """Times (C,) from a pick into all throws, while these wait."""
        return _changed(self.enter[pick], self.passing_enter.get(pick, ()), waiting)

    def leave_to(self, pick: int, waiting: int) -> Array:
        """Times (C,) from all throws to a pick, while these wait."""
        return _changed(self.leave[:, pick], self.passing_leave.get(pick, ()), waiting)

    def least_time(self, order: Sequence[int]) -> tuple[float, list[int]]:
        """The least time of picks in this order, and the throw of each."""
        waiting = sum(1 << pick for pick in order[1:])
        time = self.first[order[0]] + self.enter_from(order[0], waiting)
        before = list[Array]()
        for pick in order[1:]:
            waiting &= ~(1 << pick)
            to_here = time + self.leave_to(pick, waiting)
            before.append(to_here.argmin())
            time = to_here.min() + self.enter_from(pick, waiting)
        total = time + self.last
        throws = [int(total.argmin())]
        for choice in reversed(before):
            throws.append(int(choice))
        return float(total.min()), throws[::-1]


def _changed(times: Array, passing: Sequence[Passing], waiting: int) -> Array:
    """Times (C,) with those of motions that pass waiting objects."""
    if not passing or not waiting:
        return times
    found = times.copy()
    for throw, time, grasp in passing:
        found[throw] = time(waiting) + grasp
    return found


def best_round(times: Times) -> tuple[float, list[int], list[int]]:
    """Time [s], picks and throws of the fastest order that ends at its first pick; `times.last` is
    left out.

    Without waiting objects it is the same from any pick on.
    """
    free = dataclasses.replace(times, passing_enter={}, passing_leave={})
    least = best_order(free.ending_at(0), 0)[0]
    found = math.inf, list(range(len(times.first))), list[int]()
    for begin in range(len(times.first)):
        other = best_order(times.ending_at(begin), begin)
        if other[0] < found[0] - SAME:
            found = other
        if found[0] <= least + SAME:
            break
    return found


def best_order(times: Times, begin: int | None = None) -> tuple[float, list[int], list[int]]:
    """Time [s], picks and throws of the fastest order; begin: the first pick, None for any."""
    count = len(times.first)
    # By the set of picks that are done, as bits: the least time for each last throw (C,), and the
    # pick and the throw before it.
    done: dict[int, Array] = {}
    came: dict[int, list[tuple[int, int]]] = {}
    throws, everything = len(times.last), (1 << count) - 1
    for pick in range(count) if begin is None else (begin,):
        done[1 << pick] = times.first[pick] + times.enter_from(pick, everything & ~(1 << pick))
        came[1 << pick] = [(pick, -1)] * throws
    for chosen in range(1, 1 << count):
        if chosen not in done:
            continue
        for pick in (p for p in range(count) if not chosen >> p & 1):
            both = chosen | 1 << pick
            waiting = everything & ~both
            to_here = done[chosen] + times.leave_to(pick, waiting)
            last = int(to_here.argmin())
            found = to_here[last] + times.enter_from(pick, waiting)
            old = done.setdefault(both, np.full(throws, np.inf))
            way = came.setdefault(both, [(-1, -1)] * throws)
            for throw in np.flatnonzero(found < old).tolist():
                old[throw], way[throw] = found[throw], (pick, last)
    chosen = everything
    total = done[chosen] + times.last
    throw, order, found_throws = int(total.argmin()), list[int](), list[int]()
    if not np.isfinite(total[throw]):
        return np.inf, list(range(count)), []
    while chosen:
        pick, before = came[chosen][throw]
        order.append(pick)
        found_throws.append(throw)
        chosen, throw = chosen & ~(1 << pick), before
    return float(total.min()), order[::-1], found_throws[::-1]
