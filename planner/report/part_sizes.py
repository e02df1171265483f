"""How large the NLP of a scene is and how long it takes, with rows forced into it."""

from __future__ import annotations

import dataclasses
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...problems import Scene
from ..check import Guard
from ..compile import Compile
from ..ocp import Asked, ThrowNlp, nlp_functions, opening_nodes, parameter_values, window_of
from ..plan import Planner
from ..result import PlannedThrow
from ..search import Attempt, Clock, Task, attempts, refit, release_start, starts
from .page import Cell

Array = npt.NDArray[np.float64]

#: Starting points tried.
STARTS = 6


@dataclass(frozen=True)
class Posed:
    """A scene, and which rows beyond its sections are forced into its NLP."""

    words: str
    scene: Scene
    guards: frozenset[Guard] = frozenset()
    robust: bool = False

    @property
    def steps(self) -> list[tuple[frozenset[Guard], str]]:
        """(guards, robust) of the NLPs that lead to its throw; the last is its own."""
        found: list[tuple[frozenset[Guard], str]] = [(frozenset(), "")]
        if self.guards:
            found.append((self.guards, ""))
        if self.robust:
            found += [(self.guards, "quiet"), (self.guards, "scenarios")]
        return found


@dataclass(frozen=True)
class Measured:
    """Sizes and times [s] of one posed scene.

    operations: of the functions that the solver calls, all once; functions: their time;
    iterations, solve: of its own NLP, with corrections; whole: solver time with the NLPs
    that lead to it; build: before the first. Times are medians of the warm runs. cause: why
    it is not solved, else empty.
    """

    variables: int
    constraints: int
    parameters: int
    operations: int
    functions: float
    iterations: int
    build: float
    solve: float
    whole: float
    cause: str = ""

    @property
    def solved(self) -> bool:
        """Whether the check finds nothing wrong."""
        return not self.cause

    def over(self, other: Measured) -> list[Cell]:
        """Its times to solve as multiples of another's; nothing where one is not solved."""
        if not (self.solved and other.solved):
            return [None, None]
        return [self.solve / other.solve, self.whole / other.whole]

    @property
    def status(self) -> str:
        """In words."""
        return "solved" if self.solved else f"not solved: {self.cause}"

    def row(self) -> list[Cell]:
        """Its figures in a table, times in ms."""
        sizes: list[Cell] = [self.variables, self.constraints, self.parameters, self.operations]
        times = (self.functions, self.build, self.solve, self.whole)
        return [*sizes, self.iterations, *(1e3 * t for t in times)]


#: Of `Measured.row`.
COLUMNS = (
    "variables",
    "constraints",
    "parameters",
    "operations",
    "iterations",
    "functions [ms]",
    "build [ms]",
    "own solve [ms]",
    "all solves [ms]",
)


@dataclass
class Run:
    """One way to a throw. last: the last NLP tried; solve [s]: of that one."""

    clock: Clock
    last: Attempt | None = None
    solve: float = math.nan

    @property
    def thrown(self) -> PlannedThrow | None:
        """The throw, if the way led to one."""
        return self.last.throw if self.last is not None and self.last.solved else None


def operations(nlp: ThrowNlp) -> int:
    """Elementary operations of cost, constraints and their derivatives, all stages once."""
    found = 0
    for link in nlp.links:
        parts = link.functions
        for function in (parts.value, parts.jacobian, parts.cost_gradient, parts.hessian):
            found += int(function.n_instructions())
    return found


def measured(posed: Posed, repeats: int, compiling: Compile = "no") -> Measured:
    """Plans a posed scene once, then `repeats` times more with all that is built."""
    planner = Planner(posed.scene, compiling=compiling)
    planner.releases()
    first = _run(planner, posed)
    # What fails does so slowly, and again.
    runs = [_run(planner, posed) for _ in range(repeats)] if first.thrown else [first]
    target = posed.scene.target
    assert target is not None
    guards, robust = posed.steps[-1]
    clock = Clock()
    thrown, last = first.thrown, first.last
    nlp = thrown.nlp if thrown else planner.problems.nlp(target, Asked(guards), clock, robust)
    return Measured(
        *nlp.size,
        nlp.problem["p"].numel(),
        operations(nlp),
        _function_time(planner, nlp, thrown),
        0 if last is None else last.iterations,
        first.clock.seconds["build"],
        # The least: others on the machine only add.
        float(np.min([run.solve for run in runs])),
        float(np.min([run.clock.seconds["solve"] for run in runs])),
        "" if thrown or last is None else last.reason,
    )


def _run(planner: Planner, posed: Posed) -> Run:
    """The planner's own way to a throw: from its starts, one NLP's throw to the next one's."""
    run, target, scene = Run(Clock()), posed.scene.target, posed.scene
    assert target is not None
    task = Task(scene, target, ("fatrop",), run.clock)
    releases = planner.releases()
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    for index, goal, _ in starts(releases, scene, target, "exact", STARTS):
        start = release_start(planner.problems, task, releases, index, goal)
        for guards, robust in posed.steps:
            before = run.clock.seconds["solve"]
            start = dataclasses.replace(start, asked=Asked(guards), robust=robust, tries=1)
            run.last = next(attempts(planner.problems, start, task))
            run.solve = run.clock.seconds["solve"] - before
            source = run.last.throw
            if source is None:
                break
            start = dataclasses.replace(start, guess=_from(source, scene, nodes, posed))
        if run.thrown is not None:
            break
    return run


def _from(
    source: PlannedThrow, scene: Scene, nodes: Array, posed: Posed
) -> Callable[[ThrowNlp], Array]:
    """Guess of the next NLP from the throw before it."""
    window = window_of(scene)

    def guess(nlp: ThrowNlp) -> Array:
        robust = bool(nlp.structure.robust)
        delays = window.delays if robust else np.zeros(0)
        return refit(nlp, source, nodes, window.step if robust else 0.0, delays)

    return guess


def _function_time(planner: Planner, nlp: ThrowNlp, thrown: PlannedThrow | None) -> float:
    """Time [s] of all functions that an iteration of FATROP calls, at the solution."""
    if thrown is None or thrown.scene.target is None:
        return math.nan
    scene = thrown.scene
    window = window_of(scene) if nlp.structure.robust else None
    goal = thrown.scene.target
    values = parameter_values(scene, planner.mover, goal, window)
    p, x, lam = nlp.parameters.vector(values), thrown.solution.x, thrown.solution.lam_g
    found = nlp_functions(nlp, "fatrop")
    times = []
    for _ in range(10):
        start = time.perf_counter()
        for name in ("nlp_f", "nlp_g", "nlp_grad_f", "nlp_jac_g"):
            found[name](x, p)
        found["nlp_hess_l"](x, p, 1.0, lam)
        times.append(time.perf_counter() - start)
    return float(np.median(times))
