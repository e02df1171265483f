"""A scene's NLPs with their solvers, built when first needed and kept; a plan's task and budget."""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from ...models import Array
from ...problems import Pose, Scene
from ..ocp import Refinement, Request, Solver, ThrowNlp, build_nlp, processor_time
from ..throw import Manipulator
from .library import Turns

#: Most build time [s] that does not count against a plan's patience.
FREE_BUILD_TIME = 1.5
#: What a search counts: starts, NLPs solved (throws moved, too), solver iterations.
Counted = Literal["starts", "solves", "iterations"]
#: Parts of a plan whose times are always reported, zero for a part that is not run.
PARTS = ("build", "guess", "solve", "smooth", "check")


@dataclass(frozen=True)
class Budget:
    """Deadline of a plan, by time.perf_counter(), times [s] of its parts, and what was counted.

    `FREE_BUILD_TIME` of building, which serves later plans too, does not count. On a busy machine a
    plan is late only if the process has also used its processor time, up to `processor`.
    """

    until: float = math.inf
    processor: float = -math.inf
    seconds: dict[str, float] = field(
        default_factory=lambda: defaultdict(float, dict.fromkeys(PARTS, 0.0))
    )
    counts: dict[Counted, int] = field(
        default_factory=lambda: {"starts": 0, "solves": 0, "iterations": 0}
    )

    @classmethod
    def lasting(cls, patience: float) -> Budget:
        """A budget that ends after `patience` [s], on a busy machine of processor time."""
        return cls(time.perf_counter() + patience, processor_time() + patience)

    @property
    def left(self) -> float:
        """Time for planning that is left [s]."""
        left = max(self.until - time.perf_counter(), self.processor - processor_time())
        return left + min(self.seconds["build"], FREE_BUILD_TIME)

    @property
    def late(self) -> bool:
        """Whether the time for planning is over."""
        return time.perf_counter() > self.until and self.left < 0.0

    def part(self, share: float) -> Budget:
        """A budget with a share of the time left, which counts into this one."""
        used = (1.0 - share) * self.left
        return replace(self, until=self.until - used, processor=self.processor - used)

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Adds the block's duration to `name`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[name] += time.perf_counter() - start


@dataclass(frozen=True)
class Task:
    """One call of the planner: the scene aimed at its target, the solver, and the budget.

    turns: whether theta counts modulo full turns; wanted: how many throws that differ to look for;
    loud: whether a throw that was made quiet stays among them as it was, for a comparison; quiet:
    price of the load on the pads.
    """

    scene: Scene
    target: Pose
    solver: str = "fatrop"
    budget: Budget = field(default_factory=Budget)
    turns: Turns = "exact"
    wanted: int = 1
    loud: bool = False
    quiet: float = 0.0

    def aimed_at(self, target: Pose) -> Task:
        """This task for another target; a cup stays where it is for a pose of the task's region."""
        if target is self.target:
            return self
        inside = self.contains(target)
        scene = self.scene.changed(target=target) if inside else self.scene.aimed_at(target)
        return replace(self, scene=scene, target=target)

    def contains(self, pose: Pose) -> bool:
        """Whether the target is a region that has this pose."""
        if not self.target.is_region or pose.is_region:
            return False
        return not any(self.target.miss(pose.plane_x, pose.theta or 0.0))


@dataclass(frozen=True)
class CompiledNlp:
    """An NLP with one solver, and the bounds of its variables for one request."""

    nlp: ThrowNlp
    solver: Solver
    limits: tuple[Array, Array]


#: Key of a scene's NLP: target's kind, lazy constraints, bodies, price of load, robust method,
#: elastic landing.
_Kind = tuple[tuple[bool, ...], frozenset[str], frozenset[str], bool, str, bool]


@dataclass(frozen=True, eq=False)
class NlpCache:
    """NLPs and solvers of one scene by target and refinement, built when first needed.

    options: a user's, of the solvers.
    """

    scene: Scene
    manipulator: Manipulator
    options: Mapping[str, Any] = field(default_factory=dict)
    _nlps: dict[_Kind, ThrowNlp] = field(default_factory=dict)
    _solvers: dict[tuple[_Kind, str], Solver] = field(default_factory=dict)
    _shared: dict[str, Any] = field(default_factory=dict)

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy builds its NLPs anew: CasADi's expressions cannot be copied."""
        return NlpCache, (self.scene, self.manipulator, self.options)

    def from_state(self, manipulator: Manipulator) -> NlpCache:
        """The NLPs, shared with these, for a manipulator that begins in another state of motion."""
        return replace(self, manipulator=manipulator)

    def nlp(self, request: Request, budget: Budget) -> ThrowNlp:
        """The NLP of a request for a target."""
        kind = _kind(request)
        if kind not in self._nlps:
            with budget("build"):
                self._nlps[kind] = build_nlp(request, self._shared)
        return self._nlps[kind]

    def problem(
        self,
        target: Pose,
        refinement: Refinement,
        solver: str,
        budget: Budget,
        robust: str = "",
        elastic: bool = False,
    ) -> CompiledNlp:
        """The NLP for a target with a solver: 'fatrop' or 'ipopt'."""
        request = Request(self.scene, self.manipulator, target, refinement, robust, float(elastic))
        kind, nlp = (_kind(request), solver), self.nlp(request, budget)
        if kind not in self._solvers:
            with budget("build"):
                self._solvers[kind] = Solver(nlp, solver, self.options)
        return CompiledNlp(nlp, self._solvers[kind], nlp.bounds(request))


def _kind(request: Request) -> _Kind:
    refinement, target = request.refinement, request.target
    assert target is not None
    options = refinement.quiet > 0.0, request.robust, request.elastic > 0.0
    return target.kind, refinement.lazy, refinement.bodies, *options
