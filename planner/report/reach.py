"""Section `reach`: random targets, how many are thrown to, how fast, and what of the others.

Targets far from all that a map's samples hit are out of reach; one that is solved all the same,
under the exact check, was in reach after all.
"""

from __future__ import annotations

import collections
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...problems import Pose, Scene, load_scene
from ..compile import c_compiler
from ..plan import Planner
from ..reach import reach_map
from ..result import Plan
from ..sweep import executor_of
from .drawing import draw_targets
from .measure import LANES, quantiles, reachable_targets, warmed
from .page import Cell, Effort, Picture, Section, Table

#: Seed of the targets in reach; of targets on the map and far from it.
SEED, MAP_SEED = 1, 3
#: Scenes with the number of their targets: quick, full.
TARGETS = {
    "pose": (20, 1000),
    "cup": (5, 1000),
    "box": (0, 1000),
    "flip": (0, 1000),
    "hand-box": (20, 300),
    "hand-flip": (20, 300),
}
#: Scenes that are planned once more with prepared throws.
PREPARED = ("pose", "cup", "hand-box")
#: Plans before any is timed: the rows they need are compiled; and plans without compiling.
FIRST, PLAIN = (2, 50), (10, 100)
#: Sampled states of a map, middles of its bins that are thrown to, and targets far from it.
SAMPLED, ON_MAP, FAR_OUT = (20_000, 200_000), (2, 40), (5, 300)
#: Far: more than this from the middle of every bin that was hit, x [m] or theta [rad] ...
FAR = (0.1, math.radians(20))
#: ... and at most this beyond them.
ROUND = np.array([1.0, 2.0])
#: How far a followed target swings: x [m], theta [rad]; its period and the time between plans [s].
SWING, PERIOD, TICK = (0.06, 0.2), 2.0, 0.01


def make(effort: Effort) -> Section:
    """Targets in reach, far out, on the map, moving."""
    section = Section("reach", "Any target in reach")
    counts = {name: effort.of(*sizes) for name, sizes in TARGETS.items() if effort.of(*sizes)}
    on_map = ("hand-box",) if effort.quick else tuple(TARGETS)
    total = len(counts) + len(on_map) + 3
    steps = iter(range(1, total + 1))
    with executor_of(1 if effort.quick else LANES, None) as executor:
        run = map if executor is None else executor.map
        targets = dict(zip(counts, run(_targets, counts, counts.values()), strict=True))
    effort.tell(next(steps), total)
    rows: list[list[Cell]] = []
    lost: list[list[Cell]] = []
    inside: list[Plan] = []
    for name, some in targets.items():
        made, plans = _in_reach(load_scene(name), some, effort)
        rows += made
        lost += [["in reach", *_lost(plan)] for plan in plans if not plan.solved]
        inside = plans if name == "pose" else inside
        effort.tell(next(steps), total)
    far = _planned(warmed(load_scene("pose"), [], "cached"), outside("pose", effort))
    effort.tell(next(steps), total)
    following = [_following(name, effort.of(20, 200)) for name in ("pose", "cup")]
    effort.tell(next(steps), total)
    mapped: list[list[Cell]] = []
    for name in on_map:
        row, plans = _on_map(name, effort)
        mapped.append(row)
        lost += [["on the map", *_lost(plan)] for plan in plans if not plan.solved]
        effort.tell(next(steps), total)
    every = _every_target(inside, far)
    section.figures += _figures(rows, far, following, mapped)
    section.tables += [_inside_table(rows), _lost_table(lost), every]
    section.tables += [_following_table(following), _map_table(mapped)]
    words = "Scene pose: targets in reach and far out, and the nearest pose named for these"
    section.pictures.append(Picture("reach", words, lambda path: draw_targets(every, path)))
    return section


def _in_reach(
    scene: Scene, targets: list[Pose], effort: Effort
) -> tuple[list[list[Cell]], list[Plan]]:
    """Rows for a scene: compiled and not, without and with prepared throws; the first plans."""
    rows: list[list[Cell]] = []
    kept: list[Plan] = []
    first = targets[: effort.of(*FIRST)]
    for compiling in ("wait", "no"):
        some = targets if compiling == "wait" else targets[: effort.of(*PLAIN)]
        ready = "yes" if compiling == "wait" and c_compiler() is not None else "no"
        planner = warmed(scene, first, compiling)
        plans = _planned(planner, some)
        kept = kept or plans
        rows.append([scene.name, ready, None, *_row(plans)])
        if scene.name in PREPARED and not effort.quick:
            ahead = warmed(scene, first, compiling)
            ahead.prepare()
            rows.append([scene.name, ready, ahead.prepared, *_row(_planned(ahead, some))])
    return rows, kept


