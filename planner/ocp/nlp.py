"""The throw as a multiple-shooting NLP, composed of what the scene has.

Decision vector, stage by stage (n coordinates; C carry, O opening intervals):

    stage          states                                    controls
    k = 0          q (n, unless the start is given), T        c (n)
    0 < k < C      q (n), dq (n), ddq (n, jerk control), T    c (n)
    k = C          q (n), dq (n), ddq (n, jerk control)       c (n)
    C < k < C + O  the same and rel (6; 4 without the pivot)  c (n)
    k = C + O      the same                                   t_f, cup entry times

A robust plan has intervals of fixed length before the opening, stages like k = C, and
after it, without rel; the stage of detach then has c too.

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

from ..check import Mover
from .assembly import Nlp, Stage, assemble
from .context import Context, Structure
from .ending import at_rest, detached
from .phases import carry_interval, leaving_interval, opening_interval, waiting_interval
from .scenarios import scattered, scenario_interval
from .window_rows import ROBUST, interval_length


@dataclass(frozen=True)
class ThrowNlp(Nlp):
    """The NLP of a throw and the structure it was built for."""

    structure: Structure


def build_nlp(structure: Structure, mover: Mover) -> ThrowNlp:
    """The NLP of a structure; its numbers come later, through the parameters."""
    context = Context(structure, mover)
    s = structure
    made: dict[tuple[bool, ...], Stage] = {}
    stages = []
    # Stages share a kind unless states come or go there, or something is asked only there.
    for k in range(s.last + 1):
        marks = (0, s.carry - 1, s.carry, s.opens, s.detach, s.last)
        kind = tuple(k < mark for mark in marks) + tuple(k == mark for mark in marks)
        if kind not in made:
            made[kind] = context.stage(k)
        stages.append(made[kind])
    closed: set[int] = set()
    for k, stage in enumerate(stages[:-1]):
        if id(stage) not in closed:
            closed.add(id(stage))
            _interval(context, k, stage, stages[k + 1])
    landing = detached(context, stages[s.detach])
    if s.scenarios:
        scattered(context, stages[-1])
    at_rest(context, stages[-1])
    nlp = assemble(stages, context.parameters, ca.vertcat(*landing), s.detach)
    return ThrowNlp(**vars(nlp), structure=structure)


def _interval(context: Context, k: int, stage: Stage, following: Stage) -> None:
    """What holds in the interval after stage k."""
    s = context.structure
    if k < s.carry:
        carry_interval(context, k == 0, stage, following)
    elif k < s.opens:
        waiting_interval(context, k == s.carry, stage, following)
    elif k < s.detach:
        opening_interval(context, k == s.opens, stage, following)
    else:
        leaving_interval(context, stage, following)
    if s.robust and k >= s.carry:
        ROBUST[s.robust](context, k, stage)
    for number in range(s.scenarios if k >= s.carry else 0):
        scenario_interval(context, number, stage, following, interval_length(context, k, stage))
