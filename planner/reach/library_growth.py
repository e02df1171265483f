"""A library of solved throws grown over the reach, cell by cell, from the target to the boundary.

Landings of random throws, sorted into cells, say about how large the reach is. The scene's target
and a few of them are solved from sampled releases. A throw into each other cell is made from a
throw into a cell beside it, nearest to the target first, so that the library finds its way into
every corner that can be thrown to, whether a random throw landed there or not. A cell that none
leads to is beyond the boundary. Where throws from two neighbours end at equal distances from it,
it keeps the throw that limits let come nearest to it.
"""

from __future__ import annotations

import heapq
import itertools
import os
import pickle
import time
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ...problems import Pose, Scene
from ..library import Library, Records
from ..ocp import Optimum
from ..samples import Releases, sparse_parents, starts
from ..search import Candidates, Clock, NlpCache, Task
from ..workers import Progress, run_jobs
from .cell_solver import (
    CellResult,
    CellSolver,
    CellTask,
    KnownThrow,
    first_refinement,
    solve_in_worker,
)
from .cells import Cell, Cells, Landings, landings_of


@dataclass(frozen=True)
class GrowthSettings:
    """How a library grows.

    seeds: cells solved from sampled releases; late_seeds: at the end, of cells that random throws
    hit and that no neighbour led to. max_failures: neighbours from which a cell is tried before it
    counts as beyond the boundary; edge_sources: from which it is then approached. max_starts:
    sampled releases that a seed is solved from; edge_starts: before a cell counts as beyond the
    boundary, of those that differ. batch: cells in one job of an executor. save_every [s]: longest
    time of work that a killed process loses. few: fewer throws than this are solved by this process
    alone, since others take seconds to start; processes: by default for more. overshoot: where the
    reach is larger than random throws let it seem, at most this share of the throws asked for is
    solved; enough: where it is smaller, this share suffices. cheaper: a cell is solved again from a
    neighbour whose slope predicts an effort below this share of the cell's own. max_rounds: how
    often cells are made finer where they hold fewer throws than asked for, and finer_by: for this
    share of what is asked, since some finer cells lie beyond the edge.
    """

    seeds: int = 24
    late_seeds: int = 24
    max_failures: int = 2
    edge_sources: int = 2
    max_starts: int = 2
    edge_starts: int = 3
    batch: int = 8
    save_every: float = 5.0
    few: int = 400
    processes: int = 2
    overshoot: float = 1.3
    enough: float = 0.9
    cheaper: float = 0.95
    max_rounds: int = 4
    finer_by: float = 1.1


SETTINGS = GrowthSettings()
#: Seed of the choice among random landings.
SEED = 5


def default_workers(throws: int) -> int:
    """The number of processes that `throws` are worth on this machine."""
    return min(SETTINGS.processes, os.cpu_count() or 1) if throws >= SETTINGS.few else 1


def grow(
    problems: NlpCache,
    releases: Releases,
    library: Library,
    throws: int,
    executor: Executor | None = None,
    progress: Progress | None = None,
) -> None:
    """Grows a scene's library to about `throws`; after Ctrl-C it has what was solved until then.

    An executor spreads the cells. progress(solved, throws) is called on the way.
    """
    landings = landings_of(problems.scene)
    cells: Cells | None = Cells.of(*landings, throws, angle=library.angle)
    if executor is not None:
        # Workers on this machine then find the machine code in the cache.
        target, refinement = _at_rest(problems.scene), first_refinement(problems.scene)
        for elastic in (False, True):
            nlp = problems.problem(target.middle, refinement, "fatrop", Clock(), elastic=elastic)
            nlp.solver.compile()
    for turn in range(SETTINGS.max_rounds):
        if cells is None:
            return
        before, most = len(library), throws if turn else SETTINGS.overshoot * throws
        builder = LibraryBuilder(CellSolver(problems), releases, library, cells, most)
        builder.grow(landings, throws, executor, progress)
        # A library that was begun before may have the first cells full.
        if len(library) >= SETTINGS.enough * throws or (turn and len(library) == before):
            return
        # The reach is smaller than random throws let it seem.
        cells = cells.finer(SETTINGS.finer_by * throws / max(len(library), 1))


def _at_rest(scene: Scene) -> Pose:
    """The scene's target without velocity and time: throws of a library serve any of them."""
    return scene.aim.changed(velocity=None, arrival=None)


