"""The constraints of a scene's optional parts.

A new constraint is a subclass of `SceneConstraint` in a file of this folder and an entry of
`TERMS`, which sets the order of the constraints in an NLP.
"""

from ..scene_constraint import SceneConstraint
from . import arm_limits, landing, obstacles, own, robust, workspace

TERMS: list[type[SceneConstraint]] = [
    arm_limits.SlowingLimits,
    arm_limits.ToolSpeed,
    arm_limits.TorqueLimits,
    workspace.Floor,
    landing.CupClearance,
    landing.BinClearance,
    workspace.Palm,
    workspace.Column,
    landing.LandingBounds,
    landing.SoftLanding,
    landing.LatestArrival,
    obstacles.CollisionAvoidance,
    own.Own,
    robust.Quiet,
    robust.LandingVariance,
    robust.Scenarios,
]
