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
from .extremes import ENDINGS, PATIENCE, CaseOutcome, cases, in_processes, outcomes, some
from .judge import STEPS, judged
from .page import Effort, Picture, ReportSection, ReportTable, Row

Array = npt.NDArray[np.float64]

#: What a plan says, and what would be a defect.
STATUSES = ("solved", "out_of_reach", "not_converged", "refused")
DEFECTS = ("traceback", "hang", "crash")
#: Steps of differences along a random direction of length one per variable.
NEAR, FAR = 2e-7, 4e-7
#: Models that a given motion is thrown by in other units.
DECIDING = ("sp", "ls-step", "patch")
#: How far landings move in other units: those of a given motion, of a throw planned again.
GIVEN, AGAIN = "given motion's landing moves [m]", "planned landing moves [m]"
#: Sizes of the noise on starts, as shares of each variable, and how many of each: quick, full.
NOISE, NOISY = (0.01, 0.1, 0.3, 1.0), (3, 8)
SEED = 3


def make(effort: Effort) -> ReportSection:
    """Extreme cases, derivatives, units and noisy starts."""
    wanted = some(20) if effort.quick else cases()
    scenes = {name: load_scene(name) for name in scene_names()}
    # A scene with an uncertain opening is another one's NLP again.
    names = [n for n, s in scenes.items() if s.motion is None and s.uncertainty is None]
    chosen = ["hand-flip", "cup"] if effort.quick else names
    step, found = effort.counter(len(wanted) + len(chosen)), list[CaseOutcome]()
    for outcome in outcomes(wanted):
        found.append(outcome)
        step()
    derivatives, units, noisy = list[Row](), unit_rows("drop"), list[Row]()
    for name in chosen:
        derivatives += derivative_rows(name, effort)
        units += unit_rows(name)
        noisy += noisy_rows(name, effort.of(*NOISY))
        step()
    every = ReportTable("stability-cases", "Every extreme case", [_case_row(one) for one in found])
    words = "Every extreme case: position error by independent steps over the time of its plan"
    return ReportSection(
        "stability",
        "Stability",
        [
            *_figures(found),
            "Derivatives against central differences of fourth order at random points: at most "
            f"{_most(derivatives, 'first'):.1e} (first) and {_most(derivatives, 'second'):.1e} "
            "(second) apart.",
            "In another unit of mass a given motion's landing moves by at most "
            f"{_most(units, GIVEN):.1e} m, that of a throw planned again by at most "
            f"{_most(units, AGAIN):.1e} m.",
            _noisy_figure(noisy),
        ],
        [
            every,
            ReportTable("stability-derivatives", "Derivatives", derivatives),
            ReportTable("stability-units", "Other units", units),
            ReportTable("stability-starts", "Noisy starts", noisy),
        ],
        [Picture("stability", words, lambda path: draw_extremes(every, path))],
    )


def _case_row(one: CaseOutcome) -> Row:
    seen = one.verdict
    return {
        "case": one.case.name,
        "status": "FALSE solved" if one.false else one.status,
        "thrown again [mm]": None if seen is None else 1e3 * seen.miss,
        "independent steps [mm]": None if seen is None else 1e3 * seen.other,
        "their doubt [mm]": None if seen is None else 1e3 * seen.doubt,
        "iterations": one.iterations,
        "plan [ms]": 1e3 * one.seconds,
        "cause": one.cause,
    }


def _figures(found: list[CaseOutcome]) -> list[str]:
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


def _most(rows: list[Row], name: str) -> float:
    """Largest number of a column; cells without a value do not count."""
    cells = [row.get(name) for row in rows]
    return max((abs(cell) for cell in cells if isinstance(cell, float)), default=math.nan)


def structures(scene: Scene, mover: Mover) -> Iterator[tuple[str, ThrowNlp, Request]]:
    """(what, NLP, request) of a scene: as it is, quiet, with scenarios."""
    for robust in ("", "quiet", "scenarios"):
        request = Request(scene, mover, scene.target, robust=robust)
        yield robust or "usual", build_nlp(request), request


def derivative_rows(name: str, effort: Effort) -> list[Row]:
    """Errors of a scene's derivatives, a row for each NLP."""
    scene, rows = load_scene(name), list[Row]()
    for words, nlp, request in structures(scene, make_mover(scene)):
        numbers, limits = nlp.numbers(request), nlp.bounds(request)
        first, second = derivative_errors(nlp, numbers, limits, effort.of(2, 5))
        row: Row = {"scene": name, "NLP": words}
        row |= dict(zip(("variables", "constraints"), nlp.size, strict=True))
        rows.append(row | {"first": first, "second": second})
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


def unit_rows(name: str) -> list[Row]:
    """A scene in other units of mass: thrown by all models if its motion is given, else planned."""
    scene, rows = load_scene(name), list[Row]()
    for mass in (1e-3, 1e3):
        changed = in_other_units(scene, mass)
        row: Row = {"scene": name, "mass ×": mass}
        if scene.motion is not None:
            pairs = [(simulate(s, m)[m].release.com for s in (scene, changed)) for m in DECIDING]
            moved = max(float(np.abs(new - old)[:, -1].max()) for old, new in pairs)
            rows.append(row | {"status": "simulated", GIVEN: moved})
            continue
        plan, other = (Planner(s, compiling="no").plan() for s in (scene, changed))
        row |= {"status": other.status, GIVEN: None, AGAIN: None}
        if plan.throw is not None and other.throw is not None:
            places = other.throw.final.landing.x, plan.throw.final.landing.x
            row[AGAIN] = abs(places[0] - places[1])
        rows.append(row | {"iterations": other.iterations, "before": plan.iterations})
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


def noisy_rows(name: str, count: int) -> list[Row]:
    """A row for each size of the noise."""
    jobs = [(name, size, number) for size in NOISE for number in range(count)]
    answers = list(in_processes(from_noisy_start, jobs, PATIENCE))
    rows = list[Row]()
    for i, size in enumerate(NOISE):
        group = answers[i * count : (i + 1) * count]
        found = [(a, ENDINGS[a]) if isinstance(a, str) else a for a in group]
        kinds = collections.Counter(kind for kind, _ in found)
        causes = collections.Counter(why for _, why in found if why)
        row: Row = {"scene": name, "noise": size, "starts": count}
        row |= {kind: kinds[kind] for kind in ("true", "false", "failed", *ENDINGS)}
        said = "; ".join(f"{n} × {why}" for why, n in causes.most_common(2))
        rows.append(row | {"causes": said or None})
    return rows


def _noisy_figure(rows: list[Row]) -> str:
    """How many plans from noisy starts are solved, and whether that is true."""
    kinds = ("starts", "true", "false", "failed", *ENDINGS)
    total = {kind: sum(int(row[kind] or 0) for row in rows) for kind in kinds}
    return (
        "The planner's own guess with noise on every variable (up to 100 %), FATROP alone: of "
        f"{total['starts']} solves {total['true']} are solved and true, {total['false']} solved "
        f"and not true, {total['failed']} not solved, {total['hang'] + total['crash']} hung or "
        "crashed."
    )
