"""From one starting point to a checked throw: solve, send, throw, correct the aim.

The NLP's smoothed model lands a little beside the model that counts, thrown with what
is really sent. The aim is moved by that miss and the NLP solved again from where it
was, until the miss is under `AIM` or no longer falls.
"""

from __future__ import annotations

import math
import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene
from ..check import (
    Guard,
    Mover,
    PlannedMotion,
    SampledMotion,
    SmoothingError,
    Thrown,
    Violation,
    broken_limits,
    limit_surface_throw,
    scene_violations,
    send,
    throw,
)
from ..ocp import (
    USUAL,
    Asked,
    Margins,
    Solution,
    Solver,
    ThrowNlp,
    Window,
    opening_nodes,
    opening_start,
    parameter_values,
    planned_motion,
)
from ..result import PlannedThrow

Array = npt.NDArray[np.float64]

#: Corrections aim at this on the landing that counts: position [m], angle [rad]; at half the
#: scene's tolerance where that is less.
AIM = (1e-4, math.radians(0.02))
MAX_CORRECTIONS = 8


@dataclass
class Search:
    """One `plan` call: the scene with its target, and bookkeeping.

    trouble: why starts led nowhere, in order; fallback: a throw that keeps less than
    it should, and why; broken: the last attempt's throw, if it led to one that breaks
    something. guards, room: which rows the check has shown to be needed, and where more
    room. until: when, by time.perf_counter(), no further attempt is made. tried: starts,
    with the solver and what was asked, that led nowhere.
    """

    scene: Scene
    times: dict[str, float] = field(default_factory=lambda: defaultdict(float))
    iterations: int = 0
    attempts: int = 0
    trouble: list[str] = field(default_factory=list)
    fallback: tuple[PlannedThrow, str] | None = None
    broken: PlannedThrow | None = None
    guards: frozenset[Guard] = frozenset()
    room: Margins = USUAL.margins
    until: float = math.inf
    tried: set[tuple[object, ...]] = field(default_factory=set)

    @property
    def late(self) -> bool:
        """Whether the time for searching is over."""
        return time.perf_counter() > self.until

    @contextmanager
    def clock(self, name: str) -> Iterator[None]:
        """Adds the block's duration to `name`."""
        start = time.perf_counter()
        try:
            yield
        finally:
            self.times[name] += time.perf_counter() - start

    def take_note(self, thrown: PlannedThrow, found: list[Violation]) -> None:
        """Remembers a throw that breaks something, and what the next NLP has to ask more."""
        self.broken = thrown
        self.trouble.append("; ".join(violation.words for violation in found))
        if self.fallback is None:
            self.fallback = (thrown, self.trouble[-1])
        after = Asked(self.guards, self.room).with_(found)
        self.guards, self.room = after.guards, after.margins

    @property
    def asked(self) -> tuple[frozenset[Guard], Margins]:
        """What it takes an NLP to have now."""
        return self.guards, self.room


@dataclass(frozen=True)
class Problem:
    """An NLP with one solver and the bounds of its variables; a robust one's window."""

    nlp: ThrowNlp
    solver: Solver
    limits: tuple[Array, Array]
    window: Window | None = None


@dataclass(frozen=True)
class _Candidate:
    """A solution, its motion as planned and as sent, and where that lands."""

    solution: Solution
    numbers: Array
    planned: PlannedMotion
    samples: SampledMotion
    opening_time: float
    thrown: Thrown
    aim: tuple[float, float]


def attempt(
    problem: Problem,
    mover: Mover,
    target: Pose,
    guess: Array,
    search: Search,
    warm: Solution | None = None,
    aim: tuple[float, float] = (0.0, 0.0),
    *,
    near: bool = True,
) -> PlannedThrow | None:
    """One solve and its corrections; None (and why, in `search`) if it is no good.

    aim: (dx [m], dtheta [rad]) beside the target to aim at first. near: whether `warm` is the
    solution for almost the same target.
    """
    search.broken = None
    best = _corrected(problem, mover, target, guess, search, warm, aim, near)
    if best is None:
        return None
    with search.clock("check"):
        thrown = _thrown(problem.nlp, mover, best, target, search)
        found = _broken(search.scene, mover, thrown, target)
    if not found:
        return thrown
    search.take_note(thrown, found)
    return None


def _corrected(
    problem: Problem,
    mover: Mover,
    target: Pose,
    guess: Array,
    search: Search,
    warm: Solution | None,
    aim: tuple[float, float],
    near: bool,
) -> _Candidate | None:
    goal = target.in_plane(target.plane_x + aim[0], target.turned(aim[1]).theta)
    tolerance = search.scene.tolerance
    aimed = min(AIM[0], tolerance.position / 2), min(AIM[1], tolerance.angle / 2)
    best, best_miss = None, math.inf
    for _ in range(MAX_CORRECTIONS):
        solution, numbers = _solved(problem, mover, goal, guess, search, warm, near)
        if not solution.success:
            if best is None:
                failed = f"{problem.solver.name} did not converge"
                search.trouble.append(failed if solution.answered else solution.message)
            break
        try:
            candidate = _candidate(problem, mover, solution, numbers, target, goal, search)
        except SmoothingError as error:
            search.trouble.append(str(error))
            break
        dx, dtheta = candidate.thrown.miss(target)
        miss = scaled(dx, dtheta, aimed)
        if not miss < best_miss:
            if best is None:
                search.trouble.append("the object never comes down to the target's height")
            break
        best, best_miss = candidate, miss
        if miss <= 1.0:
            break
        goal = goal.in_plane(goal.plane_x - dx, goal.turned(-dtheta).theta)
        guess, warm, near = solution.x, solution, True
    return best


