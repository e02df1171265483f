"""Plans throws of one scene: the problem is built once and solved for many targets."""

from __future__ import annotations

import dataclasses
import functools
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from ..problems import COMPARED_METHODS, ROBUST_METHODS, InputError, Mesh, Pose, Scene, as_scene
from .check import KernelCode, check_kernels, make_mover
from .compile import Compile
from .ocp import Solution, nlp_key
from .reach import solved
from .result import Plan, checked_target
from .robust import hardened
from .search import (
    Found,
    Problem,
    Reach,
    Releases,
    ReleaseSampler,
    Search,
    SolvedThrows,
    TableSearch,
    Turns,
    Workbench,
    attempt,
    check_start,
    distinct,
    failed_plan,
    goals_of,
    ordered,
    solved_plan,
    starts,
)
from .search import release_cache_stored as stored
from .search import solved_throws_stored as stored_throws

Progress = Callable[[int, int], None]
SolverName = Literal["auto", "fatrop", "ipopt"]

#: A solution for a target within this distance [m, scaled error] needs but a few iterations.
BESIDE = 0.005
#: Numerical settings of robust plans, where the scene has none of its own. These hardly slide, so
#: that a wider rounding costs nothing; with it they were measured.
QUIET_MESH = Mesh(opening=8, grading=1.0, epsilon=0.03)
#: Other throws to a target that robust planning may start from.
MORE_SOURCES = 3
#: Most alternatives that may be asked for.
MOST_ALTERNATIVES = 20
#: Random releases drawn for the starting points.
SAMPLES = 20_000
#: Time [s] after which no further attempt is made. Usual plans take a thousandth of it.
PATIENCE = 20.0
#: Throws that `prepare` tries to solve, and the most it may be asked for.
PREPARED, MOST_PREPARED = 1000, 10_000


