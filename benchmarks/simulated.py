"""Section `mujoco`: what MuJoCo says of the landings of the built-in scenes."""

from __future__ import annotations

import math

from throwplan import Planner, load_scene, scene_names
from throwplan.lab import replay
from throwplan.pictures import Row, Table

from .page import Effort, Section


def make(effort: Effort) -> Section:
    """A row for each scene that has something to plan."""
    names = [name for name in scene_names() if load_scene(name).motion is None]
    chosen = effort.of(["hand-box", "cup"], names)
    step, rows = effort.counter(len(chosen)), list[Row]()
    for name in chosen:
        rows.append(_landing(name))
        step()
    return Section(
        "What MuJoCo says",
        "MuJoCo, a simulator that shares no code with throwplan, throws the motion of each scene "
        "(`throwplan replay`): distance of its landing from those of the two release models.",
        [Table("landings", "Landings", rows)],
    )


def _landing(name: str) -> Row:
    """Distances of MuJoCo's landing from the models'."""
    plan = Planner(name, library=False).plan()
    row: Row = {"scene": name, "status": plan.status}
    if not plan.solved:
        return row
    found = replay(plan).objects[0].to_dict()["difference"]
    for title, key in (("limit surface", "limit_surface"), ("sliding pivot", "sp")):
        row[f"{title} [mm]"] = round(1e3 * found[key]["position"], 3)
        row[f"{title} [°]"] = round(math.degrees(found[key]["angle"]), 4)
    return row
