"""Models of a rigid bar in the hand and in flight, and of motions: for floats, arrays and CasADi.

`release_dynamics`, `limit_surface_step` and `flight` give them as CasADi functions. `release` has
the release models and their registry, `robot` the arms. This package imports no scenes, files or
solvers.
"""

from .body import (
    Array,
    Body,
    Contact,
    Flags,
    FlightLaw,
    FlightState,
    HandMotion,
    HandSamples,
    HandTrack,
    Indices,
    PinchUse,
    ReadOnly,
    held_wrench,
    lowest_point,
    pinch_use,
    pivot_wrench,
    read_only,
    sticking_state,
)
from .functions import flight, limit_surface_step, release_dynamics
from .surface import SurfaceShape
from .trajectory import MovedHand, Trajectory, low_pass
