"""Section `search`: what each setting of the search earns; what one that finds none costs."""

from __future__ import annotations

import dataclasses
import time
from typing import Any
from unittest.mock import patch

import numpy as np
from throwplan import Cost, Plan, Planner, Pose, load_scene, reach_map
from throwplan.pictures import Row, Table
from throwplan.planner.search import SETTINGS

from .measure import quantiles
from .page import Effort, ReportSection
from .processes import shared
from .reach import over_map

#: Seed of the targets beside the map.
SEED = 11
#: Scenes, and targets of each over its map and beside it: quick, full.
SCENES = ("hand-flip",), ("pose", "cup", "fr3", "flip")
ON_MAP, BESIDE = (6, 30), (2, 4)
#: Pose errors [m] from the map of targets beside it.
AWAY = (0.03, 0.3)
#: Number of sampled states of a map: quick, full.
SAMPLED = (5_000, 60_000)
#: Other values of the settings, one at a time.
OTHERS: dict[str, tuple[Any, ...]] = {
    "prices": ((100.0,), (100.0, 1000.0, 10_000.0)),
    "close": (0.0, 0.1),
    "vain": (3, 6, 12),
}

#: What became of a target: solved, starts, seconds, missed.
Outcome = dict[str, Any]


def make(effort: Effort) -> ReportSection:
    """Targets over the maps and beside them, by the usual settings and with one changed."""
    names = effort.of(*SCENES)
    sizes = [[effort.of(*size)] * len(names) for size in (ON_MAP, BESIDE, SAMPLED)]
    step = effort.counter(1)
    found = list(shared(_outcomes, names, *sizes, quick=effort.quick))
    step()
    variants = list(found[0])
    rows = [_summary(name, [one for scene in found for one in scene[name]]) for name in variants]
    usual = rows[0]
    figure = (
        f"Of {usual['targets']} targets over the maps of {', '.join(names)} and beside them "
        f"{usual['solved']} are solved, without a library; the others take "
        f"{usual['not found, median [s]']:.2g} s in the median."
    )
    return ReportSection(
        "search", "The search", [figure], [Table("search-settings", "Settings, one changed", rows)]
    )


def _outcomes(name: str, count: int, beside: int, samples: int) -> dict[str, list[Outcome]]:
    """By variant: what became of each target of a scene.

    A plan by the first starts alone is the same with all settings of those that follow."""
    scene = load_scene(name).replace(cost=Cost(quiet=0.0))
    found, rng = reach_map(scene, samples=samples), np.random.default_rng(SEED)
    targets = over_map(found, count)
    while len(targets) < count + beside:
        x, theta = float(rng.uniform(-1.0, 3.0)), float(rng.uniform(-3.0, 9.0))
        if AWAY[0] < found.distance(x, theta) < AWAY[1]:
            targets.append(scene.aim.in_plane(x, theta))
    planner = Planner(scene, library=False)
    planner.plan()
    rows = {"usual": [_planned(planner, target) for target in targets]}
    for key, values in OTHERS.items():
        for value in values:
            changed = dataclasses.replace(SETTINGS, **{key: value})
            with patch("throwplan.planner.search.find.SETTINGS", changed):
                rows[f"{key} = {value}"] = [
                    one if one["starts"] <= 2 and one["solved"] else _planned(planner, target)
                    for one, target in zip(rows["usual"], targets, strict=True)
                ]
    return rows


def _planned(planner: Planner, target: Pose) -> Outcome:
    """What became of a target."""
    start = time.process_time()
    plan: Plan = planner.plan(target)
    seconds = time.process_time() - start
    near = plan.to_dict()["nearest"]
    missed = near["pose_error"] if near else None
    return {"solved": plan.solved, "starts": plan.starts, "seconds": seconds, "missed": missed}


def _summary(name: str, rows: list[Outcome]) -> Row:
    """Counts and processor times of a variant."""
    times = [
        [one["seconds"] for one in rows if one["solved"] is solved] for solved in (True, False)
    ]
    missed = [one["missed"] for one in rows if one["missed"] is not None]
    (middle, slow), (none, slowest) = (quantiles(seconds, 50, 99) for seconds in times)
    return {
        "settings": name,
        "targets": len(rows),
        "solved": len(times[0]),
        "median [s]": middle,
        "99 % [s]": slow,
        "not found, median [s]": none,
        "not found, 99 % [s]": slowest,
        "nearest throws": len(missed),
        "nearest, median [mm]": 1e3 * float(np.median(missed)) if missed else None,
    }
