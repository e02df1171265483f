"""Models of a rigid bar in the hand and in flight, and of motions: for floats, arrays and CasADi.

`release` has the release models and their registry, `robot` the arms. This package imports no
scenes, files or solvers.
"""

from .backend import Value
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
from .surface import SHAPES, SurfaceShape
from .trajectory import MovedHand, Trajectory, low_pass
