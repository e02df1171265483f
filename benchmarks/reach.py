"""Section `reach`: targets in reach: how many are solved, how fast, with a library and without."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence

import numpy as np
from throwplan import Plan, Planner, Pose, ReachMap, load_scene, reach_map
from throwplan.pictures import Row, Table

from .judge import judge
from .measure import planning_time, quantiles, reachable_targets, warmed
from .page import Effort, Section
from .processes import LANES, shared

#: Seed of the targets in reach.
SEED = 1
#: Seed of the targets on the map.
MAP_SEED = 3
#: Scenes of random targets, and the number of these: quick, full.
SCENES = ("hand-box", "hand-flip"), ("pose", "cup", "box", "flip", "hand-box", "hand-flip")
TARGETS = (4, 40)
#: Scenes whose library is measured: quick, full.
LIBRARIES = ("hand-box",), ("pose", "fr3")
#: Number of throws of a library: quick, full.
THROWS = (40, 200)
#: Number of targets in random bins of a map: quick, full.
ON_MAP = (6, 40)
#: Number of warm plans, each to a target beside that of a solved plan: quick, full.
WARM_PLANS = (3, 30)
#: Pose error [m] between the two targets.
WARM_DISTANCE = 0.008
#: Number of solved plans of each row that the oracle judges.
JUDGED = 20
#: Number of plans before the timed ones, which build the NLPs: quick, full.
FIRST = (2, 10)
#: Number of sampled states of a map: quick, full.
SAMPLED = (20_000, 200_000)


def make(effort: Effort) -> Section:
    """Plans to random targets in reach, and to targets all over the map."""
    names, mapped = effort.of(*SCENES), effort.of(*LIBRARIES)
    counts = [effort.of(*TARGETS)] * len(names)
    step, inside, spread = effort.counter(len(names) + len(mapped)), list[Row](), list[Row]()
    for name, targets in zip(
        names, shared(_targets, names, counts, quick=effort.quick), strict=True
    ):
        planner = warmed(load_scene(name), targets[: effort.of(*FIRST)])
        row: Row = {"scene": name}
        inside.append(row | _row([planner.plan(target) for target in targets]))
        step()
    for name in mapped:
        spread += _over_map(name, effort)
        step()
    return Section(
        "Reach",
        "Random targets are where a random motion, thrown exactly, lands: the planner knows "
        "nothing of these motions. Targets over the map lie at random places in random bins of "
        "`throwplan map`, up to the edge; to some no throw is known. `throwplan prepare` makes the "
        f"library, here in {LANES} processes; *warm* plans have a target "
        f"{1e3 * WARM_DISTANCE:.0f} mm from that of a solved plan. *Wrong*: of some solved plans "
        "those in which the oracle finds a broken limit. Times by the clock, without building.",
        [
            Table("reach-inside", "Random targets in reach, without a library", inside),
            Table("reach-map", "Targets over the map", spread),
        ],
    )


def _row(plans: Sequence[Plan]) -> Row:
    """Counts, times without what is built once for all plans, and worst errors."""
    solved = [plan.error_sent() for plan in plans if plan.solved]
    x, theta = np.max(solved or [(math.nan, math.nan)], axis=0)
    judged = [plan for plan in plans if plan.solved][:JUDGED]
    median, slow = quantiles([planning_time(plan) for plan in plans], 50, 99)
    return {
        "targets": len(plans),
        "solved": len(solved),
        "wrong": f"{sum(bool(judge(plan).broken) for plan in judged)} of {len(judged)}",
        "worst error [mm]": round(1e3 * float(x), 3),
        "[°]": round(math.degrees(float(theta)), 3),
        "plan, median [ms]": 1e3 * median,
        "99 % [ms]": 1e3 * slow,
    }


def _over_map(name: str, effort: Effort) -> list[Row]:
    """Plans to random places in random bins of a scene's map, without a library and with one."""
    scene = load_scene(name)
    targets = over_map(reach_map(scene, samples=effort.of(*SAMPLED)), effort.of(*ON_MAP))
    cold = warmed(scene, targets[:2])
    bare: Row = {"scene": name, "library": "none"}
    bare |= _row([cold.plan(target) for target in targets])
    planner, started = Planner(scene), time.perf_counter()
    throws = planner.prepare(effort.of(*THROWS), workers=LANES)
    seconds = time.perf_counter() - started
    # The first plan builds what others share; it is not timed.
    planner.plan(targets[0])
    plans = [planner.plan(target) for target in targets]
    warm = _warm_times(planner, [p for p in plans if p.solved][: effort.of(*WARM_PLANS)])
    row: Row = {"scene": name, "library": f"{throws} throws, {seconds:.0f} s"}
    row |= _row(plans) | {"warm, median [ms]": warm[0], "warm, 99 % [ms]": warm[1]}
    return [bare, row]


def _warm_times(planner: Planner, plans: Sequence[Plan]) -> list[float]:
    """Times [ms] of warm plans to targets beside those of `plans`: median, 99 %."""
    rng, seconds = np.random.default_rng(SEED), list[float]()
    for plan in plans:
        share = rng.uniform(-1.0, 1.0)
        turned = math.copysign(1.0 - abs(share), rng.uniform(-1.0, 1.0))
        away = WARM_DISTANCE * turned / plan.scene.object.half_length
        start = time.perf_counter()
        planner.plan(plan.target.shifted(WARM_DISTANCE * share, away), warm=plan)
        seconds.append(1e3 * (time.perf_counter() - start))
    return quantiles(seconds, 50, 99)


def over_map(found: ReachMap, count: int) -> list[Pose]:
    """Targets at random places in `count` random bins with a landing."""
    rng, target, edges = np.random.default_rng(MAP_SEED), found.scene.aim, found.theta_edges
    hit = np.argwhere(found.landings > 0)
    chosen = hit[rng.permutation(len(hit))[:count]]
    if len(chosen) < count:
        chosen = hit[rng.integers(0, len(hit), count)]
    targets = []
    for i, j in chosen:
        theta = None if edges is None else float(rng.uniform(*edges[j : j + 2]))
        targets.append(target.in_plane(float(rng.uniform(*found.x_edges[i : i + 2])), theta))
    return targets


def _targets(name: str, count: int) -> list[Pose]:
    """Random targets in reach of a scene."""
    return list(itertools.islice(reachable_targets(load_scene(name), SEED), count))
