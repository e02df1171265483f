"""From a throw to one that bears an uncertain opening."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ...problems import QUIET, Mesh, Scene
from ..ocp import Request, peak_load
from ..result import Plan, PlannedThrow
from ..search import Attempt, Problems, Start, Task, attempts, refit, scatter
from ..sweep import sweep

#: A robust throw hardly slides, so its opening needs even intervals, and a wider rounding costs
#: nothing.
QUIET_MESH = Mesh(opening=8, grading=1.0, epsilon=0.03)
#: Throws of the small sweep that judges a plan.
SAMPLES = 256
#: No other source is tried after a throw that scatters this share of the nominal one's.
LITTLE = 0.1
#: The method for throws that cannot be made quiet.
CONSTANT_RATES = "joint-velocity"
#: NLPs tried by one method from one throw.
TRIES = 2


@dataclass(frozen=True)
class Hardened:
    """A robust throw of a source plan's target.

    method, solver: what made it; peak_load: see `ocp.peak_load`; scatter [m]: how far delays
    move its landing.
    """

    source: Plan
    thrown: PlannedThrow
    method: str
    solver: str
    peak_load: float
    scatter: float

    @property
    def little(self) -> bool:
        """Whether it scatters so little that nothing else needs to be tried."""
        allowed = _allowed(self.source)
        if self.method != "nominal":
            assert self.source.throw is not None
            allowed = max(LITTLE * scatter(self.source.throw, self.source.target), allowed)
        return self.scatter <= allowed


@dataclass
class Hardening:
    """The search for a robust throw by `method`, with the attempts that it took.

    The throw that scatters least among those from the sources; the first that scatters little
    ends the search: not every throw can be made quiet, and another throw to the target often can.
    'auto' takes quiet throws, and where those scatter more constant joint rates: near the
    base, where the hand cannot follow a free flight, a slow release scatters less. Where the
    best is outside the tolerance it goes on to scenarios from there. It keeps the nominal throw
    where nothing scatters less.
    """

    problems: Problems
    method: str
    task: Task
    attempts: list[Attempt] = field(default_factory=list)

    def __post_init__(self) -> None:
        scene = self.task.scene.replace(mesh=self.problems.scene.mesh)
        self.task = dataclasses.replace(self.task, scene=scene)

    def best(self, sources: Iterable[Plan]) -> Hardened | None:
        """The robust throw that scatters least; None if there is none."""
        best: Hardened | None = None
        auto = self.method == "auto"
        for source in sources:
            if best is not None and self.task.clock.late:
                break
            best = _better(best, self._by_method(source, QUIET if auto else self.method))
            if auto:
                best = _better(best, self._nominal(source))
            if auto and best is not None and not best.little:
                best = _better(best, self._made(source, source.throw, CONSTANT_RATES))
            if best is not None and best.little:
                break
        if auto and best is not None and spread(best) > _allowed(best.source):
            best = _better(best, self._made(best.source, best.thrown, "scenarios"))
        return best

    def _by_method(self, source: Plan, method: str) -> Hardened | None:
        """A robust throw from one source; scenarios start from a quiet one, if there is one."""
        if method != "scenarios":
            return self._made(source, source.throw, method)
        quiet = self._made(source, source.throw, QUIET)
        start = source.throw if quiet is None else quiet.thrown
        return self._made(source, start, "scenarios") or quiet

    def _nominal(self, source: Plan) -> Hardened:
        """A source's own throw."""
        assert source.throw is not None
        return self._hardened(source, source.throw, "nominal", source.solver)

    def _made(self, source: Plan, start: PlannedThrow | None, method: str) -> Hardened | None:
        """A throw to the source's target by one method, started from the throw `start`."""
        assert start is not None
        request = Request(self.task.scene, self.problems.mover, robust=method)
        first = Start(
            source.target,
            lambda nlp: refit(nlp, start, request),
            "",
            start.asked,
            TRIES,
            again=lambda asked: True,
            robust=method,
        )
        for solver in self.task.solvers:
            for attempt in attempts(
                self.problems, dataclasses.replace(first, solver=solver), self.task
            ):
                self.attempts.append(attempt)
                if attempt.throw is not None and attempt.solved:
                    return self._hardened(source, attempt.throw, method, attempt.solver)
        return None

    def _hardened(self, source: Plan, thrown: PlannedThrow, method: str, solver: str) -> Hardened:
        load = peak_load(thrown.final)
        return Hardened(source, thrown, method, solver, load, scatter(thrown, source.target))


def robust_scene(scene: Scene) -> Scene:
    """The scene with the numerical settings of robust plans, where it has none of its own."""
    return scene.replace(mesh=QUIET_MESH) if scene.mesh == Mesh() else scene


def hardened(plan: Plan, hardening: Hardening, others: Callable[[], Plan]) -> Plan:
    """The plan of a robust throw to the same target, from `plan`'s or the throws of `others`."""
    more: list[Plan] = []

    def sources() -> Iterator[Plan]:
        yield plan
        more.append(others())
        yield from more[0].alternatives

    found = hardening.best(sources())
    plan = dataclasses.replace(
        plan,
        iterations=sum(p.iterations for p in (plan, *more))
        + sum(a.iterations for a in hardening.attempts),
        attempts=sum(p.attempts for p in (plan, *more)) + sum(a.solves for a in hardening.attempts),
    )
    if found is None:
        reason = hardening.attempts[-1].reason if hardening.attempts else ""
        words = f"no robust throw found by {hardening.method}: {reason}"
        return dataclasses.replace(plan, status="not_converged", message=words)
    words = found.thrown.words(found.source.target)
    if found.method == "nominal":
        words += "; no throw found that bears the opening better"
    variables, constraints = found.thrown.nlp_size
    return dataclasses.replace(
        found.source,
        status="solved",
        message=words,
        throw=found.thrown,
        solver=found.solver,
        variables=variables,
        constraints=constraints,
        robust=found.method,
        peak_load=found.peak_load,
        iterations=plan.iterations,
        attempts=plan.attempts,
    )


def _better(best: Hardened | None, found: Hardened | None) -> Hardened | None:
    """The one of two that scatters less."""
    if best is None or found is None:
        return found if best is None else best
    return found if found.scatter < best.scatter else best


def _allowed(source: Plan) -> float:
    """The scene's tolerance [m], position and angle taken together."""
    scene = source.scene
    return scene.tolerance.position + scene.tolerance.angle * scene.object.length / 2


def spread(found: Hardened) -> float:
    """95 % quantile [m] of the scaled error about the throw's own landing, by a small sweep."""
    plan = dataclasses.replace(found.source, throw=found.thrown)
    return float(np.quantile(sweep(plan, samples=SAMPLES).errors["scaled"], 0.95))
