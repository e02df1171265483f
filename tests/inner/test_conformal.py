"""Fails if the conformal region leaves out what its definition, written anew with loops, holds."""

from __future__ import annotations

import math

import numpy as np
import pytest
from throwplan.lab import conformal_region


def belongs(candidate: np.ndarray, known: np.ndarray, level: float) -> bool:
    """Whether at most k - 1 of the N measured scores are below the candidate's."""
    everything = [*known.tolist(), candidate.tolist()]
    scores = []
    for row in everything:
        parts = []
        for i, value in enumerate(row):
            column = [other[i] for other in everything]
            mean = sum(column) / len(column)
            spread = math.sqrt(sum((v - mean) ** 2 for v in column) / len(column))
            parts.append(abs(value - mean) / spread)
        scores.append(max(parts))
    below = sum(score < scores[-1] for score in scores[:-1])
    return below < math.ceil(level * len(everything) - 1e-9)


@pytest.mark.parametrize(("count", "level"), [(20, 0.9), (5, 0.6)])
def test_the_box_holds_every_candidate_of_the_region_and_little_more(count: int, level: float):
    rng = np.random.default_rng(count)
    known = rng.standard_t(4, (count, 2)) * [0.02, 0.1] + [0.05, -0.3]
    half = conformal_region(known, level)
    middle = known.mean(axis=0)
    candidates = middle + rng.uniform(-2.0, 2.0, (1000, 2)) * half
    inside = np.array([belongs(one, known, level) for one in candidates])
    away = np.abs(candidates - middle) / half
    assert (away[inside] <= 1.0).all()
    # In either component some candidate of the region is near the box's side.
    assert (away[inside].max(axis=0) > 0.85).all()
    assert inside.mean() > 0.15


def test_the_region_knows_neither_order_nor_units_nor_origin():
    known = np.random.default_rng(3).normal(size=(14, 2))
    half = conformal_region(known, 0.9)
    assert conformal_region(known[::-1], 0.9) == pytest.approx(half, rel=1e-9)
    assert conformal_region(1e3 * known + 7.0, 0.9) == pytest.approx(1e3 * half, rel=1e-6)
    assert conformal_region(known[:, ::-1], 0.9) == pytest.approx(half[::-1], rel=1e-9)
