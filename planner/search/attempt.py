"""From one starting point to a checked throw: solve, send, throw, correct the aim, check.

The smoothed model in the NLP lands a little off the model that counts, thrown with what is really
sent. The aim moves by that error and the NLP is solved again from its last solution, until the
error is under `AIM` or no longer falls. A throw whose check finds something broken is solved again
with the constraints and margins against it (`Asked`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...models import STEPPED_SURFACE, Array, Path
from ...problems import Pose, Scene
from ..check import (
    Mover,
    SmoothingError,
    Throw,
    Violation,
    broken_limits,
    send,
)
from ..ocp import (
    USUAL,
    Asked,
    Request,
    Solution,
    ThrowNlp,
    broken,
    planned_motion,
    window_of,
)
from ..result import PlannedThrow
from .guess import refit
from .nlps import Problems, Program, Task

#: Corrections aim at this on the landing that counts: position [m], angle [rad]; at half the
#: scene's tolerance where that is less.
AIM = (1e-4, math.radians(0.02))
MAX_CORRECTIONS = 8
#: A target of more full turns than this may have been given in degrees.
MANY_TURNS = 3
#: Throws differ when, at the opening's start, their coordinates or rates are this far
#: apart, as a share of the larger of the two ...
SHARE = 0.1
#: ... or their flights by this much [s].
FLIGHT = 0.05


@dataclass(frozen=True)
class Start:
    """Where solves begin.

    goal: the target, its turns counted. guess: decision vector for an NLP. asked: what the first
    NLP is asked; tries: NLPs solved, each asked for what the check of the last one found broken.
    light: ends where heavy guards would come in. again: whether the next NLP starts from `guess`
    too, by what it is asked, instead of the broken throw. warm: a solution with its multipliers
    to go on from, near: of almost the same target. aim: (dx [m], dtheta [rad]) from the goal to
    what the NLP is to land at first. rough: lands within half the scene's tolerance, soon or not
    at all. robust: the method of a robust NLP.
    """

    goal: Pose
    guess: Callable[[ThrowNlp], Array]
    solver: str
    asked: Asked = USUAL
    tries: int = 1
    light: bool = False
    again: Callable[[Asked], bool] = lambda asked: False
    warm: Solution | None = None
    near: bool = True
    aim: tuple[float, float] = (0.0, 0.0)
    rough: bool = False
    robust: str = ""


@dataclass(frozen=True)
class Edge:
    """The nearest possible landing to `goal` that was found (pose None: none), `missed` [m] away
    in the scaled error, and the names of the limits that bind there."""

    goal: Pose
    pose: Pose | None
    names: tuple[str, ...]
    missed: float

    def words(self, target: Pose) -> str:
        """The nearest landing for people, and a hint where the target may be in degrees."""
        pose = self.pose
        assert pose is not None
        angle = "" if pose.theta is None else f", theta {math.degrees(pose.theta):.1f} deg"
        limits = f" (limited by {', '.join(self.names[:4])})" if self.names else ""
        words = f"out of reach: nearest possible x {pose.plane_x:.3f} m{angle}{limits}"
        if target.theta is None or abs(target.theta) < MANY_TURNS * 2 * math.pi:
            return words
        turns = target.theta / (2 * math.pi)
        return f"{words}; theta {target.theta:g} rad is {turns:.1f} turns: Pose takes radians"


@dataclass(frozen=True)
class Attempt:
    """One NLP solved from one start, and what came of it.

    throw: None where no motion was found; broken: what the throw breaks; reason: why there is no
    solved throw, in words, empty if there is one. solver: whose; iterations of all its solves.
    edge: how near limits let it come, where they hold it short of its goal.
    """

    start: Start
    asked: Asked
    solver: str
    throw: PlannedThrow | None
    broken: tuple[Violation, ...]
    reason: str
    iterations: int
    solves: int
    edge: Edge | None = None

    @property
    def solved(self) -> bool:
        """Whether the throw lands at its goal and breaks nothing."""
        return self.throw is not None and not self.broken and self.edge is None

    @property
    def after(self) -> Asked:
        """What the next NLP is to be asked."""
        return self.asked.with_(self.broken)


def attempts(problems: Problems, start: Start, task: Task) -> Iterator[Attempt]:
    """NLPs from one start until one gives a solved throw or nothing more can be asked."""
    asked, own, last = start.asked, True, None
    for _ in range(start.tries):
        nlp = problems.nlp(start.goal, asked, task.clock, start.robust)
        with task.clock("guess"):
            request = Request(task.scene, problems.mover, robust=start.robust)
            guess = start.guess(nlp) if own or last is None else refit(nlp, last, request)
        problem = problems.problem(start.goal, asked, start.solver, task.clock, start.robust)
        # Multipliers fit their own NLP only.
        first = start if asked == start.asked else replace(start, warm=None)
        attempt = _attempt(problem, problems.mover, first, asked, guess, task)
        yield attempt
        last, after = attempt.throw, attempt.after
        if attempt.solved or last is None or after == asked or task.clock.late:
            return
        if start.light and after.heavy:
            return
        own, asked = own and start.again(after), after


@dataclass(frozen=True)
class _Candidate:
    """A solution, its motion, and the throw that is sent."""

    solution: Solution
    numbers: Array
    planned: Path
    thrown: Throw
    aim: tuple[float, float]


def _attempt(
    problem: Program, mover: Mover, start: Start, asked: Asked, guess: Array, task: Task
) -> Attempt:
    """One NLP, its corrections and the check of its throw."""
    near = None
    if problem.nlp.structure.local:
        planned = planned_motion(
            problem.nlp, Request(task.scene, mover, robust=start.robust), guess
        )
        near = Throw(task.scene, mover, *planned)
    solving = _Solving(problem, mover, start, asked, task, near)
    best, reason = solving.corrected(guess)
    thrown, broken = None, []
    if best is not None:
        with task.clock("check"):
            thrown = _thrown(problem.nlp, best, asked)
            broken = violations(thrown, start.goal)
        reason = "; ".join(violation.words for violation in broken)
    return Attempt(
        start,
        asked,
        problem.solver.name,
        thrown,
        tuple(broken),
        reason,
        solving.iterations,
        solving.solves,
    )


@dataclass
class _Solving:
    """The solves of one attempt."""

    problem: Program
    mover: Mover
    start: Start
    asked: Asked
    task: Task
    near: Throw | None
    iterations: int = 0
    solves: int = 0

    def corrected(self, guess: Array) -> tuple[_Candidate | None, str]:
        """The solution whose sent motion lands nearest the goal; None and why, without one."""
        start = self.start
        target = start.goal
        tolerance = self.task.scene.tolerance
        aimed = aims(self.task.scene)
        if start.rough:
            aimed = tolerance.position / 2, tolerance.angle / 2
        goal = target.in_plane(target.plane_x + start.aim[0], target.turned(start.aim[1]).theta)
        warm, near = start.warm, start.near
        best, least, reason = None, math.inf, ""
        for _ in range(MAX_CORRECTIONS):
            solution, numbers = self._solved(goal, guess, warm, near)
            if not solution.success:
                reason = "no motion keeps all constraints"
                break
            try:
                candidate = self._candidate(solution, numbers, goal)
            except SmoothingError as error:
                reason = str(error)
                break
            dx, dtheta = candidate.thrown.miss(target)
            miss = scaled(dx, dtheta, aimed)
            if not miss < least:
                reason = "the object never comes down to the target's height"
                break
            best, least = candidate, miss
            if miss <= 1.0:
                break
            goal = goal.in_plane(goal.plane_x - dx, goal.turned(-dtheta).theta)
            guess, warm, near = solution.x, solution, True
        return best, reason

    def _solved(
        self, goal: Pose, guess: Array, warm: Solution | None, near: bool
    ) -> tuple[Solution, Array]:
        """The NLP's solution for `goal`: from `warm` if that works, else afresh from its point."""
        problem, scene = self.problem, self.task.scene
        asked, robust = self.asked, self.start.robust
        request = Request(scene, self.mover, goal, asked, robust, near=self.near)
        clock = self.task.clock
        with clock("solve"):
            numbers = problem.nlp.numbers(request)
            solution = problem.solver.solve(
                guess, numbers, problem.limits, warm, near=near, seconds=clock.left
            )
            if not solution.success and warm is not None and not self.start.rough:
                self.iterations += solution.iterations
                solution = problem.solver.solve(warm.x, numbers, problem.limits, seconds=clock.left)
        self.iterations += solution.iterations
        self.solves += 1
        return solution, numbers

    def _candidate(self, solution: Solution, numbers: Array, goal: Pose) -> _Candidate:
        """The solution's motion as it is sent, and its landing by the model that counts."""
        scene, target = self.task.scene, self.start.goal
        request = Request(scene, self.mover, goal, robust=self.start.robust)
        planned, opening_time = planned_motion(self.problem.nlp, request, solution.x)
        with self.task.clock("smooth"):
            samples = send(self.mover, planned)
        thrown = Throw.sent(scene, self.mover, planned, samples, opening_time)
        with self.task.clock("check"):
            _ = thrown.landing
        turn = 0.0 if goal.theta is None or target.theta is None else goal.theta - target.theta
        aim = (goal.plane_x - target.plane_x, turn)
        return _Candidate(solution, numbers, planned, thrown, aim)


