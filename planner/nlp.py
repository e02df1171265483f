"""The throw as a multiple-shooting NLP, composed of what the scene has.

Decision vector, stage by stage (n coordinates; C carry, O opening intervals):

    stage          states                                    controls
    k = 0          q (n, unless the start is given), T        c (n)
    0 < k < C      q (n), dq (n), ddq (n, jerk control), T    c (n)
    k = C          q (n), dq (n), ddq (n, jerk control)       c (n)
    C < k < C + O  the same and rel (6; 4 without the pivot)  c (n)
    k = C + O      the same                                   t_f, cup entry times

T [s] is the carry's duration: the release timing. c is the control: jerk
[1000 rad/s^3] or acceleration [rad/s^2; m/s^2], constant in an interval, so that
the coordinates inside it are closed forms. rel is the relative state of the sliding
pivot (slip [m], angle [rad] and rates). t_f [s] is the flight time. At rest dq and
ddq are zero and no variables, rel is so at the opening's start, and a given start
pose is no variable either.

Every number of the scene is in the parameter vector, so one build serves all
targets, masses, frictions, limits and grip profiles of its structure.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca

from .context import Context, Structure
from .ending import end
from .mover import Mover
from .ocp import Nlp, assemble
from .phases import carry_interval, opening_interval


@dataclass(frozen=True)
class ThrowNlp(Nlp):
    """The NLP of a throw and the structure it was built for."""

    structure: Structure


def build_nlp(structure: Structure, mover: Mover) -> ThrowNlp:
    """The NLP of a structure; its numbers come later, through the parameters."""
    context = Context(structure, mover)
    stages = [context.stage(k) for k in range(structure.last + 1)]
    for k in range(structure.carry):
        carry_interval(context, k, stages[k], stages[k + 1])
    for k in range(structure.carry, structure.last):
        opening_interval(context, k - structure.carry, stages[k], stages[k + 1])
    landing = end(context, stages[-1])
    nlp = assemble(stages, context.parameters, ca.vertcat(*landing))
    return ThrowNlp(**vars(nlp), structure=structure)
