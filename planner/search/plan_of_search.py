"""One plan to a target at rest: the best throw that the search finds, or the nearest one."""

from __future__ import annotations

import math
from dataclasses import replace

from ...problems import Pose
from ..ocp import Request
from ..result import CUT_SHORT, ActiveLimit, Plan, PlannedThrow, binding_words
from .attempts import Outcome
from .find import Search, SearchContext
from .nlp_cache import Task

#: Throws among which one like the throws of [calibration] is looked for.
OTHERS = 4


def plan_throw(context: SearchContext, task: Task, warm: PlannedThrow | None = None) -> Plan:
    """The plan of the cheapest throw found to the task's target, with others that differ from it.

    warm: a throw of the same manipulator to a target nearby.
    """
    search = Search(context, task, warm if warm is not None and _is_of_kind(warm, task) else None)
    search.run()
    if not search.found:
        return _not_found(search)
    plan = solved_plan(context, task, search.found)
    claim = plan.calibrated
    if claim is None or claim.setup or not claim.speeds or task.wanted > 1:
        return plan
    # Of several throws, one at speeds that [calibration] knows.
    several = plan_throw(context, replace(task, wanted=OTHERS))
    for other in (several, *several.alternatives):
        if other.calibrated is not None and other.calibrated.holds:
            return replace(other, alternatives=())
    return plan


def solved_plan(context: SearchContext, task: Task, found: list[Outcome]) -> Plan:
    """The plan of the first throw, with the others as alternatives."""
    best, *rest = (_plan_of(context, task, one) for one in found)
    return replace(best, alternatives=tuple(rest))


def _plan_of(context: SearchContext, task: Task, found: Outcome) -> Plan:
    """The plan of one solved throw, for where it lands."""
    throw, pose = found.throw, found.pose
    assert throw is not None and pose is not None
    return Plan(
        throw.scene,
        context.problems.manipulator,
        pose,
        "solved",
        throw.words(pose),
        throw,
        solver=found.solver,
        starts=task.budget.counts["starts"],
        iterations=task.budget.counts["iterations"],
        variables=throw.nlp_size[0],
        constraints=throw.nlp_size[1],
    )


def _not_found(search: Search) -> Plan:
    """No throw found: the one that lands nearest, and the limits that hold it there."""
    task, problems = search.task, search.context.problems
    variables, constraints = problems.nlp(
        Request(task.scene, problems.manipulator, task.target), task.budget
    ).size
    nearest, binding = None, tuple[ActiveLimit, ...]()
    own = [one.name for one in task.scene.constraints]
    if search.short:
        nearest = _plan_of(search.context, task, search.short[0])
        words = f"lands at {_place(nearest.target, task.target)}, beside the target"
        nearest = replace(nearest, short_of=task.target, message=words)
        binding = tuple(ActiveLimit.of(name, own) for name in search.short[0].binding)
    elif search.broken:
        (_, most), *_ = often = search.broken.most_common()
        binding = tuple(ActiveLimit.of(name, own) for name, count in often if 2 * count > most)
    return Plan(
        task.scene,
        problems.manipulator,
        task.target,
        "not_found",
        _words(search, nearest, binding),
        None,
        nearest=nearest,
        binding=binding,
        bound=search.bound,
        solver=task.solver,
        starts=task.budget.counts["starts"],
        iterations=task.budget.counts["iterations"],
        variables=variables,
        constraints=constraints,
    )


def _words(search: Search, nearest: Plan | None, binding: tuple[ActiveLimit, ...]) -> str:
    """Why there is no throw, in a sentence."""
    task, target = search.task, search.task.target
    count = task.budget.counts["starts"]
    words = f"no throw found from {count} start{'' if count == 1 else 's'}"
    if search.bound is not None:
        words = f"nothing reaches the target: {search.bound.words}"
    if nearest is not None:
        miss = search.short[0].missed
        words += f"; the nearest lands at {_place(nearest.target, target)}, {1e3 * miss:.0f} mm off"
        if binding:
            words += f", held there by {binding_words(binding)}"
    elif binding and search.bound is None:
        often = max(search.broken.values())
        words += f", {often} of them end at {binding_words(binding)}"
    if task.budget.late:
        words += f"; {CUT_SHORT}, more may help"
    return words + target.angle_hint


def _place(pose: Pose, target: Pose) -> str:
    """A landing, with its pose error's parts in units."""
    angle = "" if pose.theta is None else f", theta {math.degrees(pose.theta):.1f} deg"
    aside = f", y {pose.y:.3f} m" if target.y or abs(pose.y) > 5e-4 else ""
    return f"x {pose.x:.3f} m{aside}{angle}"


def _is_of_kind(warm: PlannedThrow, task: Task) -> bool:
    """Whether a task's NLPs fit a warm plan's throw: not robust, theta fixed in both or neither."""
    robust = warm.layout is not None and warm.layout.structure.robust
    return not robust and (warm.deciding.target.theta is None) == (task.target.theta is None)