class Planner:
    """Plans throws of one scene; builds its NLP once and solves for many targets.

    compiling: whether the NLP's functions are compiled where a C compiler is there: 'no',
    'cached' (used if they are in the cache), 'background' (and compiled for later by a
    process of its own if they are not), 'wait' (compiled first, once, in some seconds; those
    with rows that seldom decide in the background).

    Raises InputError for a scene that cannot be planned at all: no [hand] or [robot],
    or a grip too weak to hold the object at rest in any permitted start pose.
    """

    def __init__(self, scene: Scene, *, compiling: Compile = "background") -> None:
        start = time.perf_counter()
        if compiling not in get_args(Compile):
            known = ", ".join(get_args(Compile))
            raise InputError(f"compiling = {compiling!r}: must be one of {known}")
        self.scene = scene
        self.mover = make_mover(scene)
        check_start(scene, self.mover)
        self._releases: Releases | None = None
        self._sampler = ReleaseSampler(scene, self.mover)
        self.bench = Workbench(scene, self.mover, compiling)
        self._compiling: Compile = compiling
        self._quiet: Workbench | None = None
        reach = Reach(scene, self.mover, compiling)
        self._search = TableSearch(self.bench, self._sampler, reach, self.releases)
        self._code: list[KernelCode] = []
        self._throws: SolvedThrows | None = None
        self._build_time = time.perf_counter() - start

    def plan(
        self,
        target: Pose | None = None,
        *,
        solver: SolverName = "auto",
        turns: Turns = "exact",
        warm: Plan | None = None,
        alternatives: int = 0,
        robust: str | None = None,
        patience: float = PATIENCE,
    ) -> Plan:
        """A throw to `target` (the scene's by default), with its status.

        Always returns; raises InputError only for wrong input. solver: 'auto' is FATROP
        with IPOPT as fallback. turns: 'any' takes theta modulo full turns. warm: a
        solved plan of this planner for a target nearby. alternatives: how many throws
        that differ from the plan's to look for; they are in `Plan.alternatives`. robust: a
        method of the section [robust], instead of the scene's. patience [s]: after so long
        no further attempt to find a throw is begun.
        """
        started = time.perf_counter()
        target = self.check(target)
        if solver not in get_args(SolverName):
            raise InputError(f"solver = {solver!r}: must be one of auto, fatrop, ipopt")
        if turns not in get_args(Turns):
            raise InputError(f"turns = {turns!r}: must be one of exact, any")
        if not 0 <= alternatives <= MOST_ALTERNATIVES:
            most = MOST_ALTERNATIVES
            raise InputError(f"alternatives = {alternatives!r}: must be 0 to {most}")
        method = self._method(robust)
        if method and alternatives:
            raise InputError("alternatives: not with a robust plan")
        if not patience > 0:
            raise InputError(f"patience = {patience!r}: must be above 0")
        search = Search(self.scene.aimed_at(target), until=started + patience)
        made, self._build_time = self._build_time, 0.0
        search.times["build"] = made
        self._take_code(search)
        names = ("fatrop", "ipopt") if solver == "auto" else (solver,)
        plan = self._warm_plan(target, names[0], warm, search) if warm is not None else None
        if plan is None and self._throws is not None and self._wanted(alternatives) == 1:
            plan = self._recalled(target, names[0], turns, search)
        if plan is None:
            plan = self._searched(target, names, turns, alternatives, search)
        if method and plan.solved and not plan.robust:
            plan = self._hardened(plan, method, names, turns, search)
        plan.time.update(search.times)
        plan.time["total"] = time.perf_counter() - started + made
        return plan

    def prepare(self, throws: int = PREPARED, progress: Progress | None = None) -> int:
        """Solves throws all over the reach, for this planner's plans to start from.

        Takes a minute or so; they are kept in the cache folder, so that the next planner of
        the scene has them at once when it asks. Plans then start from the nearest, within
        0.2 m of scaled error and of the scene's target height, and take about half the time;
        without one so near, and with alternatives, they are made as ever. throws: how many
        are tried; progress(tried, all) is called before each and at the end. Returns how many
        were found. Raises InputError for a number out of range and for a scene with [choice],
        whose plans look for several throws.
        """
        whole = isinstance(throws, int | np.integer) and not isinstance(throws, bool)
        if not whole or not 1 <= throws <= MOST_PREPARED:
            raise InputError(f"throws = {throws!r}: must be a whole number, 1 to {MOST_PREPARED}")
        if self._wanted(0) > 1:
            raise InputError(
                "prepare: not for a scene with [choice], which looks for several throws"
            )
        target, search = self.check(), Search(self.scene)
        self._take_code(search)
        key = nlp_key(self.bench.nlp(target, search), "fatrop")
        made = functools.partial(solved, self.bench, self.releases, int(throws), progress)
        self._throws = stored_throws(key, self.scene, int(throws), made)
        return len(self._throws)

    @property
    def prepared(self) -> int:
        """How many solved throws plans may start from."""
        return 0 if self._throws is None else len(self._throws)

    @property
    def compiled(self) -> bool:
        """Whether the problems solved so far ran as machine code."""
        return self.bench.compiled

    def _take_code(self, search: Search) -> None:
        """Machine code for the checks, as far as it may be and is there."""
        if not self._code:
            with search.clock("build"):
                kernels = check_kernels(self.scene, self.mover)
                self._code = [KernelCode(some, self._compiling) for some in kernels]
        for code in self._code:
            code.take()

    def check(self, target: Pose | None = None) -> Pose:
        """The target that `plan` would take; InputError if it does not fit the scene."""
        return checked_target(self.scene, target)

    def _searched(
        self,
        target: Pose,
        names: tuple[str, ...],
        turns: Turns,
        alternatives: int,
        search: Search,
    ) -> Plan:
        """Solvers in turn, each from several starts; then the honest answer."""
        outcome = self._search.run(target, turns, names, self._wanted(alternatives), search)
        if outcome.found:
            return self._chosen(outcome.found, alternatives, search)
        return failed_plan(self.bench, target, outcome.answer, outcome.releases, names[-1], search)

    def _method(self, robust: str | None) -> str:
        """The robust method that is asked for, empty if none."""
        if robust is None:
            return "" if self.scene.robust is None else self.scene.robust.method
        if robust not in ROBUST_METHODS + COMPARED_METHODS:
            raise InputError(f"robust = {robust!r}: must be one of {', '.join(ROBUST_METHODS)}")
        return robust

    def _hardened(
        self, plan: Plan, method: str, names: tuple[str, ...], turns: Turns, search: Search
    ) -> Plan:
        """The plan of a robust throw to the same target, from `plan`'s or others to it."""

        def sources() -> Iterator[Plan]:
            yield plan
            yield from self._searched(plan.target, names, turns, MORE_SOURCES, search).alternatives

        bench = self._robust_bench()
        trial = dataclasses.replace(search, scene=search.scene.replace(mesh=bench.scene.mesh))
        found = hardened(bench, sources(), method, names, trial)
        search.iterations, search.attempts = trial.iterations, trial.attempts
        if found is None:
            why = search.trouble[-1] if search.trouble else ""
            words = f"no robust throw found by {method}: {why}"
            return dataclasses.replace(plan, status="not_converged", message=words)
        source, throw = found
        made = solved_plan(self.bench, Found(source.target, throw.thrown, throw.solver), search)
        if throw.method == "nominal":
            words = f"{made.message}; no throw found that bears the opening better"
            made = dataclasses.replace(made, message=words)
        return dataclasses.replace(made, robust=throw.method, peak_load=throw.peak_load)

    def _robust_bench(self) -> Workbench:
        """The workbench of robust NLPs, made when first needed."""
        if self._quiet is None:
            # A robust throw hardly slides: its opening needs even intervals, not ones that
            # are short towards the end.
            usual = self.scene.mesh == Mesh()
            scene = self.scene.replace(mesh=QUIET_MESH) if usual else self.scene
            self._quiet = Workbench(scene, self.mover, self._compiling)
        return self._quiet

    def starts(self, target: Pose, count: int = 1) -> list[tuple[int, Pose, float]]:
        """(release of the table, target, scaled distance [m]) of the nearest landings."""
        return starts(self.releases(), self.scene, target, "exact", count)

    def _wanted(self, alternatives: int) -> int:
        """How many distinct throws to find before one is chosen."""
        choice = self.scene.choice
        among = 1 if choice is None else choice.among
        return max(among, 1 + alternatives)

    def _chosen(self, found: list[Found], alternatives: int, search: Search) -> Plan:
        """The plan of the best throw found, with the others that differ."""
        by = "effort" if self.scene.choice is None else self.scene.choice.by
        best, *others = ordered(distinct(found), by) if len(found) > 1 else found
        plan = solved_plan(self.bench, best, search)
        rest = tuple(solved_plan(self.bench, other, search) for other in others[:alternatives])
        return dataclasses.replace(plan, alternatives=rest)

    def _warm_plan(self, target: Pose, name: str, warm: Plan, search: Search) -> Plan | None:
        """A plan from a neighbouring one, None if that does not lead to a solved throw."""
        if warm.throw is None or warm.mover is not self.mover:
            return None
        if (warm.target.theta is None) != (target.theta is None):
            return None
        # Its multipliers fit its own NLP only.
        kind, solution = self.bench.kind_of(warm.throw.nlp), warm.throw.solution
        if kind is None or kind.robust:
            return None
        search.guards, search.room = kind.guards, warm.throw.room
        problem = self.bench.problem(target, name, search)
        return self._from_solution(problem, target, solution, warm.target, warm.throw.aim, search)

    def _recalled(self, target: Pose, name: str, turns: Turns, search: Search) -> Plan | None:
        """A plan from one of the solved throws nearby, None if that does not lead to one."""
        assert self._throws is not None
        asked = search.asked
        with search.clock("guess"):
            near_ones = self._throws.near(goals_of(self.releases(), self.scene, target, turns))
        for near, goal in near_ones:
            if search.late:
                break
            search.guards, search.room = near.guards, near.room
            problem = self.bench.problem(goal, name, search)
            if not near.fits(goal, problem.nlp.size):
                continue
            plan = self._from_solution(problem, goal, near.solution, near.target, near.aim, search)
            if plan is not None:
                return plan
        search.guards, search.room = asked
        return None

    def _from_solution(
        self,
        problem: Problem,
        goal: Pose,
        solution: Solution,
        solved: Pose,
        aim: tuple[float, float],
        search: Search,
    ) -> Plan | None:
        """A plan from a solution of the same NLP for the target `solved`, and where that aimed."""
        near = goal.distance(solved, self.scene.object.length / 2) < BESIDE
        start = goal, solution.x, search, solution, aim
        thrown = attempt(problem, self.mover, *start, near=near)
        if thrown is None:
            return None
        return solved_plan(self.bench, Found(goal, thrown, problem.solver.name), search)

    def releases(self) -> Releases:
        """The table of sampled releases that starting points come from."""
        if self._releases is None:
            draw = functools.partial(self._sampler.draw, SAMPLES)
            self._releases = stored(self.scene, self.mover, SAMPLES, 0, draw)
        return self._releases


def plan(
    scene: Scene | str | Path,
    target: Pose | None = None,
    *,
    solver: SolverName = "auto",
    turns: Turns = "exact",
) -> Plan:
    """Plan one throw of a scene (or of a built-in name or TOML file).

    To plan many targets of one scene make a `Planner`, which builds its NLP once.
    Raises InputError for wrong input; every other end is the plan's status.
    """
    return Planner(as_scene(scene)).plan(target, solver=solver, turns=turns)
