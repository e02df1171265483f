"""Section `reach`: targets in reach: how many are solved, how fast, and what others are called."""

from __future__ import annotations

import collections
import itertools
import math
import time
from collections.abc import Sequence

import numpy as np
from throwplan import Plan, Planner, Pose, ReachMap, Throw, load_scene, reach_map
from throwplan.pictures import Row, Table, shown
from throwplan.planner.throw import send
from throwplan.planner.verdict import verdict_on

from .judge import judge
from .measure import planning_time, quantiles, reachable_targets, warmed
from .page import Effort, ReportSection
from .parts import imports_of
from .processes import shared

#: Seed of the targets in reach.
SEED = 1
#: Seed of the targets on the map.
MAP_SEED = 3
#: Number of targets of each scene: quick, full.
TARGETS = {
    "pose": (20, 100),
    "cup": (5, 100),
    "box": (0, 100),
    "flip": (0, 100),
    "hand-box": (20, 100),
    "hand-flip": (20, 100),
}
#: Scenes whose library is measured: quick, full.
LIBRARIES = ("hand-box",), ("pose", "fr3")
#: Number of throws of a library: quick, full.
THROWS = (60, 1000)
#: Number of targets in random bins of a map: quick, full.
ON_MAP = (10, 100)
#: Number of plans that the oracle judges: quick, full.
JUDGED = (4, 50)
#: Number of warm plans, each to a target beside that of a solved plan: quick, full.
WARM_PLANS = (4, 50)
#: Pose error [m] (position plus angle times half the length) between the two targets.
WARM_DISTANCE = 0.008
#: Number of plans before the timed ones, which build the NLPs: quick, full.
FIRST = (2, 10)
#: Number of sampled states of a map: quick, full.
SAMPLED = (20_000, 200_000)


def make(effort: Effort) -> ReportSection:
    """Plans to targets in reach, to far ones, and to targets all over the map."""
    counts = {name: effort.of(*sizes) for name, sizes in TARGETS.items() if effort.of(*sizes)}
    spread = effort.of(*LIBRARIES)
    step = effort.counter(len(counts) + len(spread) + 1)
    made = shared(_targets, counts, counts.values(), quick=effort.quick)
    targets = dict(zip(counts, made, strict=True))
    step()
    rows, plans = list[Row](), dict[str, list[Plan]]()
    for name, some in targets.items():
        plans[name] = _planned(warmed(load_scene(name), some[: effort.of(*FIRST)]), some)
        row: Row = {"scene": name}
        rows.append(row | _row(plans[name]))
        step()
    mapped = list[Row]()
    for name in spread:
        row, plans[f"{name}, over the map"] = _over_map(name, effort)
        mapped.append(row)
        step()
    lost: list[Row] = [
        {"targets": words, **_said(plan)}
        for words, some in plans.items()
        for plan in some
        if not plan.solved
    ]
    return ReportSection(
        "reach",
        "Any target in reach",
        _figures(rows, mapped),
        [
            Table("reach-inside", "Random targets in reach, without a library", rows),
            Table("reach-lost", "Targets without a throw, and why", lost),
            Table(
                "reach-map", "Targets spread over a map's bins, with a library and without", mapped
            ),
        ],
    )


def _planned(planner: Planner, targets: Sequence[Pose]) -> list[Plan]:
    return [planner.plan(target) for target in targets]


def _row(plans: list[Plan]) -> Row:
    """Counts, times without what is built once for all plans, and worst errors."""
    solved = [plan.error_sent() for plan in plans if plan.solved]
    x, theta = np.max(solved or [(math.nan, math.nan)], axis=0)
    whole = quantiles([planning_time(plan) for plan in plans], 50, 99)
    solves = quantiles([plan.time["solve"] for plan in plans], 50, 99)
    return {
        "targets": len(plans),
        "solved": len(solved),
        "plan, median [ms]": 1e3 * whole[0],
        "plan, 99 % [ms]": 1e3 * whole[1],
        "solve, median [ms]": 1e3 * solves[0],
        "solve, 99 % [ms]": 1e3 * solves[1],
        "worst error [mm]": 1e3 * float(x),
        "worst error [deg]": math.degrees(float(theta)),
    }


def _said(plan: Plan) -> Row:
    """A plan's target, its status and why."""
    x, theta = plan.target.plane_x, plan.target.theta
    turned = None if theta is None else math.degrees(theta)
    place: Row = {"scene": plan.scene.name, "x [m]": x, "theta [deg]": turned}
    return place | {"status": plan.status, "why": plan.message}


