"""Given motions through release models: a scene's own, recorded joints, or arrays of N."""

from .releases import (
    Simulation,
    given_hand,
    named_model,
    planar_joints,
    recorded_joints,
    simulate,
    simulate_batch,
)
