"""Other ways to solve the planner's NLP, on the same targets in one run."""

from __future__ import annotations

import math
import time

import numpy as np

from ...problems import Pose, Scene
from ..ocp import USUAL, bounds, parameter_values
from ..plan import Planner
from ..search import Clock, guess_from, starts
from .page import Cell, Table
from .single_shooting import SingleShooting

#: Solver and where it starts: from the sampled release whose landing is nearest, or from one
#: at rest, the same for all targets.
WAYS = (
    ("FATROP", "table"),
    ("IPOPT", "table"),
    ("IPOPT", "crude"),
    ("SLSQP, single shooting", "table"),
)


def rivals(scene: Scene, targets: list[Pose]) -> Table:
    """First solves without corrections; functions not compiled, the same for all."""
    planner = Planner(scene, compiling="no")
    mover = planner.mover
    releases = planner.releases()
    still = int(np.argmin(np.abs(releases.dq).sum(axis=1)))
    shooting = SingleShooting(scene)
    found: dict[tuple[str, str], list[tuple[bool, float]]] = {way: [] for way in WAYS}
    for target in targets:
        aimed = scene.aimed_at(target)
        first = starts(releases, scene, target, "exact", 1)[0][0]
        _, _, flights = releases.landings(target.z, scene.gravity)
        for way in WAYS:
            solver, start = way
            index = first if start == "table" else still
            flight = float(flights[index]) if math.isfinite(flights[index]) else 0.3
            if solver.startswith("SLSQP"):
                found[way].append(shooting.solve(aimed, target, releases, index, flight))
                continue
            problem = planner.problems.problem(target, USUAL, solver.lower(), Clock())
            guess = guess_from(problem.nlp, aimed, mover, releases, index, flight)
            numbers = problem.nlp.parameters.vector(parameter_values(aimed, mover, target))
            begin = time.perf_counter()
            result = problem.solver.solve(guess, numbers, bounds(problem.nlp, aimed, mover))
            found[way].append((result.success, time.perf_counter() - begin))
    fastest = np.median([seconds for _, seconds in found[WAYS[0]]])
    rows: list[list[Cell]] = []
    for (solver, start), answers in found.items():
        times = 1e3 * np.percentile([seconds for _, seconds in answers], [50, 99])
        good = sum(success for success, _ in answers)
        ratio = float(times[0] / (1e3 * fastest))
        rows.append([solver, start, len(answers), good, *map(float, times), ratio])
    return Table(
        "reach-rivals",
        f"Scene {scene.name}: one solve of the same NLP by other means (not compiled)",
        ("solver", "start", "targets", "solved", "median [ms]", "99 % [ms]", "times FATROP's"),
        rows,
    )
