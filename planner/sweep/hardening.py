"""From a throw to one that bears what is uncertain: candidates, and the choice between them."""

from __future__ import annotations

import dataclasses
import functools
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models import Flags
from ...problems import Mesh, Robust, Scene
from ..ocp import Request, peak_load
from ..result import Plan, PlannedThrow
from ..search import Attempt, NlpCache, Start, Task, attempts, initial_guess_from
from ..verdict import sampler_of
from .results import pose_errors
from .running import SAMPLES, SEED
from .statistics import ROUNDING, quantiles
from .throws import run_sweep, simulator_of

#: A robust throw hardly slides, so its opening needs even intervals, and a wider rounding costs
#: nothing.
QUIET_MESH = Mesh(opening=8, grading=1.0, epsilon=0.03)
#: Numbers of successes tie if they differ by at most this many standard deviations of the
#: difference; errors by at most this share.
DEVIATIONS, SHARE = 2.0, 0.05
#: The search ends where all samples succeed with at most this share of the plain throw's error.
ENOUGH = 0.1
#: The method for throws that cannot be made quiet.
CONSTANT_RATES = "joint-velocity"
#: The method of several throws that share the hand's motion.
SCENARIOS = "scenarios"
#: Methods of candidates that no robust NLP made: the plain throw, and another one to the target.
PLAIN, ALTERNATIVE = "nominal", "alternative"
#: Share of the samples for which grip and clearances keep a reserve.
RESERVED = 0.999
#: NLPs tried by one method from one throw.
TRIES = 2


@dataclass(frozen=True, eq=False)
class JudgedThrow:
    """A throw to the target, and what the common samples make of it.

    plan: with this throw; method, solver: what made it.
    """

    plan: Plan
    method: str
    solver: str

    @cached_property
    def judged(self) -> tuple[Flags, float]:
        """Which of the samples (N,) succeed, and the 95 % pose error [m], as `sweep` tells them."""
        scene = self.plan.scene
        sampler = sampler_of(scene, SEED)
        simulator = simulator_of(self.plan, scene.tolerance.model, sampler)
        thrown = run_sweep(simulator, sampler, SAMPLES)
        if thrown is None or len(thrown[0]) < SAMPLES:
            raise KeyboardInterrupt
        nominal = simulator.throw(simulator.batch.nominal())
        errors = pose_errors(self.plan, thrown[2], nominal)
        return thrown[2].verdicts.succeeds, quantiles(errors["scaled"])["95"]

    @property
    def error(self) -> float:
        """95 % pose error [m]."""
        return self.judged[1]

    @property
    def words(self) -> str:
        """Success and 95 % pose error for people."""
        success, error = self.judged
        far = f"{1e3 * error:.2f} mm" if math.isfinite(error) else "no landing"
        return f"{100 * success.mean():.1f} % succeed, 95 % error {far}"

    def succeeds_as_often(self, other: JudgedThrow) -> bool:
        """Whether it is not below the other's success by more than the samples can tell.

        Of the samples on which the two differ each is as likely to go either way, if they are
        equally good (McNemar's test).
        """
        mine, others = self.judged[0], other.judged[0]
        lost, gained = int((others & ~mine).sum()), int((mine & ~others).sum())
        return lost - gained <= DEVIATIONS * math.sqrt(lost + gained)

    def bears_enough(self, plain: JudgedThrow) -> bool:
        """Whether nothing better needs to be looked for."""
        allowed = max(ENOUGH * plain.error, ROUNDING)
        return bool(self.judged[0].all()) and self.error <= allowed


def best_of(candidates: Sequence[JudgedThrow]) -> JudgedThrow:
    """The least 95 % error among those that succeed as often as any; the first is the plain throw,
    which stays unless another is better by more than the samples can tell."""
    most = max(candidates, key=lambda one: int(one.judged[0].sum()))
    good = [one for one in candidates if one.succeeds_as_often(most)]
    best, plain = min(good, key=lambda one: one.error), candidates[0]
    kept = plain in good and (1 - SHARE) * plain.error <= max(best.error, ROUNDING)
    return plain if kept else best


