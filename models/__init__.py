"""Models of a rigid bar in the hand and in flight, and of motions: for floats, arrays and CasADi.

`__all__` is for users and for the rooms around the heart; the heart itself also takes the laws of
`body.py` from here. This package imports no scenes, files or solvers.
"""

from .backend import Value
from .body import (
    Array,
    Body,
    Flags,
    FlightLaw,
    FlightState,
    HandMotion,
    HandSamples,
    HandTrack,
    Indices,
    PinchContact,
    PinchUse,
    ReadOnly,
    com_twist,
    com_wrench,
    contact_twist,
    held_wrench,
    lowest_point,
    pinch_use,
    pivot_wrench,
    read_only,
    sticking_state,
)
from .release import (
    BATCH_MODELS,
    MODELS,
    SLIDING_PIVOT,
    STEPPED_SURFACE,
    Release,
    ReleaseBatch,
    ReleaseCase,
    ReleaseModel,
    TableGrip,
    chunks,
)
from .surface import SHAPES, SurfaceShape
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
    "ReleaseModel",
    "TableGrip",
    "Trajectory",
    "Value",
    "chunks",
    "low_pass",
]
