"""Targets picked anywhere on a map: the middles of random bins that sampled throws hit."""

from __future__ import annotations

import collections
import math

import numpy as np

from ...problems import Pose, load_scene
from ..plan import Planner
from ..reach import ReachMap, reach_map
from ..result import Plan
from .page import Cell, Table

#: Scenes, and the seed of the bins.
SCENES, SEED = ("pose", "cup", "box", "flip", "hand-box", "hand-flip"), 3
#: Bins with so many landings or more are counted beside all.
WELL_HIT = 5


def map_targets(samples: int, count: int) -> list[Table]:
    """Per scene: what is said of the middles of `count` bins of a map of `samples` states."""
    rows: list[list[Cell]] = []
    lost: list[list[Cell]] = []
    for name in SCENES:
        found = reach_map(load_scene(name), samples=samples)
        planner = Planner(found.scene, compiling="no")
        bins = _bins(found, count)
        plans = [planner.plan(_middle(found, one)) for one in bins]
        said = collections.Counter(plan.status for plan in plans)
        well = [found.landings[one] >= WELL_HIT for one in bins]
        good = sum(plan.solved for plan, hit in zip(plans, well, strict=True) if hit)
        kinds = [said["solved"], said["out_of_reach"], said["not_converged"]]
        rows.append([name, found.reachable, len(bins), *kinds, f"{good} of {sum(well)}"])
        for plan, one in zip(plans, bins, strict=True):
            if not plan.solved:
                lost.append([name, *_where(plan), int(found.landings[one]), _words(plan)])
    caption = f"Middles of random bins that {samples:,} sampled states hit, seed {SEED}"
    columns = (
        *("scene", "bins hit", "middles", "solved", "out_of_reach", "not_converged"),
        f"solved, {WELL_HIT} landings or more",
    )
    tables = [Table("reach-on-map", caption, columns, rows)]
    if lost:
        names = ("scene", "x [m]", "theta [deg]", "landings in the bin", "status and why")
        tables.append(Table("reach-on-map-lost", "Middles without a throw", names, lost, 4))
    return tables


def _bins(found: ReachMap, count: int) -> list[tuple[int, int]]:
    """Random bins that were hit."""
    hit = np.argwhere(found.landings > 0)
    chosen = np.random.default_rng(SEED).permutation(len(hit))[:count]
    return [(int(i), int(j)) for i, j in hit[chosen]]


def _middle(found: ReachMap, one: tuple[int, int]) -> Pose:
    """The pose in the middle of a bin."""
    i, j = one
    target = found.scene.target
    assert target is not None
    x = float(found.x_edges[i : i + 2].mean())
    edges = found.theta_edges
    return target.in_plane(x, None if edges is None else float(edges[j : j + 2].mean()))


def _where(plan: Plan) -> list[Cell]:
    theta = plan.target.theta
    return [plan.target.plane_x, None if theta is None else math.degrees(theta)]


def _words(plan: Plan) -> str:
    return f"{plan.status}: {plan.message}"
