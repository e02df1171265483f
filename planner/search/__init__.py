"""Where solves start and how they go on: release table, solved throws, corrections.

Also answers which landing is the nearest possible, and which limits bind there.
"""

from .attempt import (
    Attempt,
    Edge,
    Start,
    attempts,
    distinct,
    ordered,
    scaled,
    scatter,
    violations,
)
from .corrector import CORRECTOR, Corrector, moved_start, optimum_of
from .failure import check_contradictions, contradiction, nothing_found
from .guess import guess_from, refit
from .launch import carry, flies_past_column, polynomial, run_up
from .library import Library, Neighbour
from .meeting import met
from .nearby import Nearby, rest_from, rest_of
from .nearest import Reach, highest
from .nlps import Clock, Problems, Program, Task, check_start
from .release_table import Releases, Turns, goals_of, joined, starts
from .sampling import ReleaseSampler, sparse_parents, stored_releases
from .table import Search, Sources, release_start
from .walk import Walk
