"""Section `robust`: robust plans against nominal ones, thrown under an uncertain opening."""

from __future__ import annotations

import collections
import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ...problems import COMPARED_METHODS, QUIET, ROBUST_METHODS, Pose, load_scene
from ..plan import Planner
from ..result import Plan
from ..show import BLACK, BLUE, GREY, RED, Cell, Row, Table, number, shown
from ..sweep import scaled_error, sweep
from .measure import reachable_targets, shared
from .page import Effort, Picture, ReportSection, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Seed of the targets, and throws of each plan under uncertainty.
SEED, SAMPLES = 7, 256
#: Targets whose nominal throw, thrown `FEW` times, spreads by less than `HARD` [m] under an
#: opening up to 10 ms early or late are left out: there is nothing to gain.
FEW, HARD = 32, 2e-3
#: An opening that no plan knew of: friction and opening time times these.
FRICTION, OPENING = 0.7, 1.2
#: Scenes with their targets: quick, full.
TARGETS = {"delay": (1, 60), "hand-flip": (1, 15)}
#: Methods that plan to all targets; the others plan to the first `SOME`.
QUICK_METHODS, MAIN, SOME = (QUIET, "joint-velocity"), ("auto", QUIET), 5
#: Where a target without a robust plan is drawn, and the least spread that is drawn.
LOST, LEAST = 20.0, 1e-4


def make(effort: Effort) -> ReportSection:
    """All methods, and those to compare with, on every target."""
    methods = QUICK_METHODS if effort.quick else (*ROBUST_METHODS, *COMPARED_METHODS)
    counts = {name: effort.of(*sizes) for name, sizes in TARGETS.items()}
    step, dots = effort.counter(sum(counts.values())), list[Row]()
    for scene, count in counts.items():
        nominal = list(itertools.islice(_nominal(_planner(scene)), count))
        jobs = [
            (scene, target, plan.target, [m for m in methods if m in MAIN or target <= SOME])
            for target, plan in enumerate(nominal, 1)
        ]
        for rows in shared(_studied, jobs, quick=effort.quick):
            dots += rows
            step()
    caption = (
        "Spread of robust plans over the nominal plan's; otherwise: with 30 % less friction and a "
        "20 % longer opening; no plan counts as infinite"
    )
    targets = Table("robust-targets", "Spread at each target", dots)
    pairs = itertools.product(counts, methods)
    rows = [_row(s, m, targets.where(scene=s, method=m)) for s, m in pairs]
    words = "Spread of robust plans over the nominal plan's: a dot a target, a bar the median"
    return ReportSection(
        "robust",
        "Throws that forgive timing",
        _figures(rows),
        [Table("robust", caption, rows), targets],
        [Picture("robust", words, _draw_ratios(targets))],
    )


def _figures(rows: list[Row]) -> list[str]:
    """What to take from it: the first method of each scene, which is the best one."""
    found = [
        f"A gripper up to 10 ms early or late, {SAMPLES} throws of each plan. Spread is the 95 % "
        "quantile of the scaled error."
    ]
    for scene in dict.fromkeys(row["scene"] for row in rows):
        first = next(row for row in rows if row["scene"] == scene)
        cell = {name: shown(value) for name, value in first.items()}
        found.append(
            f"`{scene}`, {cell['targets']} random targets: `--robust {cell['method']}` spreads "
            f"{cell['median']} times as much as the nominal throw in the median, {cell['90 %']} "
            "times at most for 90 %; with 30 % less friction and a 20 % longer opening "
            f"{cell['otherwise, median']} times in the median. It plans "
            f"{cell['plan, times nominal']} times as long."
        )
    return found


def _nominal(planner: Planner) -> Iterator[Plan]:
    """Nominal plans to random targets, without those that forgive anyway."""
    for target in reachable_targets(planner.scene, SEED):
        plan = planner.plan(target)
        if plan.solved and spread(plan, FEW) > HARD:
            yield plan


def spread(plan: Plan, samples: int = SAMPLES) -> float:
    """95 % quantile [m] of the scaled error about the plan's own landing."""
    return float(np.quantile(sweep(plan, samples=samples).errors["scaled"], 0.95))


def otherwise(plan: Plan) -> float:
    """The same about the planned landing, with friction and opening time not as planned."""
    scene = plan.scene
    contact = dataclasses.replace(scene.contact, friction=FRICTION * scene.contact.friction)
    assert scene.gripper.opening is not None and plan.throw is not None
    gripper = dataclasses.replace(scene.gripper, opening=OPENING * scene.gripper.opening)
    changed = dataclasses.replace(plan, scene=scene.replace(contact=contact, gripper=gripper))
    landing, pose = plan.throw.final.landing, sweep(changed, samples=SAMPLES).landings.pose
    length, angle = scene.object.length, plan.target.theta is not None
    error = scaled_error(pose[:, 0] - landing.x, pose[:, 1] - landing.theta, length, angle)
    return float(np.quantile(error, 0.95))


