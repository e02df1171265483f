"""Section `models`: which release model to take, and how many steps of it.

There are two errors. The own error is the distance to the converged answer of the law that a
method approximates; more steps make it smaller. The model error is the distance to a patch meshed
into 64 points with Coulomb friction; more steps do not make it smaller than that of the law.
Times are processor time on one core. See docs/release-models.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ...models import (
    MODELS,
    PatchRelease,
    Release,
    ReleaseCase,
    SlidingPivotRelease,
    SteppedRelease,
)
from ...problems import load_scene
from ..check import simulate_batch
from .drawing import draw_work_precision
from .laws import (
    LENGTH,
    STIFFNESSES,
    TRUTHS,
    Method,
    SampleThrow,
    bristled,
    case_of,
    detached,
    differences,
    extrapolated,
    four_throws,
    methods,
    off,
    patch_truth,
    python_loop,
    random_throws,
    stepped,
    stiffness_words,
)
from .measure import least_time, pareto, quantiles, shared
from .page import Effort, Picture, ReportSection, ReportTable, Row, shown

Array = npt.NDArray[np.float64]

#: Units in which people read errors: landing x, theta, detach twist, scaled landing.
SHOWN = np.array([1e3, math.degrees(1.0), 1e3, 1e3])
ERRORS = ("x [mm]", "θ [deg]", "twist [mm/s]", "scaled [mm]")
#: Scaled landing errors [m] whose cheapest settings are listed.
GOALS = (1e-3, 1e-4, 1e-5)
#: Points of a finer patch, which tells how well the usual one is meshed.
FINE_MESH = 256
#: Seconds from which on a run is not repeated, quick and full.
LONG = (0.03, 0.2)
#: Random throws: seed, number in a batch, and of those with converged answers: quick, full.
SEED, BATCH, FEW = 0, (512, 10_000), (3, 100)


@dataclass(frozen=True)
class Timed:
    """One method on one throw: time [s], errors (4,) by `differences`, why it is not to be
    trusted; best: the errors ('own', 'model') in whose Pareto set it is."""

    method: Method
    seconds: float
    own: Array
    model: Array
    trouble: str
    best: tuple[str, ...] = ()


@dataclass(frozen=True)
class ThrowErrors:
    """All of one throw. truths: detach states (6,) by law; known: how well, errors (4,)."""

    throw: SampleThrow
    truths: Mapping[str, Array]
    known: Mapping[str, Array]
    rows: Sequence[Timed]

    def apart(self, law: str) -> Array:
        """Model error (4,) of a law that is converged."""
        return off(self.throw, self.truths[law], self.truths["patch"])


def make(effort: Effort) -> ReportSection:
    """Every method on four throws, and batches of random throws."""
    throws, ways = four_throws(), list(methods(effort.quick))
    step = effort.counter(len(throws) * (len(ways) + 1) + 1)
    measured = [measure(throw, ways, effort, step) for throw in throws]
    sample = sample_table(effort)
    step()
    rows = ReportTable("models-methods", "Every method on every throw", _rows(measured))
    apart = {law: 1e3 * max(one.apart(law)[3] for one in measured) for law in ("sp", "ls")}
    words = "Scaled landing error over time, to its own law (above) and to the meshed patch (below)"
    return ReportSection(
        "models",
        "Release models: error against time",
        [
            "Own error: distance to the converged answer of a method's own law. Model error: "
            "distance to a patch meshed into 64 points with Coulomb friction, which more steps do "
            "not reduce. Worst of four throws, landing 0.9 m below the hand "
            "([what the models are](../release-models.md)).",
            f"Converged, the limit surface is at most {apart['ls']:.2g} mm of scaled landing error "
            f"from the patch, the sliding pivot {apart['sp']:.2g} mm.",
            _cheapest(sample),
        ],
        [choice(measured), rows, _laws_table(measured), sample],
        [Picture("models", words, lambda path: draw_work_precision(rows, path))],
    )


def measure(
    throw: SampleThrow, ways: Sequence[Method], effort: Effort, tick: Callable[[], None]
) -> ThrowErrors:
    """Converged answers of one throw, then every method."""
    case = throw.case
    truths = {law: truth(case) for law, truth in TRUTHS.items()}
    for stiffness in STIFFNESSES:
        run = partial(bristled, stiffness)
        truths[f"{stiffness:g}"] = detached(extrapolated(run, effort.of(100, 2000), case))
    second = {
        "sp": SlidingPivotRelease(steps=64, events=True).release(case),
        "ls": extrapolated(stepped, effort.of(5000, 10_000), case),
        "patch": extrapolated(_patched, effort.of(500, 2000), case),
    }
    known = {law: off(throw, detached(end), truths[law]) for law, end in second.items()}
    if not effort.quick:
        known["mesh"] = off(throw, patch_truth(case, FINE_MESH), truths["patch"])
    tick()
    repeats, long = effort.of(1, 3), LONG[effort.of(0, 1)]
    rows = []
    for method in ways:
        seconds, release = least_time(partial(method.run, case), repeats, long / 5, long)
        end, trouble = detached(release), release.trouble
        own, model = off(throw, end, truths[method.law]), off(throw, end, truths["patch"])
        if not np.isfinite(own).all() and not trouble:
            trouble = "no landing: the object never comes down to that height"
        rows.append(Timed(method, seconds, own, model, trouble))
        tick()
    return ThrowErrors(throw, truths, known, marked(rows, known))


def _patched(steps: int, case: ReleaseCase) -> Release:
    return PatchRelease(steps=steps).release(case)


def marked(rows: Sequence[Timed], known: Mapping[str, Array]) -> list[Timed]:
    """The rows with their Pareto sets: of one law for the own error, of all for the model's.

    Rows in trouble are in none; errors below what is known of the answer are equal.
    """
    sound = [i for i, row in enumerate(rows) if not row.trouble]
    best: dict[int, tuple[str, ...]] = dict.fromkeys(range(len(rows)), ())
    for law in ("sp", "ls", "patch"):
        some = [i for i in sound if rows[i].method.law == law]
        errors = [max(float(rows[i].own[3]), float(known[law][3])) for i in some]
        for k in pareto([rows[i].seconds for i in some], errors) if some else []:
            best[some[k]] += ("own",)
    # The patch's own rows are the measure, not models of it.
    some = [i for i in sound if rows[i].method.law != "patch"]
    for k in pareto([rows[i].seconds for i in some], [float(rows[i].model[3]) for i in some]):
        best[some[k]] += ("model",)
    return [replace(row, best=best[i]) for i, row in enumerate(rows)]


def _errors(kind: str, errors: Array) -> Row:
    """Cells of errors (4,); none where there is no landing."""
    cells = {f"{kind}{name}": float(v) for name, v in zip(ERRORS, SHOWN * errors, strict=True)}
    return {name: v if math.isfinite(v) else None for name, v in cells.items()}


def _rows(measured: Sequence[ThrowErrors]) -> list[Row]:
    """All methods on all throws."""
    rows = list[Row]()
    for one in measured:
        for row in one.rows:
            cells: Row = {"throw": one.throw.title, "method": row.method.family}
            cells |= {"setting": row.method.setting, "time [µs]": 1e6 * row.seconds}
            cells |= _errors("own ", row.own) | _errors("model ", row.model)
            status = f"not to be trusted: {row.trouble}" if row.trouble else "ok"
            rows.append(cells | {"Pareto set": ", ".join(row.best), "status": status})
    return rows


class Setting(NamedTuple):
    """One setting of a method: the worst of all throws, and why it is not to be trusted."""

    name: str
    seconds: float
    own: float
    model: float
    trouble: str


def choice(measured: Sequence[ThrowErrors]) -> ReportTable:
    """Per method the cheapest setting that keeps an own error in all throws."""
    rows = list[Row]()
    for family in dict.fromkeys(_kind(row.method) for row in measured[0].rows):
        settings = _settings(measured, family)
        row: Row = {"method": family}
        for goal in GOALS:
            able = [s for s in settings if s.own <= goal and not s.trouble]
            words = None
            if able:
                best = min(able, key=lambda s: s.seconds)
                words = f"{best.name}: {shown(1e3 * best.seconds)} ms, {1e3 * best.model:.2g} mm"
            row[f"to {1e3 * goal:g} mm"] = words
        reasons = [s.trouble for s in settings if s.trouble]
        failed = f"{len(reasons)} of {len(settings)}: {reasons[0]}" if reasons else None
        rows.append(row | {"settings that fail": failed})
    words = "Cheapest setting to an own error, its time and its model error, worst of four throws"
    return ReportTable("models-choice", words, rows, short=True)


def _kind(method: Method) -> str:
    """Family; bristles of every stiffness are a law of their own."""
    words = method.setting.split(",")[0]
    return f"LuGre, {words}" if method.family == "LuGre" else method.family


def _settings(measured: Sequence[ThrowErrors], family: str) -> list[Setting]:
    """All settings of one method."""
    found = []
    for i, row in enumerate(measured[0].rows):
        if _kind(row.method) == family:
            same = [one.rows[i] for one in measured]
            name = row.method.setting.removeprefix(family.removeprefix("LuGre, ") + ", ")
            own, model = (max(float(getattr(r, k)[3]) for r in same) for k in ("own", "model"))
            trouble = next((r.trouble for r in same if r.trouble), "")
            found.append(Setting(name, max(r.seconds for r in same), own, model, trouble))
    return found


def _laws_table(measured: Sequence[ThrowErrors]) -> ReportTable:
    """How far converged laws are from the patch, and from a second method for the same law."""
    names = {"sp": "sp", "ls": "limit surface", "patch": "patch"}
    names |= {f"{k:g}": f"LuGre, {stiffness_words(k)}" for k in STIFFNESSES}
    rows = list[Row]()
    for one in measured:
        for law, name in names.items():
            known = one.known.get(law)
            second = None if known is None else 1e3 * float(known[3])
            row: Row = {"throw": one.throw.title, "law": name, **_errors("", one.apart(law))}
            rows.append(row | {"to a second method, scaled [mm]": second})
        if "mesh" in one.known:
            finer: Row = {"throw": one.throw.title, "law": f"patch of {FINE_MESH} points"}
            rows.append(finer | _errors("", one.known["mesh"]))
    words = "Converged laws against the meshed patch, and how well they are known"
    return ReportTable("models-laws", words, rows)


def sample_table(effort: Effort) -> ReportTable:
    """Batch times over many random throws, own and model errors of the first of them."""
    count, few = effort.of(*BATCH), effort.of(*FEW)
    throws, contact = random_throws(count, SEED), load_scene("drop").patch
    cases = [case_of(throws, i, contact) for i in range(few)]
    # Nothing is timed meanwhile.
    found = list(shared(_truths, cases, quick=effort.quick))
    ends = {law: np.array([one[law] for one in found]) for law in TRUTHS}
    sure = np.isfinite(np.hstack(list(ends.values()))).all(axis=1)
    rows = list[Row]()
    for name, law, number, run in _ways(throws, cases, effort):
        repeats = effort.of(1, 2) if number < count else effort.of(1, 7)
        seconds, landed = least_time(run, repeats, 0.0, math.inf)
        came = np.isfinite(landed[:few]).all(axis=1)
        good, end = came & sure, landed[:few]
        row: Row = {"method": name, "throws timed": number}
        row |= {"time a throw [µs]": 1e6 * seconds / number}
        for kind, truth in (("own", ends.get(law)), ("model", ends["patch"])):
            row |= _quantiles(kind, end[good], None if truth is None else truth[good])
        rows.append(row | {"not computed": int(few - came.sum())})
    words = f"Batches and single releases of random throws, errors of the first {few}"
    return ReportTable("models-sample", words, rows)


def _truths(case: ReleaseCase) -> dict[str, Array]:
    """Converged detach states of a throw, by law."""
    return {law: truth(case) for law, truth in TRUTHS.items()}


def _ways(
    throws: Mapping[str, Mapping[str, Array]], cases: Sequence[ReleaseCase], effort: Effort
) -> Iterator[tuple[str, str, int, Callable[[], Array]]]:
    """Name, law, number of throws and how to get their detach states (N, 6)."""
    drop, count, few = load_scene("drop"), len(throws["object"]["mass"]), len(cases)
    first = {key: {k: v[:few] for k, v in some.items()} for key, some in throws.items()}

    def batch(model: str, some: Mapping[str, Mapping[str, Array]], steps: int) -> Array:
        return simulate_batch(drop, model, steps=steps, **some).detach  # type: ignore[arg-type]

    meshes = {"sp": (12, 27, 48, 96, 192), "ls-step": (40, 80, 120, 240)}
    for model, numbers in meshes.items():
        for steps in numbers:
            words = f"{model}, batch, {steps} steps"
            words += " (usual)" if steps == MODELS[model].steps else ""
            yield words, model.split("-")[0], count, partial(batch, model, throws, steps)
    steps = effort.of(200, 1000)
    yield f"patch, batch, {steps} steps", "patch", few, partial(batch, "patch", first, steps)
    yield f"lugre, batch, {steps} steps", "", few, partial(batch, "lugre", first, steps)
    singles: tuple[tuple[str, str, Callable[[ReleaseCase], Release]], ...] = (
        ("sp, alone, RK4, 1000 steps", "sp", SlidingPivotRelease().release),
        ("sp, alone, events, 16 steps", "sp", SlidingPivotRelease(steps=16, events=True).release),
        ("sp, alone, Euler in Python, 500 steps", "sp", partial(python_loop, 500)),
        ("sp-paper, alone, RK4, 1000 steps", "", SlidingPivotRelease("paper").release),
        ("ls-step, alone, 50 steps", "ls", SteppedRelease(steps=50).release),
        ("ls-step, alone, 1000 steps", "ls", SteppedRelease(steps=1000).release),
    )
    for words, law, run in singles:
        yield words, law, few, partial(_alone, run, cases)


def _alone(run: Callable[[ReleaseCase], Release], cases: Sequence[ReleaseCase]) -> Array:
    return np.array([detached(run(case)) for case in cases])


def _quantiles(kind: str, found: Array, truth: Array | None) -> Row:
    """Median, 99 % and worst of |dx| and of the scaled error [mm]; none without a truth."""
    errors = None if truth is None else 1e3 * differences(found, truth, LENGTH)
    row: Row = {}
    for what, k in (("x", 0), ("scaled", 3)):
        for words, share in (("median", 50), ("99 %", 99), ("worst", 100)):
            value = None if errors is None else quantiles(errors[k], share)[0]
            row[f"{kind} {what} [mm], {words}"] = value
    return row


def _cheapest(sample: ReportTable) -> str:
    """Which batch to take, by its own error and with that of its law."""
    goal, best = 1e3 * GOALS[0], {}
    for kind in ("own", "model"):
        able = [row for row in sample.rows if _figure(row, f"{kind} scaled [mm], 99 %") <= goal]
        able.sort(key=lambda row: _figure(row, "time a throw [µs]"))
        words = [
            f"`{row['method']}` ({shown(row['time a throw [µs]'])} µs a throw)" for row in able
        ]
        best[kind] = words[0] if words else "none"
    return (
        f"A batch to {goal:g} mm of scaled error in 99 % of random throws, cheapest: of its own "
        f"law {best['own']}; from the meshed patch {best['model']}."
    )


def _figure(row: Row, name: str) -> float:
    """A number of a row; infinite where there is none."""
    value = row[name]
    return float(value) if isinstance(value, float) and not row["not computed"] else math.inf