def _figures(rows: list[Row], mapped: list[Row]) -> list[str]:
    """Counts and times as sentences."""
    words = [
        f"`{row['scene']}` {row['solved']} of {row['targets']}, "
        f"{shown(row['plan, median [ms]'])} ms a plan"
        for row in rows
    ]
    middles = "; ".join(
        f"`{r['scene']}` {r['solved']} of {r['targets']}, {r['moved throws']} of them moved, "
        f"{shown(r['plan, median [ms]'])} ms a plan, {shown(r['plan, 99 % [ms]'])} at 99 % "
        f"(cold: {r['cold: solved']}, {shown(r['cold: plan, median [ms]'])} and "
        f"{shown(r['cold: plan, 99 % [ms]'])} ms), {r['judged wrong']} of "
        f"{r['judged']} judged wrong"
        for r in mapped
    )
    return [
        f"Random targets in reach that are thrown to: {'; '.join(words)}.",
        f"Targets spread evenly over a map's bins, with a library of solved throws: {middles}.",
    ]


def _over_map(name: str, effort: Effort) -> tuple[Row, list[Plan]]:
    """Plans with a library and without one to random places in random bins of a scene's map."""
    scene, count = load_scene(name), effort.of(*ON_MAP)
    targets = over_map(reach_map(scene, samples=effort.of(*SAMPLED)), count)
    planner, before, started = Planner(scene), Planner(scene).prepared, time.perf_counter()
    throws = planner.prepare(effort.of(*THROWS))
    seconds = time.perf_counter() - started
    # The first plan builds what others share; it is not timed.
    planner.plan(targets[0])
    plans, cold = _planned(planner, targets), _planned(warmed(scene, targets[:2]), targets)
    pairs = [(a.throw, b.throw) for a, b in zip(plans, cold, strict=True) if a.solved and b.solved]
    costs = [a.effort / b.effort for a, b in pairs if a is not None and b is not None]
    looked = [p for p in plans if p.solved][: effort.of(*JUDGED)]
    wrong = sum(bool(judge(plan).broken) for plan in looked)
    said = collections.Counter(plan.status for plan in plans)
    row: Row = {
        "scene": name,
        "throws": throws,
        "prepare [s]": None if before else seconds,
        "library [MB]": planner.library.records.nbytes / 1e6,
        "moved throws": sum(plan.solved and plan.solver == "corrector" for plan in plans),
        "not found": said["not_found"],
    }
    row |= _row(plans) | {f"cold: {name}": value for name, value in _row(cold).items()}
    row |= _beside(planner, [p for p in plans if p.solved][: effort.of(*WARM_PLANS)])
    row["fresh process [s]"] = imports_of(scene)["fresh process [s]"]
    for share, value in zip((50, 90), quantiles(costs, 50, 90), strict=True):
        row[f"cost over the cold plan's, {share} %"] = value
    return row | {"judged": len(looked), "judged wrong": wrong}, plans


def _beside(planner: Planner, plans: list[Plan]) -> Row:
    """Times of warm plans to targets beside those of `plans`, and of throws and checks of these."""
    rng, seconds, checks = np.random.default_rng(SEED), list[float](), list[float]()
    for plan in plans:
        throw, target = plan.throw, plan.target
        assert throw is not None
        share = rng.uniform(-1.0, 1.0)
        turned = math.copysign(1.0 - abs(share), rng.uniform(-1.0, 1.0))
        away = WARM_DISTANCE * turned / plan.scene.object.half_length
        moved = target.shifted(WARM_DISTANCE * share, away)
        start = time.perf_counter()
        planner.plan(moved, warm=plan)
        seconds.append(time.perf_counter() - start)
        start = time.perf_counter()
        sent = send(plan.manipulator, throw.planned)
        final = Throw.sent(plan.scene, plan.manipulator, sent, throw.opening_time)
        verdict_on(final, target)
        checks.append(time.perf_counter() - start)
    (warm, longest), (check,) = quantiles(seconds, 50, 99), quantiles(checks, 50)
    return {
        f"warm by {1e3 * WARM_DISTANCE:.0f} mm, median [ms]": 1e3 * warm,
        "warm, 99 % [ms]": 1e3 * longest,
        "throw and check [ms]": 1e3 * check,
    }


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