@cache
def _planner(name: str) -> Planner:
    """A process's own planner of a scene."""
    return Planner(load_scene(name), library=False)


def _studied(job: tuple[str, int, Pose, list[str]]) -> list[Row]:
    """Robust plans to one target against its nominal plan, a row for each method."""
    name, target, pose, methods = job
    planner, rows = _planner(name), list[Row]()
    # The first plan builds what the timed one needs.
    planner.plan(pose)
    nominal = planner.plan(pose)
    usual, other = spread(nominal), otherwise(nominal)
    for method in methods:
        plan = planner.plan(pose, robust=method)
        position, angle = plan.error_sent() if plan.solved else (math.nan, math.nan)
        row: Row = {
            "scene": name,
            "method": method,
            "target": target,
            "spread / nominal": spread(plan) / usual if plan.solved else None,
            "otherwise / nominal": otherwise(plan) / other if plan.solved else None,
            "plan, times nominal": _own(plan) / _own(nominal),
            "error [mm]": 1e3 * position if plan.solved else None,
            "error [deg]": math.degrees(angle) if plan.solved else None,
            "peak load": plan.peak_load,
            "why not": None if plan.solved else plan.message,
        }
        rows.append(row)
    return rows


def _own(plan: Plan) -> float:
    """Time [s] of a plan without what is built once for all."""
    return plan.time["total"] - plan.time["build"]


def _row(scene: str, method: str, found: Sequence[Row]) -> Row:
    """All targets of one method."""
    causes = collections.Counter(row["why not"] for row in found if row["why not"])

    def cells(name: str) -> list[float]:
        return [number(row[name], math.inf) for row in found]

    def worst(name: str) -> Cell:
        return max((v for v in cells(name) if math.isfinite(v)), default=None)

    return {
        "scene": scene,
        "method": method,
        "targets": len(found),
        "solved": len(found) - causes.total(),
        "median": _quantile(cells("spread / nominal"), 50),
        "90 %": _quantile(cells("spread / nominal"), 90),
        "otherwise, median": _quantile(cells("otherwise / nominal"), 50),
        "otherwise, 90 %": _quantile(cells("otherwise / nominal"), 90),
        "worst error [mm]": worst("error [mm]"),
        "worst error [deg]": worst("error [deg]"),
        "plan, times nominal": float(np.median(cells("plan, times nominal"))),
        "peak load, worst": worst("peak load"),
        "without a plan": "; ".join(f"{n} × {why}" for why, n in causes.most_common(2)) or None,
    }


def _quantile(values: list[float], share: float) -> Cell:
    """A quantile of numbers of which some may be infinite: one of them, not a mean of two."""
    found = float(np.percentile(values, share, method="higher"))
    return found if math.isfinite(found) else "no plan"


def _draw_ratios(rows: Table) -> Figure:
    """Spread of robust plans over the nominal plan's, a dot a target, a bar at the median."""
    scenes = list(dict.fromkeys(rows.column("scene")))
    figure, grid = panels(6.0 * len(scenes), 4.5, 1, len(scenes), sharey=True)
    rng = np.random.default_rng(0)
    for axis, scene in zip(grid[0], scenes, strict=True):
        some = rows.where(scene=scene)
        methods = list(dict.fromkeys(str(row["method"]) for row in some))
        for place, method in enumerate(methods):
            ratios = [row["spread / nominal"] for row in some if row["method"] == method]
            found = np.array([number(ratio) for ratio in ratios])
            solved = np.isfinite(found)
            height = np.where(solved, np.maximum(found, LEAST), LOST)
            across = place + rng.uniform(-0.25, 0.25, found.size)
            axis.plot(across[solved], height[solved], ".", color=BLUE, ms=5)
            axis.plot(across[~solved], height[~solved], "x", color=RED, ms=5)
            # One of them, not a mean of two of which one may have no plan.
            middle = float(np.percentile(height, 50, method="higher"))
            axis.plot([place - 0.35, place + 0.35], [middle, middle], color=BLACK, lw=2)
        axis.axhline(1.0, color=GREY, lw=0.8, ls="--")
        axis.set(yscale="log", title=str(scene))
        axis.set_xticks(range(len(methods)), methods, rotation=30, ha="right")
    grid[0][0].set_ylabel("spread / nominal spread (× : no plan)")
    return figure
