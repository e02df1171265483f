"""From one starting point to a checked throw: solve, send, throw, correct the aim, check.

The NLP's smoothed model lands beside the deciding model, which throws the samples that are sent.
The aim moves by that error and the NLP is solved again from its last solution, until the error is
below `ACCURACY` or no longer falls. If the check finds a limit broken, the NLP is solved again with
further constraints and larger margins (`Refinement`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from ...models import Array
from ...problems import Pose, Scene
from ..ocp import BASE, Refinement, Request, Solution, ThrowNlp, WarmStart
from ..result import PlannedThrow
from ..throw import SmoothingError, Throw, send
from ..verdict import Code, Verdict, verdict
from .guess import guess_of
from .nlp_cache import CompiledNlp, NlpCache, Task

#: Landing error (position [m], angle [rad]) at which corrections end, or half the tolerance.
ACCURACY = (1e-4, math.radians(0.02))
#: An NLP's landing is at a bound of a region within this share of half its width.
AT_BOUND = 1e-3
#: Most NLPs solved to correct one aim.
MAX_CORRECTIONS = 8


@dataclass(frozen=True)
class Start:
    """The start of one or more solves.

    goal: the target, with its full turns. guess: decision vector for an NLP. refinement: of the
    first NLP. tries: most NLPs, each refined by the check of the one before. light: end before an
    NLP with costly constraints. again: start all NLPs from `guess`, not from the broken throw.
    warm: solution with multipliers to start from; near: it is for almost this target. aim: (dx [m],
    dtheta [rad]) from the goal to the first NLP's landing. rough: corrections end at half the
    scene's tolerance. robust: method of a robust NLP. elastic: price [1/m] at which the landing may
    miss the goal; it is checked at its own place. turning: as of `Request`. from_miss: the slacks
    of an elastic landing begin with what the start misses, else at 0. below: a solution of a
    higher cost is given up.
    """

    goal: Pose
    guess: Callable[[ThrowNlp], Array]
    solver: str
    refinement: Refinement = BASE
    tries: int = 1
    light: bool = False
    again: bool = False
    warm: Solution | None = None
    near: bool = True
    aim: tuple[float, float] = (0.0, 0.0)
    rough: bool = False
    robust: str = ""
    elastic: float = 0.0
    turning: float = 1.0
    from_miss: bool = True
    below: float = math.inf


@dataclass(frozen=True)
class NearestFeasible:
    """A landing short of a goal and its pose error `missed` [m].

    names: of the limits that hold it there; empty if the throw was aimed beside the goal.
    """

    pose: Pose
    names: tuple[str, ...]
    missed: float

    def words(self, what: str, target: Pose) -> str:
        """`what` with the landing and its limits, and a hint if the target may be in degrees."""
        pose = self.pose
        angle = "" if pose.theta is None else f", theta {math.degrees(pose.theta):.1f} deg"
        limits = f" (limited by {', '.join(self.names[:4])})" if self.names else ""
        aside = f", y {pose.y:.3f} m" if target.y or abs(pose.y) > 5e-4 else ""
        return f"{what} {pose.x:.3f} m{aside}{angle}{limits}{target.angle_hint}"


@dataclass(frozen=True)
class Attempt:
    """One NLP solved, or one throw moved, for a goal, and its outcome.

    throw: None where no motion was found, and then there is no verdict either; reason: why there is
    no solved throw, in words, empty if there is one. solver: whose; iterations of all its solves.
    edge: where it lands, if that is not the goal.
    """

    goal: Pose
    refinement: Refinement
    solver: str
    throw: PlannedThrow | None
    verdict: Verdict | None
    reason: str
    iterations: int
    solves: int
    edge: NearestFeasible | None = None

    @property
    def solved(self) -> bool:
        """Whether the throw lands at its goal and breaks nothing."""
        return self.verdict is not None and self.verdict.ok and self.edge is None

    @property
    def is_edge(self) -> bool:
        """Whether limits end its throw short of the goal, and it breaks nothing where it lands."""
        landed = self.verdict is not None and self.verdict.ok
        return landed and self.edge is not None and bool(self.edge.names)

    @property
    def missed(self) -> float:
        """Pose error [m] to the goal at which limits end the throw; inf if they do not."""
        return math.inf if self.edge is None else self.edge.missed

    @property
    def miss(self) -> tuple[float, float]:
        """That landing less the goal: dx [m], dtheta [rad]."""
        assert self.edge is not None
        pose = self.edge.pose
        return self.goal.miss(pose.plane_x, pose.theta or 0.0)

    @property
    def meets_at(self) -> float:
        """Pose error [m] to the goal of a throw that only meets things; inf for any other."""
        if self.verdict is None or {one.code for one in self.verdict.broken} != {Code.COLLISION}:
            return math.inf
        return 0.0 if self.edge is None else self.edge.missed

    @cached_property
    def after(self) -> Refinement:
        """The refinement of the next NLP."""
        if self.throw is None or self.verdict is None:
            return self.refinement
        return self.refinement.refined(self.verdict, self.throw.deciding)


@dataclass(frozen=True)
class Aim:
    """The goal of an NLP whose deciding throw is to land at the target.

    accuracy [m, rad]: largest landing error; offset (dx [m], dtheta [rad]): from the target to the
    goal of the NLP.
    """

    target: Pose
    accuracy: tuple[float, float]
    offset: tuple[float, float] = (0.0, 0.0)

    @property
    def goal(self) -> Pose:
        """The pose that the NLP is solved for."""
        return self.target.shifted(*self.offset)

    def miss(self, throw: Throw, planned: tuple[float, float]) -> tuple[float, float]:
        """Landing error of a throw, (dx [m], dtheta [rad]).

        planned: the NLP's landing (x [m], theta [rad]). Where that is at a bound of a region, the
        error is the distance to this bound: there the throw costs least.
        """
        misses = list(throw.miss(self.target))
        landing, goal, middle = throw.landing, self.goal.middle, self.target.middle
        off = middle.miss(landing.x, landing.theta)
        places = zip(goal.miss(*planned), self.target.half_widths, strict=True)
        for i, (place, half) in enumerate(places):
            if abs(place) > (1.0 - AT_BOUND) * half > 0.0:
                misses[i] = off[i] - math.copysign(half, place)
        return misses[0], misses[1]

    def corrected(self, miss: tuple[float, float]) -> Aim:
        """The aim after a throw that misses the target by (dx [m], dtheta [rad])."""
        return replace(self, offset=(self.offset[0] - miss[0], self.offset[1] - miss[1]))


def attempts(problems: NlpCache, start: Start, task: Task) -> list[Attempt]:
    """NLPs from one start until one gives a solved throw or no refinement helps."""
    made: list[Attempt] = []
    refinement, guess = start.refinement, start.guess
    for _ in range(start.tries):
        # Multipliers fit their own NLP only.
        first = start if refinement == start.refinement else replace(start, warm=None)
        made.append(_attempt(problems, replace(first, guess=guess, refinement=refinement), task))
        throw, after = made[-1].throw, made[-1].after
        if made[-1].solved or throw is None or after == refinement or task.clock.late:
            break
        if start.light and after.costly:
            break
        if not start.again:
            guess = guess_of(throw, task.scene, start.robust)
        refinement = after
    return made


def _attempt(problems: NlpCache, start: Start, task: Task) -> Attempt:
    """One NLP, its corrections and the check of its throw."""
    manipulator = problems.manipulator
    request = Request(
        task.scene, manipulator, robust=start.robust, elastic=start.elastic, turning=start.turning
    )
    program = problems.problem(
        start.goal, start.refinement, start.solver, task.clock, start.robust, start.elastic > 0.0
    )
    with task.clock("guess"):
        guess = start.guess(program.nlp)
    is_open = task.scene.cup is not None and start.elastic
    if program.nlp.linearised or is_open:
        near = Throw(task.scene, manipulator, *program.nlp.motion(request, guess))
        request = replace(request, reference=near)
        if is_open:
            request = replace(request, start_angle=near.landing.theta)
    solves = _Solves(program, replace(request, refinement=start.refinement), start, task)
    throw, reason = solves.corrected(guess)
    judged, edge = None, None
    if throw is not None:
        assert throw.solution is not None
        with task.clock("check"):
            judged = verdict(throw.deciding, start.goal)
            if start.elastic and not judged.ok:
                names = program.nlp.binding_limits(
                    manipulator.joints, throw.solution, program.limits
                )
                throw, edge = _where_it_lands(throw, start.goal, names)
                judged = verdict(throw.deciding, edge.pose)
            elif start.elastic:
                # No other NLP has the variables of its solution.
                lands = throw.planned_landing
                throw = replace(throw, layout=None, solution=None, landing_of_nlp=lands)
        reason = judged.words
    return Attempt(
        start.goal,
        start.refinement,
        program.solver.name,
        throw,
        judged,
        reason,
        solves.iterations,
        solves.count,
        edge,
    )


def _where_it_lands(
    throw: PlannedThrow, goal: Pose, names: tuple[str, ...]
) -> tuple[PlannedThrow, NearestFeasible]:
    """A throw short of its goal, aimed at its own landing; names: of the limits that bind there."""
    landing = throw.deciding.landing
    pose = goal.in_plane(landing.x, None if goal.theta is None else landing.theta)
    missed = throw.scene.object.pose_error(*throw.deciding.miss(goal))
    aimed = replace(throw.deciding, scene=throw.scene.aimed_at(pose))
    return replace(throw, deciding=aimed), NearestFeasible(pose, names, missed)


@dataclass
class _Solves:
    """The solves of one attempt, which it counts."""

    program: CompiledNlp
    request: Request
    start: Start
    task: Task
    iterations: int = 0
    count: int = 0

    def corrected(self, guess: Array) -> tuple[PlannedThrow | None, str]:
        """The solution whose sent motion lands nearest the goal; None and why, without one."""
        start, tolerance = self.start, self.task.scene.tolerance
        rough = tolerance.position / 2, tolerance.angle / 2
        aim = Aim(start.goal, rough if start.rough else accuracy(self.task.scene), start.aim)
        begin = guess if start.warm is None else WarmStart(start.warm, start.near)
        best, least, reason = None, math.inf, ""
        for _ in range(MAX_CORRECTIONS):
            solution, numbers = self._solved(aim.goal, begin)
            if not solution.success:
                reason = "no motion keeps all constraints"
                break
            if solution.cost > start.below:
                reason = "another throw costs less"
                break
            try:
                candidate = self._candidate(solution, numbers, aim)
            except SmoothingError as error:
                reason = str(error)
                break
            x, _, theta = candidate.planned_landing
            miss = aim.miss(candidate.deciding, (x, theta))
            missed = error_over(*miss, aim.accuracy)
            if not missed < least:
                reason = "the object never comes down to the target's height"
                break
            best, least = candidate, missed
            # Limits may end an elastic landing short of its aim: then no further aim helps.
            held = start.elastic and error_over(*aim.goal.miss(x, theta), aim.accuracy) > 1.0
            if missed <= 1.0 or held:
                break
            aim = aim.corrected(miss)
            begin = WarmStart(solution)
        return best, reason

    def _solved(self, goal: Pose, begin: Array | WarmStart) -> tuple[Solution, Array]:
        """The NLP's solution for `goal`; where a warm start fails, from its point alone."""
        program, clock = self.program, self.task.clock
        with clock("solve"):
            numbers = program.nlp.parameter_values(replace(self.request, target=goal))
            if self.start.elastic and self.start.from_miss and not isinstance(begin, WarmStart):
                begin = program.nlp.with_miss(begin, numbers)
            solve = partial(program.solver.solve, parameters=numbers, bounds=program.limits)
            solution = solve(begin, seconds=clock.left)
            if not solution.success and isinstance(begin, WarmStart) and not self.start.rough:
                self.iterations += solution.iterations
                solution = solve(begin.solution.x, seconds=clock.left)
        self.iterations += solution.iterations
        self.count += 1
        return solution, numbers

    def _candidate(self, solution: Solution, numbers: Array, aim: Aim) -> PlannedThrow:
        """The solution's motion as it is sent, and its landing by the model that counts."""
        nlp, manipulator = self.program.nlp, self.request.manipulator
        planned, opening_time = nlp.motion(self.request, solution.x)
        with self.task.clock("smooth"):
            samples = send(manipulator, planned)
        throw = Throw.sent(self.task.scene, manipulator, planned, samples, opening_time)
        with self.task.clock("check"):
            _ = throw.landing
        x, z, theta = map(float, np.array(nlp.landing(solution.x, numbers)).ravel())
        return PlannedThrow(
            planned,
            throw,
            solution.cost,
            nlp.size,
            self.start.refinement,
            aim.offset,
            nlp.layout,
            solution,
            (x, z, theta),
        )


def accuracy(scene: Scene) -> tuple[float, float]:
    """Error of the landing at which corrections end: position [m], angle [rad]."""
    tolerance = scene.tolerance
    return min(ACCURACY[0], tolerance.position / 2), min(ACCURACY[1], tolerance.angle / 2)


def error_over(dx: float, dtheta: float, accuracy: tuple[float, float]) -> float:
    """The larger of two errors [m, rad], each over its own of `accuracy`; inf for NaN."""
    value = max(abs(dx) / accuracy[0], abs(dtheta) / accuracy[1])
    return value if math.isfinite(value) else math.inf
