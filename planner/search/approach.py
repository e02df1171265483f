"""A throw brought to a goal, or as near to it as limits let it.

From a throw that lands beside the goal the NLP is solved with an elastic landing: it may miss the
goal at a price in the pose error (39). The solution is thrown and checked as any other throw: its
landing is called the nearest possible only if the throw breaks nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from ...models import Array
from ...problems import Pose
from ..library import Neighbour
from ..ocp import CUP_MARGIN, Refinement, Request, ThrowNlp
from ..result import PlannedThrow
from ..verdict import verdict
from .attempt import Attempt, NearestFeasible, Start, attempts
from .guess import initial_guess_from
from .history import Approach
from .move import Corrector, throw_of
from .nlp_cache import Task

#: Most NLPs with an elastic landing, each refined by the check of the one before.
ROUNDS = 4
#: Most NLPs for the goal itself, once an elastic landing reaches it.
TRIES = 4
#: Price [1/m] of an elastic landing's pose error. The effort rises steeply at the edge of the
#: reach: with a tenth of this price landings end up to 11 mm short of it.
PRICE = 1000.0
#: Price [1/m] from a throw that lands `FAR` or farther off the goal: it is found sooner.
FAR_PRICE = 100.0
#: Distance [m] of such a throw's landing.
FAR = 0.2
#: Margin [m] to rim and wall of a cup, beyond its clearance.
ELASTIC_CUP_MARGIN = 2e-4


def approach_goal(corrector: Corrector, step: Approach, task: Task) -> Iterator[Attempt]:
    """Attempts to throw to the goal of a step; those that land short of it have an `edge`.

    Where a start's own goal is beside that of the step, that is solved for first.
    """
    problems, sound, goal, source = corrector.problems, True, step.goal, step.source
    if isinstance(source, Neighbour):
        throw = throw_of(corrector.controls, problems.manipulator, source.optimum, task)
        guess, refinement = _guess(throw, task), throw.refinement
    else:
        guess, refinement = source.guess, source.refinement
        if source.goal != goal:
            made = attempts(problems, source, task.aimed_at(source.goal))
            if task.contains(source.goal) and made[-1].solved:
                yield _in_region(made[-1], goal, task)
                return
            yield from (_beside(one, goal, task) for one in made)
            last = made[-1]
            sound = last.solved
            if last.solved and last.throw is not None:
                guess, refinement = _guess(last.throw, task), last.refinement
    if task.scene.cup is not None:
        margins = refinement.margins.replace(cup=ELASTIC_CUP_MARGIN - CUP_MARGIN)
        refinement = Refinement(refinement.lazy | {"flight"}, margins, refinement.bodies)
    price = FAR_PRICE if FAR <= step.away < math.inf else PRICE
    for _ in range(ROUNDS):
        start = Start(goal, guess, "fatrop", refinement, elastic=price)
        *_, near = attempts(problems, start, task)
        if near.throw is None and sound and not step.light and "ipopt" in task.solvers:
            # From a sound throw IPOPT's restoration solves some that FATROP's does not, in seconds.
            *_, near = attempts(problems, replace(start, solver="ipopt"), task)
        if near.throw is not None and _reaches(near.throw, goal):
            tries = 1 if step.light else TRIES
            start = Start(goal, _guess(near.throw, task), task.solvers[0], refinement, tries)
            made = attempts(problems, start, task)
            yield from made
            if made[-1].solved:
                return
        yield near
        after = near.after
        is_costly = after.costly > refinement.costly or after.bodies > refinement.bodies
        if near.throw is None or after == refinement or task.clock.late:
            return
        is_far = near.edge is not None and near.edge.missed > min(step.away, step.most)
        if is_far or (step.light and is_costly):
            return
        # Again from the throw that this round began with.
        refinement = after


def _guess(throw: PlannedThrow, task: Task) -> Callable[[ThrowNlp], Array]:
    request = Request(task.scene, throw.manipulator)
    return partial(initial_guess_from, throw=throw, request=request)


def _reaches(throw: PlannedThrow, goal: Pose) -> bool:
    """Whether the NLP's own landing is within the tolerance of the goal."""
    x, _, theta = throw.planned_landing
    most, (dx, dtheta) = throw.scene.tolerance, goal.miss(x, theta)
    return bool(abs(dx) <= most.position and abs(dtheta) <= most.angle)


def _in_region(attempt: Attempt, goal: Pose, task: Task) -> Attempt:
    """A solved attempt to land at a pose of a region, as one for the region."""
    throw = attempt.throw
    assert throw is not None
    lands, deciding = throw.planned_landing, replace(throw.deciding, scene=task.scene)
    # The region's NLP has other variables.
    throw = replace(throw, deciding=deciding, layout=None, solution=None, landing_of_nlp=lands)
    return replace(attempt, goal=goal, throw=throw, verdict=verdict(deciding, goal))


def _beside(attempt: Attempt, goal: Pose, task: Task) -> Attempt:
    """An attempt to land beside the goal."""
    pose = attempt.goal
    missed = task.scene.object.pose_error(*goal.miss(pose.plane_x, pose.theta or 0.0))
    return replace(attempt, goal=goal, edge=NearestFeasible(pose, (), missed))
