"""The throw as a nonlinear program: stages, constraints, derivatives and solvers.

A scene section that is absent adds no variable, constraint or parameter.
"""

from .asked import HEAVY, USUAL, Asked, Margins
from .context import JERK_UNIT
from .derivatives import nlp_functions, nlp_key
from .nlp import ThrowNlp, build_nlp
from .numbers import (
    BRAKE_SHARE,
    CUP_ROOM,
    FLIGHT_MAX,
    PASSING_ROOM,
    bounds,
    lower_end,
    opening_nodes,
    parameter_values,
    structure_of,
    with_accelerations,
)
from .quietness import load_curve, peak_load
from .solution import opening_start, planned_motion, stage_times
from .solver import Solution, Solver
from .window import Window, window_of

__all__ = [
    "BRAKE_SHARE",
    "CUP_ROOM",
    "FLIGHT_MAX",
    "HEAVY",
    "JERK_UNIT",
    "PASSING_ROOM",
    "USUAL",
    "Asked",
    "Margins",
    "Solution",
    "Solver",
    "ThrowNlp",
    "Window",
    "bounds",
    "build_nlp",
    "load_curve",
    "lower_end",
    "nlp_functions",
    "nlp_key",
    "opening_nodes",
    "opening_start",
    "parameter_values",
    "peak_load",
    "planned_motion",
    "stage_times",
    "structure_of",
    "window_of",
    "with_accelerations",
]
