"""Extreme cases planned one after the other, in processes that can be ended."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ...problems import InputError
from ..plan import Planner
from ..result import Plan
from .conditioning import condition, kkt_matrix
from .extreme_scenes import Case
from .in_turn import ENDINGS, shared
from .judge import Verdict, judged
from .page import Cell

#: A case that takes longer than this [s] is a hang; its process is ended.
PATIENCE = 60.0


@dataclasses.dataclass(frozen=True)
class Outcome:
    """What became of one case. cause: in words, why it is not solved, or not truly.

    raw, scaled: condition of the KKT matrix as it is, and equilibrated; seconds: the plan.
    """

    case: Case
    status: str
    cause: str = ""
    verdict: Verdict | None = None
    finite: bool = True
    iterations: int = 0
    seconds: float = math.nan
    raw: float = math.nan
    scaled: float = math.nan

    @property
    def false(self) -> bool:
        """Whether it is called solved and is not."""
        return self.verdict is not None and bool(self.verdict.wrong)

    @property
    def undecided(self) -> bool:
        """Whether the independent release moves too much with its steps to say anything."""
        return self.verdict is not None and self.verdict.doubt > self.case.scene.tolerance.position

    @property
    def log_scaled(self) -> float:
        """Decimal logarithm of the scaled condition; NaN where there is none."""
        return math.log10(self.scaled)

    def row(self) -> list[Cell]:
        """Its line in the table."""
        error = (math.nan,) * 3
        if self.verdict is not None:
            error = (self.verdict.miss, self.verdict.other, self.verdict.doubt)
        status = "FALSE solved" if self.false else self.status
        numbers = [self.iterations, 1e3 * self.seconds, self.log_scaled, math.log10(self.raw)]
        words = self.cause if len(self.cause) < 160 else self.cause[:157] + "…"
        return [self.case.name, status, *(1e3 * e for e in error), *numbers, words]


def run(case: Case) -> Outcome:
    """Plans one case, throws it again, looks at its KKT matrix."""
    start = time.perf_counter()
    try:
        planner = Planner(case.scene, compiling="no")
        plan = planner.plan(case.target(planner))
    except InputError as error:
        return Outcome(case, "refused", str(error), seconds=time.perf_counter() - start)
    except Exception as error:
        words = f"{type(error).__name__}: {error}"
        return Outcome(case, "traceback", words, seconds=time.perf_counter() - start)
    seconds = time.perf_counter() - start
    verdict, cause, conditions = None, plan.message, (math.nan, math.nan)
    if plan.solved and plan.throw is not None:
        verdict = judged(plan.throw, plan.target)
        cause = "; ".join(verdict.wrong)
        conditions = condition(kkt_matrix(plan.throw))
    whole = finite(plan)
    return Outcome(case, plan.status, cause, verdict, whole, plan.iterations, seconds, *conditions)


def finite(plan: Plan) -> bool:
    """Whether every number that the plan stands for is one."""
    found: list[Any] = []
    if plan.nearest is not None:
        found += [plan.nearest.x, plan.nearest.z, plan.nearest.theta or 0.0]
    if plan.solved and plan.throw is not None:
        thrown = plan.throw
        found += [thrown.solution.x, thrown.solution.lam_g, thrown.planned_landing]
        found += [thrown.samples.q, thrown.samples.dq, thrown.samples.ddq, plan.error_sent()]
        found += [thrown.final.release.com, thrown.final.release.com_twist]
    return all(bool(np.isfinite(np.asarray(value, float)).all()) for value in found)


def outcomes(wanted: Sequence[Case], patience: float = PATIENCE) -> Iterator[Outcome]:
    """All cases in turn."""
    answers = shared(run, [(case,) for case in wanted], patience)
    for case, answer in zip(wanted, answers, strict=True):
        if isinstance(answer, Outcome):
            yield answer
        else:
            yield Outcome(case, answer, ENDINGS[answer], seconds=patience)
