"""`Planner`: plans throws of one scene, whose NLPs are built once for many targets."""

from __future__ import annotations

import dataclasses
import functools
import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from pathlib import Path
from threading import RLock
from typing import Any, Concatenate, Literal, ParamSpec, TypedDict, TypeVar, Unpack, get_args

import numpy as np

from ..models import Body, HandMotion, PinchContact
from ..models.release import MODELS, SlidingPivot
from ..problems import Constraint, Cost, InputError, Pose, Scene, checked
from ..problems.scene_files import as_scene
from ..workers import Progress, executor_of
from .interception import intercept
from .reach import default_workers, grow
from .result import Plan
from .search import (
    Budget,
    Library,
    NlpCache,
    Releases,
    ReleaseSampler,
    SearchContext,
    Task,
    Turns,
    check_start,
    plan_throw,
    remaining_throw,
    stored_releases,
)
from .sweep import Hardening, check_rest, choose, hardened, resting, robust_scene
from .throw import State, make_manipulator
from .verdict import check_obstacles

SolverName = Literal["fatrop", "ipopt"]

#: Largest number of alternatives of a plan.
MOST_ALTERNATIVES = 20
#: Random states of the table of sampled releases.
SAMPLES = 20_000
#: Default patience [s] of a plan of one throw: ten times what a search takes that finds none.
PATIENCE = 30.0
#: Default patience [s] of a robust plan.
ROBUST_PATIENCE = 6.0
#: Patience [s] of the choice of the throw that stays.
REST_PATIENCE = 5.0
#: Default number of throws of `prepare`.
PREPARED = 5000
#: Largest number of throws of `prepare`.
MOST_PREPARED = 10_000


P = ParamSpec("P")
T = TypeVar("T")


def _check_law(law: type[SlidingPivot]) -> None:
    """InputError for what is no law of a release, or has the name of a known model."""
    if not (isinstance(law, type) and issubclass(law, SlidingPivot)) or law.__name__ in MODELS:
        raise InputError(f"release = {law!r}: must be a subclass of SlidingPivot with its own name")
    bar, pads = Body(0.1, 1e-3, 0.05), PinchContact(0.5, 0.01)
    still = HandMotion(0.0, 0.0, 0.0, 0.0, 0.0)
    rates = np.array(law(bar, pads).rates([0.0] * 6, still, 1.0), float)
    if rates.shape != (6,) or not np.isfinite(rates).all():
        raise InputError(f"release = {law!r}: its rates must be six finite numbers, not {rates}")


def _alone(method: Callable[Concatenate[Planner, P], T]) -> Callable[Concatenate[Planner, P], T]:
    """A method during which other threads wait with theirs: the calls of a planner share the memory
    of its solvers and of the core."""

    @functools.wraps(method)
    def waiting(self: Planner, /, *args: P.args, **kwargs: P.kwargs) -> T:
        with self._lock:
            return method(self, *args, **kwargs)

    return waiting


