"""One plan to a target at rest: from solved throws near it, else from sampled ones."""

from __future__ import annotations

from dataclasses import replace

from ..problems import Pose
from .ocp import Request
from .result import Plan, PlannedThrow
from .samples import highest
from .search import (
    FROM_NOTHING,
    FROM_THROWS,
    Attempt,
    History,
    Search,
    SearchContext,
    Task,
    contradiction,
    find_throws,
    from_warm_plan,
    nothing_found,
)

#: Name of the limit that binds if no sampled release lands at the target's height.
HEIGHT = "landing height"
#: Name of the limit that binds if the bar at the target is inside the base column.
COLUMN = "base column"
#: Throws among which one like the throws of [calibration] is looked for.
OTHERS = 4


def plan_throw(context: SearchContext, task: Task, warm: PlannedThrow | None = None) -> Plan:
    """The plan of the best throw found to the task's target, with others that differ from it.

    warm: a throw of the same manipulator to a target nearby.
    """
    search = Search(context, task, warm if warm is not None and _is_of_kind(warm, task) else None)
    history = find_throws(search, FROM_THROWS, History())
    if not history.found:
        name, words = contradiction(task.scene, context.table, task.target)
        if words:
            words = f"no throw found: {words}"
            return unsolved_plan(search, history, words, out_of_reach=False, binding=(name,))
    history = find_throws(search, FROM_NOTHING, history)
    search.remember(history)
    if not history.found:
        return _failed_plan(search, history)
    return _plan_like_measured(search, history, solved_plan(search, history))


def _plan_like_measured(search: Search, history: History, plan: Plan) -> Plan:
    """Of several throws to the target, one at speeds that [calibration] knows.

    The plan itself if it is one, if object, grip or prediction have changed, if none is found in
    the task's time, and if the task wants several throws anyway.
    """
    claim, task = plan.calibrated, search.task
    if claim is None or claim.setup or not claim.speeds or task.wanted > 1:
        return plan
    search = replace(search, task=replace(task, wanted=OTHERS))
    several = solved_plan(search, find_throws(search, (*FROM_THROWS, *FROM_NOTHING), history))
    for other in (several, *several.alternatives):
        if other.calibrated is not None and other.calibrated.holds:
            return replace(other, alternatives=())
    return plan


def plan_from_warm(context: SearchContext, task: Task, warm: PlannedThrow) -> Plan | None:
    """The plan solved from a warm plan's throw; None if that fails."""
    if not _is_of_kind(warm, task):
        return None
    search = Search(context, task, warm)
    history = find_throws(search, (from_warm_plan,), History())
    return solved_plan(search, history) if history.found else None


def solved_plan(search: Search, history: History) -> Plan:
    """The plan of the throw that the scene's [choice] prefers, with the others as alternatives."""
    by = "effort" if search.task.scene.choice is None else search.task.scene.choice.by
    best, *others = history.ordered(by)
    rest = [_plan_of(search, other, other.iterations, other.solves) for other in others]
    return _plan_of(search, best, history.iterations, history.solves, tuple(rest))


def _plan_of(
    search: Search, found: Attempt, iterations: int, solves: int, others: tuple[Plan, ...] = ()
) -> Plan:
    """The plan of one solved throw."""
    assert found.throw is not None
    return Plan(
        search.task.scene,
        search.context.problems.manipulator,
        found.goal,
        "solved",
        found.throw.words(found.goal),
        found.throw,
        solver=found.solver,
        iterations=iterations,
        attempts=solves,
        variables=found.throw.nlp_size[0],
        constraints=found.throw.nlp_size[1],
        alternatives=others,
    )


def unsolved_plan(
    search: Search,
    history: History,
    message: str,
    *,
    out_of_reach: bool = True,
    nearest: Pose | None = None,
    binding: tuple[str, ...] = (),
    throw: PlannedThrow | None = None,
) -> Plan:
    """The plan without a solved throw; throw: one that breaks something."""
    task, problems = search.task, search.context.problems
    request = Request(task.scene, problems.manipulator, task.target)
    variables, constraints = problems.nlp(request, task.clock).size
    return Plan(
        task.scene,
        problems.manipulator,
        task.target,
        "out_of_reach" if out_of_reach else "not_converged",
        message,
        throw,
        nearest=nearest,
        binding=binding,
        solver=task.solvers[-1],
        iterations=history.iterations,
        attempts=history.solves,
        variables=variables,
        constraints=constraints,
    )


def _failed_plan(search: Search, history: History) -> Plan:
    """No throw found: out of reach with the nearest landing that is possible, or not converged."""
    task = search.task
    if not search.candidates.nearest:
        far, pose, words = highest(search.candidates.releases, task.target, task.scene.flight)
        binding = (HEIGHT,)
        return unsolved_plan(
            search, history, words, out_of_reach=far, nearest=pose, binding=binding
        )
    edge = history.edges[0].edge if history.edges else None
    if edge is not None and search.is_nearest_possible(history):
        words = edge.words("out of reach: nearest possible x", task.target)
        return unsolved_plan(search, history, words, nearest=edge.pose, binding=edge.names)
    if search.blocked:
        words = "out of reach: the bar would be inside the base column at the target"
        return unsolved_plan(search, history, words, binding=(COLUMN,))
    attempts = history.attempts
    broken = [one for one in attempts if one.throw is not None and one.edge is None]
    words = nothing_found(attempts, broken, task.clock.late)
    if edge is not None:
        words += edge.words("; nearest found x", task.target)
    return unsolved_plan(
        search,
        history,
        words,
        out_of_reach=False,
        nearest=None if edge is None else edge.pose,
        throw=broken[0].throw if broken else None,
    )


def _is_of_kind(warm: PlannedThrow, task: Task) -> bool:
    """Whether a task's NLPs fit a warm plan's throw: not robust, theta fixed in both or neither."""
    robust = warm.layout is not None and warm.layout.structure.robust
    return not robust and (warm.deciding.target.theta is None) == (task.target.theta is None)
