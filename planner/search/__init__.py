"""Where solves start and how they go on: release table, solved throws, corrections.

Also answers what is the nearest landing possible, and which limits bind there.
"""

from .alternatives import Found, distinct, ordered
from .answers import failed_plan, solved_plan
from .correction import Problem, Search, attempt
from .from_release import from_release
from .guess import guess_from
from .nearest_possible import Reach, highest
from .refit import refit
from .release_cache import stored as release_cache_stored
from .release_room import flies_past_column
from .releases import Releases, ReleaseSampler, joined
from .run_up import polynomial, run_up
from .scatter import scatter
from .solved_throws import SolvedThrow, SolvedThrows, targets
from .solved_throws import stored as solved_throws_stored
from .start import check_start
from .starts import Turns, goals_of, starts
from .table_search import TableSearch
from .workbench import Workbench

__all__ = [
    "Found",
    "Problem",
    "Reach",
    "ReleaseSampler",
    "Releases",
    "Search",
    "SolvedThrow",
    "SolvedThrows",
    "TableSearch",
    "Turns",
    "Workbench",
    "attempt",
    "check_start",
    "distinct",
    "failed_plan",
    "flies_past_column",
    "from_release",
    "goals_of",
    "guess_from",
    "highest",
    "joined",
    "ordered",
    "polynomial",
    "refit",
    "release_cache_stored",
    "run_up",
    "scatter",
    "solved_plan",
    "solved_throws_stored",
    "starts",
    "targets",
]
