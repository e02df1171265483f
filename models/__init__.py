"""A rigid bar in the hand and in flight, and motions over time: floats, arrays and CasADi alike.

`release` has the release models and their registry, `robot` the arms. Scenes, files and solvers are
not known here.
"""

from .body import (
    Array,
    Body,
    Contact,
    Flags,
    HandMotion,
    HandSamples,
    HandTrack,
    Indices,
    Value,
    com_twist,
    com_wrench,
    contact_twist,
    held_wrench,
    pivot_wrench,
    sticking_state,
)
from .flight import FlightLaw, FlightState
from .trajectory import MovedHand, Trajectory, low_pass