@dataclass(frozen=True)
class Hardening:
    """How a throw is made robust by `method`; `auto` is quiet, constant joint rates where that is
    not enough, and scenarios from the best throw so far where that is not."""

    problems: NlpCache
    method: str
    task: Task

    @property
    def methods(self) -> tuple[str, ...]:
        """The methods from each source; scenarios start from the best throw so far."""
        if self.method == "auto":
            return Robust.QUIET, CONSTANT_RATES, SCENARIOS
        return (Robust.QUIET, SCENARIOS) if self.method == SCENARIOS else (self.method,)

    def made(self, source: Plan, start: PlannedThrow, method: str) -> tuple[Attempt, ...]:
        """The attempts of one method from a throw, the solved one last if there is one: with
        reserves for what is uncertain at first, then without."""
        mesh, found = self.problems.scene.mesh, list[Attempt]()
        plain = self.task.scene.replace(mesh=mesh)
        solvers = self.task.solvers[:1] if self.method == "auto" else self.task.solvers
        for scene in dict.fromkeys((with_reserves(plain), plain)):
            task = dataclasses.replace(self.task, scene=scene)
            request = Request(scene, self.problems.manipulator, robust=method)
            guess = functools.partial(initial_guess_from, throw=start, request=request)
            for solver in solvers:
                first = Start(
                    source.target, guess, solver, start.refinement, TRIES, again=True, robust=method
                )
                found += attempts(self.problems, first, task)
                if found[-1].solved or self.task.clock.late:
                    return tuple(found)
            if found[-1].throw is not None:
                # What it breaks is not for want of room.
                break
        return tuple(found)

    def candidate(self, source: Plan, made: Attempt, method: str) -> JudgedThrow:
        """The candidate of a solved attempt."""
        assert made.throw is not None
        scene = self.task.scene.replace(mesh=self.problems.scene.mesh)
        thrown = dataclasses.replace(made.throw, deciding=made.throw.deciding.in_scene(scene))
        return JudgedThrow(dataclasses.replace(source, throw=thrown), method, made.solver)


@dataclass(frozen=True)
class _Found:
    """Candidates, the plain throw first; attempts of the methods; the plans that they are from."""

    candidates: tuple[JudgedThrow, ...]
    attempts: tuple[Attempt, ...]
    plans: tuple[Plan, ...]

    @property
    def best(self) -> JudgedThrow:
        return best_of(self.candidates)

    def enough(self, hardening: Hardening) -> bool:
        return self.best.bears_enough(self.candidates[0]) or hardening.task.clock.late

    def with_method(self, hardening: Hardening, source: JudgedThrow, method: str) -> _Found:
        """Those that one method makes from a source, too."""
        throw = source.plan.throw
        assert throw is not None
        made = hardening.made(source.plan, throw, method)
        more = [hardening.candidate(source.plan, one, method) for one in made[-1:] if one.solved]
        return _Found((*self.candidates, *more), (*self.attempts, *made), self.plans)


def robust_scene(scene: Scene) -> Scene:
    """The scene with the numerical settings of robust plans, where it has none of its own."""
    return scene.replace(mesh=QUIET_MESH) if scene.mesh == Mesh() else scene


