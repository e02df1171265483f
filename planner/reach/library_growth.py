"""A library of solved throws, grown over the reach as a flood: from cell to cell, outward from the
scene's target.

Landings of random throws, sorted into cells, say about how large the reach is. The cells of the
target and of a few of these landings are solved from sampled releases; each other cell from the
cheapest solved throw beside it, moved along its slope or solved anew. So the library finds its way
into corners where no random throw landed.
"""

from __future__ import annotations

import heapq
import os
import pickle
import time
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache, partial

import numpy as np

from ...problems import Pose, Scene
from ...workers import Progress, run_jobs
from ..ocp import BASE, Optimum, ReducedVariables, Refinement, Request
from ..search import (
    Budget,
    Corrector,
    Exact,
    Library,
    Neighbour,
    NlpCache,
    Records,
    Releases,
    Starts,
    Task,
    attempt,
    guess_of,
    nearest_releases,
    optimum_of,
    quieted,
    sparse_parents,
)
from ..throw import make_manipulator
from ..uncertainty import spread
from .cells import Cell, Cells, Landings, landings_of


@dataclass(frozen=True)
class FloodSettings:
    """How a library grows.

    seeds: cells solved from sampled releases, of `starts` each; sources: throws beside it from
    which a cell is tried. moves: a throw is moved along its slope from cell to cell at most this
    often; then the NLP is solved. patience [s]: longest time for one cell. batch: cells in one job
    of an executor. save_every [s]: longest time of work that a killed process loses. few: fewer
    throws than this are solved by this process alone, since others take seconds to start;
    processes: by default for more. enough: share of the throws asked for that suffices; most:
    share that is solved where the reach is larger than random throws let it seem. rounds: how often
    cells are made finer where they hold too few throws, and finer: for this share of what is asked.
    """

    seeds: int = 48
    starts: int = 2
    sources: int = 2
    moves: int = 2
    patience: float = 3.0
    batch: int = 8
    save_every: float = 5.0
    few: int = 400
    processes: int = 2
    enough: float = 0.9
    most: float = 1.3
    rounds: int = 4
    finer: float = 1.1


SETTINGS = FloodSettings()
#: Price of the load where limits leave no quiet throw: next to none.
LOUD = 1e-3
#: Seed of the choice among random landings.
SEED = 5


@dataclass(frozen=True)
class KnownThrow:
    """A solved throw, its 95 % pose error [m] under what is uncertain, and how often it was moved
    along its slope since the NLP was solved."""

    optimum: Optimum
    error95: float
    moves: int = 0


@dataclass(frozen=True)
class CellTask:
    """A cell, the landing in its middle, and a throw beside it or sampled releases."""

    cell: Cell
    goal: Pose
    source: KnownThrow | Releases


#: A cell and its throw; None where none was found.
CellResult = tuple[Cell, KnownThrow | None]


