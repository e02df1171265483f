"""Optional parts of a scene, each whole: its rows in the NLP, its numbers, its check.

A new term is a class in a file here and an entry of `TERMS`; rows come in this order.
"""

from ...check import Throw, Violation, throw_violations
from ..asked import Request
from ..context import Term
from .arrival import LatestArrival
from .cup import CUP_MARGIN, CupClearance, lower_end
from .joint_limits import SlowingLimits, TorqueLimits
from .landing import LandingBounds
from .obstacles import Clear
from .robust import Quiet, Scenarios
from .tool_speed import ToolSpeed
from .workspace import PALM_TIMES, PASSING_MARGIN, Column, Floor, Palm

TERMS: list[type[Term]] = [
    SlowingLimits,
    ToolSpeed,
    TorqueLimits,
    Floor,
    CupClearance,
    Palm,
    Column,
    LandingBounds,
    LatestArrival,
    Clear,
    Quiet,
    Scenarios,
]


def terms_of(request: Request) -> tuple[Term, ...]:
    """The terms of a request."""
    found = (kind.of(request) for kind in TERMS)
    return tuple(term for term in found if term is not None)


def broken(throw: Throw) -> list[Violation]:
    """What a throw breaks of the grip and of its scene's terms; empty if nothing."""
    found = throw_violations(throw)
    if throw.lands:
        for term in terms_of(Request(throw.scene, throw.mover)):
            found += term.broken(throw)
    return found
