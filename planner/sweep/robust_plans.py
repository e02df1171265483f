"""Robust throws from a plain one: candidates, and the choice between them."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models import Flags
from ...problems import Mesh, Robust, Scene
from ..ocp import peak_load
from ..result import PLAIN, Plan
from ..search import Exact, NlpCache, Outcome, Task, attempt, guess_of
from ..uncertainty import sampler_of
from ..verdict import is_as_successful
from .results import pose_errors
from .running import SAMPLES, SEED, judge_of, run_sweep
from .statistics import ROUNDING, quantiles

#: Mesh of robust throws: they hardly slide, so even intervals and a wide rounding are enough.
QUIET_MESH = Mesh(opening=8, grading=1.0, epsilon=0.03)
#: Robust method of constant joint rates, for throws without a quiet release.
CONSTANT_RATES = "joint-velocity"
#: Robust method of several throws under one motion of the hand.
SCENARIOS = "scenarios"
#: Method of another plain throw to the target.
ALTERNATIVE = "alternative"


@dataclass(frozen=True)
class HardeningSettings:
    """Settings of the comparison of candidates, and of the end of the search.

    error_tie: 95 % errors tie within this share. good_error: the search ends if all samples succeed
    with at most this share of the plain throw's error. reserved: share of the samples for which
    grip and clearances have a reserve. tries: NLPs of one method from one throw.
    """

    error_tie: float = 0.05
    good_error: float = 0.1
    reserved: float = 0.999
    tries: int = 2


SETTINGS = HardeningSettings()


@dataclass(frozen=True, eq=False)
class JudgedThrow:
    """A throw to the target, with its success under the common samples.

    plan: with this throw; method: its origin.
    """

    plan: Plan
    method: str

    @cached_property
    def judged(self) -> tuple[Flags, float]:
        """Flags (N,) of the samples that succeed, and the 95 % pose error [m]; equal to
        `sweep`'s."""
        scene = self.plan.scene
        sampler = sampler_of(scene, SEED)
        judge = judge_of(self.plan, scene.tolerance.model, sampler)
        _, _, landings = run_sweep(judge, sampler, SAMPLES)
        nominal = judge.verdicts(judge.batch.nominal())
        errors = pose_errors(self.plan, landings, nominal)
        return landings.succeeds, quantiles(errors["scaled"])["95"]

    @property
    def error(self) -> float:
        """95 % pose error [m]."""
        return self.judged[1]

    @property
    def words(self) -> str:
        """Success and 95 % pose error as text."""
        success, error = self.judged
        size = f"{1e3 * error:.2f} mm" if math.isfinite(error) else "no landing"
        return f"{100 * success.mean():.1f} % succeed, 95 % error {size}"

    def is_as_successful(self, other: JudgedThrow) -> bool:
        """Whether its success rate is not significantly below the other's."""
        return is_as_successful(self.judged[0], other.judged[0])

    def is_good(self, plain: JudgedThrow) -> bool:
        """Whether the search for a better throw may end."""
        allowed = max(SETTINGS.good_error * plain.error, ROUNDING)
        return bool(self.judged[0].all()) and self.error <= allowed


def best_of(candidates: Sequence[JudgedThrow]) -> JudgedThrow:
    """The least 95 % error among the candidates of highest success.

    The first candidate, the plain throw, is chosen unless another is significantly better.
    """
    safest = max(candidates, key=lambda one: int(one.judged[0].sum()))
    good = [one for one in candidates if one.is_as_successful(safest)]
    best, plain = min(good, key=lambda one: one.error), candidates[0]
    keeps_plain = plain in good and (1 - SETTINGS.error_tie) * plain.error <= max(
        best.error, ROUNDING
    )
    return plain if keeps_plain else best


@dataclass(frozen=True)
class Hardening:
    """Makes a throw robust by `method`.

    `auto` tries a quiet release, then constant joint rates, then scenarios from the best throw.
    """

    problems: NlpCache
    method: str
    task: Task

    @property
    def methods(self) -> tuple[str, ...]:
        """The NLP methods in their order; scenarios start from the best candidate."""
        if self.method == "auto":
            return Robust.QUIET, CONSTANT_RATES, SCENARIOS
        return (Robust.QUIET, SCENARIOS) if self.method == SCENARIOS else (self.method,)

    def attempts_from(self, source: Plan, method: str) -> list[Outcome]:
        """Attempts of one method from a plan's throw: with reserves for uncertain parameters, then
        without.

        One that hits the target is the last.
        """
        mesh, start, found = self.problems.scene.mesh, source.throw, list[Outcome]()
        assert start is not None
        plain = self.task.scene.replace(mesh=mesh)
        for scene in dict.fromkeys((with_reserves(plain), plain)):
            task = dataclasses.replace(self.task, scene=scene)
            guess = guess_of(start, scene, method)
            # The middle of a region is the farthest from its bounds.
            first = Exact(source.target.middle, guess, start.refinement, robust=method)
            found.append(attempt(self.problems, first, task, rounds=SETTINGS.tries))
            if found[-1].hits or self.task.budget.late:
                return found
            if found[-1].throw is not None:
                # Less reserve does not help: a throw was found, and it breaks another limit.
                break
        return found

    def candidate(self, source: Plan, found: Outcome, method: str) -> JudgedThrow:
        """The candidate of a throw that was found."""
        assert found.throw is not None
        scene = self.task.scene.replace(mesh=self.problems.scene.mesh)
        deciding = found.throw.deciding.in_scene(scene)
        throw = dataclasses.replace(found.throw, deciding=deciding)
        plan = dataclasses.replace(source, throw=throw, solver=found.solver)
        return JudgedThrow(plan, method)