def with_reserves(scene: Scene) -> Scene:
    """The scene with a grip and clearances that bear its [uncertainty] until the opening.

    A share `RESERVED` of the samples needs no more friction, and no held bar is farther off.
    """
    if scene.uncertainty is None:
        return scene
    sampler = sampler_of(scene, SEED)
    own = scene.values | {"delay": scene.mean_delay}
    drawn = dict(zip(sampler.names, sampler.draw(0, SAMPLES).T, strict=True))
    value = {name: drawn.get(name, np.full(SAMPLES, own[name])) for name in own}
    h = value["com_offset"] - value["grasp_offset"] + own["grasp_offset"]
    pads = own["friction"] / value["friction"]
    heavy = value["mass"] / own["mass"]
    levers = [value["inertia"] / own["inertia"]]
    if own["com_offset"] > 0.0:
        levers.append(heavy * np.abs(h) / own["com_offset"])
    turning = np.max(levers, axis=0) * own["patch_radius"] / value["patch_radius"]
    load = float(np.quantile(pads * np.maximum(heavy, turning), RESERVED))
    margin = max(scene.gripper.sticking_margin, 1.0 - 1.0 / max(load, 1.0))
    scene = scene.changed(gripper=scene.gripper.changed(sticking_margin=margin))
    far = max(scene.object.com, scene.object.length - scene.object.com)
    angle = np.abs(value["grasp_angle"] - own["grasp_angle"] + value["hand_theta"])
    off = np.abs(value["grasp_offset"] - own["grasp_offset"]) + far * angle
    off = float(np.quantile(off + np.hypot(value["hand_x"], value["hand_z"]), RESERVED))
    if scene.workspace is None or off == 0.0:
        return scene
    room = scene.workspace
    wider = {
        name: getattr(room, name) + off
        for name in ("floor", "column_radius", "palm_clearance")
        if getattr(room, name) is not None
    }
    return scene.changed(workspace=room.changed(**wider))


def hardened(plan: Plan, hardening: Hardening, others: Callable[[], Plan]) -> Plan:
    """The best plan to a target under the scene's uncertainty: `plan`, or a robust throw from it or
    from the throws of `others`."""
    found, begun = (
        _Found((JudgedThrow(plan, PLAIN, plan.solver),), (), (plan,)),
        list[JudgedThrow](),
    )
    for source in _sources(found, others):
        if source not in found.candidates:
            found = dataclasses.replace(
                found, candidates=(*found.candidates, source), plans=(*found.plans, source.plan)
            )
        for method in hardening.methods:
            start = found.best if method == SCENARIOS else source
            if found.enough(hardening):
                break
            if method != SCENARIOS or start not in begun:
                found = found.with_method(hardening, start, method)
                begun += [start] if method == SCENARIOS else []
        if found.enough(hardening):
            break
    return _chosen(found, hardening)


def _sources(found: _Found, others: Callable[[], Plan]) -> Iterator[JudgedThrow]:
    """The plain throw; if that is not enough, other throws to the target."""
    yield found.candidates[0]
    for other in others().alternatives:
        yield JudgedThrow(other, ALTERNATIVE, other.solver)


def _chosen(found: _Found, hardening: Hardening) -> Plan:
    """The plan of the best candidate, whose message cites the sweep for it and the plain throw."""
    best, plain = found.best, found.candidates[0]
    throw = best.plan.throw
    assert throw is not None
    uncertain = "[uncertainty]" if best.plan.scene.uncertainty else "a delay of up to 10 ms"
    words = f"{throw.words(best.plan.target)}; of {SAMPLES:,} throws under {uncertain} {best.words}"
    robust = [one for one in found.candidates if one.method not in (PLAIN, ALTERNATIVE)]
    if best is not plain:
        words += f"; of the plain throw {plain.words}"
    elif robust:
        second = best_of(robust)
        words += f"; no throw found that is better, by {second.method} {second.words}"
    elif found.attempts:
        reason = found.attempts[-1].reason
        words += f"; no robust throw found by {hardening.method} ({reason}), this is the plain one"
    else:
        words += ", by the plain throw"
    variables, constraints = throw.nlp_size
    return dataclasses.replace(
        best.plan,
        message=words,
        solver=best.solver,
        variables=variables,
        constraints=constraints,
        robust=best.method,
        peak_load=peak_load(throw.deciding),
        iterations=sum(p.iterations for p in found.plans)
        + sum(a.iterations for a in found.attempts),
        attempts=sum(p.attempts for p in found.plans) + sum(a.solves for a in found.attempts),
    )
