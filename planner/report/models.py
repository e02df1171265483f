"""Section `models`: which release model to take, and how many steps of it."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from ...models.release import Release
from ...models.slip_onset import held_wrench
from .model_runs import (
    HEIGHT,
    STIFFNESSES,
    Method,
    SmoothedRelease,
    Throw,
    bristled,
    detached,
    differences,
    extrapolated,
    four_throws,
    methods,
    micro,
    patch_truth,
    patched,
    pivot_truth,
    stepped,
    surface_truth,
)
from .page import Cell, Effort, Picture, Section, Table
from .random_throws import sample_tables

Array = npt.NDArray[np.float64]
T = TypeVar("T")

#: Units in which people read errors: landing x, theta, detach twist, scaled landing.
SHOWN = np.array([1e3, math.degrees(1.0), 1e3, 1e3])
ERRORS = ("x [mm]", "θ [deg]", "twist [mm/s]")
#: Scaled landing errors [m] for which the cheapest settings are told.
ASKED = (1e-3, 1e-4, 1e-5)
#: A scaled landing error [m] that never matters.
NEAR = 1e-4
#: Seconds from which on a run is not repeated, quick and full.
LONG = (0.1, 1.0)
#: Rounding widths of the study; the NLP's default is 0.03.
EPSILONS = (0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4)
WIDTH_STEPS = (10, 20, 40, 80, 160, 320, 640)
INTRODUCTION = f"""Each release is computed by every method, and the object lands {-HEIGHT:g} m
 below the hand. Two errors are told apart. The own error is the distance to the converged
 answer of the law that the method approximates: for `sp` that of no rounding (ε → 0) and
 infinitely many steps, for `ls`, `ils` and `ls-step` the limit surface without smoothing (d → 0).
 More steps make it smaller. The model error is the distance to a patch meshed into 64
 points with Coulomb friction, which no number of steps makes smaller than the law's own
 distance. Errors are those of landing x and θ and of the twist at detach (|Δv| + |Δω| l/2);
 where one number is needed, as in the Pareto sets, it is the scaled landing error |Δx| + |Δθ|
 l/2 with the object's length l.""".replace("\n", "")
TRUTHS = """Converged answers come from other methods than the rows: `sp` from DOP853 at a relative
 tolerance of 1e-13, whose steps shrink at the law's corners by themselves; `ls`, `ls-step` and
 the patch from differential equations whose friction is rounded over 1e-10 m/s, by Radau with
 exact derivatives; `ils` from extrapolated time stepping. Only LuGre's is its own stepping,
 extrapolated.""".replace("\n", "")
TIMES = """Times are processor time on one core, the least of several runs after a first one that
 is not counted (slow ones, over a second, or 0.1 s in a quick report, run once), with nothing
 kept between runs but the compiled loop. The instants at which slip begins are left out, where a
 model finds them apart; `ls` and `ils` contain about half a millisecond for them. `sp`, RK4 and
 Euler, and `ls-step` run as CasADi's own loops; located events, `ls`, `ils` and the patch in
 Python. Batches are far faster, see the last tables.""".replace("\n", "")


@dataclass(frozen=True)
class Row:
    """One method on one throw: time [s], errors (4,) by `differences`, why it is not to be
    trusted; best: the errors ('own', 'model') in whose Pareto set it is.
    """

    method: Method
    seconds: float
    own: Array
    model: Array
    trouble: str
    best: tuple[str, ...] = ()


@dataclass(frozen=True)
class Measured:
    """All of one throw. truths: detach states (6,) by law; known: how well, errors (4,)."""

    throw: Throw
    truths: Mapping[str, Array]
    known: Mapping[str, Array]
    rows: Sequence[Row]

    def apart(self, law: str) -> Array:
        """Model error (4,) of a law that is converged."""
        return off(self.throw, self.truths[law], self.truths["patch"])


def make(effort: Effort) -> Section:
    """The whole section."""
    section = Section("models", "Release models: error against time")
    throws, ways = four_throws(), list(methods(effort.quick))
    total = len(throws) * (len(ways) + 2) + 1
    done = iter(range(1, total + 1))

    def tick() -> None:
        effort.tell(next(done), total)

    measured = [measure(throw, ways, effort, tick) for throw in throws]
    section.add(INTRODUCTION, throws_table(throws), TIMES, *choice(measured), *laws(measured))
    for one in measured:
        section.add(rows_table(one), diagram(one))
    section.add(*width_study(measured, effort, tick))
    section.add(*sample_tables(effort))
    tick()
    return section