class Planner:
    """Plans throws of one scene; builds its NLP once and solves for many targets.

    scene: a `Scene`, a built-in name or a TOML file. library: whether plans start from the
    scene's solved throws in the cache (see `prepare`); they do not with constraints. constraints:
    of one's own, each a `Constraint`. release: a law of one's own, a subclass of
    `models.SlidingPivot` with other `rates` for numbers, arrays and CasADi: it is in the NLP, it
    decides, and no library is used. solver_options: of the NLPs' solver, by its own names, such
    as {"tol": 1e-9}; see the manuals of FATROP and IPOPT.

    Any thread may call any method; those that solve wait for each other, and the wait is no part of
    a plan's patience. To plan in parallel, use a planner per thread or process. A copy, or one that
    is pickled, is a new planner of the same scene. Plans, and copies of them, fit every planner of
    their scene.

    Raises InputError for a scene without [hand] and [robot], and for a grip too weak to hold the
    object at rest in any permitted start pose.
    """

    def __init__(
        self,
        scene: Scene | str | Path,
        *,
        library: bool = True,
        constraints: Sequence[Constraint] = (),
        release: type[SlidingPivot] | None = None,
        solver_options: Mapping[str, Any] | None = None,
    ) -> None:
        start = time.perf_counter()
        self._lock = RLock()
        scene = as_scene(scene)
        if constraints:
            given = [constraints] if isinstance(constraints, Constraint) else constraints
            own = tuple(checked("constraints", one, Constraint, {}) for one in given)
            scene = scene.changed(constraints=scene.constraints + own)
        if release is not None:
            _check_law(release)
            scene = scene.changed(release=release)
        library = library and not (scene.constraints or scene.release)
        self._options = dict(checked("solver_options", solver_options or {}, dict, {}))
        self.scene = scene
        self.manipulator = make_manipulator(scene)
        # Obstacles stand in the base frame, tables and libraries in the throw's own plane.
        scene = scene.changed(obstacle=()) if scene.obstacle else scene
        check_start(scene, self.manipulator)
        scene.check_target_in_cup()
        # The floor alone: no target moves it.
        check_obstacles(scene, self.manipulator)
        self.problems = NlpCache(scene, self.manipulator, self._options)
        self._context = SearchContext(self.problems, self.releases, library)
        self._build_time = time.perf_counter() - start

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy is built anew from the scene."""
        make = functools.partial(
            type(self), library=self._context.keep, solver_options=self._options
        )
        return make, (self.scene,)

    @_alone
    def plan(
        self,
        target: Pose | None = None,
        *,
        solver: SolverName = "fatrop",
        turns: Turns = "exact",
        warm: Plan | None = None,
        alternatives: int = 0,
        robust: bool = False,
        patience: float | None = None,
        start: State | None = None,
    ) -> Plan:
        """A throw to `target` (the scene's by default), with its status.

        Always returns; raises InputError only for wrong input. target: a `Pose` or a `Region`, or
        an array of x, z [m] and theta [rad]. solver: of the NLPs; a throw of the library is moved
        to the target with 'fatrop' only. turns: 'any' takes theta modulo full
        turns. warm: a solved plan of this scene for a target nearby. alternatives: number of
        further throws to look for, each different, for `Plan.alternatives`. robust: whether
        further throws are looked for that succeed more often under [uncertainty]; always with a
        section [robust]. patience [s]: time limit, without building; by default 30 s, 6 s for a
        robust one. start: a state of motion in which the throw begins at its time 0, instead of the
        scene's start; `warm` is then a plan whose motion passes that state.

        With [uncertainty], [rest] or `robust` the plan is the best of the throws that were found,
        by most successes, then the least 95 % pose error, then the least effort.
        """
        started = time.perf_counter()
        target = self.check(target)
        checked("solver", solver, str, {"choices": get_args(SolverName)})
        checked("turns", turns, str, {"choices": get_args(Turns)})
        if turns == "any" and target.theta is None:
            raise InputError("turns = 'any': theta is free, its turns do not count anyway")
        checked("alternatives", alternatives, int, {"least": 0, "most": MOST_ALTERNATIVES})
        checked("patience", patience, float | None, {"above": 0})
        robust = checked("robust", robust, bool, {}) or self.scene.robust is not None
        if (robust or alternatives) and not target.is_fixed:
            raise InputError("target: velocity and arrival go with neither robust nor alternatives")
        if start is not None and robust:
            raise InputError("start: a robust plan begins at rest")
        wanted, scene = self._wanted(alternatives), self.scene.aimed_at(target)
        budget = Budget.lasting(patience or (ROBUST_PATIENCE if robust else PATIENCE))
        compares = robust or scene.uncertainty is not None or scene.rest is not None
        compares = compares and target.is_fixed
        quiet = scene.weights.quiet
        task = Task(scene, target, solver, budget, turns, wanted, loud=compares, quiet=quiet)
        built, self._build_time = self._build_time, 0.0
        context, at_rest = self._context, start is None
        known = warm.throw if warm and self._is_own(warm, at_rest=at_rest) else None
        if start is not None:
            moving = self.manipulator.from_state(start.checked(self.manipulator))
            context = self._in_motion.from_state(moving)
            known = None if known is None else remaining_throw(known, context.problems.manipulator)

        def plan_at(goal: Pose, last: Plan | None) -> Plan:
            throw = known if last is None else last.throw
            return plan_throw(context, task.aimed_at(goal), throw)

        plan = intercept(self.scene, target, self.releases, plan_at)
        if plan.solved and compares:
            plan = self._best(context, task, plan, robust, REST_PATIENCE if not patience else None)
        total, spent = time.perf_counter() - started + built, dict(budget.seconds)
        spent["build"] += built
        rest = plan.alternatives[:alternatives]
        said = functools.partial(
            dataclasses.replace,
            starts=budget.counts["starts"],
            iterations=budget.counts["iterations"],
            time={**spent, "total": total},
        )
        nearest = None if plan.nearest is None else said(plan.nearest)
        return said(plan, alternatives=rest, nearest=nearest)

    def _best(
        self, context: SearchContext, task: Task, plan: Plan, robust: bool, patience: float | None
    ) -> Plan:
        """The best of a plan, its alternatives, throws that rest, and, if asked, robust ones.

        patience [s]: for throws that rest; None for what is left of the task's time.
        """

        def others() -> Sequence[Plan]:
            # Three more throws to start from, in 40 % of the time left.
            several = dataclasses.replace(task, wanted=4, budget=task.budget.part(0.4))
            return plan_throw(context, several).alternatives

        plans = [plan, *plan.alternatives]
        if self.scene.rest is not None:
            plans += resting(context, task, plans, patience)
        if len(plans) == 1 and not robust:
            return plan
        if not robust:
            return choose(plans)
        return hardened(plans, Hardening(self._robust_problems, task), others)

    def _is_own(self, plan: Plan, *, at_rest: bool = True) -> bool:
        """Whether a plan is of this scene, and, if so asked, begins at its start."""
        begins = plan.manipulator.under_way is None or not at_rest
        return begins and self.scene.fits(plan.scene)

    @_alone
    def lend(self, plan: Plan, use: Callable[[NlpCache], T]) -> T:
        """What `use` makes of the scene's NLPs for motions under way; other threads wait.

        InputError for a plan of another scene, and for one that is not solved.
        """
        if not self._is_own(plan):
            raise InputError("follow: needs a solved plan of this planner's scene")
        return use(self._in_motion.problems)

    @_alone
    def prepare(
        self,
        throws: int = PREPARED,
        progress: Progress | None = None,
        *,
        workers: int | None = None,
        executor: Executor | None = None,
    ) -> int:
        """Builds a library of solved throws all over the reach, from which plans start.

        Takes minutes (see docs/performance.md). The library is in the cache folder, for every
        planner of the scene. A plan is then a stored throw moved to its target and checked, in a
        few milliseconds.
        throws: approximate number, fewer in a small reach, as the finest cells are 4 mm and 1
        degree wide. After Ctrl-C the next call continues. progress(solved, throws) is called on the
        way. workers: processes on this machine, by default two for 400 throws or more; executor:
        spreads the work instead, Dask's `client.get_executor()` for instance. Returns the number of
        throws. Plans of other threads wait until it has ended.
        InputError for a number out of range.
        """
        throws = checked("throws", throws, int, {"least": 1, "most": MOST_PREPARED})
        if self.scene.constraints or self.scene.release:
            raise InputError("prepare: not for a planner with constraints or a release of its own")
        try:
            releases, library = self.releases(), self.library
            if workers is None and executor is None:
                workers = default_workers(throws)
            with executor_of(workers if executor is None else None, None) as processes:
                grow(
                    self._plain_problems, releases, library, throws, executor or processes, progress
                )
        finally:
            self.library.merge()
        return len(self.library)

    @property
    def prepared(self) -> int:
        """Number of solved throws that plans may start from."""
        return len(self.library)

    @property
    def library(self) -> Library:
        """The scene's solved throws that the cache has."""
        return self._context.library

    def check(self, target: Pose | None = None) -> Pose:
        """The target that `plan` would take; InputError if it does not fit the scene."""
        target = _checked_target(self.scene, checked("target", target, Pose | None, {}))
        if self.scene.bodies_around:
            with self._lock:
                check_obstacles(self.scene.aimed_at(target), self.manipulator)
        if self.scene.rest is not None:
            check_rest(self.scene.aimed_at(target))
        return target

    @_alone
    def releases(self) -> Releases:
        """The table of sampled releases, from which solves start."""
        return self._releases

    @functools.cached_property
    def _releases(self) -> Releases:
        sampler = ReleaseSampler(self.problems.scene, self.manipulator)
        return stored_releases(self.scene, SAMPLES, 0, functools.partial(sampler.draw, SAMPLES))

    @functools.cached_property
    def _in_motion(self) -> SearchContext:
        """The context of throws from a state of motion, which have NLPs of their own."""
        problems = NlpCache(self.problems.scene, self.manipulator, self._options)
        return dataclasses.replace(self._context, problems=problems)

    @functools.cached_property
    def _plain_problems(self) -> NlpCache:
        """The NLPs of the library's throws, whose weights are the usual ones."""
        scene = self.problems.scene
        if scene.weights.usual:
            return self.problems
        usual = Cost(quiet=scene.weights.quiet)
        return NlpCache(scene.changed(cost=usual, choice=None), self.manipulator, self._options)

    @functools.cached_property
    def _robust_problems(self) -> NlpCache:
        """The NLPs of robust plans."""
        return NlpCache(robust_scene(self.scene), self.manipulator, self._options)

    def _wanted(self, alternatives: int) -> int:
        """Number of distinct throws to find before one is chosen."""
        choice = self.scene.choice
        return max(1 if choice is None else choice.among, 1 + alternatives)


class Options(TypedDict, total=False):
    """Arguments of `Planner.plan` besides the target."""

    solver: SolverName
    turns: Turns
    warm: Plan | None
    alternatives: int
    robust: bool
    patience: float | None
    start: State | None


def plan(scene: Scene | str | Path, target: Pose | None = None, **options: Unpack[Options]) -> Plan:
    """Plan one throw of a scene (or of a built-in name or TOML file).

    options: those of `Planner.plan`. To plan many targets of one scene make a `Planner`, which
    builds its NLP once. Raises InputError for wrong input; every other end is the plan's status.
    """
    return Planner(scene).plan(target, **options)


def _checked_target(scene: Scene, target: Pose | None) -> Pose:
    """The target to plan for: the given one or the scene's; InputError if it does not fit."""
    target = scene.target if target is None else target
    if target is None:
        raise InputError(f"{scene.place}: section [target] is missing")
    if scene.robot is None and target.y != 0.0:
        raise InputError("target y: only for a scene with [robot]")
    least = scene.gripper.profile().dwell + scene.gripper.profile().opening
    if target.window[1] <= least:
        raise InputError(
            f"target: arrival = {target.window[1]:g}: must be above {least:g} s, "
            "the gripper's dwell and opening"
        )
    if scene.cup is not None:
        scene.cup.check_target(target)
    if scene.arm is None:
        return target
    target, arm = target.with_lateral(scene.arm.lateral), scene.arm
    joint, angle = arm.azimuth_joint - 1, arm.azimuth_angle(target.plane.azimuth)
    low, high = arm.limits.position_min[joint], arm.limits.position_max[joint]
    if not low <= angle <= high:
        raise InputError(
            f"target: its azimuth {math.degrees(angle):.1f} deg is outside joint "
            f"{joint + 1}'s range [{math.degrees(low):.1f}, {math.degrees(high):.1f}] deg"
        )
    return target
