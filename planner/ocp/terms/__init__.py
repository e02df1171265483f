"""The constraints of a scene's optional parts.

A new constraint is a subclass of `SceneConstraint` in a file of this folder and an entry of
`TERMS`, which sets the order of the constraints in an NLP.
"""

from ..request import Request
from ..scene_constraint import SceneConstraint
from .arm_limits import SlowingLimits, ToolSpeed, TorqueLimits
from .arrival import LatestArrival
from .cup import CUP_MARGIN, CupClearance, lower_end
from .landing import LandingBounds
from .obstacles import CollisionAvoidance
from .robust import LandingVariance, Quiet, Scenarios
from .workspace import PASSING_MARGIN, Column, Floor, Palm

TERMS: list[type[SceneConstraint]] = [
    SlowingLimits,
    ToolSpeed,
    TorqueLimits,
    Floor,
    CupClearance,
    Palm,
    Column,
    LandingBounds,
    LatestArrival,
    CollisionAvoidance,
    Quiet,
    LandingVariance,
    Scenarios,
]


def constraints_of(request: Request) -> tuple[SceneConstraint, ...]:
    """The scene's constraints of a request."""
    candidates = (kind.of(request) for kind in TERMS)
    return tuple(constraint for constraint in candidates if constraint is not None)
