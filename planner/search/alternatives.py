"""Several throws to one target: which of them differ, and which is best."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...problems import Pose
from ..result import PlannedThrow
from .scatter import scatter

#: Throws differ when, at the opening's start, their coordinates or rates are this far
#: apart, as a share of the larger of the two ...
SHARE = 0.1
#: ... or their flights by this much [s].
FLIGHT = 0.05


@dataclass(frozen=True)
class Found:
    """A throw that was found, the target (turns counted) that it was for, and its solver."""

    goal: Pose
    thrown: PlannedThrow
    solver: str


def _release(found: Found) -> tuple[np.ndarray, np.ndarray, float]:
    """Coordinates and rates at the opening's start, and the flight time."""
    q, dq, _ = found.thrown.planned.at(np.array([found.thrown.opening_time]))
    return q[:, 0], dq[:, 0], found.thrown.final.landing.flight_time


def _differ(one: Found, other: Found) -> bool:
    (q1, dq1, t1), (q2, dq2, t2) = _release(one), _release(other)
    apart = np.linalg.norm(q1 - q2) > SHARE * max(np.linalg.norm(q1), np.linalg.norm(q2))
    faster = np.linalg.norm(dq1 - dq2) > SHARE * max(np.linalg.norm(dq1), np.linalg.norm(dq2))
    return bool(apart or faster or abs(t1 - t2) > FLIGHT)


def distinct(found: list[Found]) -> list[Found]:
    """The throws that differ from all before them, cheapest first."""
    kept: list[Found] = []
    for one in sorted(found, key=CRITERIA["effort"]):
        if all(_differ(one, other) for other in kept):
            kept.append(one)
    return kept


#: What a scene's [choice] may ask for the least of.
CRITERIA: dict[str, Callable[[Found], float]] = {
    "effort": lambda found: found.thrown.solution.cost,
    "time": lambda found: found.thrown.landing_time,
    "robustness": lambda found: scatter(found.thrown, found.goal),
}


def ordered(found: list[Found], by: str) -> list[Found]:
    """The throws, best first."""
    return sorted(found, key=CRITERIA[by])
