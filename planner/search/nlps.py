"""A scene's NLPs with their solvers, built when first needed and kept; whether it has any throw."""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from copy import copy
from dataclasses import dataclass, field, replace

import numpy as np

from ...models import Array, HandSamples
from ...problems import InputError, Pose, Scene
from ..check import Guard, Mover, friction_use
from ..ocp import Asked, Request, Solver, ThrowNlp, build_nlp, processor_time

#: A plan's own time does not count what is built for it, up to so much [s]: twice 0.5 s for the
#: Panda's NLPs, more with torques.
BUILDING = 1.5
#: Random start poses tried when the start is free.
POSES = 4000
#: Parts of a plan whose times are always told; a plan that needs no solve spent no time on it.
PARTS = ("build", "guess", "solve", "smooth", "check")


@dataclass(frozen=True)
class Clock:
    """When a plan must end, by time.perf_counter(), and how long its parts took [s].

    What is built once, for later plans too, puts `until` off, by BUILDING [s] at most; so does a
    busy machine, until `processor_time` is `processor`.
    """

    until: float = math.inf
    processor: float = -math.inf
    seconds: dict[str, float] = field(
        default_factory=lambda: defaultdict(float, dict.fromkeys(PARTS, 0.0))
    )

    @classmethod
    def lasting(cls, patience: float) -> Clock:
        """From now on, for `patience` [s], all of which planning must have had to itself."""
        return cls(time.perf_counter() + patience, processor_time() + patience)

    @property
    def left(self) -> float:
        """Time for planning that is left [s]."""
        left = max(self.until - time.perf_counter(), self.processor - processor_time())
        return left + min(self.seconds["build"], BUILDING)

    @property
    def late(self) -> bool:
        """Whether the time for planning is over."""
        return self.left < 0.0

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
    """One call of the planner: the scene aimed at its target, solvers in order, and the clock."""

    scene: Scene
    target: Pose
    solvers: tuple[str, ...] = ("fatrop", "ipopt")
    clock: Clock = field(default_factory=Clock)

    def aimed_at(self, target: Pose) -> Task:
        """The same for another target."""
        return replace(self, scene=self.scene.aimed_at(target), target=target)


@dataclass(frozen=True)
class Program:
    """An NLP with one solver and the bounds of its variables."""

    nlp: ThrowNlp
    solver: Solver
    limits: tuple[Array, Array]


@dataclass(frozen=True)
class _Kind:
    """Which of a scene's NLPs: for what kind of target, which guards and bodies, robust how."""

    target: tuple[bool, bool, bool]
    guards: frozenset[Guard]
    near: frozenset[str]
    robust: str


class Problems:
    """NLPs and solvers of one scene by what they are asked."""

    def __init__(self, scene: Scene, mover: Mover) -> None:
        self.scene, self.mover = scene, mover
        self._nlps: dict[_Kind, ThrowNlp] = {}
        self._problems: dict[tuple[_Kind, str], Program] = {}

    def begun(self, mover: Mover) -> Problems:
        """The same NLPs for a mover that begins in another state of motion."""
        found = copy(self)
        found.mover = mover
        return found

    def nlp(self, target: Pose, asked: Asked, clock: Clock, robust: str = "") -> ThrowNlp:
        """The NLP for a target."""
        kind = _Kind(target.kind, asked.guards, asked.near, robust)
        if kind not in self._nlps:
            with clock("build"):
                request = Request(self.scene, self.mover, target, asked, robust)
                self._nlps[kind] = build_nlp(request)
        return self._nlps[kind]

    def problem(
        self, target: Pose, asked: Asked, solver: str, clock: Clock, robust: str = ""
    ) -> Program:
        """The same with a solver: 'fatrop' or 'ipopt'."""
        kind = _Kind(target.kind, asked.guards, asked.near, robust)
        if (kind, solver) not in self._problems:
            nlp = self.nlp(target, asked, clock, robust)
            with clock("build"):
                made = Solver(nlp, solver)
                request = Request(self.scene, self.mover, target, asked, robust)
                self._problems[kind, solver] = Program(nlp, made, nlp.bounds(request))
        return self._problems[kind, solver]


def check_start(scene: Scene, mover: Mover) -> None:
    """InputError if no permitted start pose lets the full grip hold the object at rest."""
    limits = mover.planning
    if (limits.q_min > limits.q_max).any():
        raise InputError(f"{scene.place}: [robot] position_margin leaves no room")
    if mover.start is not None:
        q = mover.start[:, None]
        _check_margin(scene, mover, mover.start)
    else:
        rng = np.random.default_rng(0)
        q = rng.uniform(limits.q_min, limits.q_max, (POSES, mover.size)).T
    zero = np.zeros_like(q)
    hand = HandSamples(np.zeros(q.shape[1]), *(np.array(o) for o in mover.motion(q, zero, zero)))
    use = float(np.hypot(*friction_use(scene, hand)).min())
    allowed = 1.0 - scene.mesh.sticking_margin
    if use > allowed:
        full, table = scene.gripper.profile().full, scene.gripper.table
        given = f"force = {full:g}:" if table is None else f"table = {table}: {full:g} N is"
        where = "its start pose" if mover.start is not None else "any permitted start pose"
        raise InputError(
            f"{scene.place}: [gripper] {given} too weak to hold the object at rest in "
            f"{where}, needs at least {full * use / allowed:.3g} N"
        )


def _check_margin(scene: Scene, mover: Mover, start: Array) -> None:
    """InputError if a given start of an arm is nearer a limit than the planner's margin."""
    if scene.robot is None:
        return
    limits = mover.planning
    for name, *values in zip(mover.joints, start, limits.q_min, limits.q_max, strict=True):
        value, low, high = (math.degrees(v) for v in values)
        if not low <= value <= high:
            raise InputError(
                f"{scene.place}: [robot] start_deg: {name} at {value:.2f} must be within "
                f"[{low:.2f}, {high:.2f}], the limits less position_margin"
            )
