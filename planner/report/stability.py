"""Section `stability`: extreme scenes, derivatives, other units, noisy starts."""

from __future__ import annotations

import collections
import dataclasses
import functools
import math
from collections.abc import Callable, Iterator

import numpy as np
import numpy.typing as npt

from ...problems import Scene, load_scene, scene_names
from ..check import Mover, make_mover, simulate
from ..ocp import Request, ThrowNlp, build_nlp, nlp_functions
from ..plan import Planner
from ..result import Plan
from ..search import Task, attempts, release_start, starts
from .drawing import draw_extremes
from .extremes import ENDINGS, PATIENCE, Outcome, cases, in_processes, outcomes, some
from .judge import STEPS, judged
from .page import Cell, Effort, Picture, Section, Table

Array = npt.NDArray[np.float64]

#: What a plan says, and what would be a defect.
STATUSES = ("solved", "out_of_reach", "not_converged", "refused")
DEFECTS = ("traceback", "hang", "crash")
#: Steps of differences along a random direction of length one per variable.
NEAR, FAR = 2e-7, 4e-7
#: Models that a given motion is thrown by in other units.
DECIDING = ("sp", "ls-step", "patch")
#: Sizes of the noise on starts, as shares of each variable, and how many of each: quick, full.
NOISE, NOISY = (0.01, 0.1, 0.3, 1.0), (3, 8)
SEED = 3
#: Columns of the tables of derivatives, units and starts.
DERIVATIVES = ("scene", "NLP", "variables", "constraints", "first", "second")
UNITS = (
    *("scene", "mass ×", "status", "given motion's landing moves [m]"),
    *("planned landing moves [m]", "iterations before", "iterations"),
)
STARTS = (
    *("scene", "noise", "runs", "solved, true", "solved, false", "not solved"),
    *("hung or crashed", "causes"),
)


def make(effort: Effort) -> Section:
    """Extreme cases, derivatives, units and noisy starts."""
    section = Section("stability", "Stability")
    wanted = some(20) if effort.quick else cases()
    scenes = {name: load_scene(name) for name in scene_names()}
    # A scene with an uncertain opening is another one's NLP again.
    names = [n for n, s in scenes.items() if s.motion is None and s.uncertainty is None]
    chosen = ["hand-flip", "cup"] if effort.quick else names
    total = len(wanted) + 3 * len(chosen) + 1
    steps = iter(range(1, total + 1))

    def told(rows: list[list[Cell]]) -> list[list[Cell]]:
        effort.tell(next(steps), total)
        return rows

    found = []
    for outcome in outcomes(wanted):
        found.append(outcome)
        effort.tell(next(steps), total)
    derivatives = [row for name in chosen for row in told(derivative_rows(name, effort))]
    units = [row for name in ("drop", *chosen) for row in told(unit_rows(name))]
    noisy = [row for name in chosen for row in told(noisy_rows(name, effort.of(*NOISY)))]
    every = _cases_table(found)
    section.figures += [
        *_figures(found),
        "Derivatives against central differences of fourth order at random points: at most "
        f"{_most(derivatives, -2):.1e} (first) and {_most(derivatives, -1):.1e} (second) apart.",
        f"In another unit of mass a given motion's landing moves by at most {_most(units, 3):.1e} "
        f"m, that of a throw planned anew by at most {_most(units, 4):.1e} m.",
        _noisy_figure(noisy),
    ]
    section.tables += [
        every,
        Table("stability-derivatives", "Derivatives", DERIVATIVES, derivatives),
        Table("stability-units", "Other units", UNITS, units),
        Table("stability-starts", "Noisy starts", STARTS, noisy),
    ]
    words = "Every extreme case: position error by independent steps over the time of its plan"
    section.pictures.append(Picture("stability", words, lambda path: draw_extremes(every, path)))
    return section


def _cases_table(found: list[Outcome]) -> Table:
    rows: list[list[Cell]] = []
    for one in found:
        seen = one.verdict
        errors = (None,) * 3 if seen is None else (seen.miss, seen.other, seen.doubt)
        status = "FALSE solved" if one.false else one.status
        cells = [None if e is None else 1e3 * e for e in errors]
        rows.append([one.case.name, status, *cells, one.iterations, 1e3 * one.seconds, one.cause])
    columns = (
        *("case", "status", "thrown again [mm]", "independent steps [mm]", "their doubt [mm]"),
        *("iterations", "plan [ms]", "cause"),
    )
    return Table("stability-cases", "Every extreme case", columns, rows)