def robust_scene(scene: Scene) -> Scene:
    """The scene with the mesh of robust plans, unless it sets its own."""
    return scene.replace(mesh=QUIET_MESH) if scene.mesh == Mesh() else scene


def with_reserves(scene: Scene) -> Scene:
    """The scene with reserves of grip and clearances for its [uncertainty] until the opening.

    They cover the friction and the displacement of the held bar in a share `reserved` of the
    samples.
    """
    if scene.uncertainty is None:
        return scene
    sampler = sampler_of(scene, SEED)
    own = scene.values | {"delay": scene.mean_delay}
    draws = dict(zip(sampler.names, sampler.draw(0, SAMPLES).T, strict=True))
    value = {name: draws.get(name, np.full(SAMPLES, own[name])) for name in own}
    h = value["com_offset"] - value["grasp_offset"] + own["grasp_offset"]
    pads = own["friction"] / value["friction"]
    heavy = value["mass"] / own["mass"]
    # Against turning, the moment of inertia about the pads, and the weight's lever.
    about_pads = value["inertia"] + value["mass"] * h**2
    levers = [about_pads / (own["inertia"] + own["mass"] * own["com_offset"] ** 2)]
    if own["com_offset"] > 0.0:
        levers.append(heavy * np.abs(h) / own["com_offset"])
    turning = np.max(levers, axis=0) * own["patch_radius"] / value["patch_radius"]
    load = float(np.quantile(pads * np.maximum(heavy, turning), SETTINGS.reserved))
    margin = max(scene.gripper.sticking_margin, 1.0 - 1.0 / max(load, 1.0))
    scene = scene.changed(gripper=scene.gripper.changed(sticking_margin=margin))
    lever = max(scene.object.com, scene.object.length - scene.object.com)
    angle = np.abs(value["grasp_angle"] - own["grasp_angle"] + value["hand_theta"])
    off = np.abs(value["grasp_offset"] - own["grasp_offset"]) + lever * angle
    off = float(np.quantile(off + np.hypot(value["hand_x"], value["hand_z"]), SETTINGS.reserved))
    if scene.workspace is None or off == 0.0:
        return scene
    room = scene.workspace
    wider = {
        name: getattr(room, name) + off
        for name in ("floor", "column_radius", "column_height", "palm_clearance")
        if getattr(room, name) is not None
    }
    return scene.changed(workspace=room.changed(**wider))


def hardened(plan: Plan, hardening: Hardening, others: Callable[[], Plan]) -> Plan:
    """The best plan to a target under the scene's uncertainty.

    It is `plan` itself, or a robust throw from it or from the alternatives of `others`.
    """
    plain = JudgedThrow(plan, PLAIN)
    candidates = [plain]
    tried, scenario_sources = list[Outcome](), list[JudgedThrow]()

    def is_complete() -> bool:
        return best_of(candidates).is_good(plain) or hardening.task.budget.late

    for source in _sources(plain, others):
        if source is not plain:
            candidates.append(source)
        for method in hardening.methods:
            start = best_of(candidates) if method == SCENARIOS else source
            if is_complete():
                break
            if method == SCENARIOS:
                if start in scenario_sources:
                    continue
                scenario_sources.append(start)
            found = hardening.attempts_from(start.plan, method)
            tried += found
            if found and found[-1].hits:
                candidates.append(hardening.candidate(start.plan, found[-1], method))
        if is_complete():
            break
    hardening.task.budget.counts["starts"] += len(tried)
    return _best_plan(candidates, hardening.method, tried)


def _sources(plain: JudgedThrow, others: Callable[[], Plan]) -> Iterator[JudgedThrow]:
    """The plain throw, then other throws to the target."""
    yield plain
    for other in others().alternatives:
        yield JudgedThrow(other, ALTERNATIVE)


def _best_plan(candidates: Sequence[JudgedThrow], method: str, tried: Sequence[Outcome]) -> Plan:
    """The plan of the best candidate; its message gives the sweeps of this and the plain throw."""
    best, plain = best_of(candidates), candidates[0]
    throw = best.plan.throw
    assert throw is not None
    uncertain = "[uncertainty]" if best.plan.scene.uncertainty else "a delay of up to 10 ms"
    words = f"{throw.words(best.plan.target)}; of {SAMPLES:,} throws under {uncertain} {best.words}"
    robust = [one for one in candidates if one.method not in (PLAIN, ALTERNATIVE)]
    if best is not plain:
        words += f"; of the plain throw {plain.words}"
    elif robust:
        second = best_of(robust)
        words += f"; the best robust throw, by {second.method}, is not better: {second.words}"
    elif tried:
        judged = tried[-1].verdict
        reason = "no motion keeps all constraints" if judged is None else judged.words
        words += f"; the throw is the plain one: {method} found none ({reason})"
    else:
        words += ", by the plain throw"
    variables, constraints = throw.nlp_size
    return dataclasses.replace(
        best.plan,
        message=words,
        variables=variables,
        constraints=constraints,
        robust=best.method,
        peak_load=peak_load(throw.deciding),
    )
