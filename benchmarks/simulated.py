"""Section `mujoco`: what MuJoCo says of landings of the built-in scenes, and of rest in bins."""

from __future__ import annotations

import math

import numpy as np
from throwplan import Cup, Object, Plan, Planner, Region, Rest, Scene, load_scene, scene_names
from throwplan.lab import replay
from throwplan.pictures import Row, Table
from throwplan.planner.uncertainty import Entries, count_rests

from .measure import number, quantiles
from .page import Effort, Section

#: Seed of the bins.
SEED = 32
#: Number of bins that are drawn: quick, full; no throw is found to some.
BINS = (1, 12)
#: Number of throws into a bin.
THROWS = 64


def make(effort: Effort) -> Section:
    """Landings of the built-in scenes, and throws into random bins."""
    names = [name for name in scene_names() if load_scene(name).motion is None]
    chosen, count = effort.of(["hand-box", "cup"], names), effort.of(*BINS)
    step, rows, bins = effort.counter(len(chosen) + count), list[Row](), list[Row]()
    for name in chosen:
        rows.append(_landing(name))
        step()
    for index in range(count):
        bins += _bin_rows(index)
        step()
    return Section(
        "What MuJoCo says",
        "MuJoCo, a simulator that shares no code with throwplan, throws the motion of each scene "
        "above (`throwplan replay`): distance of its landing from those of the two release models. "
        f"Random bins on the floor or on a table: of {THROWS} throws by samples that planning did "
        "not use, those that come to rest in the bin.",
        [
            Table("landings", "Landings, MuJoCo's less the models'", rows),
            Table("bins", "Throws that stay in a bin", _bin_summary(bins)),
        ],
        [Table("bins-each", "every bin", bins)],
    )


def _landing(name: str) -> Row:
    """Distances of MuJoCo's landing from the models'."""
    plan = Planner(name, library=False).plan()
    row: Row = {"scene": name, "status": plan.status}
    if not plan.solved:
        return row
    found = replay(plan).objects[0].to_dict()["difference"]
    for title, key in (("limit surface", "limit_surface"), ("sliding pivot", "sp")):
        row[f"{title} [mm]"] = 1e3 * found[key]["position"]
        row[f"{title} [°]"] = math.degrees(found[key]["angle"])
    return row


def bin_scene(number: int) -> Scene:
    """A Panda that throws a bar into a bin on the floor or on a table, as a user would write it.

    The object may land anywhere near the middle, at any angle within 35 degrees of upright.
    """
    rng = np.random.default_rng((SEED, number))
    length, width, mass = rng.uniform(0.08, 0.35), rng.uniform(0.015, 0.04), rng.uniform(0.05, 0.3)
    radius, depth = rng.uniform(0.06, 0.13), rng.uniform(0.08, 0.25)
    rim = depth + 0.005 + (rng.uniform(0.1, 0.3) if rng.random() < 0.4 else 0.0)
    x, insertion = rng.uniform(0.75, 1.3), min(0.05, 0.6 * depth)
    room, turn = 0.5 * radius, math.radians(35.0)
    inertia = mass * (length**2 + width**2) / 12
    return load_scene("cup").replace(
        name=f"bin {number}",
        object=Object(mass=mass, inertia=inertia, length=length, width=width, com=length / 2),
        cup=Cup(x=x, rim=rim, radius=radius, depth=depth, clearance=0.005, insertion=insertion),
        target=Region(
            (x - room, x + room),
            rim - insertion + length / 2,
            (-math.pi / 2 - turn, -math.pi / 2 + turn),
        ),
        rest=Rest(in_="cup"),
    )


def _bin_rows(index: int) -> list[Row]:
    """The plain plan and that with `[rest]` of one bin; none where no plan reaches it."""
    scene = bin_scene(index)
    plain = Planner(scene.replace(rest=None), library=False).plan()
    if not plain.solved:
        return []
    plan, rows = Planner(scene, library=False).plan(), list[Row]()
    for words, one in (("without `[rest]`", plain), ("with `[rest]`", plan)):
        row: Row = {"bin": index, "plan": words, "status": one.status}
        if one.throw is not None and one.solved:
            row |= _rests(one, scene.rest)
        rows.append(row | {"plan [s]": one.time["total"]})
    return rows


def _rests(plan: Plan, rest: Rest | None) -> Row:
    """Of the throws those that stay, by the planner's contacts and by MuJoCo's."""
    from oracle.rest import rests_in_cup

    assert plan.throw is not None
    throw = plan.throw.deciding
    throw = throw.in_scene(throw.scene.replace(rest=rest))
    count, found = count_rests(throw), Entries.sampled(throw)
    assert count is not None
    ends = rests_in_cup(throw.scene, found.states, found.restitution, found.friction)
    return {"stay": count.rests, "stay in MuJoCo": int(ends.sum())}


def _bin_summary(rows: list[Row]) -> list[Row]:
    """Both kinds of plans over all bins that both reach."""
    failed = {row["bin"] for row in rows if "stay" not in row}
    found = list[Row]()
    for words in dict.fromkeys(row["plan"] for row in rows):
        some = [row for row in rows if row["plan"] == words and row["bin"] not in failed]
        cells: Row = {"plan": words, "bins": len(some)}
        for column in ("stay", "stay in MuJoCo"):
            values = [number(row[column]) for row in some]
            cells[f"{column} [%]"] = float(np.mean(values or math.nan)) * 100 / THROWS
        cells["plan, median [s]"] = quantiles([number(r["plan [s]"]) for r in some], 50)[0]
        found.append(cells)
    return found
