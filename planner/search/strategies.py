"""Strategies of the search: each a function of the search and its history, to the next try or None.

Solved throws near the target come first: a warm plan's and the library's, moved or as a solver's
start. Then sampled releases that land near it, and what is possible nearest to it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import islice

from ...problems import Cost, Pose
from ..library import Neighbour
from .attempt import Start
from .candidates import MANY_STARTS, REGION_STARTS, STARTS, Candidates, release_start
from .context import SETTINGS
from .guess import guess_of
from .history import LAST_PRICE, Approach, History, Lead, Move, Solve, Try
from .search import Search

Strategy = Callable[[Search, History], Try | None]


def from_neighbours(search: Search, history: History) -> Try | None:
    """Solved throws near the target, moved to it; for a region, and for weights of the cost that
    are not the library's, a solver's starts."""
    if search.task.names_solver:
        return None
    neighbours = islice(search.neighbours(), search.moves)
    if search.task.target.is_region or search.task.scene.weights != Cost():
        # A moved throw keeps its place in a region, and its time: another may cost less.
        number = len(history.solves_from("neighbour"))
        near = next(islice(neighbours, number, None), None)
        waits = search.warm is not None and not history.solves_from("warm plan")
        return None if near is None or waits else Solve(search.start(near), "neighbour")
    number = sum(isinstance(one, Move) for one in history.tries)
    return next(islice(map(Move, neighbours), number, None), None)


def from_warm_plan(search: Search, history: History) -> Try | None:
    """A solver's start from the warm plan."""
    warm, task = search.warm, search.task
    if warm is None or history.solves_from("warm plan"):
        return None
    if warm.solution is not None and warm.deciding.target.kind == task.target.kind:
        solution, lever = warm.solution, task.scene.object.half_length
        near = task.target.distance(warm.deciding.target, lever) < SETTINGS.near_distance
        start = Start(task.target, lambda nlp: solution.x, task.solvers[0], near=near)
        start = replace(start, refinement=warm.refinement, warm=solution, aim=warm.aim)
    elif warm.optimum is not None:
        start = search.start(Neighbour.of(warm.optimum, task.target, task.scene))
    else:
        # The rest of a swing has no solution of an NLP of this task.
        start = Start(task.target, guess_of(warm, task.scene), task.solvers[0])
    return Solve(start, "warm plan")


def from_nearest_samples(search: Search, history: History) -> Try | None:
    """A solver's start from one of few sampled releases: those that land nearest, then those of
    them that arrive well."""
    if search.blocked or search.is_short_cut(history) or search.is_settled(history):
        return None
    compares = search.task.target.is_region and history.found
    count = REGION_STARTS if compares else SETTINGS.first_starts
    solver, few = search.task.solvers[0], SETTINGS.first_starts
    nearest = _from_samples(search, history, (search.candidates,), solver, count)
    return nearest or _from_samples(search, history, (search.candidates.arriving,), solver, few)


def from_library(search: Search, history: History) -> Try | None:
    """A throw of the library that lands beside the target, led and brought as near to it as limits
    let it.

    Most targets that no throw of it was moved to are out of reach, if there are many; this says so
    soonest.
    """
    if search.is_sparse or history.found or search.task.names_solver:
        return None
    if history.leads < min(SETTINGS.leads, len(search.ends)) and not search.task.target.is_region:
        return Lead(search.ends[history.leads])
    # Where landings agree, a sampled start comes before a third approach.
    if search.blocked or search.are_alike(history) or search.is_settled(history):
        return None
    return next(islice(search.stored, history.approaches, None), None)


def from_found(search: Search, history: History) -> Try | None:
    """IPOPT's start from a throw that an earlier plan found near the target.

    Along a line of targets 5 mm apart it leads from one to the next where sampled starts and
    elastic landings do not.
    """
    is_done = search.task.names_solver or history.found or history.solves_from("found")
    if is_done or search.blocked or search.is_short_cut(history) or search.is_settled(history):
        return None
    near = search.earlier
    return None if near is None else Solve(replace(search.start(near), solver="ipopt"), "found")


def from_beside(search: Search, history: History) -> Try | None:
    """A throw that lands beside the target, brought as near to it as limits let it."""
    number = history.approaches
    enough = history.found or search.is_settled(history)
    is_known = bool(history.leads and history.edges)
    is_given_up = search.blocked and (is_known or number == SETTINGS.column_approaches)
    if enough or is_given_up or not search.candidates.nearest:
        return None
    return next(islice(search.approaches(), number, None), None)


def from_edge(search: Search, history: History) -> Try | None:
    """The nearest landing, brought as near to the target as limits let it at any effort; of one out
    of reach, or so near that sampled throws that lead nowhere are no evidence.

    Throws of a library's boundary stay as they are.
    """
    is_done = any(isinstance(one, Approach) and one.is_last for one in history.tries)
    if is_done or history.found or not (history.edges and search.is_sparse) or search.blocked:
        return None
    edge = history.edges[0]
    is_near = edge.missed < search.sure_distance
    if edge.throw is None or not (is_near or search.is_nearest_possible(history)):
        return None
    guess = guess_of(edge.throw, search.task.scene)
    start = Start(edge.goal, guess, "fatrop", edge.refinement)
    return Approach(edge.goal, start, edge.missed, light=True, prices=(LAST_PRICE,))


def from_samples(search: Search, history: History) -> Try | None:
    """A solver's start from a further sampled release that arrives well, then from any."""
    if search.blocked or search.is_settled(history):
        return None
    tables, solver = (search.candidates.arriving, search.candidates), search.task.solvers[0]
    scene = search.task.scene
    is_hard = solver == "fatrop" and (scene.obstacle or scene.robot is None)
    count = MANY_STARTS if is_hard else STARTS[solver]
    return _from_samples(search, history, tables, solver, count)


def _from_samples(
    search: Search, history: History, tables: Sequence[Candidates], solver: str, count: int
) -> Try | None:
    """The next release that the solver did not start from, of `count` for each table up to its
    own."""
    task, before = search.task, history.solves_from("samples")
    tried = {(one.release, one.start.goal) for one in before if one.start.solver == solver}
    seen = set[tuple[bytes, Pose]]()
    for number, table in enumerate(tables, start=1):
        releases = ((i, goal, (table.releases.key(i), goal)) for i, goal, _ in table.different)
        new = (one for one in releases if one[2] not in seen)
        for index, goal, key in list(islice(new, number * count * task.wanted - len(seen))):
            seen.add(key)
            if key not in tried:
                start = release_start(search.context.problems, task, table.releases, index, goal)
                start = replace(start, solver=solver, refinement=search.refinement(history))
                return Solve(start, "samples", key[0])
    return None


#: Strategies that start from solved throws, in the order of tries.
FROM_THROWS: tuple[Strategy, ...] = (from_neighbours, from_warm_plan)
#: Strategies after these, in the order of tries.
FROM_NOTHING: tuple[Strategy, ...] = (
    from_library,
    from_nearest_samples,
    from_found,
    from_beside,
    from_samples,
    from_edge,
)
