"""From the elastic point to a checked throw: the last resort, at the edge of what is possible."""

from __future__ import annotations

from dataclasses import replace

from ..ocp import CUP_ROOM, Margins
from .alternatives import Found
from .correction import Search, attempt
from .nearest_possible import Binding
from .refit import again
from .workbench import Workbench

#: NLPs tried for each aim, each asked what the check has seen to be missing.
TRIES = 3
#: How much farther than the elastic point to aim, which lies at the very edge.
BEYOND = 1.02
#: Share of the tolerance that may be aimed away.
INSIDE = 0.98
#: Room [m] beyond the cup's clearance that is kept in the end, looked at in more depths.
LEAST = 2e-4


def from_elastic(bench: Workbench, answer: Binding, search: Search) -> Found | None:
    """The throw that an elastic point within the tolerance leads to; None without one or the other.

    The target itself first. Where that cannot be had the elastic point's own landing, which the
    tolerance allows, is the aim; and in the end less room beside the cup is kept.
    """
    if answer.outside or answer.solution is None:
        return None
    most = search.scene.tolerance
    dx, dtheta = (
        min(max(BEYOND * miss, -INSIDE * allowed), INSIDE * allowed)
        for miss, allowed in zip(answer.beside, (most.position, most.angle), strict=True)
    )
    rooms = _rooms(search)
    for room in rooms:
        for aim in ((0.0, 0.0), (dx, dtheta)):
            if search.late:
                return None
            if room != search.room and search.scene.cup is not None:
                search.guards, search.room = search.guards | {"flight"}, room
            found = _aimed(bench, answer, search, aim)
            if found is not None:
                return found
    search.room = rooms[0]
    return None


def _rooms(search: Search) -> list[Margins]:
    """What room to try: that of the search and, where there is a cup, less beside that."""
    if search.scene.cup is None:
        return [search.room]
    return [search.room, replace(search.room, cup=LEAST - CUP_ROOM)]


def _aimed(
    bench: Workbench, answer: Binding, search: Search, aim: tuple[float, float]
) -> Found | None:
    """The throw from the elastic point with `aim` beside the target."""
    goal = answer.goal
    guess = answer.guess_for(bench.nlp(goal, search))
    for _ in range(TRIES):
        asked, problem = search.asked, bench.problem(goal, "ipopt", search)
        thrown = attempt(problem, bench.mover, goal, guess, search, None, aim)
        if thrown is not None:
            return Found(goal, thrown, problem.solver.name)
        if search.broken is None or search.asked == asked or search.late:
            return None
        guess = again(bench.nlp(goal, search), search)
    return None
