"""One plan to a target at rest: from solved throws near it, else from sampled ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..models import Array, FlightState
from ..problems import Pose, Scene
from .ocp import Request
from .result import Plan, PlannedThrow
from .samples import Releases, highest
from .search import (
    FROM_NOTHING,
    FROM_THROWS,
    Attempt,
    History,
    Search,
    SearchContext,
    Task,
    find_throws,
    from_warm_plan,
)

#: Name of the limit that binds if no sampled release lands at the target's height.
HEIGHT = "landing height"
#: Name of the limit that binds if the bar at the target is inside the base column.
COLUMN = "base column"
#: Throws among which one like the throws of [calibration] is looked for.
OTHERS = 4
#: A bound contradicts the target if all near sampled releases miss it by more than this factor.
FACTOR = 2.0


def plan_throw(context: SearchContext, task: Task, warm: PlannedThrow | None = None) -> Plan:
    """The plan of the best throw found to the task's target, with others that differ from it.

    warm: a throw of the same manipulator to a target nearby.
    """
    search = Search(context, task, warm if warm is not None and _is_of_kind(warm, task) else None)
    history = find_throws(search, FROM_THROWS, History())
    if not history.found:
        name, words = _contradiction(task.scene, context.table, task.target)
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
    """The plan of the cheapest throw, with the others as alternatives."""
    best, *rest = (_plan_of(search, found) for found in history.ordered)
    iterations, solves = history.iterations, history.solves
    return replace(best, iterations=iterations, attempts=solves, alternatives=tuple(rest))


def _plan_of(search: Search, found: Attempt) -> Plan:
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
        iterations=found.iterations,
        attempts=found.solves,
        variables=found.throw.nlp_size[0],
        constraints=found.throw.nlp_size[1],
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
        solver=history.attempts[-1].solver if history.attempts else task.solvers[0],
        iterations=history.iterations,
        attempts=history.solves,
        variables=variables,
        constraints=constraints,
    )


def _failed_plan(search: Search, history: History) -> Plan:
    """No throw found: out of reach with the nearest landing that is possible, or not converged."""
    task = search.task
    if not search.candidates.nearest:
        # The top of a sampled throw is no landing that a plan could throw to.
        z = task.target.z
        far, apex, words = highest(search.candidates.releases, z, task.scene.flight)
        binding = (HEIGHT,) if -math.inf < apex < z else ()
        return unsolved_plan(search, history, words, out_of_reach=far, binding=binding)
    edge = history.edges[0].edge if history.edges else None
    if edge is not None and search.is_nearest_possible(history):
        search.remember_beyond(edge.pose)
        if search.blocked:
            edge = replace(edge, names=tuple(dict.fromkeys((COLUMN, *edge.names))))
        words = edge.words("out of reach: nearest possible x", task.target)
        return unsolved_plan(search, history, words, nearest=edge.pose, binding=edge.names)
    if search.blocked:
        words = "out of reach: the bar would be inside the base column at the target"
        return unsolved_plan(search, history, words, binding=(COLUMN,))
    attempts = history.attempts
    broken = [one for one in attempts if one.throw is not None and one.edge is None]
    words = _nothing_found(attempts, broken, task.clock.late)
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


def _contradiction(scene: Scene, releases: Callable[[], Releases], target: Pose) -> tuple[str, str]:
    """The first bound of [landing], or latest arrival, that contradicts the target: name and words.

    The 200 sampled releases that land nearest decide; both are empty without a contradiction.
    """
    bounds, latest = scene.landing, target.window[1]
    if bounds is None and not math.isfinite(latest):
        return "", ""
    table = releases()
    x, theta, flown = table.landings(target.z, scene.flight)
    if not np.isfinite(x).any():
        return "", ""
    off = scene.object.pose_error(*target.miss(x, theta))
    near = np.argsort(off)[: min(200, int(np.isfinite(off).sum()))]
    end = scene.flight.after(FlightState(*table.detach[near].T), flown[near])
    speed, omega = np.hypot(end.v_x, end.v_z), end.omega
    # Rates of either sign pass through zero.
    rate = np.abs(omega) if (omega > 0).all() or (omega < 0).all() else 0 * omega
    time = table.run_up[near] + scene.gripper.profile().opening + flown[near]
    bounds_of: list[tuple[str, float | None, Array, str]] = [
        ("[target] arrival", latest, time, "s")
    ]
    if bounds is not None:
        bounds_of += [
            ("[landing] speed_max", bounds.speed_max, speed, "m/s"),
            ("[landing] rate_max", bounds.rate_max, rate, "rad/s"),
            ("[landing] speed_min", bounds.speed_min or None, -speed, "m/s"),
        ]
    for name, bound, values, unit in bounds_of:
        words = _words(name, bound, values, unit)
        if words:
            return name.split()[1], words
    return "", ""


def _words(name: str, bound: float | None, values: Array, unit: str) -> str:
    """Why values contradict an upper bound, or (values negative) a lower one; else empty."""
    least = float(values.min())
    if bound is None:
        return ""
    if least > 0 and least > FACTOR * bound:
        how = f"at least about {least:.2g} {unit}"
    elif least < 0 and -least * FACTOR < bound:
        how = f"at most about {-least:.2g} {unit}"
    else:
        return ""
    kind = "after" if unit == "s" else "with"
    return f"{name} = {bound:g}: throws to this target land {kind} {how}"


def _nothing_found(tried: Sequence[Attempt], broken: Sequence[Attempt], late: bool) -> str:
    """Why there is no throw, in words: how many attempts there were, and what they broke."""
    if not tried:
        return "no throw found: time was over before the first attempt; more patience may help"
    words = f"no throw found in {len(tried)} attempts"
    vain = sum(one.throw is None for one in tried)
    if vain:
        words += f": {vain} led to no motion that keeps all constraints"
    if broken:
        words += f"; what a throw broke: {broken[0].reason}"
    return words + ("; time is over, more patience may help" if late else "")
