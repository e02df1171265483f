"""The throw as a nonlinear program: stages, constraints, derivatives and solvers.

`problem` states the optimal control problem. Each optional part of a scene has constraints of its
own in `terms`; an absent one adds no variable, constraint or parameter.
"""

from .assembly import nlp_functions
from .condensed import CondensedQp, Step
from .lazy_constraints import BASE, PALM_TIMES, Margins, Refinement
from .nlp import ThrowNlp, build_nlp
from .reduced_variables import Optimum, ReducedVariables
from .request import Request, load_curve, opening_nodes, peak_load, window_of
from .scene_constraint import BRAKE_SHARE
from .solver import Solution, Solver, TimeLimitError, WarmStart, processor_time, run_limited
from .terms import CUP_MARGIN, PASSING_MARGIN, lower_end
from .variables import FLIGHT_MAX, Block
