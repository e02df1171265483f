"""From one start to a checked throw: solve, send, throw, correct the aim, judge, refine.

The NLP's smoothed model lands beside the deciding model, which throws the samples that are sent.
The aim moves by that error and the NLP is solved again from its last solution, until the error is
below `ACCURACY` or no longer falls. If the verdict finds a limit broken, the NLP is solved again
with the limit's constraint, or with a wider margin (`Refinement.refined`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from ...models import Array
from ...problems import Pose, Scene
from ..ocp import BASE, Refinement, Request, Solution, ThrowNlp, WarmStart, effort_of
from ..result import PlannedThrow
from ..throw import SmoothingError, Throw, send
from ..uncertainty import spread
from ..verdict import Verdict, verdict_on
from .decision_vectors import guess_of
from .nlp_cache import Budget, CompiledNlp, NlpCache, Task

#: Landing error (position [m], angle [rad]) at which corrections end, or half the tolerance.
ACCURACY = (1e-4, math.radians(0.02))
#: An NLP's landing is at a bound of a region within this share of half its width.
AT_BOUND = 1e-3
#: Most NLPs solved to correct one aim.
MAX_CORRECTIONS = 8
#: Most NLPs of one attempt, each refined by the verdict on the throw before.
ROUNDS = 4
#: Prices of the load on the pads that are tried, as shares of the task's, and the NLPs of each.
QUIET, QUIET_ROUNDS = (1.0, 0.1, 0.01), 2
#: Name of what ends a start whose motion cannot be sent, or whose object does not come down.
SENDING, COMING_DOWN = "sent motion", "coming down"

#: Decision vector for an NLP.
Guess = Callable[[ThrowNlp], Array]


@dataclass(frozen=True)
class Exact:
    """The NLP for a goal, from a throw.

    goal: the target, with its full turns. guess: decision vector for an NLP. refinement: of the
    first NLP. aim: (dx [m], dtheta [rad]) from the goal to the first NLP's landing. warm: solution
    with multipliers to start from; near: it is for almost this goal. robust: method of a robust
    NLP.
    """

    goal: Pose
    guess: Guess
    refinement: Refinement = BASE
    aim: tuple[float, float] = (0.0, 0.0)
    warm: Solution | None = None
    near: bool = False
    robust: str = ""


@dataclass(frozen=True)
class Elastic:
    """The NLP for a goal or, at a price, as near to it as limits let it.

    home: where the throw lands that the guess is made of. from_miss: the slacks of the landing
    begin with what it misses, else at 0.
    """

    goal: Pose
    guess: Guess
    home: Pose
    refinement: Refinement = BASE
    from_miss: bool = False


@dataclass(frozen=True)
class Outcome:
    """What a start led to.

    throw: None where no motion was found. pose: where it lands, which it was judged for: the goal,
    or a place beside it, `missed` [m] from it as a pose error. binding: the limits that hold it
    there. broken: the limits that ended the start; empty if it breaks none, or none is known, as of
    a throw that could not be moved. missed is 0 for a throw that was judged for the goal, wherever
    it lands.
    """

    goal: Pose
    refinement: Refinement = BASE
    throw: PlannedThrow | None = None
    verdict: Verdict | None = None
    pose: Pose | None = None
    missed: float = math.inf
    binding: tuple[str, ...] = ()
    broken: tuple[str, ...] = ()
    solver: str = ""

    @property
    def ok(self) -> bool:
        """Whether it breaks nothing where it lands."""
        return self.verdict is not None and self.verdict.ok

    @property
    def hits(self) -> bool:
        """Whether that is the goal."""
        return self.ok and self.missed == 0.0

    @property
    def without_nlp(self) -> Outcome:
        """This without the NLP's solution, whose variables no other NLP has."""
        if self.throw is None:
            return self
        lands = self.throw.planned_landing
        throw = replace(self.throw, layout=None, solution=None, landing_of_nlp=lands)
        return replace(self, throw=throw)


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


