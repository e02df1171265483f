"""The throw as a nonlinear program: stages, constraints, derivatives and solvers.

A scene section that is absent adds no variable, constraint or parameter: each optional part of a
scene is a term of its own, see `terms`.
"""

from .asked import USUAL, Asked, Margins, Request
from .assembly import nlp_functions, nlp_key
from .layout import FLIGHT_MAX, Block
from .motions import binding_limits, decision_vector, planned_motion, stage_times
from .nlp import BRAKE_SHARE, ThrowNlp, build_nlp
from .solver import GivenUpError, Solution, Solver, watched
from .terms import CUP_MARGIN, PALM_TIMES, PASSING_MARGIN, broken, lower_end
from .window import Window, load_curve, opening_nodes, peak_load, window_of

__all__ = [
    "BRAKE_SHARE",
    "CUP_MARGIN",
    "FLIGHT_MAX",
    "PALM_TIMES",
    "PASSING_MARGIN",
    "USUAL",
    "Asked",
    "Block",
    "GivenUpError",
    "Margins",
    "Request",
    "Solution",
    "Solver",
    "ThrowNlp",
    "Window",
    "binding_limits",
    "broken",
    "build_nlp",
    "decision_vector",
    "load_curve",
    "lower_end",
    "nlp_functions",
    "nlp_key",
    "opening_nodes",
    "peak_load",
    "planned_motion",
    "stage_times",
    "watched",
    "window_of",
]
