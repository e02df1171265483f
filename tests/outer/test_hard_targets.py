"""Targets that a search from nothing missed once: few sampled throws lead to them."""

from __future__ import annotations

import pytest
import throwplan as tp

pytestmark = pytest.mark.slow

#: Scene, x [m] and theta [rad] of targets in reach.
SOLVED = """
cup -1.1537 2.18760
cup -1.1291 2.23053
cup 0.4034 0.97197
cup -0.932 2.18899
cup 0.6162 0.74700
cup 1.25 -1.57080
cup -0.25523 1.48108
cup -0.44076 2.14295
cup -0.74854 2.13982
cup 1.11923 1.69438
cup 1.0936 0.9598
near-cup -0.735 4.50993
pose 1.248871172 2.412940836
pose 0.17546259 -1.85285
hand-flip 2.5071 -8.222
hand-flip 3.8149 15.3616
hand-flip 1.3534 19.1243
hand-flip -1.1685 19.1444
flip 0.5458 -3.10556
flip 0.4582 -3.51109
flip -0.2481 1.88772
fr3 0.677 -3.35698
fr3 0.53 4.984
fr3 0.352 3.486
"""


@pytest.mark.parametrize("row", SOLVED.strip().splitlines())
def test_a_target_that_few_samples_lead_to_is_solved(row: str) -> None:
    scene, x, theta = row.split()
    planner = tp.Planner(scene, library=False)
    plan = planner.plan(planner.scene.target.in_plane(float(x), float(theta)), patience=60.0)
    assert plan.solved, plan.message


@pytest.mark.parametrize(
    ("scene", "x", "theta", "within"),
    # Into this cup the bar's other end goes first. At the target's x limits hold throws 0.2 m off.
    [("cup", 1.448, 1.3, 0.1), ("flip", 0.161, 3.32, 0.15)],
)
def test_what_is_named_nearest_is_not_the_next_best(scene, x, theta, within) -> None:
    planner, other = (tp.Planner(scene, library=False) for _ in range(2))
    target = planner.scene.target.in_plane(x, theta)
    plan = planner.plan(target, patience=60.0)
    assert plan.status == "out_of_reach", plan.message
    assert target.distance(plan.nearest, planner.scene.object.half_length) < within
    assert other.plan(plan.nearest, patience=60.0).solved
