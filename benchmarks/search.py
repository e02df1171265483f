"""Section `search`: what each setting of search and mesh earns."""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from collections.abc import Sequence
from typing import Any
from unittest.mock import patch

import numpy as np
from throwplan import Cost, Plan, Planner, Pose, load_scene, reach_map
from throwplan.pictures import Row, Table
from throwplan.planner.planner import SolverName
from throwplan.planner.search import SETTINGS

from .measure import quantiles, reachable_targets, warmed
from .page import Effort, Section
from .processes import shared
from .reach import over_map

#: Seed of the targets.
SEED = 11
#: Scenes of the search, and targets of each over its map and beside it: quick, full.
SCENES = ("hand-flip",), ("pose", "cup", "fr3", "flip")
ON_MAP, BESIDE = (4, 14), (1, 3)
#: Pose errors [m] from the map of targets beside it.
AWAY = (0.03, 0.3)
#: Number of sampled states of a map: quick, full.
SAMPLED = (5_000, 60_000)
#: Other values of the settings of the search, one at a time: quick, full.
SEARCHES: tuple[dict[str, tuple[Any, ...]], ...] = (
    {"prices": ((100.0,),)},
    {"prices": ((100.0,), (100.0, 1000.0, 10_000.0)), "close": (0.0, 0.1), "vain": (2, 8)},
)
#: Scenes of the mesh, and targets of each: quick, full.
MESH_SCENES, MESH_TARGETS = (("hand-flip",), ("cup", "hand-flip")), (2, 6)
#: Other values of the settings of the NLP, one at a time: quick, full.
MESHES: tuple[dict[str, tuple[float, ...]], ...] = (
    {"opening": (12,)},
    {
        "carry": (4, 8, 12),
        "opening": (4, 8, 12, 24),
        "grading": (1.0, 1.5, 3.0),
        "epsilon": (0.1, 0.05, 0.01, 0.003),
    },
)

#: A target's plan: solved, starts, seconds, missed.
Outcome = dict[str, Any]


def make(effort: Effort) -> Section:
    """Targets over the maps and beside them, by the usual settings and with one changed."""
    names, meshed = effort.of(*SCENES), effort.of(*MESH_SCENES)
    jobs = [[effort.of(*size)] * len(names) for size in (ON_MAP, BESIDE, SAMPLED)]
    step, searches = effort.counter(2), effort.of(*SEARCHES)
    found = list(shared(_outcomes, names, *jobs, [searches] * len(names), quick=effort.quick))
    step()
    rows = [_summary(name, [one for scene in found for one in scene[name]]) for name in found[0]]
    meshes = _mesh_rows(meshed, effort.of(*MESH_TARGETS), effort.of(*MESHES))
    step()
    usual = load_scene("cup").nlp
    return Section(
        "Settings of search and mesh",
        f"One setting changed at a time. Search: targets over the maps of {', '.join(names)}, and "
        "beside them, without a library and without a price of the load; processor time. Mesh "
        f"(`[nlp]`; usual: carry {usual.carry}, opening {usual.opening}, grading "
        f"{usual.grading:g}, epsilon {usual.epsilon:g}) and solver: random targets of "
        f"{', '.join(meshed)}, medians of ratios to the usual plan to the same target. *Error*: "
        "how far the exact release of the NLP's motion lands from where the NLP believes, before "
        "it is corrected.",
        [
            Table("search", f"Search (usual: {_settings()})", rows),
            Table("mesh", "Mesh and solver", meshes),
        ],
    )


def _settings() -> str:
    names = ("prices", "close", "vain")
    return ", ".join(f"{name} = {getattr(SETTINGS, name)}" for name in names)


def _outcomes(
    name: str, count: int, beside: int, samples: int, others: dict[str, tuple[Any, ...]]
) -> dict[str, list[Outcome]]:
    """By variant: what became of each target of a scene.

    A plan by the first starts alone is the same with all settings of those that follow.
    """
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
    for key, value in ((key, value) for key, values in others.items() for value in values):
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
    times = [[one["seconds"] for one in rows if one["solved"] is flag] for flag in (True, False)]
    missed = [1e3 * one["missed"] for one in rows if one["missed"] is not None]
    (median, slow), (none, slowest) = (quantiles(seconds, 50, 99) for seconds in times)
    return {
        "search": name,
        "targets": len(rows),
        "solved": len(times[0]),
        "median [s]": median,
        "99 % [s]": slow,
        "not found, median [s]": none,
        "not found, 99 % [s]": slowest,
        "nearest throw, median [mm]": quantiles(missed, 50)[0],
    }


def _mesh_rows(names: Sequence[str], count: int, others: dict[str, tuple[float, ...]]) -> list[Row]:
    """A row for each variant of mesh and solver, over the targets of all scenes."""
    variants: list[tuple[str, dict[str, float], SolverName]] = [
        ("usual", {}, "fatrop"),
        ("IPOPT", {}, "ipopt"),
    ]
    for key, values in others.items():
        variants += [(f"{key} {value:g}", {key: value}, "fatrop") for value in values]
    targets = {
        name: list(itertools.islice(reachable_targets(load_scene(name), SEED), count))
        for name in names
    }
    plans: dict[str, list[Plan]] = {words: [] for words, _, _ in variants}
    for name, some in targets.items():
        scene, planners = load_scene(name), list[Planner]()
        for _, mesh, solver in variants:
            nlp = dataclasses.replace(scene.nlp, **mesh)  # type: ignore[arg-type]
            planners.append(warmed(scene.replace(nlp=nlp), some[:1], solver))
        # All variants for one target, then for the next: a machine changes its speed.
        for target in some:
            for planner, (words, _, solver) in zip(planners, variants, strict=True):
                plans[words].append(planner.plan(target, solver=solver))
    figures = {
        words: np.array([_figures(plan) for plan in some]).T for words, some in plans.items()
    }
    rows = list[Row]()
    for words, now in figures.items():
        # NaN of a plan that is not solved counts nowhere.
        time, error, effort = (
            float(np.nanmedian(ratio)) for ratio in now[:3] / figures["usual"][:3]
        )
        rows.append(
            {
                "mesh": words,
                "solved": f"{sum(plan.solved for plan in plans[words])} of {len(plans[words])}",
                "solve [ms]": float(np.nanmedian(now[0])),
                "times usual": time,
                "error [mm]": float(np.nanmedian(now[1])),
                "times usual ": error,
                "cost, % above usual": round(100 * (effort - 1), 2),
                "final error, worst [mm]": round(float(np.nanmax(now[3])), 3),
            }
        )
    return rows


def _figures(plan: Plan) -> tuple[float, float, float, float]:
    """Solving time [ms], error before correction [mm], cost and final error [mm] of a plan.

    NaN if it is not solved.
    """
    if not plan.solved or plan.throw is None:
        return (math.nan,) * 4
    x, _, theta = plan.throw.planned_landing
    exact, thing = plan.throw.exact.landing, plan.scene.object
    turned = 0.0 if plan.target.theta is None else exact.theta - theta
    before, final = thing.pose_error(exact.x - x, turned), thing.pose_error(*plan.error_sent())
    return 1e3 * plan.time["solve"], 1e3 * before, plan.throw.effort, 1e3 * final