def attempt(
    problems: NlpCache,
    start: Exact | Elastic,
    task: Task,
    *,
    price: float = 0.0,
    rounds: int = ROUNDS,
    corrections: int = MAX_CORRECTIONS,
) -> Outcome:
    """The throw that a start leads to; price [1/m]: of an elastic landing's pose error.

    At most `rounds` NLPs, each refined by the verdict on the throw before; each is solved
    `corrections` times at most, with its aim moved. An exact NLP begins where the one before ended,
    an elastic one where the first began.
    """
    one, begin = Outcome(start.goal, start.refinement), start
    for _ in range(rounds):
        one = _solved(problems, begin, task, price, corrections)
        if one.throw is None or one.ok or task.budget.late:
            break
        assert one.verdict is not None
        after = one.refinement.refined(one.verdict, one.throw.deciding)
        if after == one.refinement:
            break
        if isinstance(begin, Elastic):
            begin = replace(begin, refinement=after)
        else:
            # Multipliers fit their own NLP only.
            guess = guess_of(one.throw)
            begin = Exact(begin.goal, guess, after, begin.aim, robust=begin.robust)
    return one


def quieted(problems: NlpCache, one: Outcome, task: Task) -> Outcome:
    """The throw with as little load on the pads while they open as limits let it; the throw as it
    is where its landings scatter no less.

    The task's price of the load is tried first, then smaller ones.
    """
    throw, price = one.throw, task.quiet
    if throw is None or not price or one.refinement.quiet or task.budget.late:
        return one
    for share in QUIET:
        after = replace(one.refinement, quiet=share * price)
        start = Exact(one.goal, guess_of(throw), after, throw.aim)
        other = attempt(problems, start, task, rounds=QUIET_ROUNDS)
        task.budget.counts["starts"] += 1
        if other.hits and other.throw is not None:
            with task.budget("check"):
                errors = [spread(each.deciding, one.goal) for each in (other.throw, throw)]
            return other if errors[0] < errors[1] else one
        if task.budget.late:
            break
    return one


def _solved(
    problems: NlpCache, start: Exact | Elastic, task: Task, price: float, corrections: int
) -> Outcome:
    """One NLP, and the verdict on its throw.

    It is solved again with its aim moved by the landing error of the throw that is sent, until this
    lands on the goal, or limits hold it short of it.
    """
    manipulator, goal, budget = problems.manipulator, start.goal, task.budget
    program, request, begin = _begun(problems, start, task, price)
    nlp, aim = program.nlp, Aim(goal, accuracy(task.scene))
    if isinstance(start, Exact):
        aim = replace(aim, offset=start.aim)
    best, least, broken = None, math.inf, tuple[str, ...]()
    for _ in range(corrections):
        solution, numbers = _solution(program, replace(request, target=aim.goal), begin, budget)
        if not solution.success:
            broken = () if budget.late else _broken(problems, program, solution, numbers)
            break
        planned, opens = nlp.motion(request, solution.x)
        try:
            with budget("smooth"):
                samples = send(manipulator, planned)
        except SmoothingError:
            broken = (SENDING,)
            break
        with budget("check"):
            throw = Throw.sent(task.scene, manipulator, samples, opens)
            x_nlp, z_nlp, theta_nlp = map(float, nlp.landing(solution.x, numbers).full().ravel())
            miss = aim.miss(throw, (x_nlp, theta_nlp))
        missed = error_over(*miss, aim.accuracy)
        if not missed < least:
            broken = (COMING_DOWN,)
            break
        of_nlp = nlp.layout, solution, (x_nlp, z_nlp, theta_nlp)
        quiet = start.refinement.quiet > 0.0
        effort = effort_of(request, planned) if quiet else solution.cost
        numbered = effort, nlp.size, start.refinement, aim.offset
        best, least = PlannedThrow(planned, throw, *numbered, *of_nlp), missed
        # Limits may end an elastic landing short of its aim: then no further aim helps.
        short = aim.goal.miss(x_nlp, theta_nlp)
        held = price > 0.0 and error_over(*short, aim.accuracy) > 1.0
        if missed <= 1.0 or held:
            break
        aim, begin = aim.corrected(miss), WarmStart(solution)
    if best is None:
        return Outcome(goal, start.refinement, broken=broken, solver=task.solver)
    with budget("check"):
        return _judged(problems, program, start, task, best, price)


