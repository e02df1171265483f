"""The search for throws: strategies give the next try from the history of tries."""

from .approach import approach_goal
from .attempt import Attempt, Start, attempts, error_over
from .candidates import Candidates, release_start
from .context import SearchContext, agree
from .continuation import SqpContinuation
from .feasibility import check_start
from .guess import guess_of, initial_guess_from, remaining_throw, remaining_trajectory
from .history import Approach, Entry, History, Solve
from .loop import find_throws
from .move import Corrector, condensed_at, fixed_optimum, optimum_of
from .nlp_cache import Clock, NlpCache, Task
from .search import Search
from .strategies import FROM_NOTHING, FROM_THROWS, from_warm_plan
