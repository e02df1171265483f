"""The report's first page, for anyone, made from the sections' tables.

Section `example`: what only they show, a throw, and the built-in scenes thrown in MuJoCo.
"""

from __future__ import annotations

import csv
import math
import re
import statistics
from collections.abc import Iterator, Mapping
from pathlib import Path

from throwplan import Planner
from throwplan import pictures as drawing
from throwplan.lab import replay
from throwplan.models.release import STEPPED_SURFACE
from throwplan.pictures import BLACK, BLUE, GREEN, ORANGE, Row, Table

from .models import MODEL, TIME
from .page import Effort, Picture, ReportSection, panels

#: File of the report's first page.
PAGE = "index.md"
#: File of its picture.
PICTURE = "summary.png"
HEAD = """# How well throwplan throws

A robot arm swings a bar and opens its gripper. throwplan plans the swing and the instant, so that
the bar lands at a place and an angle. This page says how often that works, how long it takes, and
what the figures are worth. Every figure comes from a run of `python -m benchmarks`; below each part
stands when and on what machine. All else is in the [appendix](appendix.md), and every table is a
CSV file in this folder."""
LIMITS = """## What is not validated

- **Nothing here was thrown by a robot.** All landings are computed. The published error of the
  sliding pivot on real throws is 2.4 cm and 15° (Liu and Billard). Nobody has compared the limit
  surface with real throws yet.
- The plans take friction, patch radius and the gripper's force as known. Yours are not: measure
  them ([measured throws](../throw-data.md)), and sweep what remains uncertain.
- MuJoCo too takes the bar as rigid and friction as Coulomb's. Where it agrees with a model, the
  mathematics is right; that does not show that real pads behave so.
- Left out: a robot that lags behind what it is sent, soft pads, air drag, bars that bend, and what
  happens after landing.
"""
#: Curves of the picture: methods of the table, with label and colour.
CURVES = {
    "sp, RK4": ("sliding pivot", BLUE),
    STEPPED_SURFACE: ("limit surface, time stepping", GREEN),
    "ils, Radau": ("limit surface, implicit", ORANGE),
    "patch": ("meshed pad", BLACK),
}
#: Scene of the drawn throw.
SHOWN = "cup"
#: Scenes that are also thrown in MuJoCo.
THROWN = ("pose", "cup", "flip", "delay", "hand-flip")
#: Name of the table of MuJoCo's throws.
MUJOCO = "example-mujoco"
#: Name of that table's column of the limit surface.
SURFACE = "limit surface"
#: Name of that table's column of the sliding pivot.
PIVOT = "sliding pivot"
Rows = list[dict[str, str]]


def write_summary(folder: Path, parts: Mapping[str, str]) -> None:
    """Write the page from the folder's tables; parts: of the appendix, by section."""
    blocks = [HEAD]
    for make, key in ((_throw, "example"), (_often, "reach"), (_robust, "robust")):
        blocks += _block(list(make(folder)), parts.get(key, ""))
    blocks += _block(list(_agree(folder)), parts.get("example", "") or parts.get("models", ""))
    blocks += _block(list(_steps(folder)), parts.get("models", ""))
    (folder / PAGE).write_text("\n\n".join([*blocks, LIMITS]), encoding="utf-8")


def _block(lines: list[str], part: str) -> list[str]:
    """Paragraphs, and where and when their figures were measured; nothing without a table."""
    made = re.findall(r"^`python -m benchmarks --only \w+`.*?: \S+ s, (.*)$", part, flags=re.M)
    return [*lines, f"*Measured {made[-1]}*"] if lines and made else lines


def _rows(folder: Path, name: str) -> Rows:
    """A table's rows; empty without its file."""
    path = folder / f"{name}.csv"
    if not path.exists():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def _throw(folder: Path) -> Iterator[str]:
    if (folder / "example.png").exists():
        yield "## A throw"
        yield (
            "The arm swings from rest. The gripper gets its command early, for it needs time to "
            "open. While the grip force falls, for some 50 ms, the bar turns and slides between "
            "the pads. Then it flies."
        )
        yield '<img src="example.png" width="720" alt="A throw, from rest to landing">'


def _often(folder: Path) -> Iterator[str]:
    table = [_rate(row, "random") for row in _rows(folder, "reach-inside")]
    for row in _rows(folder, "reach-map"):
        cold = {name.removeprefix("cold: "): row[name] for name in row if name.startswith("cold: ")}
        table.append(_rate({"scene": row["scene"]} | cold, "over the map"))
        table.append(_rate(row, "over the map", int(row["throws"])))
    if table:
        yield "## How often, and how fast"
        yield (
            "Random targets are those that a random throw hits. Targets over the map lie all "
            "over what sampled throws reach, up to its edge; to some no throw is found. A target "
            "counts as solved if the motion that is sent breaks no limit of the arm and lands "
            "within the scene's tolerance (mostly 2 mm and 0.5°) by the limit surface. `throwplan "
            "prepare` solves throws ahead. A plan that finds no throw takes the longest."
        )
        yield "\n".join(Table("often", "", table).markdown())


def _rate(row: Mapping[str, str], targets: str, ahead: int | None = None) -> Row:
    """Solved targets of a scene, and times of their plans; ahead: throws solved before."""
    return {
        "scene": row["scene"],
        "targets": f"{row['targets']} {targets}",
        "throws solved ahead": ahead,
        "solved": int(row["solved"]),
        "time of a plan, median [ms]": float(row["plan, median [ms]"]),
        "99 % [ms]": float(row["plan, 99 % [ms]"]),
    }


