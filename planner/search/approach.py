"""A throw brought to a goal, or as near to it as limits let it.

From a throw that lands beside the goal the NLP is solved with an elastic landing: it may miss the
goal at a price in the pose error (39). The solution is thrown and checked as any other throw: its
landing is called the nearest possible only if the throw breaks nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ...problems import Pose
from ..library import Neighbour
from ..ocp import CUP_MARGIN, Refinement
from ..verdict import verdict
from .attempt import Attempt, NearestFeasible, Start, attempts
from .guess import guess_of
from .history import Approach
from .move import Corrector
from .nlp_cache import NlpCache, Task

#: Most NLPs with an elastic landing, each refined by the check of the one before.
ROUNDS = 5
#: Price of the angle where it comes to the goal first, over its price in the pose error. The pose
#: error has a kink at the goal's x and one at its angle, and limits hold a throw at either: from
#: the same samples both ways ended at landings that differed by a factor of up to ten.
TURNING = 8.0
#: Pose error [m] below which two landings are the same: the same limits hold both.
SAME_LANDING = 1e-3
#: Margin [m] to rim and wall of a cup, beyond its clearance.
ELASTIC_CUP_MARGIN = 2e-4


def approach_goal(corrector: Corrector, step: Approach, task: Task) -> Iterator[Attempt]:
    """Attempts to throw to the goal of a step; those that land short of it have an `edge`.

    Where a start's own goal is beside that of the step, that is solved for first.
    """
    problems, goal, source = corrector.problems, step.goal, step.source
    if isinstance(source, Neighbour):
        throw = corrector.throw_of(source.optimum, task)
        guess, refinement = guess_of(throw, task.scene), throw.refinement
    else:
        guess, refinement = source.guess, source.refinement
        if source.goal != goal:
            made = attempts(problems, source, task.aimed_at(source.goal))
            if task.contains(source.goal) and made[-1].solved:
                yield _in_region(made[-1], goal, task)
                return
            yield from (_beside(one, goal, task) for one in made)
            last = made[-1]
            if last.solved and last.throw is not None:
                guess, refinement = guess_of(last.throw, task.scene), last.refinement
    if task.scene.cup is not None:
        margins = refinement.margins.replace(cup=ELASTIC_CUP_MARGIN - CUP_MARGIN)
        refinement = Refinement(refinement.lazy | {"flight"}, margins, refinement.bodies)
    start = Start(
        goal, guess, "fatrop", refinement, elastic=step.prices[0], from_miss=not step.drawn
    )
    if step.turns and goal.theta is not None:
        made = list(_rounds(problems, replace(start, turning=TURNING), step, task))
        yield from made
        if not made[-1].is_edge or made[-1].throw is None:
            return
        start = replace(
            start, guess=guess_of(made[-1].throw, task.scene), refinement=made[-1].refinement
        )
    for price in step.prices:
        *made, last = _rounds(problems, replace(start, elastic=price), step, task)
        yield from (*made, last)
        if not last.is_edge or last.throw is None or last.missed > step.most:
            return
        assert last.edge is not None
        lever = task.scene.object.half_length
        if any(last.edge.pose.distance(one, lever) < SAME_LANDING for one in step.known):
            return
        guess, refinement = guess_of(last.throw, task.scene), last.refinement
        start = replace(start, guess=guess, refinement=refinement, from_miss=True)


def _rounds(problems: NlpCache, start: Start, step: Approach, task: Task) -> Iterator[Attempt]:
    """NLPs with an elastic landing from one start, each refined by the check of the one before, and
    for the goal itself once one lands there."""
    goal, broken = step.goal, None
    for _ in range(ROUNDS):
        *_, near = attempts(problems, start, task)
        if near.throw is None and broken is not None:
            # With the further constraint no motion was found from where this round began.
            yield near
            *_, near = attempts(problems, replace(start, guess=guess_of(broken, task.scene)), task)
        elif near.throw is None:
            # Some starts lead to a motion from slacks at 0, some from those of their miss.
            yield near
            *_, near = attempts(problems, replace(start, from_miss=not start.from_miss), task)
        broken = near.throw
        if near.solved and near.throw is not None:
            guess = guess_of(near.throw, task.scene)
            [exact] = attempts(
                problems, Start(goal, guess, task.solvers[0], start.refinement), task
            )
            yield exact
            if exact.solved:
                return
        yield near
        after = near.after
        is_costly = after.costly > start.refinement.costly or after.bodies > start.refinement.bodies
        if near.throw is None or after == start.refinement or task.clock.late:
            return
        is_far = near.edge is not None and near.edge.missed > min(step.away, step.most)
        if is_far or (step.light and is_costly):
            return
        # Again from the throw that this round began with.
        start = replace(start, refinement=after)


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