def _figures(found: list[Outcome]) -> list[str]:
    """Counts, and the worst cases by name."""
    states = collections.Counter(outcome.status for outcome in found)
    said = ", ".join(f"{states[s]} {s}" for s in STATUSES)
    solved = [outcome for outcome in found if outcome.verdict is not None]
    undecided = [outcome.case.name for outcome in solved if outcome.undecided]
    times = np.percentile([outcome.seconds for outcome in found], [50, 95])
    slow = max(found, key=lambda outcome: outcome.seconds)
    text = (
        f"{len(found)} extreme scenes: {said}; tracebacks, hangs and crashes "
        f"{sum(states[s] for s in DEFECTS)}, numbers that are not finite "
        f"{sum(not o.finite for o in found)}. Each solved one is judged by other code, with "
        f"{STEPS} even steps or more: {sum(o.false for o in solved)} are not true, "
        f"{len(undecided)} undecided, where these steps do not settle"
    )
    text += f" ({', '.join(undecided)})." if undecided else "."
    return [
        text,
        f"A plan takes {1e3 * times[0]:.0f} ms in the median and {1e3 * times[1]:.0f} ms in 95 %, "
        f"with building and nothing compiled; the slowest {slow.seconds:.1f} s ({slow.case.name}, "
        f"{slow.status}).",
    ]


def _most(rows: list[list[Cell]], place: int) -> float:
    """Largest number in a column; cells without a value do not count."""
    cells = [row[place] for row in rows]
    return max((abs(cell) for cell in cells if isinstance(cell, float)), default=math.nan)


def structures(scene: Scene, mover: Mover) -> Iterator[tuple[str, ThrowNlp, Request]]:
    """(what, NLP, request) of a scene: as it is, quiet, with scenarios."""
    for robust in ("", "quiet", "scenarios"):
        request = Request(scene, mover, scene.target, robust=robust)
        yield robust or "usual", build_nlp(request), request


def derivative_rows(name: str, effort: Effort) -> list[list[Cell]]:
    """Errors of a scene's derivatives, a row for each NLP."""
    scene, rows = load_scene(name), list[list[Cell]]()
    mover = make_mover(scene)
    for words, nlp, request in structures(scene, mover):
        numbers, limits = nlp.numbers(request), nlp.bounds(request)
        rows.append(
            [name, words, *nlp.size, *derivative_errors(nlp, numbers, limits, effort.of(2, 5))]
        )
        if effort.quick:
            break
    return rows


def derivative_errors(
    nlp: ThrowNlp, numbers: Array, limits: tuple[Array, Array], points: int
) -> tuple[float, float]:
    """Largest relative errors of first and of second derivatives at random points.

    Along random directions, against central differences of fourth order, relative to the
    largest component. The points are in the middle half of the bounds.
    """
    functions = nlp_functions(nlp, "fatrop")
    rng = np.random.default_rng(SEED)
    low, high = (np.clip(side, -1.0, 1.0) for side in limits)

    def values(x: Array) -> Array:
        g = functions["nlp_g"](x, numbers)
        return np.append(np.array(g), float(functions["nlp_f"](x, numbers)))

    worst = np.zeros(2)
    for _ in range(points):
        x = low + (high - low) * rng.uniform(0.25, 0.75, low.size)
        multipliers, way = rng.standard_normal(nlp.size[1]), rng.standard_normal(x.size)
        slope = functions["nlp_jac_g"](x, numbers)[1].full() @ way
        cost = functions["nlp_grad_f"](x, numbers).full().ravel() @ way
        curvature = functions["nlp_hess_l"](x, numbers, 1.0, multipliers)[1].full() @ way

        def gradient(at: Array, multipliers: Array = multipliers) -> Array:
            return np.array(functions["nlp_grad"](at, numbers, 1.0, multipliers)[2]).ravel()

        first = _off(values, x, way, np.append(slope, cost))
        worst = np.maximum(worst, [first, _off(gradient, x, way, curvature)])
    return float(worst[0]), float(worst[1])


def _off(function: Callable[[Array], Array], x: Array, way: Array, exact: Array) -> float:
    """Relative error of a derivative along a direction against differences."""
    near, far = (
        (function(x + step * way) - function(x - step * way)) / (2 * step) for step in (NEAR, FAR)
    )
    return float(np.abs((4 * near - far) / 3 - exact).max() / np.abs(exact).max())


