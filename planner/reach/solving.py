"""One cell of the reach solved: from a throw that lands beside it, or from sampled releases."""

from __future__ import annotations

import pickle
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from ...problems import Pose, Scene
from ..library import Neighbour
from ..ocp import BASE, Optimum, ReducedVariables, Refinement, Request
from ..samples import Releases, starts
from ..search import (
    Clock,
    Corrector,
    NlpCache,
    SqpContinuation,
    Start,
    Task,
    attempts,
    moved_start,
    optimum_of,
    release_start,
)
from ..throw import make_manipulator
from .cells import Cell


@dataclass(frozen=True)
class SolverSettings:
    """How a cell is solved.

    patience [s]: longest time for one cell. max_distance [m]: a throw with a larger pose error is
    not moved along its slope. max_moves: a throw is moved along its slope from cell
    to cell at most this often, then solved anew, which keeps its effort near the least.
    max_starts: sampled releases that a throw is solved from.
    """

    patience: float = 3.0
    max_distance: float = 0.15
    max_moves: int = 2
    max_starts: int = 2


SETTINGS = SolverSettings()


@dataclass(frozen=True)
class KnownThrow:
    """A solved throw; moves: how often it was moved along its slope since it was solved."""

    optimum: Optimum
    moves: int = 0


@dataclass(frozen=True)
class CellTask:
    """A cell, the landing in its middle, and a throw that lands beside it or sampled releases."""

    cell: Cell
    goal: Pose
    source: KnownThrow | Releases


@dataclass(frozen=True)
class CellResult:
    """The throw that lands in a cell; None without one, and names of the limits that bind there."""

    cell: Cell
    throw: KnownThrow | None
    binding: tuple[str, ...] = ()


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

        A throw near it is moved along its slope; from a farther one the NLP is solved. Where that
        fails, steps that know all limits lead to the cell.
        """
        cell, goal, source = cell_task.cell, cell_task.goal, cell_task.source
        clock = Clock.lasting(SETTINGS.patience)
        task = Task(self.problems.scene.aimed_at(goal), goal, ("fatrop",), clock)
        if isinstance(source, Releases):
            return CellResult(cell, self._from_releases(source, task))
        near = self._neighbour(source.optimum, goal)
        is_near = near.distance < SETTINGS.max_distance and source.moves < SETTINGS.max_moves
        if is_near and (moved := self._moved(near, task)) is not None:
            return CellResult(cell, KnownThrow(moved, source.moves + 1))
        binding = near.optimum.binding
        found = None if is_near else self._solved_anew(near, task)
        if found is None:
            *_, last = None, *SqpContinuation(self.corrector, near, task).attempts()
            if last is not None and last.solved and last.throw is not None:
                found = last.throw.optimum
            elif last is not None and last.edge is not None:
                binding = last.edge.names
        return CellResult(cell, None if found is None else KnownThrow(found), binding)

    def _neighbour(self, optimum: Optimum, goal: Pose) -> Neighbour:
        """A throw with how far off the goal it lands."""
        scene = self.problems.scene
        x, theta, _ = map(float, scene.flight.land(optimum.detach[None], goal.z)[0])
        miss = x - goal.plane_x, 0.0 if goal.theta is None else theta - goal.theta
        return Neighbour(optimum, goal, miss, scene.object.pose_error(*miss))

    def _moved(self, near: Neighbour, task: Task) -> Optimum | None:
        """The throw moved along its slope; None where it breaks something there."""
        attempt, optimum = self.corrector.attempt(near, task), near.optimum
        if not attempt.solved or attempt.throw is None:
            return None
        off = near.miss[: optimum.slope.shape[1]]
        u = self.corrector.controls.within(optimum.u - optimum.slope @ off)
        detach = attempt.throw.deciding.release.end
        return replace(optimum, u=u, detach=detach, effort=attempt.throw.effort)

    def _solved_anew(self, near: Neighbour, task: Task) -> Optimum | None:
        """The NLP's solution from the throw; None where it has none."""
        controls, manipulator = self.corrector.controls, self.problems.manipulator
        start = moved_start(controls, manipulator, near.optimum, near.goal, task)
        return self._optimum(replace(start, rough=True), task)

    def _from_releases(self, releases: Releases, task: Task) -> KnownThrow | None:
        """The NLP's solution from the sampled releases that land nearest; None without one."""
        nearest = starts(releases, task.scene, task.target, "exact", SETTINGS.max_starts)
        for index, goal, _ in nearest:
            start = release_start(self.problems, task, releases, index, goal)
            start = replace(start, refinement=first_refinement(self.problems.scene))
            optimum = self._optimum(start, task)
            if optimum is not None:
                return KnownThrow(optimum)
        return None

    def _optimum(self, start: Start, task: Task) -> Optimum | None:
        """The solution of an NLP from a start, without the costly constraints."""
        *_, last = attempts(self.problems, replace(start, light=True), task)
        if not last.solved or last.throw is None or last.throw.solution is None:
            return None
        program = self.problems.problem(task.target, last.refinement, last.solver, task.clock)
        joints, solution = self.problems.manipulator.joints, last.throw.solution
        names = program.nlp.binding_limits(joints, solution, program.limits)
        return optimum_of(self.corrector.controls, program, last.throw, names)


def first_refinement(scene: Scene) -> Refinement:
    """What the first NLP of each cell constrains: the flying bar, where there is a palm or cup."""
    workspace = scene.workspace
    palm = workspace is not None and workspace.palm_clearance is not None
    return Refinement(frozenset({"flight"})) if palm or scene.cup is not None else BASE


def solve_in_worker(scene: bytes, tasks: Sequence[CellTask]) -> list[CellResult]:
    """Results of cells of a pickled scene, by a process that keeps the scene's NLPs."""
    solver = _solver_of(scene)
    return [solver.solve(task) for task in tasks]


@lru_cache(maxsize=1)
def _solver_of(data: bytes) -> CellSolver:
    scene = pickle.loads(data)
    return CellSolver(NlpCache(scene, make_manipulator(scene)))
