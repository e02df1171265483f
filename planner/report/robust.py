"""Section `robust`: robust plans against nominal ones, thrown under an uncertain opening."""

from __future__ import annotations

import collections
import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from ...problems import COMPARED_METHODS, ROBUST_METHODS, Pose, load_scene
from ..plan import Planner
from ..result import Plan
from ..sweep import scaled_error, sweep
from .drawing import draw_ratios
from .measure import reachable_targets, shared
from .page import Cell, Effort, Picture, ReportSection, ReportTable, Row, shown

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
QUICK_METHODS, MAIN, SOME = ("quiet", "joint-velocity"), ("auto", "quiet"), 5


@dataclass(frozen=True)
class RobustPlan:
    """One method at one target.

    ratio, otherwise: 95 % spread over the nominal plan's, infinite without a plan, as planned
    and with another friction and opening time; plan_time, solve_time: over the nominal plan's;
    error: (m, rad) of what is sent; load: the largest wrench over the grip's friction limit.
    """

    solved: bool
    ratio: float
    otherwise: float
    plan_time: float
    solve_time: float
    error: tuple[float, float]
    load: float | None
    why: str = ""


def make(effort: Effort) -> ReportSection:
    """All methods, and those to compare with, on every target."""
    methods = QUICK_METHODS if effort.quick else (*ROBUST_METHODS, *COMPARED_METHODS)
    counts = {name: effort.of(*sizes) for name, sizes in TARGETS.items()}
    step, rows, dots = effort.counter(sum(counts.values())), list[Row](), list[Row]()
    for scene, count in counts.items():
        nominal = list(itertools.islice(_nominal(_planner(scene)), count))
        jobs = [
            (scene, plan.target, [m for m in methods if m in MAIN or number < SOME])
            for number, plan in enumerate(nominal)
        ]
        found: dict[str, list[RobustPlan]] = {method: [] for method in methods}
        for made in shared(_studied, jobs, quick=effort.quick):
            for method, robust in made.items():
                found[method].append(robust)
            step()
        for method, some in found.items():
            key: Row = {"scene": scene, "method": method}
            rows.append(key | _row(some))
            for number, one in enumerate(some, 1):
                dots.append(key | {"target": number, "spread / nominal": one.ratio})
    caption = (
        "Spread of robust plans over the nominal plan's; otherwise: with 30 % less friction and a "
        "20 % longer opening; no plan counts as infinite"
    )
    targets = ReportTable("robust-targets", "Spread at each target", dots)
    words = "Spread of robust plans over the nominal plan's: a dot a target, a bar the median"
    return ReportSection(
        "robust",
        "Throws that forgive timing",
        _figures(rows),
        [ReportTable("robust", caption, rows), targets],
        [Picture("robust", words, lambda path: draw_ratios(targets, path))],
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
    return Planner(load_scene(name), compiling="no")


def _studied(job: tuple[str, Pose, list[str]]) -> dict[str, RobustPlan]:
    """Robust plans to one target, by method, against its nominal plan."""
    name, target, methods = job
    planner = _planner(name)
    # The first plan builds what the timed one needs.
    planner.plan(target)
    nominal = planner.plan(target)
    usual, other = spread(nominal), otherwise(nominal)
    made = {}
    for method in methods:
        plan = planner.plan(target, robust=method)
        solved = plan.solved
        made[method] = RobustPlan(
            solved,
            spread(plan) / usual if solved else math.inf,
            otherwise(plan) / other if solved else math.inf,
            _own(plan) / _own(nominal),
            plan.time["solve"] / nominal.time["solve"],
            plan.error_sent() if solved else (math.nan, math.nan),
            plan.peak_load,
            "" if solved else plan.message,
        )
    return made


def _own(plan: Plan) -> float:
    """Time [s] of a plan without what is built once for all."""
    return plan.time["total"] - plan.time["build"]


def _row(found: list[RobustPlan]) -> Row:
    solved = [robust for robust in found if robust.solved]
    worst = np.max([robust.error for robust in solved] or [(math.nan, math.nan)], axis=0)
    loads = [robust.load for robust in solved if robust.load is not None]
    causes = collections.Counter(robust.why for robust in found if not robust.solved)
    ratios, others = ([getattr(r, k) for r in found] for k in ("ratio", "otherwise"))
    return {
        "targets": len(found),
        "solved": len(solved),
        "median": _quantile(ratios, 50),
        "90 %": _quantile(ratios, 90),
        "otherwise, median": _quantile(others, 50),
        "otherwise, 90 %": _quantile(others, 90),
        "worst error [mm]": 1e3 * float(worst[0]),
        "worst error [deg]": math.degrees(float(worst[1])),
        "solve, times nominal": float(np.median([robust.solve_time for robust in found])),
        "plan, times nominal": float(np.median([robust.plan_time for robust in found])),
        "peak load": float(np.median(loads)) if loads else None,
        "without a plan": "; ".join(f"{n} × {why}" for why, n in causes.most_common(2)) or None,
    }


def _quantile(values: list[float], share: float) -> Cell:
    """A quantile of numbers of which some may be infinite: one of them, not a mean of two."""
    found = float(np.percentile(values, share, method="higher"))
    return found if math.isfinite(found) else "no plan"
