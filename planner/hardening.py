"""From a throw to one that bears an uncertain opening."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

import numpy as np

from .correction import Search, attempt
from .numbers import opening_nodes
from .plan import Plan, PlannedThrow
from .quietness import peak_load
from .refit import refit
from .window import window_of
from .workbench import Workbench

#: Throws of the small sweep that judges a plan.
SAMPLES = 256


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
    """A robust throw by `method` from the first of `sources` that leads to one."""
    for source in sources:
        first = "quiet" if method in ("auto", "scenarios") else method
        found = _made(bench, source, source.throw, first, names, search)
        if method == "scenarios" or (method == "auto" and not (found and enough(source, found))):
            start = source.throw if found is None else found.thrown
            better = _made(bench, source, start, "scenarios", names, search)
            if better is not None and (
                found is None
                or method == "scenarios"
                or spread(source, better) < spread(source, found)
            ):
                found = better
        if found is not None:
            return source, found
    return None


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
                return Hardened(thrown, method, name, load)
            if search.broken is None or search.asked == asked:
                break
    return None


def spread(source: Plan, found: Hardened) -> float:
    """95 % quantile [m] of the scaled error about the throw's own landing, by a small sweep."""
    from .sweep import sweep

    plan = dataclasses.replace(source, throw=found.thrown)
    return float(np.quantile(sweep(plan, samples=SAMPLES).errors["scaled"], 0.95))


def enough(source: Plan, found: Hardened) -> bool:
    """Whether that is inside the scene's tolerance, position and angle taken together."""
    scene = source.scene
    allowed = scene.tolerance.position + scene.tolerance.angle * scene.object.length / 2
    return spread(source, found) <= allowed
