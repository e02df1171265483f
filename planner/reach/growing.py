"""A library of solved throws grown over the map, frontier by frontier, to the edge of the reach.

The map's landings, sorted into cells, say about how large the reach is; a few random ones are
solved from the release table. From then on each solved cell is where solves for its neighbours
start, a few iterations each, so that the library finds its way into every corner that can be
thrown to, whether a random throw landed there or not. Where a solver fails from one neighbour,
steps from another know all limits at once. A cell that none leads to is the edge, and keeps the
names of the limits that bind at it.
"""

from __future__ import annotations

import dataclasses
import heapq
import itertools
import math
import time
from collections.abc import Iterator

import numpy as np

from ...problems import Pose, Scene
from ..ocp import USUAL, Asked, Optimum, Solution, binding_limits
from ..search import (
    Attempt,
    Clock,
    Corrector,
    Library,
    Neighbour,
    Search,
    Sources,
    Start,
    Task,
    Walk,
    attempts,
    moved_start,
    optimum_of,
    release_start,
    sparse_parents,
    starts,
)
from .cells import Cell, Cells, Landings
from .maps import Progress

#: Seeds solved from the release table, and starts tried for each.
SEEDS, STARTS = 24, 2
#: How many more throws are solved at most where the reach is larger than that.
MORE = 1.3
#: A cell is solved again where a neighbour's slope foretells a throw that costs less than this
#: share of what the cell's own does.
CHEAPER = 0.95
#: Throws whose costs differ by less than this share are the same.
SAME = 0.999
#: Neighbours from which a cell is tried before it counts as beyond the edge.
TRIED = 2
#: Time [s] for the cells that random throws hit and no neighbour led to.
HOLES = 20.0
#: Records are kept this often [s]: so much is lost at most where the process is ended.
KEPT = 5.0
#: Time [s] for one cell.
PATIENCE = 3.0
SEED = 5