def _begun(
    problems: NlpCache, start: Exact | Elastic, task: Task, price: float
) -> tuple[CompiledNlp, Request, Array | WarmStart]:
    """A start's NLP, its request without the target, and where the solver begins."""
    manipulator, budget = problems.manipulator, task.budget
    robust = start.robust if isinstance(start, Exact) else ""
    request = Request(
        task.scene, manipulator, refinement=start.refinement, robust=robust, elastic=price
    )
    program = problems.problem(
        start.goal, start.refinement, task.solver, budget, robust, elastic=price > 0.0
    )
    nlp = program.nlp
    with budget("guess"):
        x = start.guess(nlp)
        in_cup = price > 0.0 and task.scene.cup is not None
        if nlp.linearised or in_cup:
            near = Throw(task.scene, manipulator, *nlp.motion(request, x))
            theta = near.landing.theta if in_cup else None
            request = replace(request, reference=near, start_angle=theta)
        if isinstance(start, Elastic) and start.from_miss:
            x = nlp.with_miss(x, nlp.parameter_values(replace(request, target=start.goal)))
    if isinstance(start, Exact) and start.warm is not None:
        return program, request, WarmStart(start.warm, start.near)
    return program, request, x


def _solution(
    program: CompiledNlp, request: Request, begin: Array | WarmStart, budget: Budget
) -> tuple[Solution, Array]:
    """The NLP's solution and parameters; where a warm start fails, from its point alone."""
    with budget("solve"):
        numbers = program.nlp.parameter_values(request)
        for first in (begin, begin.solution.x) if isinstance(begin, WarmStart) else (begin,):
            solution = program.solver.solve(first, numbers, program.limits, seconds=budget.left)
            budget.counts["iterations"] += solution.iterations
            if solution.success:
                break
    budget.counts["solves"] += 1
    return solution, numbers


def _broken(
    problems: NlpCache, program: CompiledNlp, solution: Solution, numbers: Array
) -> tuple[str, ...]:
    """Name of the limit that the last iterate of a failed solve breaks most; where it breaks the
    equations instead, of the limits that press against them."""
    nlp, joints = program.nlp, problems.manipulator.joints
    broken = nlp.broken_limit(program.solver.jacobian(solution.x, numbers)[0])
    if broken or not solution.lam_g.size:
        return (broken,) if broken else ()
    return nlp.binding_limits(joints, solution, program.limits)


def _judged(
    problems: NlpCache,
    program: CompiledNlp,
    start: Exact | Elastic,
    task: Task,
    throw: PlannedThrow,
    price: float,
) -> Outcome:
    """The outcome of a throw, judged for the goal; of an elastic one, at its landing beside it."""
    goal, deciding = start.goal, throw.deciding
    judged, pose_error = verdict_on(deciding, goal), task.scene.object.pose_error
    if price:
        # The price of the miss is no effort.
        x, _, theta = throw.planned_landing
        paid = price * pose_error(*goal.shifted(*throw.aim).miss(x, theta))
        throw = replace(throw, effort=throw.effort - paid)
    if isinstance(start, Exact) or judged.ok:
        broken = () if judged.ok else (judged.broken[0].limit_name,)
        return Outcome(
            goal,
            start.refinement,
            throw,
            judged,
            pose=goal,
            missed=0.0,
            broken=broken,
            solver=task.solver,
        )
    landing = deciding.landing
    assert throw.solution is not None
    if not deciding.lands:
        return Outcome(goal, start.refinement, broken=(COMING_DOWN,), solver=task.solver)
    pose = goal.in_plane(landing.x, None if goal.theta is None else landing.theta)
    there = replace(deciding, scene=task.scene.aimed_at(pose))
    joints, limits = problems.manipulator.joints, program.limits
    names = program.nlp.binding_limits(joints, throw.solution, limits)
    missed = pose_error(*deciding.miss(goal))
    judged = verdict_on(there, pose)
    broken = () if judged.ok else (judged.broken[0].limit_name,)
    throw = replace(throw, deciding=there)
    return Outcome(goal, start.refinement, throw, judged, pose, missed, names, broken, task.solver)


def accuracy(scene: Scene) -> tuple[float, float]:
    """Error of the landing at which corrections end: position [m], angle [rad]."""
    tolerance = scene.tolerance
    return min(ACCURACY[0], tolerance.position / 2), min(ACCURACY[1], tolerance.angle / 2)


def error_over(dx: float, dtheta: float, accuracy: tuple[float, float]) -> float:
    """The larger of two errors [m, rad], each over its own of `accuracy`; inf for NaN."""
    value = max(abs(dx) / accuracy[0], abs(dtheta) / accuracy[1])
    return value if math.isfinite(value) else math.inf
