"""Plans throws of one scene: the problem is built once and solved for many targets.

The way of one plan: from a neighbouring plan, from throws solved ahead, from sampled releases,
from the edge of what is possible; each attempt solves, sends, throws, corrects and checks.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict, Unpack, get_args

from ..problems import (
    COMPARED_METHODS,
    ROBUST_METHODS,
    InputError,
    Pose,
    Scene,
    as_scene,
    checked,
)
from .check import State, Throw, check_obstacles, make_mover
from .follow import Response, Session
from .ocp import USUAL
from .reach import Progress, grow
from .result import Plan, checked_target
from .robust import Hardening, hardened, robust_scene
from .search import (
    Attempt,
    Clock,
    Edge,
    Library,
    Nearby,
    Problems,
    Reach,
    Releases,
    ReleaseSampler,
    Search,
    Sources,
    Task,
    Turns,
    attempts,
    check_contradictions,
    check_start,
    contradiction,
    distinct,
    highest,
    met,
    nothing_found,
    ordered,
    rest_of,
    stored_releases,
)

SolverName = Literal["auto", "fatrop", "ipopt"]

#: Other throws to a target that robust planning may start from.
MORE_SOURCES = 3
#: Most alternatives that may be asked for.
MOST_ALTERNATIVES = 20
#: Random releases drawn for the starting points.
SAMPLES = 20_000
#: How long [s] a throw is looked for, and several throws or a robust one.
PATIENCE, LONG_PATIENCE = 3.0, 20.0
#: What binds where no sampled release comes down through the target's height.
HEIGHT = "landing height"
#: Throws that `prepare` solves where the reach has room for so many, and the most it may be asked.
PREPARED, MOST_PREPARED = 5000, 10_000


class Planner:
    """Plans throws of one scene; builds its NLP once and solves for many targets.

    scene: a `Scene`, a built-in name or a TOML file. library: whether plans start from the
    scene's solved throws where the cache has them (see `prepare`).

    Raises InputError for a scene that cannot be planned at all: no [hand] or [robot],
    or a grip too weak to hold the object at rest in any permitted start pose.
    """

    def __init__(self, scene: Scene | str | Path, *, library: bool = True) -> None:
        start = time.perf_counter()
        scene = as_scene(scene)
        self.scene = scene
        self.mover = make_mover(scene)
        # Obstacles stand in the base frame, tables and libraries in the throw's own plane.
        scene = scene.replace(obstacle=()) if scene.obstacle else scene
        check_start(scene, self.mover)
        check_contradictions(scene, self.mover)
        self.problems = Problems(scene, self.mover)
        self._sampler = ReleaseSampler(scene, self.mover)
        reach = Reach(scene, self.mover)
        self._sources = Sources(self.problems, self._sampler, reach, self.releases)
        self._stored = library
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
        patience: float | None = None,
        start: State | None = None,
    ) -> Plan:
        """A throw to `target` (the scene's by default), with its status.

        Always returns; raises InputError only for wrong input. solver: 'auto' is FATROP with IPOPT
        as fallback. turns: 'any' takes theta modulo full turns. warm: a solved plan of this planner
        for a target nearby. alternatives: how many throws that differ from the plan's to look for,
        for `Plan.alternatives`. robust: a method of the section [robust], instead of the scene's.
        patience [s]: how long to look, besides what is built once; 3 s, 20 s for several throws or
        a robust one. start: a state of motion that the throw goes on from, at its time 0; it is a
        given start then, and `warm` a plan whose motion passes there.
        """
        started = time.perf_counter()
        target = self.check(target)
        _check_one_of("solver", solver, SolverName)
        _check_one_of("turns", turns, Turns)
        checked("alternatives", alternatives, int, {"least": 0, "most": MOST_ALTERNATIVES})
        checked("patience", patience, float | None, {"above": 0})
        checked("warm", warm, Plan | None, {})
        checked("start", start, State | None, {})
        method = self._method(robust)
        if method and alternatives:
            raise InputError("alternatives: not with a robust plan")
        if (method or alternatives) and not target.at_rest:
            raise InputError("target: velocity and arrival go with neither robust nor alternatives")
        if start is not None and method:
            raise InputError("start: a robust plan begins at rest")
        if patience is None:
            patience = PATIENCE if not method and self._wanted(alternatives) == 1 else LONG_PATIENCE
        solvers = ("fatrop", "ipopt") if solver == "auto" else (solver,)
        clock = Clock.lasting(patience)
        task = Task(self.scene.aimed_at(target), target, solvers, clock)
        made, self._build_time = self._build_time, 0.0
        wanted, by = self._wanted(alternatives), self
        if start is not None:
            by = self._begun(start)
            warm = None if warm is None else rest_of(warm, by.mover)

        def thrown(at: Pose, last: Plan | None) -> Plan:
            return by._planned(task.aimed_at(at), turns, wanted, last or warm)

        plan = met(self.scene, target, self.releases, thrown)
        if method and plan.solved:
            others = functools.partial(self._planned, task, turns, MORE_SOURCES + 1)
            plan = hardened(plan, Hardening(self._robust_problems, method, task), others)
        total, spent = time.perf_counter() - started + made, dict(clock.seconds)
        spent["build"] += made
        rest = plan.alternatives[:alternatives]
        return dataclasses.replace(plan, alternatives=rest, time={**spent, "total": total})

    def _planned(self, task: Task, turns: Turns, wanted: int, warm: Plan | None = None) -> Plan:
        """The best of `wanted` distinct throws, from solved ones nearby or else from a search."""
        tried: list[Attempt] = []
        found: list[Attempt] = []
        before = None if warm is None or warm.mover is not self.mover else warm.throw
        for attempt in self._nearby.attempts(task, turns, wanted, before):
            tried.append(attempt)
            if attempt.solved:
                found = distinct([*found, attempt]) if wanted > 1 else [attempt]
            if len(found) >= wanted:
                return self._best(found, tried, task)
        name, words = ("", "") if found else contradiction(task.scene, self.releases, task.target)
        if words:
            plan = self._plan(task, task.target, tried, 0, (0, 0))
            message = f"out of reach: {words}"
            plan = dataclasses.replace(plan, status="out_of_reach", binding=(name,))
            return dataclasses.replace(plan, message=message)
        search = Search(self._sources, task, turns, wanted, tried, self._nearby.edge(task, turns))
        for start in search.starts():
            tried += attempts(self.problems, start, task)
            if tried[-1].solved:
                found = distinct([*found, tried[-1]])
            if len(found) >= wanted:
                break
        if not found:
            return self._failed(search, tried, task)
        return self._best(found, tried, task, search.iterations)

    def _best(
        self, found: list[Attempt], tried: Sequence[Attempt], task: Task, iterations: int = 0
    ) -> Plan:
        """The plan of the best of the throws found; iterations: of solves beside the attempts."""
        by = "effort" if self.scene.choice is None else self.scene.choice.by
        best, *others = ordered(found, by) if len(found) > 1 else found
        plan = self._solved(best, tried, task, iterations)
        rest = tuple(self._solved(other, [other], task) for other in others)
        return dataclasses.replace(plan, alternatives=rest)

    def follow(
        self,
        plan: Plan,
        horizon: float = 0.02,
        *,
        sent: Throw | None = None,
        response: Response | None = None,
    ) -> Session:
        """A session that corrects the swing of a solved plan until the hand opens.

        Takes some tenths of a second, before the swing. horizon [s]: after a measurement until
        what is sent for it is on its way. sent: what is sent instead of the plan's motion to joints
        that lag, response: how these follow, where that is known. InputError for a plan that is not
        this planner's.
        """
        horizon = checked("horizon", horizon, float, {"above": 0})
        checked("plan", plan, Plan, {})
        checked("sent", sent, Throw | None, {})
        checked("response", response, Response | None, {})
        return Session(self._under_way[0], plan, horizon, sent, response)

    def polish(self, plan: Plan) -> Plan:
        """The plan at its optimum: solved again from where it is, for times without other work.

        A throw that was moved, from the library or after a target, costs more than need be. The
        plan itself comes back where nothing cheaper is found, where it is robust or not solved, and
        for a target that moves or is to be met at a time.
        """
        before = checked("plan", plan, Plan, {}).throw
        mine = plan.solved and plan.mover is self.mover and plan.target.at_rest
        if not mine or before is None:
            return plan
        target, started, clock = plan.target, time.perf_counter(), Clock.lasting(PATIENCE)
        task = Task(self.scene.aimed_at(target), target, ("fatrop",), clock)
        for attempt in self._nearby.attempts(task, "exact", 1, before):
            if attempt.solved and attempt.throw and attempt.throw.effort < before.effort:
                better = self._solved(attempt, [attempt], task)
                total = time.perf_counter() - started
                return dataclasses.replace(better, time={**clock.seconds, "total": total})
        return plan

    def prepare(self, throws: int = PREPARED, progress: Progress | None = None) -> int:
        """Grows a library of solved throws all over the reach, for plans to start from.

        Takes up to six minutes, some seconds of it for the C compiler, where one is there; all is
        kept in the cache folder, and every planner of the scene uses it. A plan is then a stored
        throw moved to its target and checked, in a few milliseconds.
        throws: about how many; ended early (Ctrl-C), it goes on from what it has when called again.
        progress(solved, throws) is called on the way. Returns how many there are. InputError for a
        number out of range.
        """
        throws = checked("throws", throws, int, {"least": 1, "most": MOST_PREPARED})
        try:
            grow(self._sources, self.library, throws, progress)
        finally:
            self.library.merge()
        return len(self.library)

    @property
    def prepared(self) -> int:
        """How many solved throws plans may start from."""
        return len(self.library)

    @functools.cached_property
    def _nearby(self) -> Nearby:
        return Nearby(self.problems, self.library)

    @functools.cached_property
    def library(self) -> Library:
        """The scene's solved throws, as far as the cache has them."""
        return Library(self.problems.scene, self.mover, keep=self._stored)

    def check(self, target: Pose | None = None) -> Pose:
        """The target that `plan` would take; InputError if it does not fit the scene."""
        target = checked_target(self.scene, target)
        check_obstacles(self.scene.aimed_at(target), self.mover)
        return target

    def releases(self) -> Releases:
        """The table of sampled releases that starting points come from."""
        if self._releases is None:
            draw = functools.partial(self._sampler.draw, SAMPLES)
            self._releases = stored_releases(self.scene, self.mover, SAMPLES, 0, draw)
        return self._releases

    _releases: Releases | None = None

    def _begun(self, start: State) -> Planner:
        """A planner of throws that go on from a state of motion; it shares NLPs and table.

        Solved throws of the library are from rest, and of no use to it.
        """
        found, mover = copy.copy(self), self.mover.begun(start.checked(self.mover))
        problems, reach = self._under_way
        found.mover, found.problems = mover, problems.begun(mover)
        found._sources = dataclasses.replace(
            self._sources, problems=problems.begun(mover), reach=reach.begun(mover)
        )
        found._nearby = Nearby(found.problems, Library(self.problems.scene, mover, keep=False))
        return found

    @functools.cached_property
    def _under_way(self) -> tuple[Problems, Reach]:
        """The NLPs of throws that go on from a state of motion."""
        scene = self.problems.scene
        return Problems(scene, self.mover), Reach(scene, self.mover)

    def _method(self, robust: str | None) -> str:
        """The robust method that is asked for, empty if none."""
        if robust is None:
            return "" if self.scene.robust is None else self.scene.robust.method
        if robust not in ROBUST_METHODS + COMPARED_METHODS:
            raise InputError(f"robust = {robust!r}: must be one of {', '.join(ROBUST_METHODS)}")
        return robust

    @functools.cached_property
    def _robust_problems(self) -> Problems:
        """The NLPs of robust plans."""
        return Problems(robust_scene(self.scene), self.mover)

    def _wanted(self, alternatives: int) -> int:
        """How many distinct throws to find before one is chosen."""
        choice = self.scene.choice
        return max(1 if choice is None else choice.among, 1 + alternatives)

    def _solved(
        self, found: Attempt, tried: Sequence[Attempt], task: Task, iterations: int = 0
    ) -> Plan:
        """The plan of a throw that was found; iterations: of solves beside the attempts."""
        assert found.throw is not None
        goal = found.start.goal
        plan = self._plan(task, goal, tried, iterations, found.throw.nlp_size)
        words, throw = found.throw.words(goal), found.throw
        plan = dataclasses.replace(plan, status="solved", message=words, throw=throw)
        return dataclasses.replace(plan, solver=found.solver)

    def _failed(self, search: Search, tried: Sequence[Attempt], task: Task) -> Plan:
        """No throw found: out of reach with the nearest possible, or not converged."""
        answer, late, target = search.answer, task.clock.late, task.target
        nlp = self.problems.nlp(target, USUAL, task.clock)
        plan = self._plan(task, target, tried, search.iterations, nlp.size)
        if answer is None and not late:
            far, pose, words = highest(search.releases, target, task.scene.gravity)
            plan = dataclasses.replace(plan, message=words, nearest=pose, binding=(HEIGHT,))
            return dataclasses.replace(plan, status="out_of_reach") if far else plan
        edge: Edge | None = answer if answer is not None and answer.outside else None
        edge = edge or self._nearby.held(task, search.turns, tried)
        if edge is not None:
            plan = dataclasses.replace(plan, status="out_of_reach", message=edge.words(target))
            return dataclasses.replace(plan, nearest=edge.pose, binding=edge.names)
        broken = [one for one in tried if one.throw is not None and one.edge is None]
        throw = broken[0].throw if broken else None
        return dataclasses.replace(plan, message=nothing_found(tried, broken, late), throw=throw)

    def _plan(
        self, task: Task, target: Pose, tried: Sequence[Attempt], more: int, size: tuple[int, int]
    ) -> Plan:
        """A plan without a throw; more: iterations of solves beside the attempts."""
        variables, constraints = size
        return Plan(
            task.scene,
            self.mover,
            target,
            "not_converged",
            "",
            None,
            solver=task.solvers[-1],
            iterations=more + sum(attempt.iterations for attempt in tried),
            attempts=sum(attempt.solves for attempt in tried),
            variables=variables,
            constraints=constraints,
        )


class Options(TypedDict, total=False):
    """What `Planner.plan` takes besides the target."""

    solver: SolverName
    turns: Turns
    warm: Plan | None
    alternatives: int
    robust: str | None
    patience: float | None
    start: State | None


def plan(scene: Scene | str | Path, target: Pose | None = None, **options: Unpack[Options]) -> Plan:
    """Plan one throw of a scene (or of a built-in name or TOML file).

    options: those of `Planner.plan`. To plan many targets of one scene make a `Planner`, which
    builds its NLP once. Raises InputError for wrong input; every other end is the plan's status.
    """
    return Planner(scene).plan(target, **options)


def _check_one_of(name: str, value: object, allowed: Any) -> None:
    if value not in get_args(allowed):
        raise InputError(f"{name} = {value!r}: must be one of {', '.join(get_args(allowed))}")