def _solved(
    problem: Problem,
    mover: Mover,
    goal: Pose,
    guess: Array,
    search: Search,
    warm: Solution | None,
    near: bool,
) -> tuple[Solution, Array]:
    """The NLP's solution for `goal`: from `warm` if that works, else from its point afresh."""
    with search.clock("solve"):
        values = parameter_values(search.scene, mover, goal, problem.window, search.room)
        numbers = problem.nlp.parameters.vector(values)
        solution = problem.solver.solve(guess, numbers, problem.limits, warm, near=near)
        if not solution.success and warm is not None:
            search.iterations += solution.iterations
            solution = problem.solver.solve(warm.x, numbers, problem.limits)
    search.iterations += solution.iterations
    search.attempts += 1
    return solution, numbers


def _candidate(
    problem: Problem,
    mover: Mover,
    solution: Solution,
    numbers: Array,
    target: Pose,
    goal: Pose,
    search: Search,
) -> _Candidate:
    """The solution's motion, smoothed, and its landing by the model that counts."""
    scene = search.scene
    nlp, step = problem.nlp, 0.0 if problem.window is None else problem.window.step
    opening_time = opening_start(nlp, solution.x, step)
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    planned = planned_motion(nlp, mover, solution.x, nodes, step)
    with search.clock("smooth"):
        samples = send(mover, planned)
    motion = planned if scene.robot is None else samples
    with search.clock("check"):
        model = limit_surface_throw if scene.tolerance.model == "ls-step" else throw
        thrown = model(scene, mover, motion, opening_time, target.z)
    turn = 0.0 if goal.theta is None or target.theta is None else goal.theta - target.theta
    aim = (goal.plane_x - target.plane_x, turn)
    return _Candidate(solution, numbers, planned, samples, opening_time, thrown, aim)


def _thrown(
    nlp: ThrowNlp, mover: Mover, best: _Candidate, target: Pose, search: Search
) -> PlannedThrow:
    """The candidate thrown by the models that count."""
    scene = search.scene
    planned, samples, at = best.planned, best.samples, best.opening_time
    motion = planned if scene.robot is None else samples
    counting = best.thrown
    if scene.tolerance.model == "ls-step":
        counting = throw(scene, mover, motion, at, target.z)
    exact, sent = counting, None
    if scene.robot is not None:
        exact, sent = throw(scene, mover, planned, at, target.z), counting
    x, z, theta = np.array(nlp.landing(best.solution.x, best.numbers)).ravel()
    return PlannedThrow(
        scene,
        mover,
        nlp,
        best.solution,
        planned,
        samples,
        at,
        (x, z, theta),
        exact,
        sent,
        best.thrown,
        best.aim,
        search.room,
    )


def _broken(scene: Scene, mover: Mover, thrown: PlannedThrow, target: Pose) -> list[Violation]:
    """Everything that a solved throw must not break, in words."""
    tolerance = scene.tolerance
    throws = {"planned": thrown.exact}
    if thrown.sent is not None:
        throws["sent"] = thrown.sent
    if tolerance.model == "ls-step":
        throws = {"sent": thrown.final}
    problems = []
    for label, result in throws.items():
        dx, dtheta = result.miss(target)
        if not scaled(dx, dtheta, (tolerance.position, tolerance.angle)) <= 1.0:
            off = f"{1e3 * abs(dx):.2f} mm and {math.degrees(abs(dtheta)):.2f} deg off"
            problems.append(Violation(f"{label} motion lands {off}"))
    problems += [
        Violation(f"limit of {name} broken")
        for name in broken_limits(mover.hard, mover.joints, thrown.samples)
    ]
    if thrown.exact.grip_use > 1.0:
        use = f"grip use {thrown.exact.grip_use:.2f}"
        problems.append(Violation(f"slip before the opening ({use})", "carry"))
    motion = thrown.planned if thrown.sent is None else thrown.samples
    end = thrown.planned.times[-1] if thrown.sent is None else thrown.samples.times[-1]
    return problems + scene_violations(scene, mover, motion, end, thrown.opening_time, thrown.final)


def scaled(dx: float, dtheta: float, scale: tuple[float, float]) -> float:
    """The larger of the two misses, each in its own unit of `scale`; inf for NaN."""
    value = max(abs(dx) / scale[0], abs(dtheta) / scale[1])
    return value if math.isfinite(value) else math.inf
