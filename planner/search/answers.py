"""What a search comes to: a solved plan, out of reach, or not converged."""

from __future__ import annotations

import dataclasses
import math

from ...problems import Pose
from ..result import Plan, PlannedThrow, Status
from .alternatives import Found
from .correction import Search
from .nearest_possible import Binding, highest
from .releases import Releases
from .workbench import Workbench

#: A target of more full turns than this may have been given in degrees.
MANY_TURNS = 3


def solved_plan(bench: Workbench, found: Found, search: Search) -> Plan:
    """The plan of a throw that was found."""
    plan = _plan(bench, "solved", found.goal, "", found.thrown, found.solver, search)
    dx, dtheta = plan.error_sent()
    turn = "" if found.goal.theta is None else f" and {math.degrees(dtheta):.3f} deg"
    words = f"lands {1e3 * dx:.3f} mm{turn} from the target"
    return dataclasses.replace(plan, message=words)


def failed_plan(
    bench: Workbench,
    target: Pose,
    answer: Binding | None,
    releases: Releases,
    name: str,
    search: Search,
) -> Plan:
    """No throw found: out of reach with the nearest possible, or not converged."""
    if answer is None and not search.late:
        far, pose, words = highest(releases, target, search.scene.gravity)
        status: Status = "out_of_reach" if far else "not_converged"
        plan = _plan(bench, status, target, words, None, name, search)
        return dataclasses.replace(plan, nearest=pose, binding=("landing height",))
    if answer is not None and answer.outside:
        words = _out_of_reach(answer) + _radians(target)
        plan = _plan(bench, "out_of_reach", target, words, None, name, search)
        return dataclasses.replace(plan, nearest=answer.pose, binding=answer.names)
    thrown, why = search.fallback or (None, search.trouble[-1] if search.trouble else "")
    message = f"no throw found: {why or 'no feasible release to start from'}"
    if search.late:
        message += "; given up after the longest time, more may help (Planner.plan(patience=…))"
    return _plan(bench, "not_converged", target, message, thrown, name, search)


def _plan(
    bench: Workbench,
    status: Status,
    target: Pose,
    message: str,
    thrown: PlannedThrow | None,
    name: str,
    search: Search,
) -> Plan:
    nlp = bench.nlp(target, search) if thrown is None else thrown.nlp
    variables, constraints = nlp.size
    return Plan(
        search.scene,
        bench.mover,
        target,
        status,
        message,
        thrown,
        solver=name,
        iterations=search.iterations,
        attempts=search.attempts,
        variables=variables,
        constraints=constraints,
    )


def _radians(target: Pose) -> str:
    """A hint for an angle that may have been meant in degrees."""
    if target.theta is None or abs(target.theta) < MANY_TURNS * 2 * math.pi:
        return ""
    turns = target.theta / (2 * math.pi)
    return f"; theta {target.theta:g} rad is {turns:.1f} turns: Pose takes radians"


def _out_of_reach(answer: Binding) -> str:
    pose = answer.pose
    assert pose is not None
    angle = "" if pose.theta is None else f", theta {math.degrees(pose.theta):.1f} deg"
    limits = f" (limited by {', '.join(answer.names[:4])})" if answer.names else ""
    return f"out of reach: nearest possible x {pose.plane_x:.3f} m{angle}{limits}"
