"""The throw as a nonlinear program: stages, constraints, derivatives and solvers.

A scene section that is absent adds no variable, constraint or parameter: each optional part of a
scene is a term of its own, see `terms`.
"""

from .asked import USUAL, Asked, Margins, Request
from .assembly import nlp_functions, nlp_key
from .condensed import Condensed, Step
from .context import BRAKE_SHARE
from .controls import Controls, Optimum
from .layout import FLIGHT_MAX, Block
from .motions import binding_limits, decision_vector, planned_motion
from .nlp import ThrowNlp, build_nlp
from .solver import GivenUpError, Solution, Solver, processor_time, watched
from .terms import CUP_MARGIN, PALM_TIMES, PASSING_MARGIN, broken, lower_end
from .window import Window, load_curve, opening_nodes, peak_load, window_of
