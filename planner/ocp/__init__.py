"""The throw as a nonlinear program: stages, constraints, derivatives and solvers.

`problem` states the optimal control problem. Each optional part of a scene has constraints of its
own in `terms`; an absent one adds no variable, constraint or parameter.
"""

from .assembly import nlp_functions
from .nlp import ThrowNlp, build_nlp
from .problem import FLIGHT_MAX, effort_of
from .reduced_qp import CondensedQp, Optimum, ReducedVariables, Step
from .request import (
    BASE,
    CONSTANT_RATES,
    LEAST_LOAD,
    PALM_TIMES,
    SCENARIOS,
    Margins,
    Refinement,
    Request,
    load_curve,
    opening_nodes,
    peak_load,
    window_of,
)
from .scene_constraint import BRAKE_SHARE
from .solver import Solution, Solver, TimeLimitError, WarmStart, processor_time, run_limited
from .stages import TURN, Block, Layout
from .terms.landing import CUP_MARGINS, lower_end
from .terms.workspace import PASSING_MARGIN
