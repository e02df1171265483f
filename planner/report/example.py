"""Section `example`: a throw to look at, and the built-in scenes thrown in MuJoCo."""

from __future__ import annotations

import math

from ..plan import Planner
from ..robot import replay
from ..show import Row, Table
from .page import Effort, Picture, ReportSection

#: The throw that is shown, and those that MuJoCo throws too.
SHOWN, THROWN = "cup", ("pose", "cup", "flip", "delay", "hand-flip")
#: The table of MuJoCo's throws, and its columns.
MUJOCO, SURFACE, PIVOT = "example-mujoco", "limit surface", "sliding pivot"


def make(effort: Effort) -> ReportSection:
    """Plans, a picture of one, and where MuJoCo lands them."""
    rows, pictures, step = list[Row](), list[Picture](), effort.counter(len(THROWN))
    for name in THROWN:
        plan = Planner(name).plan()
        if name == SHOWN:
            pictures.append(Picture("example", f"A throw: scene {name}", plan.draw()))
        found = replay(plan).to_dict()["difference"]
        row: Row = {"scene": name, "status": plan.status}
        for title, key in ((SURFACE, "limit_surface"), (PIVOT, "sp")):
            row[f"{title} [mm]"] = 1e3 * found[key]["position"]
            row[f"{title} [deg]"] = math.degrees(found[key]["angle"])
        rows.append(row)
        step()
    words = (
        "Distance of MuJoCo's landing, with twelve contact points a pad, from what the two release "
        "models say of the same motion."
    )
    caption = "MuJoCo's landing less the models'"
    table = Table(MUJOCO, caption, rows, short=True, digits=2)
    return ReportSection("example", "The scenes in MuJoCo", [words], [table], pictures)
