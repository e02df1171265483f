"""Fails if some order of picks that hits nothing is faster than the one found."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from throwplan.cycles.order import best_order


@pytest.mark.parametrize("given", [False, True])
def test_no_order_that_hits_nothing_is_faster(given: bool) -> None:
    """Of 40 random sets of times; some motions are impossible, some hit objects that wait."""
    random, solved = np.random.default_rng(0), 0
    for _ in range(40):
        count = int(random.integers(1, 5))
        picks = np.append(np.arange(count), random.integers(0, count, 3))
        throws = len(picks)
        start, way, end = (
            random.random(throws),
            random.random((throws, throws)),
            random.random(throws),
        )
        way[random.random(way.shape) < 0.5] = np.inf
        hits = tuple(
            np.where(random.random(shape) < 0.6, random.integers(0, 1 << count, shape), 0)
            for shape in (start.shape, way.shape)
        )
        least = math.inf
        for order in itertools.permutations(range(count)):
            if given and order != tuple(range(count)):
                continue
            for chosen in itertools.product(*(np.flatnonzero(picks == pick) for pick in order)):
                waits = [sum(1 << pick for pick in order[k + 1 :]) for k in range(count)]
                time = start[chosen[0]] + end[chosen[-1]]
                met = hits[0][chosen[0]] & waits[0]
                for pair, waiting in zip(itertools.pairwise(chosen), waits[1:], strict=True):
                    time, met = time + way[pair], met | hits[1][pair] & waiting
                least = min(least, math.inf if met else time)
        total, found = best_order(start, way, end, picks, hits, given=given)
        assert total == pytest.approx(least)
        assert sorted(picks[found]) == list(range(count if math.isfinite(least) else 0))
        solved += bool(found)
    assert 10 < solved < 40
