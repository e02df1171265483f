"""Section `models`: error against run time of the release models and their numbers of steps.

There are two errors. The own error is the distance to the converged answer of the law that a
method approximates; more steps make it smaller. The model error is the distance to a patch of
64 points with Coulomb friction; more steps do not make it smaller than that of the law.
Both are scaled landing errors. Times are processor time on one core. See docs/how-it-works.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from throwplan import load_scene, simulate_batch
from throwplan.models import Array
from throwplan.models.release import (
    MODELS,
    STEPPED_SURFACE,
    Release,
    ReleaseCase,
    SlidingPivotRelease,
    SteppedRelease,
)
from throwplan.models.release.patch import PatchRelease
from throwplan.pictures import BLACK, BLUE, GREEN, GREY, ORANGE, RED, Row, Table, shown

from .measure import least_time, pareto, quantiles
from .page import Effort, Picture, ReportSection, number, panels
from .plain_pivot import PlainPivot
from .processes import shared
from .reference_releases import (
    LENGTH,
    STIFFNESSES,
    TRUTHS,
    Method,
    SampleThrow,
    bristles,
    case_of,
    extrapolated,
    four_throws,
    methods,
    off,
    patch_truth,
    random_throws,
    scaled_errors,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


#: Name of the column with the times.
TIME = "time [µs]"
#: Name of the column with the distance from the model's own converged answer.
OWN = "own scaled [mm]"
#: Name of the column with the distance from the converged answer of a pad of points.
MODEL = "model scaled [mm]"
#: Scaled landing errors [mm] for which the cheapest settings are listed.
GOALS = (1.0, 0.1, 0.01)
#: Number of points of a finer patch, to measure the error of the usual grid.
FINE_MESH = 256
#: Time [s] of a run above which it is not repeated: quick, full.
LONG = (0.03, 0.2)
#: Seed of the random throws.
SEED = 0
#: Number of random throws of a batch: quick, full.
BATCH = (512, 10_000)
#: Number of random throws with converged answers: quick, full.
FEW = (3, 100)
#: Colour, marker and line of a release method; only settings that refine each other have a line.
METHODS = {
    "sp, Euler": (BLUE, "v", ":"),
    "sp, RK4": (BLUE, "o", "-"),
    "sp, RK4, events located": (BLUE, "s", "--"),
    "ls, Karnopp, Euler": (GREY, "X", ""),
    "ils, LSODA": (RED, "o", ""),
    "ils, Radau": (RED, "^", ""),
    "ils, BDF": (RED, "x", ""),
    STEPPED_SURFACE: (GREEN, "o", "-"),
    "ls-step, extrapolated": (GREEN, "s", "--"),
    "patch": (BLACK, "D", "-"),
    "LuGre, σ₀ 1e7 1/m": (ORANGE, "1", ""),
    "LuGre, σ₀ 1e6 1/m": (ORANGE, "2", ""),
    "LuGre, σ₀ 1e5 1/m": (ORANGE, "3", ""),
}
#: Accuracy [mm] of a model's converged answer; smaller errors are drawn at it.
OWN_FLOOR = 1e-7
#: Accuracy [mm] of the answer of a pad of points; smaller errors are drawn at it.
MODEL_FLOOR = 1e-4


def make(effort: Effort) -> ReportSection:
    """Every method on four throws, and batches of random throws."""
    throws, ways = four_throws(), list(methods(effort.quick))
    step = effort.counter(len(throws) * (len(ways) + 1) + 1)
    rows, laws = list[Row](), list[Row]()
    for throw in throws:
        truths = converged(throw.case, effort)
        found = _law_rows(throw, truths, effort)
        step()
        known = {str(row["law"]): row["to a second method [mm]"] for row in found}
        laws += found
        rows += marked([_measured(throw, way, truths, effort, step) for way in ways], known)
    sample = _sample_table(effort)
    step()
    every = Table("models-methods", "Every method on every throw", rows)
    caption = "Converged laws against the patch of points, and how well they are known"
    apart = {
        law: max(_number(row["to the patch [mm]"]) for row in laws if row["law"] == law)
        for law in ("sp", "ls")
    }
    words = (
        "Scaled landing error over time, to its own law (above) and to the patch of points (below)"
    )
    return ReportSection(
        "models",
        "Release models: error against time",
        [
            "Own error: distance to the converged answer of a method's own law. Model error: "
            "distance to a patch of 64 points with Coulomb friction, which more steps do "
            "not reduce. Worst of four throws, landing 0.9 m below the hand "
            "([what the models are](../how-it-works.md#release-models)).",
            f"Converged, the limit surface is at most {apart['ls']:.2g} mm of scaled landing error "
            f"from the patch, the sliding pivot {apart['sp']:.2g} mm.",
            _cheapest(sample),
        ],
        [choice(rows), every, Table("models-laws", caption, laws), sample],
        [Picture("models", words, _draw_work_precision(every))],
    )


def converged(case: ReleaseCase, effort: Effort) -> dict[str, Array]:
    """Converged detach states (6,) of a throw, by law."""
    truths = {law: truth(case) for law, truth in TRUTHS.items()}
    for stiffness in STIFFNESSES:
        steps, model = effort.of(100, 2000), PatchRelease(stiffness=stiffness)
        truths[bristles(stiffness)] = extrapolated(model, steps, case).end
    return truths


def _law_rows(throw: SampleThrow, truths: Mapping[str, Array], effort: Effort) -> list[Row]:
    """Distances of converged laws from the patch, and from a second method for the law."""
    case, patch = throw.case, truths["patch"]
    second = {
        "sp": SlidingPivotRelease(steps=64).release(case),
        "ls": extrapolated(SteppedRelease(), effort.of(5000, 10_000), case),
        "patch": extrapolated(PatchRelease(), effort.of(500, 2000), case),
    }
    apart = {law: off(throw, end, patch) for law, end in truths.items()}
    known = {law: off(throw, run.end, truths[law]) for law, run in second.items()}
    if not effort.quick:
        finer = off(throw, patch_truth(case, FINE_MESH), patch)
        apart[f"patch of {FINE_MESH} points"] = finer
    return [
        {
            "throw": throw.title,
            "law": law,
            "to the patch [mm]": 1e3 * apart[law],
            "to a second method [mm]": 1e3 * known[law] if law in known else None,
        }
        for law in apart
    ]


def _measured(
    throw: SampleThrow,
    method: Method,
    truths: Mapping[str, Array],
    effort: Effort,
    tick: Callable[[], None],
) -> Row:
    """One method on one throw: its time, its errors, and a reason not to trust it."""
    long = LONG[effort.of(0, 1)]
    run = partial(method.run, throw.case)
    seconds, release = least_time(run, effort.of(1, 3), long / 5, long)
    tick()
    errors = [1e3 * off(throw, release.end, truths[law]) for law in (method.law, "patch")]
    lands = all(map(math.isfinite, errors))
    trouble = release.trouble or ("" if lands else "the object never comes down to that height")
    return {
        "throw": throw.title,
        "method": method.family,
        "setting": method.setting,
        "law": method.law,
        TIME: 1e6 * seconds,
        OWN: errors[0] if lands else None,
        MODEL: errors[1] if lands else None,
        "trouble": trouble or None,
    }


def marked(rows: Sequence[Row], known: Row) -> list[Row]:
    """A throw's rows with their Pareto sets: of one law for the own error, of all for the model's.

    known: how well [mm] a law's converged answer is known; own errors below that are equal. Rows
    in trouble are in no set.
    """
    best: list[tuple[str, ...]] = [() for _ in rows]
    sound = [i for i, row in enumerate(rows) if not row["trouble"]]
    for law in ("sp", "ls", "patch"):
        some = [i for i in sound if rows[i]["law"] == law]
        floor = _number(known[law])
        errors = [max(_number(rows[i][OWN]), floor) for i in some]
        for k in pareto([_number(rows[i][TIME]) for i in some], errors) if some else []:
            best[some[k]] += ("own",)
    # Without the patch's rows: it is the reference of the model error.
    some = [i for i in sound if rows[i]["law"] != "patch"]
    for k in pareto(*([_number(rows[i][name]) for i in some] for name in (TIME, MODEL))):
        best[some[k]] += ("model",)
    return [row | {"Pareto set": ", ".join(found)} for row, found in zip(rows, best, strict=True)]


def choice(rows: Iterable[Row]) -> Table:
    """Per method the cheapest setting that keeps an own error in all throws."""
    settings: dict[str, dict[str, list[Row]]] = {}
    for row in rows:
        settings.setdefault(str(row["method"]), {}).setdefault(str(row["setting"]), []).append(row)
    found = list[Row]()
    for method, ways in settings.items():
        reasons = [
            next((row["trouble"] for row in same if row["trouble"]), None) for same in ways.values()
        ]
        sound = {w: same for (w, same), why in zip(ways.items(), reasons, strict=True) if not why}
        worst = {
            words: [max(_number(row[name]) for row in same) for name in (TIME, OWN, MODEL)]
            for words, same in sound.items()
        }
        cells: Row = {"method": method}
        for goal in GOALS:
            able = [(time, words) for words, (time, own, _) in worst.items() if own <= goal]
            cells[f"to {goal:g} mm"] = None
            if able:
                time, words = min(able)
                model = worst[words][2]
                cells[f"to {goal:g} mm"] = f"{words}: {shown(1e-3 * time)} ms, {model:.2g} mm"
        failed = [why for why in reasons if why]
        cells["settings that fail"] = (
            f"{len(failed)} of {len(ways)}: {failed[0]}" if failed else None
        )
        found.append(cells)
    caption = "Cheapest setting to an own error, its time and its model error, worst of four throws"
    return Table("models-choice", caption, found, short=True)


def _sample_table(effort: Effort) -> Table:
    """Batch times over many random throws, own and model errors of the first of them."""
    count, few = effort.of(*BATCH), effort.of(*FEW)
    throws, contact = random_throws(count, SEED), load_scene("drop").patch
    cases = [case_of(throws, i, contact) for i in range(few)]
    # In several processes, as nothing is timed here.
    found = list(shared(_truths, cases, quick=effort.quick))
    ends = {law: np.array([one[law] for one in found]) for law in TRUTHS}
    sure = np.isfinite(np.hstack(list(ends.values()))).all(axis=1)
    rows = list[Row]()
    for name, law, thrown, run in _ways(throws, cases, effort):
        repeats = effort.of(1, 2) if thrown < count else effort.of(1, 7)
        seconds, landed = least_time(run, repeats, 0.0, math.inf)
        came = np.isfinite(landed[:few]).all(axis=1)
        row: Row = {"method": name, "throws timed": thrown, TIME: 1e6 * seconds / thrown}
        for kind, truth in ((OWN, ends.get(law)), (MODEL, ends["patch"])):
            good, errors = came & sure, np.empty(0)
            if truth is not None:
                errors = 1e3 * scaled_errors(landed[:few][good], truth[good], LENGTH)
            for words, share in (("median", 50), ("99 %", 99), ("worst", 100)):
                row[f"{kind}, {words}"] = quantiles(errors, share)[0] if errors.size else None
        rows.append(row | {"not computed": int(few - came.sum())})
    words = f"Batches and single releases of random throws, errors of the first {few}"
    return Table("models-sample", words, rows)


def _truths(case: ReleaseCase) -> dict[str, Array]:
    """Converged detach states of a throw, by law."""
    return {law: truth(case) for law, truth in TRUTHS.items()}


def _ways(
    throws: Mapping[str, Any], cases: Sequence[ReleaseCase], effort: Effort
) -> Iterator[tuple[str, str, int, Callable[[], Array]]]:
    """Name, law, number of throws, and the function that computes their detach states (N, 6)."""
    drop, count, few = load_scene("drop"), len(throws["mass"]), len(cases)
    first = {key: value[:few] for key, value in throws.items() if key != "hand"}
    first["hand"] = {key: rows[:few] for key, rows in throws["hand"].items()}

    def batch(model: str, some: Mapping[str, Any], steps: int) -> Array:
        return simulate_batch(drop, model, steps=steps, **some).detach

    intervals = {"sp": (12, 27, 48, 96, 192), STEPPED_SURFACE: (40, 80, 120, 240)}
    for model, numbers in intervals.items():
        for steps in numbers:
            words = f"{model}, batch, {steps} steps"
            words += " (usual)" if steps == MODELS[model].steps else ""
            yield words, model.split("-")[0], count, partial(batch, model, throws, steps)
    steps = effort.of(200, 1000)
    yield f"patch, batch, {steps} steps", "patch", few, partial(batch, "patch", first, steps)
    yield f"lugre, batch, {steps} steps", "", few, partial(batch, "lugre", first, steps)
    singles: tuple[tuple[str, str, Callable[[ReleaseCase], Release]], ...] = (
        ("sp, alone, RK4, 1000 steps", "sp", PlainPivot().release),
        ("sp, alone, events, 16 steps", "sp", SlidingPivotRelease(steps=16).release),
        ("sp-paper, alone, RK4, 1000 steps", "", PlainPivot("paper").release),
        ("ls-step, alone, 50 steps", "ls", SteppedRelease(steps=50).release),
        ("ls-step, alone, 1000 steps", "ls", SteppedRelease(steps=1000).release),
    )
    for words, law, run in singles:
        yield words, law, few, partial(_alone, run, cases)


def _alone(run: Callable[[ReleaseCase], Release], cases: Sequence[ReleaseCase]) -> Array:
    return np.array([run(case).end for case in cases])


def _cheapest(sample: Table) -> str:
    """Sentences on the batches, by their own error and that of their law."""
    goal, best = GOALS[0], {}
    for kind in (OWN, MODEL):
        able = [
            (_number(row[TIME]), row["method"])
            for row in sample.rows
            if _number(row[f"{kind}, 99 %"]) <= goal and not row["not computed"]
        ]
        best[kind] = f"`{min(able)[1]}` ({shown(min(able)[0])} µs a throw)" if able else "none"
    return (
        f"A batch to {goal:g} mm of scaled error in 99 % of random throws, cheapest: of its own "
        f"law {best[OWN]}; from the patch of points {best[MODEL]}."
    )


def _number(cell: Any) -> float:
    return number(cell, math.inf)


def _draw_work_precision(rows: Table) -> Figure:
    """Own error (above) and model error (below) over the time of a release; a column a throw."""
    throws = list(dict.fromkeys(rows.column("throw")))
    figure, grid = panels(3.6 * len(throws), 8.0, 2, len(throws), sharex=True, sharey="row")
    for column, throw in enumerate(throws):
        some = rows.where(throw=throw)
        for line, (kind, floor) in enumerate((("own", OWN_FLOOR), ("model", MODEL_FLOOR))):
            axis = grid[line][column]
            _draw_methods(axis, some, kind, floor)
            axis.set(xscale="log", yscale="log")
        grid[0][column].set_title(str(throw), fontsize=10)
        grid[1][column].set_xlabel("time a throw [µs]")
    for line, words in enumerate(("own error", "model error")):
        grid[line][0].set_ylabel(f"{words}: scaled landing [mm]")
    handles, names = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=7, fontsize=9)
    return figure


def _draw_methods(axis: Axes, rows: Sequence[Row], kind: str, floor: float) -> None:
    column = f"{kind} scaled [mm]"
    known = [row for row in rows if isinstance(row[column], float)]

    def places(some: Sequence[Row]) -> tuple[list[float], list[float]]:
        errors = [max(number(row[column]), floor) for row in some]
        return [number(row["time [µs]"]) for row in some], errors

    for name, (colour, marker, line) in METHODS.items():
        mine = [row for row in known if row["method"] == name]
        style: dict[str, Any] = {"color": colour, "marker": marker, "ms": 5, "lw": 1.1}
        axis.plot(*places(mine), ls=line or "none", label=name, **style)
    best = [row for row in known if kind in str(row["Pareto set"])]
    ring: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 11, "mfc": "none", "mec": BLACK}
    axis.plot(*places(best), label="Pareto set", **ring)
