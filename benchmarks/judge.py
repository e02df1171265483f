"""Whether a plan that is called solved is true, by the oracle, which shares no code with it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from throwplan import Plan

from oracle import STEPS, oracle_of


@dataclass(frozen=True)
class Judgement:
    """What the oracle finds of a solved plan.

    broken: limits that it breaks by more than the oracle's error; error [m]: horizontal distance
    of the landing from the target; doubt [m]: change of the landing with half the oracle's steps.
    """

    broken: tuple[str, ...]
    error: float
    doubt: float


def judge(plan: Plan) -> Judgement:
    """The oracle's judgement of a solved plan, by the files that it saves."""
    oracle = oracle_of(plan)
    judged = oracle.judge(planned=True)
    doubt = np.abs(oracle.landing(STEPS // 2) - judged.landing)[0]
    own_error = {"position": doubt[0], "angle": doubt[1]}
    broken = tuple(
        name
        for name, found in judged.found.items()
        if found.broken.any()
        and not found.doubtful.all()
        and not (found.room + own_error.get(name, 0.0) / found.limit >= 0.0).all()
    )
    error = abs(judged.landing[0, 0] - oracle.target_x)
    return Judgement(broken, float(error), float(doubt[0]))
