"""The order of picks and the throw of each in the least time: dynamic programming.

Only the last throw and the set of picks that are done matter for what comes next: the others wait
at their picks, and motions that would hit them are none.
"""

from __future__ import annotations

import numpy as np

from ..models import Array, Indices


def best_order(
    start: Array,
    way: Array,
    end: Array,
    picks: Indices,
    hits: tuple[Indices, Indices],
    *,
    given: bool,
) -> tuple[float, list[int]]:
    """Time [s] and throws in turn of the fastest order that takes each pick once.

    Times [s] of C throws, infinite where something is not possible. start (C,): from the start of
    the cycle until the throw has left the hand; way (C, C): from a throw to the next one; end (C,):
    from the last throw to the end of the cycle. picks (C,): number of each throw's pick. hits:
    for start (C,) and way (C, C) the picks whose objects they hit, as bits. given: only picks in
    the order of their numbers.
    """
    count = int(picks.max()) + 1
    everything = (1 << count) - 1
    # By the set of picks that are done, as bits: the least time for each last throw (C,), and the
    # throw before it.
    done, before = dict[int, Array](), dict[int, Indices]()
    start = np.where(hits[0] & everything & ~(1 << picks), np.inf, start)
    for pick in range(1 if given else count):
        done[1 << pick] = np.where(picks == pick, start, np.inf)
    for chosen in (2**n - 1 for n in range(1, count)) if given else range(1, everything):
        if chosen not in done:
            continue
        waiting = everything & ~chosen & ~(1 << picks)
        times = np.where(hits[1] & waiting, np.inf, done[chosen][:, None] + way)
        last, least = times.argmin(axis=0), times.min(axis=0)
        nexts = [chosen.bit_length()] if given else range(count)
        for pick in (p for p in nexts if not chosen >> p & 1):
            both, own = chosen | 1 << pick, picks == pick
            old = done.get(both, np.full(len(picks), np.inf))
            done[both] = np.where(own, least, old)
            before[both] = np.where(own, last, before.get(both, last))
    total = done[everything] + end
    if not np.isfinite(total.min()):
        return np.inf, []
    order, chosen = [int(total.argmin())], everything
    while chosen in before:
        throw = order[-1]
        order.append(int(before[chosen][throw]))
        chosen &= ~(1 << int(picks[throw]))
    return float(total.min()), order[::-1]