# Measuring.


def least_time(run: Callable[[], T], repeats: int, budget: float, long: float) -> tuple[float, T]:
    """Least processor time [s] of `run` after a warm one, and its result.

    At least `repeats` times, and more as long as they take less than `budget` seconds; a
    first run beyond `long` seconds is not repeated.
    """
    start = time.process_time()
    found = run()
    first = time.process_time() - start
    if first > long:
        return first, found
    seconds: list[float] = []
    while len(seconds) < repeats or (sum(seconds) < budget and len(seconds) < 50):
        start = time.process_time()
        run()
        seconds.append(time.process_time() - start)
    return min(seconds), found


def off(throw: Throw, found: Array, truth: Array) -> Array:
    """Errors (4,) of one detach state (6,)."""
    errors = differences(found[None], truth[None], throw.case.gravity, throw.length)
    return np.asarray(errors[:, 0])


def measure(
    throw: Throw, ways: Sequence[Method], effort: Effort, tick: Callable[[], None]
) -> Measured:
    """Converged answers of one throw, then every method."""
    case, fine = throw.case, effort.of(5000, 10_000)
    truths = {"sp": pivot_truth(case), "ls": surface_truth(case), "patch": patch_truth(case)}
    truths["ils"] = detached(extrapolated(stepped, fine, case))
    for stiffness in STIFFNESSES:
        run = partial(bristled, stiffness)
        truths[f"{stiffness:g}"] = detached(extrapolated(run, effort.of(250, 2000), case))
    located = next(w for w in reversed(ways) if w.family == "sp, RK4, events located")
    second = {
        "sp": detached(located.run(case)),
        "ls": truths["ils"],
        "patch": detached(extrapolated(patched, effort.of(500, 2000), case)),
    }
    known = {law: off(throw, end, truths[law]) for law, end in second.items()}
    known["ils"] = known["ls"]
    tick()
    repeats, long = effort.of(1, 3), LONG[effort.of(0, 1)]
    rows = []
    for method in ways:
        seconds, release = least_time(partial(method.run, case), repeats, long / 5, long)
        rows.append(_row(throw, method, seconds, release, truths))
        tick()
    return Measured(throw, truths, known, marked(rows, known))


def _row(
    throw: Throw, method: Method, seconds: float, release: Release, truths: Mapping[str, Array]
) -> Row:
    end, trouble = detached(release), release.trouble
    own, model = off(throw, end, truths[method.law]), off(throw, end, truths["patch"])
    if not np.isfinite(own).all() and not trouble:
        trouble = "no landing: the object never comes down to that height"
    return Row(method, seconds, own, model, trouble)


def marked(rows: Sequence[Row], known: Mapping[str, Array]) -> list[Row]:
    """The rows with their Pareto sets: of one law for the own error, of all for the model's.

    Rows in trouble are in none; errors below what is known of the answer are equal.
    """
    sound = [i for i, row in enumerate(rows) if not row.trouble]
    best: dict[int, tuple[str, ...]] = dict.fromkeys(range(len(rows)), ())
    laws = {rows[i].method.law.replace("ils", "ls") for i in sound}
    for law in sorted(laws & {"sp", "ls", "patch"}):
        some = [i for i in sound if rows[i].method.law.replace("ils", "ls") == law]
        errors = [max(float(rows[i].own[3]), float(known[law][3])) for i in some]
        for k in pareto([rows[i].seconds for i in some], errors):
            best[some[k]] += ("own",)
    # The patch's own rows are the measure, not models of it.
    some = [i for i in sound if rows[i].method.law != "patch"]
    for k in pareto([rows[i].seconds for i in some], [float(rows[i].model[3]) for i in some]):
        best[some[k]] += ("model",)
    return [replace(row, best=best[i]) for i, row in enumerate(rows)]