def in_other_units(scene: Scene, mass: float) -> Scene:
    """The same throw where a mass, and with it a force, reads `mass` times as much."""
    thing, force = scene.object, scene.gripper.force
    assert force is not None
    heavier = dataclasses.replace(thing, mass=mass * thing.mass, inertia=mass * thing.inertia)
    gripper = dataclasses.replace(scene.gripper, force=mass * force)
    return scene.replace(object=heavier, gripper=gripper)


def unit_rows(name: str) -> list[list[Cell]]:
    """A scene in other units of mass: thrown by all models if its motion is given, else planned."""
    scene, rows = load_scene(name), list[list[Cell]]()
    for mass in (1e-3, 1e3):
        changed = in_other_units(scene, mass)
        if scene.motion is not None:
            pairs = [(simulate(s, m)[m] for s in (scene, changed)) for m in DECIDING]
            moved = max(
                float(np.abs(new.release.com[:, -1] - old.release.com[:, -1]).max())
                for old, new in pairs
            )
            rows.append([name, mass, "simulated", moved, None, None, None])
            continue
        plan, other = (Planner(s, compiling="no").plan() for s in (scene, changed))
        landed = None
        if plan.throw is not None and other.throw is not None:
            landed = abs(other.throw.final.landing.x - plan.throw.final.landing.x)
        rows.append([name, mass, other.status, None, landed, plan.iterations, other.iterations])
    return rows


@functools.cache
def _planned(name: str) -> tuple[Planner, Plan]:
    """A built-in scene's planner and plan, once in each process."""
    planner = Planner(load_scene(name), compiling="no")
    return planner, planner.plan()


def from_noisy_start(name: str, size: float, number: int) -> tuple[str, str]:
    """("true", "false" or "failed", why) of a scene's first solve from its guess with noise on it.

    Each variable gets `size` times its value (at least 0.1) times a normal number; FATROP alone,
    without another start.
    """
    planner, plan = _planned(name)
    rng = np.random.default_rng([SEED, number])
    target, releases = plan.target, planner.releases()
    task = Task(plan.scene.aimed_at(target), target, ("fatrop",))
    index, goal, _ = starts(releases, task.scene, target, "exact", 1)[0]
    given = release_start(planner.problems, task, releases, index, goal)

    def noisy(nlp: ThrowNlp) -> Array:
        guess = given.guess(nlp)
        return guess + size * np.maximum(np.abs(guess), 0.1) * rng.standard_normal(guess.size)

    start = dataclasses.replace(given, guess=noisy, tries=1)
    attempt = next(attempts(planner.problems, start, task))
    if attempt.throw is None or not attempt.solved:
        return "failed", attempt.reason
    wrong = judged(attempt.throw, target, STEPS // 4).wrong
    return ("false" if wrong else "true"), "; ".join(wrong)


def noisy_rows(name: str, count: int) -> list[list[Cell]]:
    """A row for each size of the noise."""
    jobs = [(name, size, number) for size in NOISE for number in range(count)]
    answers = list(in_processes(from_noisy_start, jobs, PATIENCE))
    rows: list[list[Cell]] = []
    for i, size in enumerate(NOISE):
        group = answers[i * count : (i + 1) * count]
        ended = [ENDINGS[a] for a in group if isinstance(a, str)]
        came = [a for a in group if not isinstance(a, str)]
        kinds = collections.Counter(kind for kind, _ in came)
        causes = collections.Counter([why for _, why in came if why] + ended)
        said = "; ".join(f"{n} × {why}" for why, n in causes.most_common(2))
        counts = (kinds["true"], kinds["false"], kinds["failed"], len(ended))
        rows.append([name, size, count, *counts, said or None])
    return rows


def _noisy_figure(rows: list[list[Cell]]) -> str:
    """How many plans from noisy starts are solved, and whether that is true."""
    total, true, false, failed, ended = (sum(int(row[i] or 0) for row in rows) for i in range(2, 7))
    return (
        "The planner's own guess with noise on every variable (up to 100 %), FATROP alone: of "
        f"{total} solves {true} are solved and true, {false} solved and not true, {failed} not "
        f"solved, {ended} hung or crashed."
    )
