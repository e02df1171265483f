"""A throw brought to a goal, or as near to it as limits let it.

From a throw that lands beside the goal the NLP is solved with an elastic landing: it may miss the
goal at a price in the pose error (39). The solution is thrown and checked as any other throw: its
landing is called the nearest possible only if the throw breaks nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from ...models import Array
from ...problems import Pose
from ..library import Neighbour
from ..ocp import CUP_MARGIN, Refinement, Request, ThrowNlp
from ..result import PlannedThrow
from .attempt import Attempt, NearestFeasible, Start, attempts
from .guess import initial_guess_from
from .move import Corrector, throw_of
from .nlp_cache import Task

#: Most NLPs with an elastic landing, each refined by the check of the one before.
ROUNDS = 4
#: Most NLPs for the goal itself, once an elastic landing reaches it.
TRIES = 4
#: Largest pose error [m] of a start for which `NEAR_PRICE` is used.
NEAR = 0.2
#: Prices [1/m] of an elastic landing's pose error. At the edge of the reach the effort rises
#: steeply: at `FAR_PRICE` landings end up to 11 mm short of it; from afar `NEAR_PRICE` fails.
NEAR_PRICE, FAR_PRICE = 1000.0, 100.0
#: Margin [m] to rim and wall of a cup, beyond its clearance.
ELASTIC_CUP_MARGIN = 2e-4


def approach_goal(
    corrector: Corrector, goal: Pose, source: Start | Neighbour, task: Task, *, light: bool = False
) -> Iterator[Attempt]:
    """Attempts to throw to the goal; those that land short of it have an `edge`.

    source: a solved throw that lands beside the goal, or a start. Where the start's own goal is
    beside it, that is solved for first. light: by FATROP alone, ending before an NLP with costly
    constraints, or with clearances of bodies.
    """
    problems, sound = corrector.problems, True
    away = _distance(source, goal, task)
    price = NEAR_PRICE if away < NEAR else FAR_PRICE
    if isinstance(source, Neighbour):
        throw = throw_of(corrector.controls, problems.manipulator, source.optimum, task)
        guess, refinement = _guess(throw, task), throw.refinement
    else:
        guess, refinement = source.guess, source.refinement
        if source.goal != goal:
            made = attempts(problems, source, task.aimed_at(source.goal))
            yield from (_beside(one, goal, task) for one in made)
            last = made[-1]
            sound = last.solved
            if last.solved and last.throw is not None:
                guess, refinement = _guess(last.throw, task), last.refinement
    if task.scene.cup is not None:
        margins = refinement.margins.replace(cup=ELASTIC_CUP_MARGIN - CUP_MARGIN)
        refinement = Refinement(refinement.lazy | {"flight"}, margins, refinement.bodies)
    for _ in range(ROUNDS):
        start = Start(goal, guess, "fatrop", refinement, miss_price=price)
        *_, near = attempts(problems, start, task)
        if near.throw is None and sound and "ipopt" in task.solvers and not light:
            # From a sound throw IPOPT's restoration solves some that FATROP's does not.
            *_, near = attempts(problems, replace(start, solver="ipopt"), task)
        if near.throw is not None and _reaches(near.throw, goal):
            tries = 1 if light else TRIES
            start = Start(goal, _guess(near.throw, task), task.solvers[0], refinement, tries)
            made = attempts(problems, start, task)
            yield from made
            if made[-1].solved:
                return
        yield near
        after = near.after
        if near.throw is None or after == refinement or (light and (after.costly or after.bodies)):
            return
        # Again from the throw that this round began with.
        refinement = after


def _distance(source: Start | Neighbour, goal: Pose, task: Task) -> float:
    """Pose error [m] of a source's landing to the goal."""
    if isinstance(source, Neighbour):
        return source.distance
    return goal.distance(source.goal, task.scene.object.half_length)


def _guess(throw: PlannedThrow, task: Task) -> Callable[[ThrowNlp], Array]:
    request = Request(task.scene, throw.manipulator)
    return partial(initial_guess_from, throw=throw, request=request)


def _reaches(throw: PlannedThrow, goal: Pose) -> bool:
    """Whether the NLP's own landing is within the tolerance of the goal."""
    x, _, theta = throw.planned_landing
    most, turn = throw.scene.tolerance, 0.0 if goal.theta is None else theta - goal.theta
    return abs(x - goal.plane_x) <= most.position and abs(turn) <= most.angle


def _beside(attempt: Attempt, goal: Pose, task: Task) -> Attempt:
    """An attempt to land beside the goal."""
    pose, turn = attempt.goal, 0.0
    if goal.theta is not None and pose.theta is not None:
        turn = pose.theta - goal.theta
    missed = task.scene.object.pose_error(pose.plane_x - goal.plane_x, turn)
    return replace(attempt, goal=goal, edge=NearestFeasible(pose, (), missed))