def pareto(seconds: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Which runs have no other that is at least as fast and nearer."""
    found, nearest = [], math.inf
    for i in np.lexsort((errors, seconds)):
        if errors[i] < nearest:
            nearest = errors[i]
            found.append(int(i))
    return found


# Tables, pictures and words.


def throws_table(throws: Sequence[Throw]) -> Table:
    """The numbers of the throws."""
    rows: list[list[Cell]] = []
    for throw in throws:
        case = throw.case
        body, pads, hand = case.body, case.contact, case.hand.at(np.zeros(1))
        f_x, f_z, torque = held_wrench(case, np.zeros(1))[0][:, 0]
        use = math.sqrt(pads.utilisation_squared(f_x, f_z, torque, case.grip.full))
        pose, twist, a = (np.asarray(v)[:, 0] for v in (hand.pose, hand.twist, hand.acceleration))
        numbers = [1e3 * body.mass, 1e6 * body.inertia, 1e3 * body.com_offset, 1e3 * throw.length]
        numbers += [pads.friction, 1e3 * pads.patch_radius, pads.torsion, float(pads.faces)]
        numbers += [case.grip.full, 1e3 * case.grip.opening, math.degrees(pose[2])]
        rows.append([throw.title, *(float(v) for v in (*numbers, *twist, *a, use))])
    columns = ["throw", "m [g]", "I [kg mm²]", "h [mm]", "l [mm]", "μ", "r_p [mm]", "c", "faces"]
    columns += ["grip [N]", "opening [ms]", "hand θ [deg]", "v_x [m/s]", "v_z [m/s]", "ω [rad/s]"]
    columns += ["a_x [m/s²]", "a_z [m/s²]", "α [rad/s²]", "use of the full grip"]
    words = (
        "The four throws: grip falling linearly from the first instant, hand accelerating evenly"
    )
    return Table("models-throws", words, columns, rows)


def choice(measured: Sequence[Measured]) -> list[str | Table]:
    """Per family the cheapest setting that keeps an own error in all four throws."""
    families = dict.fromkeys(row.method.family for row in measured[0].rows)
    rows: list[list[Cell]] = []
    for family in families:
        settings = _settings(measured, family)
        cells: list[Cell] = [family]
        for asked in ASKED:
            able = [s for s in settings if s[2] <= asked and not s[4]]
            name, seconds = min(able, key=lambda s: s[1])[:2] if able else (None, None)
            cells += [name, None if seconds is None else micro(seconds)]
        sound = [s for s in settings if not s[4]]
        near = min(sound, key=lambda s: s[3]) if sound else None
        cells += [None if near is None else 1e3 * near[3]]
        reasons = [s[4] for s in settings if s[4]]
        words = f"{len(reasons)} of {len(settings)} settings fail: {reasons[0]}" if reasons else ""
        rows.append([*cells, words])
    columns = ["method"]
    for asked in ASKED:
        columns += [f"to {1e3 * asked:g} mm", "time [µs]"]
    columns += ["best model error [mm]", "failures, the first one's cause"]
    words = (
        "To choose from: the fastest setting whose own scaled landing error is below the figure in "
        "all four throws, its slowest time, and the model error, worst of the four, of the "
        "family's best setting"
    )
    return [Table("models-choice", words, columns, rows), _advice(measured)]


def _settings(
    measured: Sequence[Measured], family: str
) -> list[tuple[str, float, float, float, str]]:
    """Setting, worst time, own and model error over the throws, and trouble, of one family."""
    found = []
    for i, row in enumerate(measured[0].rows):
        if row.method.family == family:
            same = [one.rows[i] for one in measured]
            seconds = max(r.seconds for r in same)
            own = max(float(r.own[3]) for r in same)
            model = max(float(r.model[3]) for r in same)
            trouble = next((r.trouble for r in same if r.trouble), "")
            found.append((row.method.setting, seconds, own, model, trouble))
    return found


def _advice(measured: Sequence[Measured]) -> str:
    """From how many steps on the law, not the steps, decides the error."""
    sentences = []
    for family, law in (("sp, RK4", "sp"), ("ls-step", "ls"), ("ls-step, extrapolated", "ls")):
        able = [
            same
            for same in zip(*(one.rows for one in measured), strict=True)
            if same[0].method.family == family
            and all(
                row.own[3] < max(one.apart(law)[3] / 2, NEAR)
                for row, one in zip(same, measured, strict=True)
            )
        ]
        words = f"no setting of `{family}` has"
        if able:
            slowest = 1e6 * max(row.seconds for row in able[0])
            words = f"`{family}` with {able[0][0].method.setting} ({slowest:.0f} µs) has"
        sentences.append(f"{words} such an own error in all four throws")
    return (
        "The steps no longer matter once the own error is below half of the law's model error, or "
        f"below {1e3 * NEAR:g} mm: {'; '.join(sentences)}. Finer steps bring a law hardly nearer "
        "to the patch."
    )


def laws(measured: Sequence[Measured]) -> list[str | Table]:
    """How far converged laws are from the patch, and how well the answers are known."""
    names = {"sp": "sp", "ls": "limit surface"}
    names |= {f"{k:g}": f"LuGre, σ₀ {k:.0e} 1/m".replace("e+0", "e") for k in STIFFNESSES}
    rows: list[list[Cell]] = []
    for one in measured:
        for law, name in names.items():
            x, theta, twist, scaled = (float(v) for v in SHOWN * one.apart(law))
            rows.append([one.throw.title, name, x, theta, twist, scaled])
    columns = ["throw", "law", *ERRORS, "scaled landing [mm]"]
    words = "Model errors: each law's converged answer against the meshed Coulomb patch"
    table = Table("models-laws", words, columns, rows)
    sure: list[list[Cell]] = []
    seconds = {
        "sp": "RK4 with events located",
        "ls": "time stepping, extrapolated",
        "patch": "its own steps, extrapolated",
    }
    for one in measured:
        for law, other in seconds.items():
            values = [float(v) for v in SHOWN * one.known[law]]
            sure.append([one.throw.title, names.get(law, law), other, *values])
    columns = ["throw", "law", "second method", *ERRORS, "scaled landing [mm]"]
    words = "How well the converged answers are known: their distance to a second method"
    nearest = min(("sp", "ls"), key=lambda law: max(one.apart(law)[3] for one in measured))
    far = {law: 1e3 * max(one.apart(law)[3] for one in measured) for law in ("sp", "ls")}
    text = (
        f"Converged, the nearest law to the patch is `{names[nearest]}`: at most "
        f"{far[nearest]:.2g} mm of scaled landing error in these throws (`sp` {far['sp']:.2g} mm, "
        f"limit surface {far['ls']:.2g} mm). Bristles are a band for compliant pads, not a better "
        "or a worse answer."
    )
    return [table, text, TRUTHS, Table("models-known", words, columns, sure)]


def rows_table(one: Measured) -> Table:
    """All methods on one throw."""
    rows: list[list[Cell]] = []
    for row in one.rows:
        errors = [*(SHOWN * row.own)[:3], *(SHOWN * row.model)[:3]]
        cells = [float(v) if math.isfinite(v) else None for v in errors]
        best = ", ".join(row.best)
        status = f"not to be trusted: {row.trouble}" if row.trouble else "ok"
        rows.append(
            [row.method.family, row.method.setting, micro(row.seconds), *cells, best, status]
        )
    columns = ["method", "setting", "time [µs]", *(f"own {e}" for e in ERRORS)]
    columns += [*(f"model {e}" for e in ERRORS), "Pareto set", "status"]
    words = (
        f"{one.throw.title.capitalize()}: time a throw, own error and model error; the Pareto set "
        "of the own error is among methods of one law, that of the model error among all but the "
        "patch's own"
    )
    return Table(f"models-{one.throw.key}", words, columns, rows)


def diagram(one: Measured) -> Picture:
    """Six panels: own and model error of landing x, theta and of the twist."""
    words = (
        f"{one.throw.title.capitalize()}: error against time a throw. Own errors (above) are drawn "
        "no lower than the converged answer is known; a model error below its law's converged one "
        "is chance, as the own error makes up for a part of it; what gave no landing is not drawn"
    )

    def draw(path: Path) -> None:
        from .diagrams import Panel, Point, draw_work_precision

        grid: list[list[Panel]] = [[], []]
        sound = [row for row in one.rows if np.isfinite(row.own).all()]
        for i, name in enumerate(ERRORS):
            own, model = [], []
            for row in sound:
                family, seconds, known = (
                    row.method.family,
                    row.seconds,
                    one.known.get(row.method.law),
                )
                least = 0.0 if known is None else float(known[i])
                errors = SHOWN[i] * max(float(row.own[i]), least), SHOWN[i] * float(row.model[i])
                own.append(Point(family, seconds, errors[0], "own" in row.best))
                model.append(Point(family, seconds, errors[1], "model" in row.best))
            soft = [float(SHOWN[i] * one.apart(f"{k:g}")[i]) for k in STIFFNESSES]
            words = f"LuGre, σ₀ {STIFFNESSES[0]:.0e} to {STIFFNESSES[-1]:.0e} 1/m".replace(
                "e+0", "e"
            )
            ends = {"sp, RK4": float(SHOWN[i] * one.apart("sp")[i])}
            ends["ls-step"] = float(SHOWN[i] * one.apart("ls")[i])
            floor = 1e-7 if i < 2 else 1e-6
            grid[0].append(Panel(f"own error of {name}", own, floor, {}))
            band = (min(soft), max(soft), words)
            grid[1].append(Panel(f"model error of {name}", model, 1e-4, ends, band))
        draw_work_precision(grid, one.throw.title, path)

    return Picture(f"models-{one.throw.key}", words, draw)


def _resolved(panels: Sequence[tuple[str, Mapping[str, Array]]], epsilons: Sequence[float]) -> str:
    """From which epsilon on the steps of the opening decide the error."""
    i, found = WIDTH_STEPS.index(40), []
    for epsilon in epsilons:
        pairs = [(lines[f"ε {epsilon:g}"][i], lines["not smoothed"][i]) for _, lines in panels]
        if all(error <= 1.5 * plain for error, plain in pairs):
            found.append(epsilon)
    if not found:
        return "At 40 steps every ε here still decides the error."
    return (
        f"With 40 steps, ε = {max(found):g} is small enough: its landing error is within half of "
        "that without rounding in all four throws, so a smaller one buys nothing."
    )


def width_study(
    measured: Sequence[Measured], effort: Effort, tick: Callable[[], None]
) -> list[str | Table | Picture]:
    """The smoothed sliding pivot of the NLP against epsilon -> 0."""
    epsilons = EPSILONS[:: effort.of(2, 1)]
    rows: list[list[Cell]] = []
    panels: list[tuple[str, dict[str, Array]]] = []
    slopes = []
    for one in measured:
        case, truth, lines, widths = one.throw.case, one.truths["sp"], {}, []
        for epsilon in (*epsilons, 0.0):
            errors, own = [], []
            smooth = pivot_truth(case, epsilon) if epsilon else truth
            for steps in WIDTH_STEPS:
                end = detached(SmoothedRelease(epsilon, steps).release(case))
                errors.append(1e3 * off(one.throw, end, truth)[3])
                own.append(1e3 * off(one.throw, end, smooth)[3])
            lines[f"ε {epsilon:g}" if epsilon else "not smoothed"] = np.array(errors)
            width = SHOWN * off(one.throw, smooth, truth)
            if epsilon:
                widths.append(float(width[3]))
                cells: list[Cell] = [float(v) for v in (width[0], width[1], width[3])]
                rows.append([one.throw.title, epsilon, *cells, *(float(v) for v in own)])
        slopes.append(np.polyfit(np.log(epsilons[1:5]), np.log(widths[1:5]), 1)[0])
        panels.append((one.throw.title, lines))
        tick()
    columns = ["throw", "ε", "x [mm]", "θ [deg]", "scaled landing [mm]"]
    columns += [f"{steps} steps [mm]" for steps in WIDTH_STEPS]
    words = (
        "What rounding costs: landing of the smoothed sliding pivot, converged, against ε → 0; "
        "then the scaled landing error of even RK4 steps against the same ε converged"
    )
    text = (
        "The NLP plans with a sliding pivot whose corners are rounded over ε times the object's "
        f"weight. Its landing error falls as ε to the power {min(slopes):.2f} to "
        f"{max(slopes):.2f} over the four throws. {_resolved(panels, epsilons)}"
    )

    def draw(path: Path) -> None:
        from .diagrams import draw_widths

        draw_widths(panels, WIDTH_STEPS, path)

    name = "models-epsilon"
    picture = Picture(name, "Steps and ε: landing error against the law itself", draw)
    return [text, Table(name, words, columns, rows), picture]