@dataclass(frozen=True)
class CellSolver:
    """Solves cells of one scene."""

    problems: NlpCache

    @cached_property
    def corrector(self) -> Corrector:
        """Moves throws along their slope."""
        scene = self.problems.scene
        quiet = Refinement(quiet=scene.weights.quiet)
        request = Request(scene, self.problems.manipulator, scene.target, quiet)
        return Corrector(ReducedVariables(request), self.problems)

    def solve(self, cell: CellTask) -> CellResult:
        """A throw into the cell: a throw beside it is moved there, else solved anew."""
        goal, source, scene = cell.goal, cell.source, self.problems.scene
        budget = Budget.lasting(SETTINGS.patience)
        quiet = scene.weights.quiet
        task = Task(scene.aimed_at(goal), goal, budget=budget, quiet=quiet)
        if isinstance(source, Releases):
            table = Starts(source, task, self.problems.manipulator)
            tries = (Exact(goal, table.guess(index)) for index, goal, _ in table.nearest)
            return cell.cell, next(filter(None, (self._solved(one, task) for one in tries)), None)
        near, found = Neighbour.of(source.optimum, goal, scene), None
        if source.moves < SETTINGS.moves:
            found = self._moved(near, source, task)
        return cell.cell, found or self._solved(self.corrector.start(near, task), task)

    def _moved(self, near: Neighbour, source: KnownThrow, task: Task) -> KnownThrow | None:
        """The throw moved along its slope; None where it breaks something there."""
        one, u = self.corrector.moved(near, task)
        if not one.hits or one.throw is None or u is None:
            return None
        detach, effort = one.throw.deciding.release.end, one.throw.effort
        optimum = replace(near.optimum, u=u, detach=detach, effort=effort)
        return KnownThrow(optimum, spread(one.throw.deciding, one.goal), source.moves + 1)

    def _solved(self, start: Exact, task: Task) -> KnownThrow | None:
        """The NLP's solution with its sensitivity; None where it has none."""
        one = quieted(self.problems, attempt(self.problems, start, task), task)
        if one.hits and one.throw is not None and task.quiet and not one.refinement.quiet:
            # All throws of a library have the same variables.
            alike = replace(one.refinement, quiet=LOUD)
            start = Exact(one.goal, guess_of(one.throw), alike, one.throw.aim)
            one = attempt(self.problems, start, task)
        if not one.hits or one.throw is None:
            return None
        program = self.problems.problem(task.target, one.refinement, task.solver, task.budget)
        optimum = optimum_of(self.corrector.controls, program, one.throw)
        if optimum is None:
            return None
        return KnownThrow(optimum, spread(one.throw.deciding, one.goal))


def solve_in_worker(scene: bytes, tasks: Sequence[CellTask]) -> list[CellResult]:
    """Results of cells of a pickled scene, by a process that keeps the scene's NLPs."""
    solver = _solver_of(scene)
    return [solver.solve(task) for task in tasks]


@lru_cache(maxsize=1)
def _solver_of(data: bytes) -> CellSolver:
    scene = pickle.loads(data)
    return CellSolver(NlpCache(scene, make_manipulator(scene)))


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
        target = _at_rest(problems.scene)
        problems.problem(target.middle, BASE, "fatrop", Budget()).solver.compile()
    for turn in range(SETTINGS.rounds):
        if cells is None:
            return
        before, most = len(library), SETTINGS.most * throws if not turn else throws
        flood = Flood(CellSolver(problems), releases, library, cells, most)
        flood.run(landings, throws, executor, progress)
        # A library that was begun before may have the first cells full.
        if len(library) >= SETTINGS.enough * throws or (turn and len(library) == before):
            return
        # The reach is smaller than random throws let it seem.
        cells = cells.finer(SETTINGS.finer * throws / max(len(library), 1))


def _at_rest(scene: Scene) -> Pose:
    """The scene's target without velocity and time: throws of a library serve any of them."""
    return scene.aim.changed(velocity=None, arrival=None)