class Growth:
    """One process' share of the growth of a scene's library.

    share: (number of this process, number of processes): it begins in its own part of the map,
    and goes on in the others' when it is done there.
    """

    def __init__(
        self,
        sources: Sources,
        library: Library,
        landings: Landings,
        throws: int,
        share: tuple[int, int] = (0, 1),
    ) -> None:
        self.problems, self.library, self._throws = sources.problems, library, throws
        self._scene, self._sources = self.problems.scene, sources
        assert self._scene.target is not None
        self._target = self._scene.target
        self._asked = always_asked(self._scene)
        self._x, self._theta = landings
        self.cells = Cells.of(*landings, throws, angle=library.angle)
        # Halves of the map for two processes: as many landings in each.
        parts = np.quantile(self._x, np.linspace(0, 1, share[1] + 1)) if self._x.size else [0, 0]
        self._own = float(parts[share[0]]), float(parts[share[0] + 1])
        if share[0] == 0:
            self._own = -math.inf, self._own[1]
        if share[0] == share[1] - 1:
            self._own = self._own[0], math.inf
        cells = {self.cells(x, theta) for x, theta in zip(*landings, strict=True)}
        self._hit = dict.fromkeys(sorted(cells))
        self._rng = np.random.default_rng([SEED, share[0]])
        self._corrector = Corrector(library.controls, self.problems)
        self._solutions: dict[Cell, tuple[Solution, Asked]] = {}
        self._optima: dict[Cell, Optimum] = {}
        self._solved: dict[Cell, float] = {}
        self._stored: dict[Cell, int] = {}
        self._beyond: dict[Cell, int] = {}
        self._new: list[np.ndarray] = []
        self._kept = time.perf_counter()

    # How far it is.

    def grow(self, progress: Progress | None = None) -> None:
        """Solves until there are so many throws, or none is left to find."""
        try:
            self._take_up()
            for _ in self._steps():
                if time.perf_counter() > self._kept + KEPT:
                    self._keep()
                if progress is not None:
                    progress(min(len(self._solved), self._throws), self._throws)
                if len(self._solved) >= MORE * self._throws:
                    break
        finally:
            self._keep()

    def _keep(self) -> None:
        """Adds what was solved to the library, and takes up what others have added."""
        self.library.add(self._new)
        self._new, self._kept = [], time.perf_counter()
        self.library.refresh()
        self._take_up()

    def _take_up(self) -> None:
        """The library's cells."""
        records, self._stored = self.library.records, {}
        x, theta = records["landing"].astype(float).T.tolist()
        efforts, found = records["effort"].tolist(), records["solved"].tolist()
        solved = itertools.count()
        for *landing, effort, good in zip(x, theta, efforts, found, strict=True):
            cell = self.cells(*landing)
            if good:
                self._stored[cell] = next(solved)
                if effort < SAME * self._solved.get(cell, math.inf):
                    self._solved[cell] = effort
                    self._solutions.pop(cell, None)
                    self._optima.pop(cell, None)
            else:
                self._beyond[cell] = TRIED

    def _steps(self) -> Iterator[None]:
        """Seeds, then cell after cell from a solved neighbour, then what no neighbour led to."""
        if not self._solved:
            for cell in self._seeds():
                self._from_table(cell)
                yield
        yield from self._spread(own=True)
        for _ in self._holes():
            yield
            yield from self._spread(own=True)
        yield from self._spread(own=False)
        yield from self._cheapen()

    def _holes(self) -> Iterator[None]:
        """Cells that random throws hit and no neighbour led to, by a search that takes its time.

        Those farthest from any throw first. Each that is solved gives its neighbours, beyond the
        edge as it seemed, another try.
        """
        end = time.perf_counter() + HOLES
        known = np.array(list(self._solved)).reshape(-1, 2)
        lost = [cell for cell in self._hit if cell not in self._solved and self._mine(cell)]
        away = {cell: np.abs(known - cell).sum(axis=1).min(initial=9) for cell in lost}
        for cell in sorted(lost, key=lambda cell: -away[cell]):
            if time.perf_counter() > end:
                return
            if cell in self._solved or not self._searched(cell):
                continue
            for beside in self.cells.around(cell):
                self._beyond.pop(beside, None)
            yield

    def _spread(self, *, own: bool) -> Iterator[None]:
        """Cells from their neighbours, those first that random throws hit, until none is left.

        From the cheapest neighbours first, so that of two families of throws the cheaper one
        comes to a cell before the other. own: in this process' part of the map.
        """
        waiting: list[tuple[bool, float, Cell, Cell]] = []

        def take(source: Cell) -> None:
            for cell in self.cells.around(source):
                if self._open(cell) and (not own or self._mine(cell)):
                    entry = cell not in self._hit, self._solved[source], cell, source
                    heapq.heappush(waiting, entry)

        for cell in list(self._solved):
            take(cell)
        while waiting:
            *_, cell, source = heapq.heappop(waiting)
            if self._open(cell):
                if self._step(cell, source):
                    take(cell)
                else:
                    # Once more at the end, should it have no other neighbour.
                    heapq.heappush(waiting, (True, math.inf, cell, source))
                yield

    def _cheapen(self) -> Iterator[None]:
        """Cells again from neighbours of a cheaper family, which so spreads as far as it is so."""
        waiting: list[tuple[float, float, Cell, Cell]] = []

        def take(cell: Cell, source: Cell) -> None:
            if cell in self._solved and self._mine(cell):
                effort = self._foretold(cell, source)
                share = effort / self._solved[cell]
                if share < CHEAPER:
                    heapq.heappush(waiting, (share, effort, cell, source))

        for source in list(self._solved):
            for cell in self.cells.around(source):
                take(cell, source)
        while waiting:
            _, effort, cell, source = heapq.heappop(waiting)
            before = self._solved[cell]
            if effort < CHEAPER * before:
                self._step(cell, source)
                if self._solved[cell] < before:
                    for beside in self.cells.around(cell):
                        take(beside, cell)
                yield

    def _foretold(self, cell: Cell, source: Cell) -> float:
        """What a neighbour's throw would cost, moved to a cell by its slope."""
        optimum = self._optimum(source)
        goal, at = (self.cells.middle(c, self._target) for c in (cell, source))
        away = np.array([goal.plane_x - at.plane_x, (goal.theta or 0.0) - (at.theta or 0.0)])
        slope = optimum.slope
        return self.library.controls.effort(optimum.u + slope @ away[: slope.shape[1]])

    def _optimum(self, cell: Cell) -> Optimum:
        """The throw of a solved cell."""
        if cell in self._optima:
            return self._optima[cell]
        return self.library.optimum(self._stored[cell])

    def _open(self, cell: Cell) -> bool:
        """Whether a cell may still be solved."""
        return cell not in self._solved and self._beyond.get(cell, 0) < TRIED

    def _mine(self, cell: Cell) -> bool:
        """Whether a cell is in this process' part of the map."""
        return self._own[0] <= (cell[0] + 0.5) * self.cells.x <= self._own[1]

    # One cell.

    def _seeds(self) -> list[Cell]:
        some = sparse_parents(self._x, self._theta, SEEDS, self._rng)
        cells = [self.cells(self._x[i], self._theta[i]) for i in some]
        return [cell for cell in dict.fromkeys(cells) if self._mine(cell)]

    def _task(self, goal: Pose) -> Task:
        clock = Clock.lasting(PATIENCE)
        return Task(self._scene.aimed_at(goal), goal, ("fatrop",), clock)

    def _from_table(self, cell: Cell) -> None:
        """A throw from nothing but the release table."""
        goal = self.cells.middle(cell, self._target)
        task, releases = self._task(goal), self._sources.table()
        for index, aim, _ in starts(releases, task.scene, goal, "exact", STARTS):
            start = release_start(self.problems, task, releases, index, aim)
            start = dataclasses.replace(start, asked=self._asked, light=True)
            if self._taken(list(attempts(self.problems, start, task)), task):
                return
        self._beyond[cell] = 1

    def _searched(self, cell: Cell) -> bool:
        """Whether a search such as a plan's solves a cell."""
        goal, tried = self.cells.middle(cell, self._target), list[Attempt]()
        task = dataclasses.replace(self._task(goal), solvers=("fatrop", "ipopt"))
        for start in Search(self._sources, task, "exact", 1, tried).starts():
            tried += attempts(self.problems, start, task)
            if tried[-1].solved:
                break
        return self._taken(tried, task)

    def _step(self, cell: Cell, source: Cell) -> bool:
        """Whether a cell is solved from a neighbour: by a solver, then by steps from another."""
        task, optimum = self._task(self.cells.middle(cell, self._target)), self._optimum(source)
        failed = self._beyond.get(cell, 0)
        if failed or cell not in self._hit:
            found = self._walked(optimum, source, task)
        else:
            start = self._start(optimum, source, task)
            found = self._taken(list(attempts(self.problems, start, task)), task)
        if found or cell in self._solved:
            return found
        self._beyond[cell] = failed + 1
        if self._beyond[cell] >= TRIED:
            landing = (task.target.plane_x, task.target.theta or 0.0)
            self._new.append(self.library.record(optimum, landing, solved=False))
        return False

    def _start(self, optimum: Optimum, source: Cell, task: Task) -> Start:
        """A solver's start from a neighbour's throw."""
        if source in self._solutions:
            solution, asked = self._solutions[source]
            start = Start(
                task.target,
                lambda nlp: solution.x,
                "fatrop",
                asked=asked,
                warm=solution,
                near=False,
                aim=optimum.smoothing,
            )
        else:
            controls, mover = self.library.controls, self.problems.mover
            start = moved_start(controls, mover, optimum, task.target, task)
        return dataclasses.replace(start, light=True, rough=True)

    def _walked(self, optimum: Optimum, source: Cell, task: Task) -> bool:
        """Whether steps from a neighbour's throw, which keep all limits, come to the goal."""
        goal, at = task.target, self.cells.middle(source, self._target)
        miss = at.plane_x - goal.plane_x, (at.theta or 0.0) - (goal.theta or 0.0)
        near = Neighbour(optimum, goal, miss, 0.0)
        *_, last = None, *Walk(self._corrector, near, task).attempts()
        if last is None or not last.solved or last.throw is None or last.throw.optimum is None:
            return False
        self._keeps(goal, last.throw.optimum)
        return True

    def _taken(self, tried: list[Attempt], task: Task) -> bool:
        """Whether the last attempt is a throw, a cheaper one than the cell's; then it is kept."""
        last = tried[-1] if tried else None
        if last is None or not last.solved or last.throw is None or last.throw.solution is None:
            return False
        goal, solution = task.target, last.throw.solution
        cell = self.cells(goal.plane_x, goal.theta)
        if not last.throw.effort < SAME * self._solved.get(cell, math.inf):
            return False
        program = self.problems.problem(goal, last.asked, last.solver, task.clock)
        names = binding_limits(program.nlp, self.problems.mover.joints, solution, program.limits)
        optimum = optimum_of(self.library.controls, program, last.throw, names)
        if optimum is None:
            return False
        self._keeps(goal, optimum)
        self._solutions[cell] = solution, last.asked
        return True

    def _keeps(self, goal: Pose, optimum: Optimum) -> None:
        """Keeps a throw that lands in a cell's middle."""
        cell = self.cells(goal.plane_x, goal.theta)
        self._solved[cell], self._optima[cell] = optimum.effort, optimum
        landing = (goal.plane_x, goal.theta or 0.0)
        self._new.append(self.library.record(optimum, landing, solved=True))


def always_asked(scene: Scene) -> Asked:
    """What the library's NLPs are asked from the start: rows of the flying bar."""
    workspace = scene.workspace
    palm = workspace is not None and workspace.palm_clearance is not None
    return Asked(frozenset({"flight"})) if palm or scene.cup is not None else USUAL