def _robust(folder: Path) -> Iterator[str]:
    rows = _rows(folder, "robust")
    if rows:
        yield "## What is not known exactly"
        yield (
            "Plans by `--robust` against plain ones, in random scenes whose plain throw has "
            "a 95 % pose error above 2 mm. Each was thrown 2,000 times with samples that planning "
            "did not use."
        )
        yield "\n".join(
            f"- {row['scenes']} scenes, uncertain {row['uncertain']}: the error is "
            f"{_digits(row['times less, median'])} times less in the median, success goes from "
            f"{_digits(row['plain success, mean [%]'])} to "
            f"{_digits(row['robust success, mean [%]'])} % in the mean; {row['worse']} robust "
            f"plans are worse. A plan takes {_digits(row['plan, median [s]'])} s of processor time "
            f"in the median, at most {_digits(row['plan, longest [s]'])} s."
            for row in rows
        )


def _digits(value: str) -> str:
    """A number to two digits."""
    number = float(value)
    return f"{round(number, 1 - math.floor(math.log10(number))) if number else 0:,g}"


def _agree(folder: Path) -> Iterator[str]:
    rows, laws = _rows(folder, MUJOCO), _rows(folder, "models-laws")
    if not rows and not laws:
        return
    yield "## Do the models agree?"
    if laws:
        yield (
            "A pad on a bar was meshed into 64 points with Coulomb friction. In the worst of four "
            f"throws the limit surface lands {_apart(laws, 'ls'):.2g} mm from it and the sliding "
            f"pivot, which the optimiser uses, {_apart(laws, 'sp'):.2g} mm. A turn counts by the "
            "way of the bar's end."
        )
    if rows:
        yield (
            "MuJoCo, a simulator that shares no code with throwplan, threw the built-in scenes. "
            "The table says how far it lands from the two models, for the same motion."
        )
        columns = [f"{title} [{unit}]" for title in (SURFACE, PIVOT) for unit in ("mm", "deg")]
        table = [Row({"scene": r["scene"], **{c: float(r[c]) for c in columns}}) for r in rows]
        yield "\n".join(Table("agree", "", table, digits=2).markdown())


def _apart(laws: Rows, law: str) -> float:
    """Largest distance [mm] of a law from the meshed patch."""
    return max(float(row["to the patch [mm]"]) for row in laws if row["law"] == law)


def _steps(folder: Path) -> Iterator[str]:
    rows = _rows(folder, "models-methods")
    if not rows:
        return
    points = {method: _curve(rows, method) for method in CURVES}
    _draw(points).write(folder)
    yield "## Error against time"
    yield (
        "More steps make a release model slower and, up to its own limit, more exact. Each point "
        "is a setting: its time on one core, and its distance from the meshed pad, worst of four "
        "throws."
    )
    yield f'<img src="{PICTURE}" width="560" alt="Error over time of four release models">'


def _curve(rows: Rows, method: str) -> list[tuple[float, float]]:
    """(time [ms], error [mm]) of a method's settings: median time, worst error of the throws."""
    found = dict[str, list[dict[str, str]]]()
    for row in rows:
        if row["method"] == method:
            found.setdefault(row["setting"], []).append(row)
    points = []
    for runs in found.values():
        errors = [float(run[MODEL] or math.nan) for run in runs]
        times = sorted(float(run[TIME] or math.nan) for run in runs)
        if all(math.isfinite(value) for value in (*errors, *times)):
            points.append((1e-3 * statistics.median(times), max(errors)))
    return sorted(points)


def _draw(points: Mapping[str, list[tuple[float, float]]]) -> Picture:
    """The curves, without settings that are slower and no better than another."""
    figure, axes = panels(6.4, 4.2)
    (axis,) = axes.flat
    for method, (name, colour) in CURVES.items():
        front = list[tuple[float, float]]()
        for time, error in points[method]:
            if not front or error < front[-1][1]:
                front.append((time, error))
        if front:
            axis.loglog(*zip(*front, strict=True), "o-", color=colour, ms=4, label=name)
    axis.set(xlabel="time of a throw [ms]", ylabel="distance from the meshed pad [mm]")
    axis.legend(fontsize=9)
    return Picture(Path(PICTURE).stem, "Error over time of four release models", figure)


# Section `example`.


def make(effort: Effort) -> ReportSection:
    """Plans, a picture of one, and their landings in MuJoCo."""
    rows, pictures, step = list[Row](), list[Picture](), effort.counter(len(THROWN))
    for name in THROWN:
        plan = Planner(name, library=False).plan()
        if name == SHOWN:
            pictures.append(Picture("example", f"A throw: scene {name}", drawing.draw(plan)))
        found = replay(plan).objects[0].to_dict()["difference"]
        row: Row = {"scene": name, "status": plan.status}
        for title, key in ((SURFACE, "limit_surface"), (PIVOT, "sp")):
            row[f"{title} [mm]"] = 1e3 * found[key]["position"]
            row[f"{title} [deg]"] = math.degrees(found[key]["angle"])
        rows.append(row)
        step()
    words = (
        "Distance of MuJoCo's landing, with a contact a pad whose friction is the limit surface's "
        "ellipsoid, from what the two release models say of the same motion."
    )
    caption = "MuJoCo's landing less the models'"
    table = Table(MUJOCO, caption, rows, short=True, digits=2)
    return ReportSection("example", "The scenes in MuJoCo", [words], [table], pictures)
