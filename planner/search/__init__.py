"""The search for throws: one loop over starts, one attempt from each."""

from .attempts import Exact, Outcome, attempt, error_over, quieted
from .decision_vectors import guess_of, initial_guess_from, remaining_throw, remaining_trajectory
from .feasibility import check_start
from .find import SETTINGS, Search, SearchContext
from .library import Library, Neighbour, Turns
from .move import Corrector, condensed_at, optimum_of
from .nlp_cache import Budget, NlpCache, Task
from .plan_of_search import plan_throw, solved_plan
from .records import Records
from .releases import (
    Releases,
    ReleaseSampler,
    arrival,
    carry,
    flies_past_column,
    highest,
    joined,
    nearest_releases,
    run_up,
    sparse_parents,
    stored_releases,
)
from .starts import Starts
