"""A throw of the library led towards a goal that it does not reach.

Moving a throw takes half a millisecond, an NLP tens of them. Where the bar would be inside the base
column at the goal no NLP comes much nearer.
"""

from __future__ import annotations

from dataclasses import replace

from .attempt import Attempt, NearestFeasible
from .history import Lead
from .move import Corrector
from .nlp_cache import Task

#: Halvings of the way, for the angle and for x: to a thirtieth of it.
HALVINGS = 5


def led(corrector: Corrector, step: Lead, task: Task) -> Attempt:
    """The throw that lands nearest the goal on the way there: first it turns, then x moves.

    Its limits are those that it breaks a step farther on, or those that bind at its optimum. A
    throw of the boundary stays as it is.
    """
    near, goal, names = step.near, step.near.goal, step.near.optimum.binding

    def at(x: float, theta: float) -> Attempt:
        pose = goal.in_plane(x, None if goal.theta is None else theta)
        return corrector.attempt(replace(near, goal=pose), task.aimed_at(pose))

    (x, theta), (off, turn) = near.landing, near.miss
    nearest, moves = None, 0
    for dx, dtheta in () if step.stays else ((0.0, -turn), (-off, 0.0)):
        done = 0.0
        for k in range(HALVINGS if dx or dtheta else 0):
            share = done + 0.5 ** (k + 1)
            made, moves = at(x + share * dx, theta + share * dtheta), moves + 1
            if made.solved:
                done, nearest = share, made
            elif made.verdict is None:
                names = near.optimum.binding
            else:
                names = tuple(dict.fromkeys(one.limit_name for one in made.verdict.broken))
        x, theta = x + done * dx, theta + done * dtheta
    nearest = nearest or at(x, theta)
    missed = task.scene.object.pose_error(*goal.miss(x, theta))
    edge = NearestFeasible(nearest.goal, names, missed)
    return replace(nearest, goal=goal, edge=edge, solves=max(moves, 1))