def _planned(planner: Planner, targets: Sequence[Pose]) -> list[Plan]:
    return [planner.plan(target) for target in targets]


def _own(plan: Plan) -> float:
    """A plan's time [ms] without what is built, and compiled, once for all plans."""
    return 1e3 * (plan.time["total"] - plan.time["build"])


def _row(plans: list[Plan]) -> list[Cell]:
    """Counts, times [ms] and worst errors [mm, deg] of some plans."""
    solved = [plan.error_sent() for plan in plans if plan.solved]
    x, theta = np.max(solved or [(math.nan, math.nan)], axis=0)
    return [
        *(len(plans), len(solved)),
        *quantiles([_own(plan) for plan in plans], 50, 99),
        *quantiles([1e3 * plan.time["solve"] for plan in plans], 50, 99),
        *(1e3 * float(x), math.degrees(float(theta))),
    ]


def _inside_table(rows: list[list[Cell]]) -> Table:
    columns = (
        *("scene", "compiled", "prepared", "targets", "solved"),
        *("plan, median [ms]", "plan, 99 % [ms]", "solve, median [ms]", "solve, 99 % [ms]"),
        *("worst error [mm]", "worst error [deg]"),
    )
    caption = "Random targets in reach; prepared: throws that were solved before, to start from"
    return Table("reach-inside", caption, columns, rows)


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)


def _lost(plan: Plan) -> list[Cell]:
    pose = plan.target
    where = (pose.plane_x, _degrees(pose.theta))
    return [plan.scene.name, *where, plan.status, plan.message]


def _lost_table(rows: list[list[Cell]]) -> Table:
    columns = ("targets", "scene", "x [m]", "theta [deg]", "status", "why")
    return Table("reach-lost", "Targets without a throw, and why", columns, rows)


def _figures(
    rows: list[list[Cell]],
    far: list[Plan],
    following: list[list[Cell]],
    mapped: list[list[Cell]],
) -> list[str]:
    """What is thrown to, and how fast."""
    compiled = [row for row in rows if row[1] == "yes"] or rows
    words: list[str] = []
    for name, _, prepared, count, solved, plan, *_ in compiled:
        if prepared is None:
            words.append(f"`{name}` {solved} of {count}, {plan:.3g} ms a plan")
        else:
            words[-1] += f" ({plan:.3g} ms prepared)"
    said = collections.Counter(plan.status for plan in far)
    after = ", ".join(
        f"`{row[0]}` {row[2]} of {row[1]}, {row[6]:.3g} ms a plan" for row in following
    )
    middles = ", ".join(f"`{row[0]}` {row[3]} of {row[2]}" for row in mapped)
    return [
        f"Random targets in reach that are thrown to: {'; '.join(words)}.",
        f"Targets far from all that the samples of a map hit, `pose`: {said['out_of_reach']} of "
        f"{len(far)} are called out of reach, {said['solved']} are solved under the exact check, "
        f"{said['not_converged']} have no answer.",
        f"Middles of random bins of a map that are thrown to: {middles}.",
        f"Plans after a target that swings by {100 * SWING[0]:.0f} cm and {SWING[1]:g} rad, a plan "
        f"every {1e3 * TICK:.0f} ms: {after}.",
    ]


def outside(name: str, effort: Effort) -> list[Pose]:
    """Targets far from every landing of a scene's map."""
    found = reach_map(load_scene(name), samples=effort.of(*SAMPLED))
    target = found.scene.target
    assert target is not None
    known = np.column_stack([found.x, found.theta])
    rng = np.random.default_rng(SEED)
    low, high = known.min(axis=0) - ROUND, known.max(axis=0) + ROUND
    targets: list[Pose] = []
    while len(targets) < effort.of(*FAR_OUT):
        x, theta = rng.uniform(low, high)
        if not (np.abs(known - [x, theta]) < FAR).all(axis=1).any():
            targets.append(target.in_plane(x, theta))
    return targets