class Flood:
    """Solves a throw into each of `cells` that a solved one leads to, `most` throws at most."""

    def __init__(
        self, solver: CellSolver, releases: Releases, library: Library, cells: Cells, most: float
    ) -> None:
        self._solver, self._releases, self._library = solver, releases, library
        self._target, self._cells, self._most = _at_rest(solver.problems.scene), cells, most
        self._solved: dict[Cell, KnownThrow] = {}
        #: Cells beside solved ones: pose error [m] from the target, and cell.
        self._waiting: list[tuple[float, Cell]] = []
        #: Solved cells from which a cell was tried.
        self._tried: dict[Cell, set[Cell]] = {}
        self._seeds: set[Cell] = set()
        self._running: dict[Cell, CellTask] = {}
        self._new: list[Records] = []
        self._saved = time.perf_counter()

    def run(
        self,
        landings: Landings,
        throws: int,
        executor: Executor | None = None,
        progress: Progress | None = None,
    ) -> None:
        """Solves until no cell is left; an executor spreads the cells.

        landings: of random throws. progress(solved, throws) is called on the way.
        """
        records = self._library.records
        for number in range(len(self._library)):
            x, theta = records["landing"][number].astype(float).tolist()
            known = KnownThrow(self._library.optimum(number), float(records["error95"][number]))
            self._take(self._cells(x, theta), known)
        some = sparse_parents(*landings, SETTINGS.seeds, np.random.default_rng(SEED))
        self._seeds = {self._cells(landings[0][i], landings[1][i]) for i in some}
        self._seeds.add(self._cells(self._target.plane_x, self._target.theta))
        for cell in self._seeds:
            self._wait_for(cell)

        def keep(results: Sequence[CellResult]) -> None:
            for cell, throw in results:
                self._running.pop(cell, None)
                if throw is not None and cell not in self._solved:
                    self._take(cell, throw)
                    goal = self._cells.middle(cell, self._target)
                    landing = goal.plane_x, goal.theta or 0.0
                    row = self._library.record(throw.optimum, landing, throw.error95)
                    self._new.append(row)
                elif throw is None:
                    self._wait_for(cell)
            if time.perf_counter() > self._saved + SETTINGS.save_every:
                self._save()
            if progress is not None:
                progress(min(len(self._solved), throws), throws)

        try:
            try:
                run_jobs(partial(self._next_job, executor), executor, keep)
            except BrokenExecutor:
                # A worker was killed: this process solves what is left.
                lost, self._running = self._running, {}
                for cell, task in lost.items():
                    self._tried.pop(cell, None)
                    if isinstance(task.source, Releases):
                        self._seeds.add(cell)
                    self._wait_for(cell)
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
        """The waiting cell nearest to the target; None while no cell waits."""
        while self._waiting and len(self._solved) < self._most:
            _, cell = heapq.heappop(self._waiting)
            if cell in self._running or cell in self._solved:
                continue
            source = self._source(cell)
            if source is None and cell in self._seeds:
                self._seeds.remove(cell)
                return CellTask(cell, *self._from_releases(cell))
            if source is not None:
                self._tried.setdefault(cell, set()).add(source)
                goal = self._cells.middle(cell, self._target)
                return CellTask(cell, goal, self._solved[source])
        return None

    def _from_releases(self, cell: Cell) -> tuple[Pose, Releases]:
        """The middle of a cell, and the sampled releases that land nearest to it."""
        goal, scene = self._cells.middle(cell, self._target), self._solver.problems.scene
        nearest = nearest_releases(self._releases, scene, goal, "exact", SETTINGS.starts)
        chosen = np.array([index for index, *_ in nearest], int)
        return goal, self._releases.picked(chosen)

    def _source(self, cell: Cell) -> Cell | None:
        """The cheapest solved cell beside an open one from which it was not tried; None without."""
        tried = self._tried.get(cell, set())
        if cell in self._solved or len(tried) >= SETTINGS.sources:
            return None
        beside = [one for one in self._cells.around(cell) if one in self._solved]
        open_ones = [one for one in beside if one not in tried]
        return min(open_ones, key=lambda one: self._solved[one].optimum.effort, default=None)

    def _take(self, cell: Cell, throw: KnownThrow) -> None:
        """Takes up a cell's throw."""
        self._solved[cell] = throw
        for beside in self._cells.around(cell):
            self._wait_for(beside)

    def _wait_for(self, cell: Cell) -> None:
        """Puts a cell into the queue if it is open: a seed, or with a throw beside it to try."""
        if cell in self._seeds or self._source(cell) is not None:
            goal = self._cells.middle(cell, self._target)
            away = goal.distance(self._target, self._solver.problems.scene.object.half_length)
            heapq.heappush(self._waiting, (away, cell))

    def _save(self) -> None:
        """Adds what was solved to the library."""
        self._library.add(self._new)
        self._new, self._saved = [], time.perf_counter()
