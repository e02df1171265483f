"""Throws that stay: further ones to a target, among which one may rest there more often.

The landing's angle and speeds decide. So throws are solved again with a price of the landing's
speed, from the plain throw and from sampled releases whose landings' speeds let them rest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models import Array, Flags, FlightLaw, Indices
from ...problems import InputError, Pose, Scene
from ..ocp import Refinement
from ..rest import entry_states, floor_of, load_mujoco, roll_to_rest
from ..result import Plan
from ..search import Budget, Exact, SearchContext, Starts, Task, attempt, guess_of, solved_plan
from ..uncertainty import RestingThrow


@dataclass(frozen=True)
class RestingSettings:
    """Settings of the choice.

    prices: of the landing's speed, in order, as shares of the plain throw's effort over its squared
    speed. nearest: releases that are ranked, those that land nearest to the target; trials:
    contacts of each, with speeds off by the share `off`; solved: the best, solved with the second
    price. alike: throws whose landings differ by less [m, m/s] are compared once. seed: of the
    trials' contacts.
    """

    prices: tuple[float, ...] = (0.1, 0.3, 1.0, 3.0, 10.0)
    nearest: int = 40
    trials: int = 5
    off: float = 0.03
    solved: int = 8
    alike: float = 0.05
    seed: int = 7


SETTINGS = RestingSettings()


def resting(
    context: SearchContext, task: Task, plans: Sequence[Plan], patience: float | None = None
) -> list[Plan]:
    """Further plans to the target of `plans`, whose objects may rest there more often.

    patience [s]: time for it; None for what is left of the task's time. It ends with one that rests
    there always.
    """
    budget, plan = task.budget, plans[0]
    if patience is not None:
        own = Budget.lasting(patience)
        budget = replace(own, seconds=budget.seconds, counts=budget.counts)
    found, seen = list[Plan](), [_landing(one) for one in plans]
    task = replace(task, target=plan.target, budget=budget)
    starts = Starts(context.table(), task, context.problems.manipulator).arriving
    if any(_stays(one) for one in plans):
        return found
    for start in _starts(starts, plan):
        if budget.late:
            break
        one = attempt(context.problems, start, task)
        budget.counts["starts"] += 1
        if not one.hits or one.throw is None:
            continue
        words = one.throw.words(plan.target)
        other = replace(solved_plan(context, task, [one]), target=plan.target, message=words)
        if any(np.abs(_landing(other) - known).max() < SETTINGS.alike for known in seen):
            continue
        seen.append(_landing(other))
        found.append(other)
        if _stays(other):
            break
    return found


def _stays(plan: Plan) -> bool:
    """Whether all sampled throws of a plan succeed and rest."""
    assert plan.throw is not None
    return bool(RestingThrow(plan.throw.deciding).stays.all())


def _landing(plan: Plan) -> Array:
    """Place and speeds (5,) of the landing, in m and m/s of the CoM and of an end about it."""
    assert plan.throw is not None
    end, half = plan.throw.deciding.landing.state, plan.scene.object.half_length
    return np.array([end.x, half * end.theta, end.v_x, end.v_z, half * end.omega])


def check_rest(scene: Scene) -> None:
    """InputError for a scene with [rest] without MuJoCo, or with its ground above the target or the
    bottom of cup or bin."""
    load_mujoco()
    floor, target, cup, rest = floor_of(scene), scene.aim, scene.opening, scene.rest
    assert floor is not None and rest is not None
    given = "" if rest.floor is not None else " (0 where none is given)"
    if floor >= target.z:
        raise InputError(
            f"[rest] floor = {floor:g}{given}: must be below the target's z = {target.z:g}"
        )
    if cup is not None and floor > cup.rim - cup.depth:
        raise InputError(
            f"[rest] floor = {floor:g}: must be at most the {cup.KIND}'s bottom, "
            f"{cup.rim - cup.depth:g}"
        )


def _starts(starts: Starts, plan: Plan) -> Iterator[Exact]:
    """Starts from the plain throw, then from sampled releases, with prices of the landing speed."""
    throw, task = plan.throw, starts.task
    assert throw is not None
    landing = throw.deciding.landing.state
    price = throw.effort / (landing.v_x**2 + landing.v_z**2)
    refinements = [replace(throw.refinement, soft=share * price) for share in SETTINGS.prices]
    guess = guess_of(throw)
    for refinement in refinements:
        yield Exact(task.target, guess, refinement)
    found = starts.nearest[: SETTINGS.nearest]
    if not found:
        return
    indices = np.array([index for index, *_ in found])
    detach, goals = _moved(starts, indices, [goal for _, goal, _ in found])
    rests = _rests(task.scene, np.repeat(detach, SETTINGS.trials, axis=0))
    shares = rests.reshape(len(found), -1).mean(axis=1)
    for k in np.argsort(-shares, kind="stable")[: SETTINGS.solved]:
        soft = Refinement(soft=refinements[1].soft)
        yield Exact(goals[k], starts.guess(int(indices[k])), soft)


def _moved(starts: Starts, indices: Indices, aims: Sequence[Pose]) -> tuple[Array, list[Pose]]:
    """States at detach (N, 6) of releases, moved so that they land at their aims, and where."""
    task, detach = starts.task, starts.releases.detach[indices].copy()
    # These flights begin as at the pads: without the bias of [calibration].
    landing = FlightLaw(task.scene.gravity).land(detach, task.target.z)
    goals = [
        goal.nearest(float(x), float(theta)).middle
        for goal, (x, theta, _) in zip(aims, landing, strict=True)
    ]
    detach[:, 0] += np.array([goal.plane_x for goal in goals]) - landing[:, 0]
    turned = [a if g.theta is None else g.theta for g, a in zip(goals, landing[:, 1], strict=True)]
    detach[:, 2] += np.array(turned) - landing[:, 1]
    return detach, goals


def _rests(scene: Scene, detach: Array) -> Flags:
    """Flags (N,) of flights that come to rest at the wanted place, with contacts at random."""
    rng = np.random.default_rng(SETTINGS.seed)
    rest = scene.rest
    assert rest is not None
    detach = detach.copy()
    detach[:, 3:] *= 1 + SETTINGS.off * rng.standard_normal((len(detach), 3))
    _, states = entry_states(scene, detach)
    contact = [rng.uniform(*bounds, len(detach)) for bounds in (rest.restitution, rest.friction)]
    return roll_to_rest(scene, states, *contact).where_wanted(scene)
