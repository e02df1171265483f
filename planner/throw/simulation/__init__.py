"""Given motions through release models: a scene's own, recorded joints, or arrays of N."""

from .given_motion import given_hand, planar_joints, recorded_joints
from .releases import Simulation, named_model, simulate, simulate_batch
