"""From the elastic point to a checked throw: the last resort, at the edge of what is possible."""

from __future__ import annotations

from .alternatives import Found
from .correction import Search, attempt
from .reach import Binding
from .refit import again
from .workbench import Workbench

#: NLPs tried for each aim, each asked what the check has seen to be missing.
TRIES = 3
#: How much farther than the elastic point to aim, which lies at the very edge.
BEYOND = 1.02


def from_elastic(bench: Workbench, answer: Binding, search: Search) -> Found | None:
    """The throw that an elastic point within the tolerance leads to; None without one or the other.

    The target itself first. Where that cannot be had the elastic point's own landing, which the
    tolerance allows, is the aim.
    """
    if answer.outside or answer.solution is None:
        return None
    dx, dtheta = answer.beside
    for aim in ((0.0, 0.0), (BEYOND * dx, BEYOND * dtheta)):
        found = _aimed(bench, answer, search, aim)
        if found is not None or search.late:
            return found
    return None


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
