"""The choice among throws to one target: the best under the scene's uncertainty."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

from ...models import Flags
from ..result import Plan
from ..uncertainty import RestingThrow, sampler_of
from ..verdict import is_as_successful
from .results import pose_errors
from .running import SAMPLES, SEED, judge_of, run_sweep
from .statistics import ROUNDING, quantiles


@dataclass(frozen=True, eq=False)
class Candidate:
    """A throw to the target, with its success under the samples that all candidates share."""

    plan: Plan

    @cached_property
    def swept(self) -> tuple[Flags, float]:
        """Flags (N,) of the samples that succeed, and the 95 % pose error [m]; equal to
        `sweep`'s."""
        scene = self.plan.scene
        sampler = sampler_of(scene, SEED)
        judge = judge_of(self.plan, scene.deciding_model, sampler)
        _, _, landings = run_sweep(judge, sampler, SAMPLES)
        nominal = judge.verdicts(judge.batch.nominal())
        errors = pose_errors(self.plan, landings, nominal)
        return landings.succeeds, quantiles(errors["scaled"])["95"]

    @cached_property
    def success(self) -> Flags:
        """Flags of the samples that succeed: those of a sweep; with [rest] those (64,) that also
        come to rest where they should."""
        assert self.plan.throw is not None
        if self.plan.scene.rest is None:
            return self.swept[0]
        return RestingThrow(self.plan.throw.deciding).stays

    @property
    def cost(self) -> tuple[float, float]:
        """What decides among throws that succeed alike: 95 % pose error [m], then effort."""
        assert self.plan.throw is not None
        return max(self.swept[1], ROUNDING), self.plan.throw.effort

    @property
    def words(self) -> str:
        """Success and 95 % pose error as text."""
        succeeds, error = self.swept
        size = f"{1e3 * error:.2g} mm" if math.isfinite(error) else "no landing"
        share = f"{100 * succeeds.mean():.1f} %"
        return f"of {SAMPLES:,} uncertain throws {share} succeed, 95 % error {size}"


def best_of(candidates: Iterable[Candidate]) -> Candidate:
    """The throw with the most successes; of those that tie with it (McNemar's test) the one with
    the least 95 % pose error, then the least effort."""
    some = list(candidates)
    safest = max(some, key=lambda one: int(one.success.sum()))
    return min(
        (one for one in some if is_as_successful(one.success, safest.success)),
        key=lambda one: one.cost,
    )


def choose(plans: Sequence[Plan]) -> Plan:
    """The best of several plans to one target, with the others as its alternatives."""
    return chosen([Candidate(plan) for plan in plans])


def chosen(candidates: Sequence[Candidate]) -> Plan:
    """The best of candidates, with the others as its alternatives."""
    best = best_of(candidates)
    others = tuple(one.plan for one in candidates if one is not best)
    message = f"{best.plan.message}; {best.words}"
    return dataclasses.replace(best.plan, message=message, sampled=best.words, alternatives=others)