def _thrown(nlp: ThrowNlp, best: _Candidate, asked: Asked) -> PlannedThrow:
    """The candidate as a throw."""
    x, z, theta = (float(v) for v in np.array(nlp.landing(best.solution.x, best.numbers)).ravel())
    return PlannedThrow(
        best.planned,
        best.thrown,
        best.solution.cost,
        nlp.size,
        asked,
        best.aim,
        nlp,
        best.solution,
        (x, z, theta),
    )


def violations(thrown: PlannedThrow, target: Pose) -> list[Violation]:
    """Everything that a solved throw must not break."""
    tolerance = thrown.scene.tolerance
    throws = {"planned": thrown.exact}
    if thrown.sent is not None:
        throws["sent"] = thrown.sent
    if tolerance.model == STEPPED_SURFACE:
        throws = {"sent": thrown.final}
    found = []
    for label, result in throws.items():
        dx, dtheta = result.miss(target)
        if not scaled(dx, dtheta, (tolerance.position, tolerance.angle)) <= 1.0:
            off = f"{1e3 * abs(dx):.2f} mm and {math.degrees(abs(dtheta)):.2f} deg off"
            found.append(Violation(f"{label} motion lands {off}"))
    found += [
        Violation(f"limit of {name} broken") for name in broken_limits(thrown.mover, thrown.samples)
    ]
    if thrown.exact.grip_use > 1.0:
        use = f"grip use {thrown.exact.grip_use:.2f}"
        found.append(Violation(f"slip before the opening ({use})", "carry"))
    return found + broken(thrown.final)