def _on_map(name: str, effort: Effort) -> tuple[list[Cell], list[Plan]]:
    """Plans to the middles of random bins of a scene's map, and their row."""
    found = reach_map(load_scene(name), samples=effort.of(*SAMPLED))
    target, edges = found.scene.target, found.theta_edges
    assert target is not None
    hit = np.argwhere(found.landings > 0)
    chosen = hit[np.random.default_rng(MAP_SEED).permutation(len(hit))[: effort.of(*ON_MAP)]]
    middles = []
    for i, j in chosen:
        x = float(found.x_edges[i : i + 2].mean())
        middles.append(
            target.in_plane(x, None if edges is None else float(edges[j : j + 2].mean()))
        )
    plans = _planned(Planner(found.scene, compiling="no"), middles)
    said = collections.Counter(plan.status for plan in plans)
    kinds = (said["solved"], said["out_of_reach"], said["not_converged"])
    return [name, found.reachable, len(plans), *kinds], plans


def _map_table(rows: list[list[Cell]]) -> Table:
    columns = ("scene", "bins hit", "middles", "solved", "out_of_reach", "not_converged")
    return Table("reach-map", "Middles of a map's bins", columns, rows)


@dataclass(frozen=True)
class Followed:
    """Plans to a moving target, each from the last solved one: times [ms] of their solves and of
    the whole, and errors [m, rad] of what is sent of the solved ones."""

    solves: list[float]
    totals: list[float]
    errors: list[tuple[float, float]]

    @property
    def in_time(self) -> int:
        """How many plans were there when the next was due."""
        return sum(total <= 1e3 * TICK for total in self.totals)

    @property
    def worst(self) -> tuple[float, float]:
        """Largest errors [m, rad]; NaN without a solved plan."""
        x, theta = np.max(self.errors or [(math.nan, math.nan)], axis=0)
        return float(x), float(theta)


def follow(planner: Planner, count: int) -> Followed:
    """`count` plans to the planner's own target that swings, each from the last solved one."""
    plan = planner.plan()
    # The second plan builds what only warm plans need.
    plan = planner.plan(warm=plan)
    target, found = plan.target, Followed([], [], [])
    for k in range(count):
        swing = math.sin(2 * math.pi * k * TICK / PERIOD)
        theta = None if target.theta is None else target.theta + SWING[1] * swing
        moved = target.in_plane(target.plane_x - SWING[0] * swing, theta)
        after = planner.plan(moved, warm=plan)
        found.solves.append(1e3 * after.time["solve"])
        found.totals.append(1e3 * after.time["total"])
        if after.solved:
            plan = after
            found.errors.append(after.error_sent())
    return found


def _following(name: str, count: int) -> list[Cell]:
    scene = load_scene(name)
    assert scene.target is not None
    found = follow(warmed(scene, [scene.target], "wait"), count)
    x, theta = found.worst
    counts: list[Cell] = [name, count, len(found.errors), found.in_time]
    times = [*quantiles(found.solves, 50, 95), *quantiles(found.totals, 50)]
    return [*counts, *times, 1e3 * x, math.degrees(theta)]


def _following_table(rows: list[list[Cell]]) -> Table:
    columns = (
        *("scene", "plans", "solved", f"within {1e3 * TICK:.0f} ms", "solve, median [ms]"),
        *("solve, 95 % [ms]", "plan, median [ms]", "worst error [mm]", "worst error [deg]"),
    )
    return Table("reach-following", "Plans after a moving target", columns, rows)


def _every_target(inside: list[Plan], far: list[Plan]) -> Table:
    """What the picture shows: each target, what was said of it, the pose named instead."""
    columns = ("drawn", "x [m]", "theta [deg]", "status", "nearest x [m]", "nearest theta [deg]")
    rows: list[list[Cell]] = []
    for where, plans in (("in reach", inside), ("far out", far)):
        for plan in plans:
            _, x, theta, status, _ = _lost(plan)
            pose = plan.nearest
            named = [None, None] if pose is None else [pose.plane_x, _degrees(pose.theta)]
            rows.append([where, x, theta, status, *named])
    return Table("reach-targets", "Targets of `pose`, and what was said", columns, rows)


def _targets(name: str, count: int) -> list[Pose]:
    """Random targets in reach of a scene."""
    return list(itertools.islice(reachable_targets(load_scene(name), SEED), count))
