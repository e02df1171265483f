"""Several throws to one target: which of them differ, and which is best."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from ...problems import Pose
from ..ocp import window_of
from ..result import PlannedThrow
from .attempt import Attempt

#: Throws differ when, at the opening's start, their coordinates or rates are this far
#: apart, as a share of the larger of the two ...
SHARE = 0.1
#: ... or their flights by this much [s].
FLIGHT = 0.05


def _release(found: Attempt) -> tuple[np.ndarray, np.ndarray, float]:
    """Coordinates and rates at the opening's start, and the flight time."""
    thrown = _throw_of(found)
    q, dq, _ = thrown.planned.at(np.array([thrown.opening_time]))
    return q[:, 0], dq[:, 0], thrown.final.landing.flight_time


def _throw_of(found: Attempt) -> PlannedThrow:
    assert found.throw is not None
    return found.throw


def _differ(one: Attempt, other: Attempt) -> bool:
    (q1, dq1, t1), (q2, dq2, t2) = _release(one), _release(other)
    apart = np.linalg.norm(q1 - q2) > SHARE * max(np.linalg.norm(q1), np.linalg.norm(q2))
    faster = np.linalg.norm(dq1 - dq2) > SHARE * max(np.linalg.norm(dq1), np.linalg.norm(dq2))
    return bool(apart or faster or abs(t1 - t2) > FLIGHT)


def distinct(found: list[Attempt]) -> list[Attempt]:
    """The throws that differ from all before them, cheapest first."""
    kept: list[Attempt] = []
    for one in sorted(found, key=CRITERIA["effort"]):
        if all(_differ(one, other) for other in kept):
            kept.append(one)
    return kept


#: What a scene's [choice] may ask for the least of.
CRITERIA: dict[str, Callable[[Attempt], float]] = {
    "effort": lambda found: _throw_of(found).solution.cost,
    "time": lambda found: _throw_of(found).landing_time,
    "robustness": lambda found: scatter(_throw_of(found), found.start.goal),
}


def ordered(found: list[Attempt], by: str) -> list[Attempt]:
    """The throws, best first."""
    return sorted(found, key=CRITERIA[by])


def scatter(thrown: PlannedThrow, target: Pose) -> float:
    """Largest scaled error [m] about the throw's own landing over the window's delays.

    Exact throws of the motion that counts; infinite if one never comes down to the target's
    height. target: says whether theta counts.
    """
    scene = thrown.scene
    base, worst = thrown.final.landing, 0.0
    for delay in window_of(scene).delays:
        found = thrown.final.sliding_pivot.delayed(float(delay)).landing
        turn = 0.0 if target.theta is None else found.theta - base.theta
        error = abs(found.x - base.x) + abs(turn) * scene.object.length / 2
        worst = max(worst, error if math.isfinite(error) else math.inf)
    return worst