def aims(scene: Scene) -> tuple[float, float]:
    """How near to the target corrections aim: position [m], angle [rad]."""
    tolerance = scene.tolerance
    return min(AIM[0], tolerance.position / 2), min(AIM[1], tolerance.angle / 2)


def scaled(dx: float, dtheta: float, scale: tuple[float, float]) -> float:
    """The larger of the two errors, each in its own unit of `scale`; inf for NaN."""
    value = max(abs(dx) / scale[0], abs(dtheta) / scale[1])
    return value if math.isfinite(value) else math.inf


# Several throws to one target: which of them differ, and which is best.


def _release(found: Attempt) -> tuple[np.ndarray, np.ndarray, float]:
    """Coordinates and rates at the opening's start, and the flight time."""
    thrown = _throw_of(found)
    q, dq, _ = thrown.planned.at(np.array([thrown.opening_time]))
    return q[:, 0], dq[:, 0], thrown.final.landing.flight_time


def _throw_of(found: Attempt) -> PlannedThrow:
    assert found.throw is not None
    return found.throw


def _differ(one: Attempt, other: Attempt) -> bool:
    (q1, dq1, t1), (q2, dq2, t2) = _release(one), _release(other)
    apart = np.linalg.norm(q1 - q2) > SHARE * max(np.linalg.norm(q1), np.linalg.norm(q2))
    faster = np.linalg.norm(dq1 - dq2) > SHARE * max(np.linalg.norm(dq1), np.linalg.norm(dq2))
    return bool(apart or faster or abs(t1 - t2) > FLIGHT)


def distinct(found: list[Attempt]) -> list[Attempt]:
    """The throws that differ from all before them, cheapest first."""
    kept: list[Attempt] = []
    for one in sorted(found, key=CRITERIA["effort"]):
        if all(_differ(one, other) for other in kept):
            kept.append(one)
    return kept


#: What a scene's [choice] may ask for the least of.
CRITERIA: dict[str, Callable[[Attempt], float]] = {
    "effort": lambda found: _throw_of(found).effort,
    "time": lambda found: _throw_of(found).landing_time,
    "robustness": lambda found: scatter(_throw_of(found), found.start.goal),
}


def ordered(found: list[Attempt], by: str) -> list[Attempt]:
    """The throws, best first."""
    return sorted(found, key=CRITERIA[by])


def scatter(thrown: PlannedThrow, target: Pose) -> float:
    """Largest scaled error [m] about the throw's own landing over the window's delays.

    Exact throws of the motion that counts; infinite if one never comes down to the target's
    height. target: says whether theta counts.
    """
    scene = thrown.scene
    base, worst = thrown.final.landing, 0.0
    for delay in window_of(scene).delays:
        found = thrown.final.delayed(float(delay)).landing
        turn = 0.0 if target.theta is None else found.theta - base.theta
        error = abs(found.x - base.x) + abs(turn) * scene.object.length / 2
        worst = max(worst, error if math.isfinite(error) else math.inf)
    return worst
