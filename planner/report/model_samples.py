"""What the models make of many random throws: times of batches, and errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from ...models import (
    BatchRelease,
    EvenSteps,
    ImplicitRelease,
    LuGreRelease,
    PatchRelease,
    Release,
    ReleaseBatch,
    ReleaseCase,
    SlidingPivotRelease,
    throw_limit_surface,
    throw_sliding_pivot,
)
from ..check import STEPS
from ..compile import compiled_steps
from ..sweep import executor_of
from .model_measures import least_time
from .model_runs import STIFFNESSES, SmoothedRelease, python_loop, stepped
from .model_throws import detached, differences
from .model_truths import patch_truth, pivot_truth, surface_truth
from .page import Cell, Effort, Part, Table, shown
from .random_throws import GRAVITY, RANGES, random_throws, throw_number

Array = npt.NDArray[np.float64]

#: The errors that are shown.
WHAT = ("x [mm]", "θ [deg]", "scaled [mm]")
#: Of the report's sample.
SEED = 0
#: The object's length in scaled errors [m], as in the built-in scenes.
LENGTH = 0.26
#: A scaled landing error [m] in 99 of 100 throws for which the cheapest batch is told.
ASKED = 1e-3
#: Converged answers by law, and the processes that make them.
TRUTHS = {"sp": pivot_truth, "ls": surface_truth, "patch": patch_truth}
WORKERS = 2


@dataclass(frozen=True)
class Sample:
    """Parts of the section, and what to take from them."""

    parts: list[Part]
    short: str


def _truths(case: ReleaseCase) -> dict[str, Array]:
    """Converged detach states of a throw, by law."""
    return {law: truth(case) for law, truth in TRUTHS.items()}


def sample_tables(effort: Effort) -> Sample:
    """Batch times over many random throws, own and model errors of the first of them."""
    count, few = effort.of(512, 10_000), effort.of(3, 100)
    batch = random_throws(count, SEED)
    first = batch.part(np.arange(few))
    cases = [throw_number(batch, i) for i in range(few)]
    # Nothing is timed meanwhile.
    with executor_of(1 if effort.quick else WORKERS, None) as executor:
        found_by_law = list((map if executor is None else executor.map)(_truths, cases))
    ends = {law: np.array([one[law] for one in found_by_law]) for law in TRUTHS}
    sure = np.isfinite(np.hstack(list(ends.values()))).all(axis=1)
    own: list[list[Cell]] = []
    model: list[list[Cell]] = []
    for name, law, thrown, run in _ways(batch, first, cases, effort):
        repeats = effort.of(1, 2) if thrown < count else effort.of(1, 7)
        seconds, found = least_time(run, repeats, 0.0, math.inf)
        came = np.isfinite(found[:few]).all(axis=1)
        good, missed = came & sure, int(few - came.sum())
        cells: list[Cell] = [name, thrown, 1e6 * seconds / thrown]
        if law in ends:
            own.append([*cells, *_quantiles(found[:few][good], ends[law][good]), missed])
        model.append([*cells, *_quantiles(found[:few][good], ends["patch"][good]), missed])
    columns = ["method", "throws timed", "time a throw [µs]"]
    columns += [f"{what}, {q}" for what in WHAT for q in ("median", "99 %", "worst")]
    columns += ["not computed"]
    text = (
        f"Random throws that the full grip holds, seed {SEED}: {RANGES}. Times are of {count} "
        f"throws (single ones: {few}), errors of {sure.sum()} of the first "
        f"{few}, those with converged answers. `sp` steps of a batch are graded "
        "towards the end of the opening and doubled for throws that swing fast; batches of "
        "`ls-step` are extrapolated from two runs. Compiled rows need a C "
        f"compiler. Scaled errors are those of an object of {LENGTH:g} m. The last column counts "
        "throws without an answer."
    )
    short = _cheapest(own, model)
    words = "Random throws: {} error of the landing, median, 99 % and worst"
    tables = [
        Table("models-sample-own", words.format("own"), columns, own),
        Table("models-sample-model", words.format("model"), columns, model),
    ]
    return Sample([text, *tables, short], short)


def _cheapest(own: list[list[Cell]], model: list[list[Cell]]) -> str:
    """Which batch to take, by its own error and with that of its law."""

    def told(rows: list[list[Cell]]) -> str:
        able = [row for row in rows if _is_near(row)]
        if not able:
            return "none"
        name, _, each, *_ = min(able, key=_time)
        return f"`{name}` ({shown(_time([name, 0, each]) / 10)} s for 100,000 throws)"

    def figures(steps: str) -> str:
        row = next((row for row in model if str(row[0]).startswith(steps)), None)
        if row is None:
            return ""
        x, theta, scaled = (float(row[i] or math.nan) for i in (4, 7, 10))
        return f"{x:.2g} mm, {theta:.2g}°, {scaled:.2g} mm scaled"

    usual = [_steps(name, STEPS[name]) for name in ("sp", "ls-step")]
    return (
        f"A batch to {1e3 * ASKED:g} mm of scaled error in 99 % of random throws, cheapest: of its "
        f"own law {told(own)}; from the meshed patch, with the law's error, {told(model)}. "
        "`simulate_batch` takes the steps marked as usual, or `steps=`; from the patch 99 % of "
        f"its throws are within {figures(usual[0])} (`sp`) and {figures(usual[1])} (`ls-step`)."
    )


def _is_near(row: list[Cell]) -> bool:
    # The patch is the measure with its usual pressure only.
    known = "Hertz" not in str(row[0])
    return known and isinstance(row[10], float) and row[10] <= 1e3 * ASKED and not row[-1]


def _time(row: list[Cell]) -> float:
    """Time a throw [µs]."""
    return float(row[2] or 0.0)


def _ways(
    batch: ReleaseBatch, first: ReleaseBatch, cases: Sequence[ReleaseCase], effort: Effort
) -> Iterator[tuple[str, str, int, Callable[[], Array]]]:
    """Name, law, number of throws and how to get their detach states (N, 6)."""
    meshes = {"sp": (12, 27, 48, 96, 192), "ls-step": (40, 80, 120, 240)}
    throwers: dict[str, Callable[..., BatchRelease]] = {
        "sp": throw_sliding_pivot,
        "ls-step": throw_limit_surface,
    }
    for name, steps in meshes.items():
        law, throw = name.split("-")[0], throwers[name]
        for number in steps:
            yield (
                f"{_steps(name, number)}, NumPy", law, batch.count,
                partial(_thrown, throw, batch, number, None),
            )  # fmt: skip
        even = compiled_steps(name, batch.hands)
        for number in steps if even else ():
            yield (
                f"{_steps(name, number)}, compiled", law, batch.count,
                partial(_thrown, throw, batch, number, even),
            )  # fmt: skip

    def alone(run: Callable[[ReleaseCase], Release]) -> Callable[[], Array]:
        return lambda: np.array([detached(run(case)) for case in cases])

    singles: list[tuple[str, str, Callable[[ReleaseCase], Release]]] = [
        ("sp, alone, RK4, 80 steps", "sp", SlidingPivotRelease(steps=80).release),
        ("sp, alone, RK4, 1000 steps", "sp", SlidingPivotRelease().release),
        (
            "sp, alone, events located, 16 steps",
            "sp",
            SlidingPivotRelease(steps=16, events=True).release,
        ),
        ("sp, alone, ε 0.03, 40 steps", "sp", SmoothedRelease(0.03, 40).release),
        ("sp, alone, Euler in Python, 500 steps", "sp", partial(python_loop, 500)),
        ("sp-paper, alone, RK4, 1000 steps", "sp-paper", SlidingPivotRelease("paper").release),
        ("ls-step, alone, 50 steps", "ls", partial(stepped, 50)),
        ("ls-step, alone, 1000 steps", "ls", partial(stepped, 1000)),
        ("ils, alone, LSODA, d 0.01 m/s", "ls", ImplicitRelease(samples=2).release),
    ]
    for words, law, run in singles:
        yield words, law, len(cases), alone(run)
    steps_of_points = effort.of(200, 1000)
    patch, hertz = (PatchRelease(pressure=p, steps=steps_of_points) for p in ("uniform", "hertz"))
    yield f"patch, batch, {steps_of_points} steps", "patch", len(cases), partial(patch.batch, first)
    words = f"patch, batch, Hertz pressure, {steps_of_points} steps"
    yield words, "hertz", len(cases), partial(hertz.batch, first)
    for stiffness in STIFFNESSES:
        model = LuGreRelease(stiffness=stiffness, steps=steps_of_points)
        words = f"LuGre, batch, σ₀ {stiffness:.0e} 1/m, {steps_of_points} steps".replace("e+0", "e")
        yield words, "LuGre", len(cases), partial(model.batch, first)


def _steps(name: str, number: int) -> str:
    """A batch's steps; the limit surface takes so many and twice as many."""
    words = f"{number} and {2 * number}" if name == "ls-step" else f"{number}"
    return f"{name}, batch, {words} steps" + (" (usual)" if number == STEPS[name] else "")


def _thrown(
    throw: Callable[..., BatchRelease], batch: ReleaseBatch, steps: int, even: EvenSteps | None
) -> Array:
    return throw(batch, steps, even=even).detach


def _quantiles(found: Array, truth: Array) -> list[Cell]:
    """Median, 99 % and worst of |dx| [mm], of |d theta| [deg], of the scaled error [mm]."""
    x, theta, _, scaled = differences(found, truth, GRAVITY, LENGTH)
    cells: list[Cell] = []
    for values in (1e3 * x, np.degrees(theta), 1e3 * scaled):
        cells += [float(v) for v in np.quantile(values, [0.5, 0.99, 1.0])]
    return cells
