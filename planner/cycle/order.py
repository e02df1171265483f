"""The order of picks and the throw of each in the least time: dynamic programming.

Only the last throw and the set of picks that are done matter for what comes next. Up to `EXACT`
picks all orders are compared; of more, an order grows by the cheapest insertion and is improved by
reversals of its parts, its throws always chosen exactly.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models import Array

#: Largest number of picks of which all orders are compared.
EXACT = 10


@dataclass(frozen=True)
class Times:
    """Times [s] of P picks and C throws, infinite where something is not possible.

    first (P,): from the start of the cycle to holding a pick's object. enter (P, C): from there
    until the throw has left the hand. leave (C, P): from then to holding the next object; last
    (C,): to the end of the cycle.
    """

    first: Array
    enter: Array
    leave: Array
    last: Array

    def least_time(self, order: Sequence[int]) -> tuple[float, list[int]]:
        """The least time of picks in this order, and the throw of each."""
        time = self.first[order[0]] + self.enter[order[0]]
        before = list[Array]()
        for pick in order[1:]:
            to_here = time + self.leave[:, pick]
            before.append(to_here.argmin())
            time = to_here.min() + self.enter[pick]
        total = time + self.last
        throws = [int(total.argmin())]
        for choice in reversed(before):
            throws.append(int(choice))
        return float(total.min()), throws[::-1]


def best_order(times: Times, begin: int | None) -> tuple[float, list[int], list[int]]:
    """Time [s], picks and throws of the fastest order; begin: the first pick, None for any."""
    count = len(times.first)
    if count > EXACT:
        order = _inserted(times, begin)
        return times.least_time(order)[0], order, times.least_time(order)[1]
    # By the set of picks that are done, as bits: the least time for each last throw (C,), and the
    # pick and the throw before it.
    done: dict[int, Array] = {}
    came: dict[int, list[tuple[int, int]]] = {}
    throws = len(times.last)
    for pick in range(count) if begin is None else (begin,):
        done[1 << pick] = times.first[pick] + times.enter[pick]
        came[1 << pick] = [(pick, -1)] * throws
    for chosen in range(1, 1 << count):
        if chosen not in done:
            continue
        for pick in (p for p in range(count) if not chosen >> p & 1):
            to_here = done[chosen] + times.leave[:, pick]
            last, both = int(to_here.argmin()), chosen | 1 << pick
            found = to_here[last] + times.enter[pick]
            old = done.setdefault(both, np.full(throws, np.inf))
            way = came.setdefault(both, [(-1, -1)] * throws)
            for throw in np.flatnonzero(found < old).tolist():
                old[throw], way[throw] = found[throw], (pick, last)
    chosen = (1 << count) - 1
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


def _inserted(times: Times, begin: int | None) -> list[int]:
    """An order by cheapest insertion, improved by reversals of its parts."""
    count = len(times.first)
    order = [0 if begin is None else begin]
    low = 0 if begin is None else 1
    left = [pick for pick in range(count) if pick not in order]
    while left:
        ways = [[*order[:k], pick, *order[k:]] for pick in left for k in range(low, len(order) + 1)]
        order = min(ways, key=lambda way: times.least_time(way)[0])
        left = [pick for pick in left if pick not in order]
    best = times.least_time(order)[0]
    better = True
    while better:
        better = False
        for a, b in itertools.combinations(range(low, count + 1), 2):
            way = [*order[:a], *order[a:b][::-1], *order[b:]]
            time = times.least_time(way)[0]
            if time < best - 1e-9:
                order, best, better = way, time, True
    return order
