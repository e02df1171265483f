"""Section `models`: error against run time of the release models and their numbers of steps.

There are two errors. The own error is the distance to the converged answer of the law that a
method approximates; more steps make it smaller. The model error is the distance to a patch of
64 points with Coulomb friction; more steps do not make it smaller than that of the law. Times are
processor time on one core. See docs/how-it-works.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from throwplan import load_scene, simulate_batch
from throwplan.models import Array
from throwplan.models.release import STEPPED_SURFACE, ReleaseCase
from throwplan.pictures import BLACK, BLUE, GREEN, GREY, ORANGE, RED, Row, Table, new_figure, shown

from .measure import least_time, number, quantiles
from .page import Effort, Picture, Section
from .processes import shared
from .releases import TRUTHS, Method, case_of, methods, pose_errors, random_throws

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Columns of the time, of the distance from the model's own converged answer and from that of a pad
#: of points, worst of all throws.
TIME, OWN, MODEL = "time [ms]", "own error [mm]", "model error [mm]"
#: Own errors [mm] for which the cheapest settings are listed.
GOALS = (1.0, 0.1, 0.01)
#: Time [s] of a run above which it is not repeated.
LONG = 0.2
#: Seed of the random throws.
SEED = 0
#: Number of throws of a batch, and of those that have converged answers: quick, full.
BATCH, FEW = (512, 10_000), (2, 12)
#: Least error [mm] in the picture; smaller ones are drawn at it.
FLOOR = 1e-4
#: Colour and marker of a family of methods.
STYLES = {
    "sp, Euler": (BLUE, "v"),
    "sp, RK4": (BLUE, "o"),
    "sp, events located": (BLUE, "s"),
    "sp, batch": (BLUE, "D"),
    "ils, LSODA": (RED, "o"),
    "ils, Radau": (RED, "^"),
    STEPPED_SURFACE: (GREEN, "o"),
    "ls-step, batch": (GREEN, "D"),
    "patch": (BLACK, "D"),
    "LuGre, σ₀ 1e7 1/m": (ORANGE, "1"),
    "sp-paper, RK4": (GREY, "x"),
}


def make(effort: Effort) -> Section:
    """Every method on the same random throws."""
    ways = list(methods(effort.quick))
    step = effort.counter(len(ways) + 1)
    throws, contact = random_throws(effort.of(*BATCH), SEED), load_scene("drop").patch
    cases = [case_of(throws, i, contact) for i in range(effort.of(*FEW))]
    # In several processes, as nothing is timed here.
    found = list(shared(_truths, cases, quick=effort.quick))
    truths = {law: np.array([one[law] for one in found]) for law in TRUTHS}
    step()
    rows = list[Row]()
    for way in ways:
        rows.append(_measured(way, throws, cases, truths, effort))
        step()
    laws = [_law_row(law, truths) for law in ("sp", "ls")]
    return Section(
        "Release models: error against time",
        f"The first {len(cases)} of random throws that land 0.9 m below the hand (h 2–20 cm, "
        "m 0.1–0.4 kg, hand 1–3 m/s, opening 30–100 ms, μ 0.3–1, r_p 2.5–10 mm, with a grip that "
        "holds them). *Own error*: pose error against the converged answer of the same law by "
        "another method. *Model error*: against a pad of 64 points with Coulomb friction. Time: "
        f"of a throw on one core, in the median; of a batch of {effort.of(*BATCH):,} its share.",
        [
            Table("laws", "Converged laws against the pad of points", laws),
            Table("choice", "Cheapest setting to an own error in the worst throw", choice(rows)),
        ],
        [Table("models-methods", "every setting", rows)],
        Picture("models", "Error against run time of the release models", _draw(rows)),
    )


def _truths(case: ReleaseCase) -> dict[str, Array]:
    """Converged detach states of a throw, by law."""
    return {law: truth(case) for law, truth in TRUTHS.items()}


def _law_row(law: str, truths: Mapping[str, Array]) -> Row:
    """Distance of a converged law from the pad of points."""
    errors = 1e3 * pose_errors(truths[law], truths["patch"])
    title = {"sp": "sliding pivot (`sp`)", "ls": "limit surface (`ls`, `ils`, `ls-step`)"}[law]
    return {"law": title, "median [mm]": float(np.median(errors)), "worst [mm]": errors.max()}


def _measured(
    method: Method,
    throws: Mapping[str, Any],
    cases: Sequence[ReleaseCase],
    truths: Mapping[str, Array],
    effort: Effort,
) -> Row:
    """One method: its time, its errors in the throws that it computes, and why not in others."""
    trouble = ""
    if method.run is None:
        count, drop = len(throws["mass"]), load_scene("drop")
        run = partial(simulate_batch, drop, method.batch, steps=method.steps, **throws)
        seconds, batch = least_time(run, effort.of(1, 5), 0.0, math.inf)
        seconds, ends = seconds / count, batch.detach[: len(cases)]
        good = np.isfinite(ends).all(axis=1)
    else:
        timed = [
            least_time(partial(method.run, case), effort.of(1, 3), LONG / 5, LONG) for case in cases
        ]
        seconds = float(np.median([one for one, _ in timed]))
        ends = np.array([release.end for _, release in timed])
        good = np.array([not release.trouble for _, release in timed]) & np.isfinite(ends).all(1)
        trouble = next((release.trouble for _, release in timed if release.trouble), "")
    row: Row = {"method": method.family, "setting": method.setting, TIME: 1e3 * seconds}
    for column, law in ((OWN, method.law), (MODEL, "patch")):
        errors = np.empty(0)
        if law:
            errors = 1e3 * pose_errors(ends[good], truths[law][good])
        row[column] = float(errors.max()) if errors.size else None
        row[f"{column}, median"] = quantiles(errors, 50)[0] if errors.size else None
    failed = int((~good).sum())
    return row | {"throws": len(cases), "not computed": failed, "why": trouble or None}


def choice(rows: Sequence[Row]) -> list[Row]:
    """Per method the cheapest setting to each own error, and the model error of the last setting.

    A setting counts if it computes all throws.
    """
    found = list[Row]()
    for method in dict.fromkeys(row["method"] for row in rows):
        ways = [row for row in rows if row["method"] == method]
        sound = [row for row in ways if not row["not computed"]]
        cells: Row = {"method": method}
        for goal in GOALS:
            able = [row for row in sound if number(row[OWN]) <= goal]
            best = min(able, key=lambda row: number(row[TIME]), default=None)
            cells[f"to {goal:g} mm"] = (
                f"{shown(best[TIME])} ms: {best['setting']}" if best else None
            )
        last = sound[-1] if sound else {}
        cells["model error, median [mm]"] = last.get(f"{MODEL}, median")
        cells["worst [mm]"] = last.get(MODEL)
        why = next((row["why"] for row in ways if row["why"]), None)
        cells["settings that fail"] = why and f"{len(ways) - len(sound)} of {len(ways)}: {why}"
        found.append(cells)
    return found


def _draw(rows: Sequence[Row]) -> Figure:
    """Own error (left) and model error (right) over the time of a throw; a line a method."""
    figure = new_figure(9.0, 4.6)
    for axis, column in zip(figure.subplots(1, 2), (OWN, MODEL), strict=True):
        for name, (colour, marker) in STYLES.items():
            sound = [row for row in rows if row["method"] == name and not row["not computed"]]
            known = [row for row in sound if row[column] is not None]
            places = [max(number(row[column]), FLOOR) for row in known]
            style: dict[str, Any] = {"color": colour, "marker": marker, "ms": 4, "lw": 1.0}
            axis.plot([number(row[TIME]) for row in known], places, label=name, **style)
        axis.set(
            xscale="log", yscale="log", xlabel="time of a throw [ms]", ylabel=f"{column}, worst"
        )
        axis.grid(alpha=0.3)
    handles, names = axis.get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=6, fontsize=8)
    return figure
