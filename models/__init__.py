"""Models of a rigid bar in the hand and in flight, and of motions: for floats, arrays and CasADi.

`release_dynamics`, `limit_surface_step` and `flight` give them as CasADi functions. `release` has
the release models and their registry, `robot` the arms. `__all__` is for users and for the rooms
around the heart; the heart itself also takes the laws of `body.py` from here. This package imports
no scenes, files or solvers.
"""

from .body import (
    Array,
    Body,
    Flags,
    HandMotion,
    HandSamples,
    HandTrack,
    Indices,
    PinchContact,
    PinchUse,
    ReadOnly,
    held_wrench,
    lowest_point,
    pinch_use,
    pivot_wrench,
    read_only,
    sticking_state,
)
from .flight import FlightLaw, FlightState
from .functions import flight, limit_surface_step, release_dynamics
from .release import (
    BATCH_MODELS,
    MODELS,
    SLIDING_PIVOT,
    STEPPED_SURFACE,
    Release,
    ReleaseBatch,
    ReleaseCase,
    ReleaseModel,
    SlidingPivot,
    TableGrip,
    chunks,
)
from .surface import SurfaceShape
from .trajectory import MovedHand, Trajectory, low_pass

__all__ = [
    "BATCH_MODELS",
    "MODELS",
    "SLIDING_PIVOT",
    "STEPPED_SURFACE",
    "Array",
    "Body",
    "Flags",
    "FlightLaw",
    "FlightState",
    "HandMotion",
    "HandSamples",
    "HandTrack",
    "Indices",
    "PinchContact",
    "ReadOnly",
    "Release",
    "ReleaseBatch",
    "ReleaseCase",
    "SlidingPivot",
    "TableGrip",
    "Trajectory",
    "flight",
    "limit_surface_step",
    "low_pass",
    "release_dynamics",
]
