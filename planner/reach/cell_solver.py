"""One cell of the reach solved: from a throw that lands beside it, or from sampled releases."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from operator import attrgetter

from ...problems import Pose, Scene
from ..library import Neighbour
from ..ocp import BASE, Optimum, ReducedVariables, Refinement, Request
from ..samples import Releases, starts
from ..search import (
    Approach,
    Attempt,
    Clock,
    Corrector,
    NlpCache,
    SqpContinuation,
    Start,
    Task,
    agree,
    approach_goal,
    attempts,
    fixed_optimum,
    optimum_of,
    release_start,
)
from ..throw import make_manipulator
from .cells import Cell


@dataclass(frozen=True)
class SolverSettings:
    """How a cell is solved.

    patience [s]: longest time for one cell. max_distance [m]: a throw with a larger pose error is
    not moved along its slope. max_moves: a throw is moved along its slope from cell to cell at most
    this often; then the NLP is solved.
    """

    patience: float = 3.0
    max_distance: float = 0.15
    max_moves: int = 2


SETTINGS = SolverSettings()


@dataclass(frozen=True)
class KnownThrow:
    """A solved throw, and how often it was moved along its slope since the NLP was solved."""

    optimum: Optimum
    moves: int = 0


@dataclass(frozen=True)
class CellTask:
    """A cell, the landing in its middle, and a throw that lands beside it or sampled releases.

    A cell that may be beyond the boundary has the two throws that land nearest for its source, and
    `others` to try before it counts so. has_throw: whether the cell has a throw, which a cheaper
    one is to replace.
    """

    cell: Cell
    goal: Pose
    source: KnownThrow | Releases | tuple[KnownThrow, ...]
    has_throw: bool = False
    others: Releases | None = None


@dataclass(frozen=True)
class CellResult:
    """The throw that lands in a cell; or None, and the one that limits let come nearest to it."""

    cell: Cell
    throw: KnownThrow | None
    boundary: Optimum | None = None


@dataclass(frozen=True)
class CellSolver:
    """Solves cells of one scene."""

    problems: NlpCache

    @cached_property
    def corrector(self) -> Corrector:
        """Moves throws along their slope."""
        scene = self.problems.scene
        request = Request(scene, self.problems.manipulator, scene.target)
        return Corrector(ReducedVariables(request), self.problems)

    def solve(self, cell_task: CellTask) -> CellResult:
        """A throw into the cell.

        A throw near it is moved along its slope; from a farther one, or one that was moved often,
        the NLP is solved. Where that fails, steps that know all limits lead to the cell. At the
        edge two throws are brought as near to the cell as limits let them.
        """
        cell, goal, source = cell_task.cell, cell_task.goal, cell_task.source
        clock = Clock.lasting(SETTINGS.patience)
        task = Task(self.problems.scene.aimed_at(goal), goal, ("fatrop",), clock)
        if isinstance(source, Releases):
            return CellResult(cell, self._from_releases(source, task))
        if isinstance(source, tuple):
            return self._approached(cell_task, source, task)
        near = Neighbour.of(source.optimum, goal, self.problems.scene)
        is_near, found = near.distance < SETTINGS.max_distance, None
        if is_near and source.moves < SETTINGS.max_moves:
            found = self._moved(near, source, task)
        else:
            found = self._solved_anew(near, task)
        if found is None and not cell_task.has_throw:
            found = self._continued(near, task)
        return CellResult(cell, found)

    def _continued(self, near: Neighbour, task: Task) -> KnownThrow | None:
        """The throw after steps within all limits; None where they do not lead to the cell."""
        *_, last = None, *SqpContinuation(self.corrector, near, task).attempts()
        if last is None or not last.solved or last.throw is None or last.throw.optimum is None:
            return None
        return KnownThrow(last.throw.optimum)

    def _approached(
        self, cell_task: CellTask, sources: Sequence[KnownThrow], task: Task
    ) -> CellResult:
        """The first throw that is brought to the cell; else the one that limits let come nearest,
        if they end the others equally near and no sampled release leads there."""
        cell, short = cell_task.cell, list[Attempt]()
        for source in sources:
            near = Neighbour.of(source.optimum, task.target, task.scene)
            step = Approach(near.goal, near, near.distance, light=True)
            # From a solved throw the first price gains no cell, and takes 6 % of a library's time.
            step = replace(step, prices=step.prices[-1:])
            *_, last = approach_goal(self.corrector, step, task)
            found = self._known(last, task)
            if found is not None:
                return CellResult(cell, found)
            if not last.is_edge:
                # No two end equally near; the second rarely reaches the cell (1 of 86).
                return CellResult(cell, None)
            short.append(last)
        if not agree((one.miss for one in short), task.scene.object.half_length):
            return CellResult(cell, None)
        if cell_task.others is not None and (found := self._from_releases(cell_task.others, task)):
            return CellResult(cell, found)
        nearest = min(short, key=attrgetter("missed"))
        assert nearest.throw is not None and nearest.edge is not None
        controls, names = self.corrector.controls, nearest.edge.names
        return CellResult(cell, None, fixed_optimum(controls, nearest.throw, names))

    def _moved(self, near: Neighbour, source: KnownThrow, task: Task) -> KnownThrow | None:
        """The throw moved along its slope; None where it breaks something there."""
        attempt, u = self.corrector.moved(near, task)
        if not attempt.solved or attempt.throw is None or u is None:
            return None
        detach, effort = attempt.throw.deciding.release.end, attempt.throw.effort
        optimum = replace(near.optimum, u=u, detach=detach, effort=effort)
        return KnownThrow(optimum, source.moves + 1)

    def _solved_anew(self, near: Neighbour, task: Task) -> KnownThrow | None:
        """The NLP's solution from the throw; None where it has none."""
        return self._solution(replace(self.corrector.start(near, task), rough=True), task)

    def _from_releases(self, releases: Releases, task: Task) -> KnownThrow | None:
        """The NLP's solution from sampled releases, the nearest first; None without one."""
        for index, goal, _ in starts(releases, task.scene, task.target, "exact", len(releases.q)):
            start = release_start(self.problems, task, releases, index, goal)
            start = replace(start, refinement=first_refinement(self.problems.scene))
            found = self._solution(start, task)
            if found is not None:
                return found
        return None

    def _solution(self, start: Start, task: Task) -> KnownThrow | None:
        """The solution of an NLP from a start, without the costly constraints."""
        return self._known(attempts(self.problems, replace(start, light=True), task)[-1], task)

    def _known(self, last: Attempt, task: Task) -> KnownThrow | None:
        """A solver's throw with its sensitivity; None where it is not solved."""
        if not last.solved or last.throw is None or last.throw.solution is None:
            return None
        program = self.problems.problem(task.target, last.refinement, last.solver, task.clock)
        joints, solution = self.problems.manipulator.joints, last.throw.solution
        names = program.nlp.binding_limits(joints, solution, program.limits)
        optimum = optimum_of(self.corrector.controls, program, last.throw, names)
        return None if optimum is None else KnownThrow(optimum)


def first_refinement(scene: Scene) -> Refinement:
    """What the first NLP of each cell constrains: the flying bar, where there is a palm or cup."""
    palm = scene.palm_clearance is not None
    return Refinement(frozenset({"flight"})) if palm or scene.cup is not None else BASE


def solve_in_worker(scene: bytes, tasks: Sequence[CellTask]) -> list[CellResult]:
    """Results of cells of a pickled scene, by a process that keeps the scene's NLPs."""
    solver = _solver_of(scene)
    return [solver.solve(task) for task in tasks]


@lru_cache(maxsize=1)
def _solver_of(data: bytes) -> CellSolver:
    scene = pickle.loads(data)
    return CellSolver(NlpCache(scene, make_manipulator(scene)))
