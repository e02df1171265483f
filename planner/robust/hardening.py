"""From a throw to one that bears an uncertain opening."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from ..ocp import opening_nodes, peak_load, window_of
from ..result import Plan, PlannedThrow
from ..search import Search, Workbench, attempt, refit, scatter
from ..sweep import sweep

#: Throws of the small sweep that judges a plan.
SAMPLES = 256
#: A throw that scatters this share of the nominal one's needs no other way to be tried.
LITTLE = 0.1
#: What is tried where a throw cannot be made quiet.
STILL = "joint-velocity"


@dataclasses.dataclass(frozen=True)
class Hardened:
    """A robust throw, the method and solver that made it, and its largest load."""

    thrown: PlannedThrow
    method: str
    solver: str
    peak_load: float


def hardened(
    bench: Workbench,
    sources: Iterable[Plan],
    method: str,
    names: tuple[str, ...],
    search: Search,
) -> tuple[Plan, Hardened] | None:
    """The robust throw by `method` that scatters least among those from `sources`.

    The first that scatters little enough ends the search: not every throw can be made
    quiet, and another way to the same target often can. 'auto' takes quiet throws, and
    beside those that scatter more than that constant joint velocities: near the base, where
    the hand cannot follow a free flight, a slow let-go scatters less. Where the best is
    beyond the tolerance it goes to scenarios from there. It keeps to the nominal throw where
    nothing scatters less.
    """
    best: _Judged | None = None
    for source in sources:
        if best is not None and search.late:
            break
        found = _by_method(bench, source, "quiet" if method == "auto" else method, names, search)
        best = _better(best, source, found)
        if method == "auto":
            best = _better(best, source, _as_it_is(bench, source))
            if best is not None and not best.little:
                still = _made(bench, source, source.throw, STILL, names, search)
                best = _better(best, source, still)
        if best is not None and best.little:
            break
    if method == "auto" and best is not None and not enough(best.source, best.found):
        found = _made(bench, best.source, best.found.thrown, "scenarios", names, search)
        best = _better(best, best.source, found)
    return None if best is None else (best.source, best.found)


@dataclasses.dataclass(frozen=True)
class _Judged:
    """A robust throw, where it came from, and how much it scatters [m]."""

    source: Plan
    found: Hardened
    scatter: float

    @property
    def little(self) -> bool:
        """Whether no other way needs to be tried."""
        if self.found.method == "nominal":
            return self.scatter <= _allowed(self.source)
        usual = _scatter(self.source, self.source.throw)
        return self.scatter <= max(LITTLE * usual, _allowed(self.source))


def _better(best: _Judged | None, source: Plan, found: Hardened | None) -> _Judged | None:
    """The one of two that scatters less."""
    if found is None:
        return best
    mine = _Judged(source, found, _scatter(source, found.thrown))
    return mine if best is None or mine.scatter < best.scatter else best


def _scatter(source: Plan, thrown: PlannedThrow | None) -> float:
    """How much a throw scatters [m]."""
    assert thrown is not None
    return scatter(thrown, source.target)


def _by_method(
    bench: Workbench, source: Plan, method: str, names: tuple[str, ...], search: Search
) -> Hardened | None:
    """A robust throw from one source; scenarios start from a quiet one, if there is one."""
    if method != "scenarios":
        return _made(bench, source, source.throw, method, names, search)
    quiet = _made(bench, source, source.throw, "quiet", names, search)
    start = source.throw if quiet is None else quiet.thrown
    better = _made(bench, source, start, "scenarios", names, search)
    return quiet if better is None else better


def _as_it_is(bench: Workbench, source: Plan) -> Hardened:
    """A source's own throw."""
    thrown = source.throw
    assert thrown is not None
    motion = thrown.planned if thrown.sent is None else thrown.samples
    load = peak_load(source.scene, bench.mover, motion, thrown.opening_time)
    return Hardened(thrown, "nominal", source.solver, load)


def _allowed(source: Plan) -> float:
    """The scene's tolerance [m], position and angle taken together."""
    scene = source.scene
    return scene.tolerance.position + scene.tolerance.angle * scene.object.length / 2


def _made(
    bench: Workbench,
    source: Plan,
    start: PlannedThrow | None,
    method: str,
    names: tuple[str, ...],
    search: Search,
) -> Hardened | None:
    """A throw to the source's target by one method, started from `start`."""
    assert start is not None
    scene, mover, goal = search.scene, bench.mover, source.target
    window = window_of(scene)
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    for name in names:
        for _ in range(2):
            asked = search.asked
            problem = bench.problem(goal, name, search, method)
            with search.clock("guess"):
                guess = refit(problem.nlp, start, nodes, window.step, window.delays)
            thrown = attempt(problem, mover, goal, guess, search)
            if thrown is not None:
                motion = thrown.planned if thrown.sent is None else thrown.samples
                load = peak_load(scene, mover, motion, thrown.opening_time)
                return Hardened(thrown, method, problem.solver.name, load)
            if search.broken is None or search.asked == asked:
                break
    return None


def spread(source: Plan, found: Hardened) -> float:
    """95 % quantile [m] of the scaled error about the throw's own landing, by a small sweep."""
    plan = dataclasses.replace(source, throw=found.thrown)
    return float(np.quantile(sweep(plan, samples=SAMPLES).errors["scaled"], 0.95))


def enough(source: Plan, found: Hardened) -> bool:
    """Whether that is inside the scene's tolerance."""
    return spread(source, found) <= _allowed(source)