class LibraryBuilder:
    """Solves a throw into each of `cells` that a neighbour leads to, `most` throws at most."""

    def __init__(
        self, solver: CellSolver, releases: Releases, library: Library, cells: Cells, most: float
    ) -> None:
        self._solver, self._releases, self._library = solver, releases, library
        self._target, self._cells, self._most = _at_rest(solver.problems.scene), cells, most
        self._solved: dict[Cell, KnownThrow] = {}
        self._failures: dict[Cell, int] = {}
        #: Cells that may be beyond the boundary, to be approached; those that were; those proven.
        self._edge: list[Cell] = []
        self._approached: set[Cell] = set()
        self._beyond: set[Cell] = set()
        self._running: dict[Cell, CellTask] = {}
        #: Tasks that come before all others.
        self._first: list[CellTask] = []
        #: Cells to solve: whether no random throw hit it, pose error [m] from the target, effort
        #: of the source, cell, and its source: a solved cell, or itself for sampled releases.
        self._waiting: list[tuple[bool, float, float, Cell, Cell]] = []
        #: Solved cells that a neighbour may improve: share of the effort, effort, cell, neighbour.
        self._costly: list[tuple[float, float, Cell, Cell]] = []
        self._hit: set[Cell] = set()
        self._late_seeds: list[Cell] | None = None
        self._new: list[Records] = []
        self._saved = time.perf_counter()

    def grow(
        self,
        landings: Landings,
        throws: int,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Solves until no cell is left; an executor spreads the cells.

        landings: of random throws. progress(solved, throws) is called on the way.
        """
        self._hit = {self._cells(x, theta) for x, theta in zip(*landings, strict=True)}
        self._read_library()
        if not self._solved:
            rng = np.random.default_rng(SEED)
            some = sparse_parents(*landings, SETTINGS.seeds, rng)
            target = self._cells(self._target.plane_x, self._target.theta)
            self._hit.add(target)
            for cell in {target, *(self._cells(landings[0][i], landings[1][i]) for i in some)}:
                self._wait_for(cell, cell, 0.0)

        def keep(results: Sequence[CellResult]) -> None:
            for result in results:
                self._keep(result)
            if time.perf_counter() > self._saved + SETTINGS.save_every:
                self._save()
            if progress is not None:
                progress(min(len(self._solved), throws), throws)

        try:
            try:
                run_jobs(partial(self._next_job, executor), executor, keep)
            except BrokenExecutor:
                # A worker was killed: this process solves what is left.
                self._first, self._running = list(self._running.values()), {}
                run_jobs(partial(self._next_job, None), None, keep)
        finally:
            self._save()

    def _next_job(self, executor: Executor | None) -> Callable[[], list[CellResult]] | None:
        """What solves the next cells; None while no cell waits."""
        count, tasks = 1 if executor is None else SETTINGS.batch, list[CellTask]()
        while len(tasks) < count and (task := self._next_task()) is not None:
            self._running[task.cell] = task
            tasks.append(task)
        if not tasks:
            return None
        if executor is None:
            return lambda: [self._solver.solve(task) for task in tasks]
        return partial(solve_in_worker, self._pickled_scene, tasks)

    @cached_property
    def _pickled_scene(self) -> bytes:
        return pickle.dumps(self._solver.problems.scene)

    def _next_task(self) -> CellTask | None:
        """Cells outward from the target, seeds where none led, cells that cost too much.

        The cheapest solved neighbour gives a cell's throw; at the end a cheaper neighbour replaces
        dearer throws.
        """
        if len(self._solved) < self._most and (task := self._next_new()) is not None:
            return task
        while self._costly and (self._late_seeds is not None or len(self._solved) >= self._most):
            _, effort, cell, source = heapq.heappop(self._costly)
            limit = SETTINGS.cheaper * self._solved[cell].optimum.effort
            if effort < limit and cell not in self._running:
                return self._task(cell, source)
        return None

    def _next_new(self) -> CellTask | None:
        """An unsolved cell; None while no cell waits."""
        if self._first:
            return self._first.pop()
        while self._waiting:
            *_, cell, source = heapq.heappop(self._waiting)
            if self._is_open(cell):
                return self._task(cell, source)
        if (task := self._next_at_edge()) is not None:
            return task
        if self._late_seeds is None:
            if self._running:
                return None
            self._late_seeds = self._unsolved_hits()
        while self._late_seeds:
            cell = self._late_seeds.pop()
            if cell not in self._solved and cell not in self._running:
                return self._task(cell, cell)
        return None

    def _task(self, cell: Cell, source: Cell) -> CellTask:
        """To solve a cell from a solved one, or from sampled releases where that is itself."""
        known = self._releases_near(cell) if source == cell else self._solved[source]
        goal = self._cells.middle(cell, self._target)
        return CellTask(cell, goal, known, has_throw=cell in self._solved)

    def _next_at_edge(self) -> CellTask | None:
        """A cell that no throw beside it led to, to be approached; None while no cell is.

        None is approached beside one that is, or that is proven beyond.
        """
        if not self._edge and not self._running:
            beside = {beside for cell in self._solved for beside in self._cells.around(cell)}
            self._edge = sorted(beside - self._solved.keys() - self._approached)
        while self._edge:
            i, j = cell = self._edge.pop()
            around = set(itertools.product((i - 1, i, i + 1), (j - 1, j, j + 1)))
            if cell not in self._solved and around.isdisjoint(self._beyond | self._running.keys()):
                self._approached.add(cell)
                known = list(self._solved)
                away = np.abs(np.array(known) - cell).sum(axis=1)
                nearest = np.argsort(away, kind="stable")[: SETTINGS.edge_sources]
                sources = tuple(self._solved[known[k]] for k in nearest)
                goal = self._cells.middle(cell, self._target)
                return CellTask(cell, goal, sources, others=self._different_releases(goal))
        return None

    def _different_releases(self, goal: Pose) -> Releases:
        """Sampled releases that land near the goal and differ."""
        problems = self._solver.problems
        task = Task(problems.scene.aimed_at(goal), goal)
        found = Candidates(self._releases, task, problems.manipulator).different
        chosen = [index for index, _, _ in found[: SETTINGS.edge_starts]]
        return self._releases.picked(np.array(chosen, int))

    def _releases_near(self, cell: Cell) -> Releases:
        """The sampled releases that land nearest to a cell's middle."""
        goal, scene = self._cells.middle(cell, self._target), self._solver.problems.scene
        nearest = starts(self._releases, scene, goal, "exact", SETTINGS.max_starts)
        return self._releases.picked(np.array([index for index, _, _ in nearest], int))

    def _unsolved_hits(self) -> list[Cell]:
        """Cells that random throws hit and no neighbour led to, farthest from any throw last; nine
        cells or more count alike."""
        known = np.array(list(self._solved)).reshape(-1, 2)
        lost = [cell for cell in self._hit if cell not in self._solved]
        away = {cell: np.abs(known - cell).sum(axis=1).min(initial=9) for cell in lost}
        return sorted(lost, key=lambda cell: (away[cell], cell))[-SETTINGS.late_seeds :]

    def _is_open(self, cell: Cell) -> bool:
        """Whether a cell may still be solved."""
        tried = self._failures.get(cell, 0) >= SETTINGS.max_failures
        return not tried and cell not in self._solved and cell not in self._running

    # What is known.

    def _keep(self, result: CellResult) -> None:
        """Takes up what came of a cell."""
        cell, source = result.cell, self._running.pop(result.cell).source
        if cell in self._solved and not self._improves(result):
            return
        if result.throw is not None:
            self._solved[cell] = result.throw
            if isinstance(source, Releases):
                # Its neighbours may be in reach after all.
                for beside in self._cells.around(cell):
                    self._failures.pop(beside, None)
            self._spread(cell)
            self._record(cell, result.throw.optimum, solved=True)
            return
        failures = self._failures.get(cell, 0)
        self._failures[cell] = failures + 1
        if isinstance(source, KnownThrow) and not failures:
            self._record(cell, source.optimum)
        if result.boundary is not None:
            self._beyond.add(cell)
            self._record(cell, result.boundary, boundary=True)

    def _wait_for(self, cell: Cell, source: Cell, effort: float) -> None:
        """Puts a cell that has no throw into the queue."""
        goal = self._cells.middle(cell, self._target)
        away = goal.distance(self._target, self._solver.problems.scene.object.half_length)
        heapq.heappush(self._waiting, (cell not in self._hit, away, effort, cell, source))

    def _spread(self, cell: Cell) -> None:
        """Puts the cells beside a solved one into the queues."""
        effort = self._solved[cell].optimum.effort
        for beside in self._cells.around(cell):
            if beside not in self._solved:
                self._wait_for(beside, cell, effort)
            else:
                self._compare(beside, cell)
                self._compare(cell, beside)

    def _improves(self, result: CellResult) -> bool:
        """Whether a solved cell's new throw costs less."""
        before = self._solved[result.cell].optimum.effort
        return result.throw is not None and result.throw.optimum.effort < before

    def _compare(self, cell: Cell, source: Cell) -> None:
        """Puts a solved cell into the queue where a neighbour's slope predicts a cheaper throw."""
        optimum = self._solved[source].optimum
        goal, at = (self._cells.middle(c, self._target) for c in (cell, source))
        away = np.array([goal.plane_x - at.plane_x, (goal.theta or 0.0) - (at.theta or 0.0)])
        u = optimum.u + optimum.slope @ away[: optimum.slope.shape[1]]
        controls = self._solver.corrector.controls
        effort = controls.effort(controls.motion(u)[0])
        share = effort / self._solved[cell].optimum.effort
        if share < SETTINGS.cheaper:
            heapq.heappush(self._costly, (share, effort, cell, source))

    def _record(self, cell: Cell, optimum: Optimum, **kind: bool) -> None:
        goal = self._cells.middle(cell, self._target)
        landing = goal.plane_x, goal.theta or 0.0
        self._new.append(self._library.record(optimum, landing, **kind))

    def _save(self) -> None:
        """Adds what was solved to the library."""
        self._library.add(self._new)
        self._new, self._saved = [], time.perf_counter()

    def _read_library(self) -> None:
        """The library's throws, and cells beyond the boundary, of these cells."""
        throws = itertools.count()
        records = self._library.records
        kinds = records["solved"].tolist(), records["boundary"].tolist()
        landings = records["landing"].astype(float).T.tolist()
        for x, theta, solved, boundary in zip(*landings, *kinds, strict=True):
            cell = self._cells(x, theta)
            if solved:
                self._solved[cell] = KnownThrow(self._library.optimum(next(throws)))
            else:
                self._failures[cell] = SETTINGS.max_failures
                self._approached.add(cell)
            if boundary:
                self._beyond.add(cell)
        for cell in self._solved:
            self._spread(cell)
