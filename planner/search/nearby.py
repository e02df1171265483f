"""Attempts from solved throws near a target: a warm plan's and the library's."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from heapq import merge

import numpy as np

from ...models import Path, land
from ...problems import Pose
from ..check import NO_SAMPLES, TICK, Mover, Throw
from ..ocp import Optimum, Request
from ..result import Plan, PlannedThrow
from .attempt import Attempt, Edge, Start, attempts
from .corrector import Corrector, moved_start, optimum_of
from .guess import refit
from .library import Library, Neighbour
from .nlps import Problems, Task
from .release_table import Turns
from .walk import Walk

#: Throws of the library that a plan is moved from, that a choice is made among, per throw, and that
#: steps of the condensed NLP begin from.
NEIGHBOURS, CHOSEN_FROM, STEPPED = 4, 6, 8
#: Throws from which the nearest possible landing is looked for.
EDGE = 2
#: As far [m, scaled error] a warm plan's optimum is moved.
MOVED = 0.06
#: A solution for a target within this distance [m, scaled error] needs few iterations.
NEAR = 0.005


class Nearby:
    """What plans of one scene begin with, before anything is searched."""

    def __init__(self, problems: Problems, library: Library) -> None:
        self._problems, self._library = problems, library
        self._corrector = Corrector(library.controls, problems)
        # Of the last warm plan that a solver made: targets that move ask for it again and again.
        self._last: tuple[PlannedThrow, Optimum | None] | None = None

    def attempts(
        self, task: Task, turns: Turns, wanted: int, warm: PlannedThrow | None = None
    ) -> Iterator[Attempt]:
        """Throws nearby moved to the target; then the nearest as a solver's start.

        wanted: how many distinct throws are looked for; warm: a plan's throw to a target nearby.
        A single solver that is asked for gets no moved throws.
        """
        near: Iterator[Neighbour] = iter(())
        if warm is not None and not _of_kind(warm, task):
            warm = None
        count = 0
        if len(task.solvers) > 1:
            count = NEIGHBOURS if wanted == 1 else CHOSEN_FROM * wanted
            near = self._library.near(task.target, turns, max(count, STEPPED))
            if warm is not None:
                near = merge(self._moved_on(warm, task), near, key=lambda one: one.distance)
        known = list[Neighbour]()
        for one in near:
            known.append(one)
            if task.clock.late:
                return
            if len(known) <= count:
                yield self._corrector.attempt(one, task)
        for one in known[:STEPPED]:
            yield from Walk(self._corrector, one, task).attempts()
        first = known[0] if known else None
        for start in self._starts(task, warm, first):
            if task.clock.late:
                return
            yield from attempts(self._problems, start, task)

    def edge(self, task: Task, turns: Turns) -> list[tuple[Start, float]]:
        """Starts from the library's throws that land nearest, with how far off [m]."""
        if len(task.solvers) == 1:
            return []
        near = self._library.near(task.target, turns, EDGE, math.inf)
        return [(self._start(one.optimum, one.goal, task), one.distance) for one in near]

    def held(self, task: Task, turns: Turns, tried: Sequence[Attempt]) -> Edge | None:
        """The nearest landing that limits let an attempt, or the library's growth, come to."""
        edges = [attempt.edge for attempt in tried if attempt.edge is not None]
        for one in self._library.near(task.target, turns, 1, math.inf):
            edges = [edge for edge in edges if edge.missed < one.distance]
            if not edges and self._library.beyond(one.goal):
                (dx, turn), goal = one.miss, one.goal
                pose = goal.in_plane(goal.plane_x + dx, goal.turned(turn).theta)
                edges.append(Edge(goal, pose, one.optimum.binding, one.distance))
        return min(edges, key=lambda edge: edge.missed, default=None)

    def _moved_on(self, warm: PlannedThrow, task: Task) -> Iterator[Neighbour]:
        """A warm plan's optimum, if it lands near enough."""
        optimum = warm.optimum
        if optimum is None:
            if self._last is None or self._last[0] is not warm:
                program = self._problems.problem(task.target, warm.asked, "fatrop", task.clock)
                self._last = warm, optimum_of(self._library.controls, program, warm)
            optimum = self._last[1]
        if optimum is None:
            return
        target = task.target
        x, theta, _ = map(float, land(optimum.detach[None], target.z, task.scene.gravity)[0])
        turn = 0.0 if target.theta is None else theta - target.theta
        dx = x - target.plane_x
        away = abs(dx) + abs(turn) * task.scene.object.length / 2
        if away < MOVED:
            yield Neighbour(optimum, target, (dx, turn), away)

    def _starts(
        self, task: Task, warm: PlannedThrow | None, first: Neighbour | None
    ) -> Iterator[Start]:
        """Starts of a solver from a warm plan, then from the nearest throw of the library."""
        if warm is not None and warm.solution is not None:
            solution, lever = warm.solution, task.scene.object.length / 2
            near = task.target.distance(warm.final.target, lever) < NEAR
            start = Start(task.target, lambda nlp: solution.x, task.solvers[0], near=near)
            yield replace(start, asked=warm.asked, warm=solution, aim=warm.aim)
        elif warm is not None and warm.optimum is not None:
            yield self._start(warm.optimum, task.target, task)
        elif warm is not None:
            # The rest of a swing: no solution of the NLPs of this task.
            request, rest = Request(task.scene, warm.mover), warm
            yield Start(task.target, lambda nlp: refit(nlp, rest, request), task.solvers[0])
        if first is not None and (warm is None or first.optimum is not warm.optimum):
            yield self._start(first.optimum, first.goal, task)

    def _start(self, optimum: Optimum, goal: Pose, task: Task) -> Start:
        return moved_start(self._library.controls, self._problems.mover, optimum, goal, task)


def rest_of(swing: Plan, mover: Mover) -> Plan | None:
    """The rest of a plan's swing from where it is nearest to the state that `mover` begins in.

    None for a plan without a throw.
    """
    if swing.throw is None or mover.start is None:
        return None
    throw, weight = swing.throw, mover.hard.dq
    samples, final = throw.samples, throw.final
    off = np.abs(samples.q - mover.start) + np.abs(samples.dq - mover.begins[0]) / weight
    before = math.floor(throw.opening_time / TICK)
    time = TICK * int(off[:before].sum(axis=1).argmin())
    return replace(swing, mover=mover, throw=rest_from(final, time, mover, throw.planned))


def rest_from(throw: Throw, time: float, mover: Mover, planned: Path | None = None) -> PlannedThrow:
    """The rest of a throw's motion from `time` [s] on; planned: its motion up to detach."""
    path, opens = throw.path.later(time), throw.opening_time - time
    rest = replace(throw, mover=mover, path=path, opening_time=opens, samples=NO_SAMPLES)
    return PlannedThrow(path if planned is None else planned.later(time), rest, 0.0, (0, 0))


def _of_kind(warm: PlannedThrow, task: Task) -> bool:
    """Whether a warm plan's throw is of the NLPs of a task: not robust, theta alike."""
    robust = warm.nlp is not None and bool(warm.nlp.structure.robust)
    return not robust and (warm.final.target.theta is None) == (task.target.theta is None)
