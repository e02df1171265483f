"""Section: robust plans against nominal ones, on random targets, by exact throws."""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...problems.load import load_scene
from ...problems.robust import COMPARED, METHODS
from ..plan import Plan
from ..planner import Planner
from ..reach_study import reachable_targets
from ..sweep import sweep
from ..sweep_statistics import scaled_error
from .page import Cell, Effort, Picture, Section, Table

Array = npt.NDArray[np.float64]

#: Seed of the targets, and throws of each plan under uncertainty.
SEED, SAMPLES = 7, 256
#: Targets whose nominal throw forgives +-10 ms already [m, scaled error] are left out.
HARD = 2e-3
#: The opening as it was not planned: friction and opening time times these.
FRICTION, OPENING = 0.7, 1.2
#: Scenes with their targets: quick, full.
TARGETS = {"delay": (2, 60), "hand-flip": (2, 25)}
QUICK_METHODS = ("quiet", "joint-velocity")


@dataclass(frozen=True)
class Robust:
    """One method at one target: its plan, and 95 % spreads [m] over the nominal plan's."""

    plan: Plan
    seconds: float
    ratio: float
    otherwise: float


def make(effort: Effort) -> Section:
    """The section: all methods and baselines on every target."""
    section = Section("robust", "Throws that forgive timing")
    section.add(
        f"For every target a nominal plan and one by each method, thrown {SAMPLES} times by the "
        "exact sliding pivot along what is sent, with an opening delay uniform in ±10 ms. Spread "
        "is the 95 % quantile of the scaled landing error (position and half the bar's length "
        "times the angle) about the plan's own landing; tables give it as a share of the nominal "
        f"plan's. `otherwise`: the same with friction {100 * (1 - FRICTION):.0f} % lower and the "
        f"opening {100 * (OPENING - 1):.0f} % longer, which no plan knew of. A target without a "
        f"plan counts as infinite. Nothing is compiled. Random targets in reach, seed {SEED}; "
        f"those whose nominal spread is under {1e3 * HARD:.0f} mm already are left out."
    )
    methods = QUICK_METHODS if effort.quick else (*METHODS, *COMPARED)
    total = len(TARGETS) * len(methods)
    for number, (name, sizes) in enumerate(TARGETS.items()):
        planner = Planner(load_scene(name), compiling="no")
        nominal = list(itertools.islice(_nominal(planner), effort.of(*sizes)))
        spreads = np.array([spread(plan) for plan in nominal])
        rows, ratios = [], {}
        for k, method in enumerate(methods):
            effort.tell(number * len(methods) + k, total)
            found = [_made(planner, plan, method) for plan in nominal]
            rows.append(_row(method, found, nominal))
            ratios[method] = np.array([robust.ratio for robust in found])
        section.add(
            f"Scene `{name}`: {len(nominal)} targets, nominal spread median "
            f"{1e3 * np.median(spreads):.1f} mm, worst {1e3 * spreads.max():.1f} mm."
        )
        section.add(_table(name, rows), _picture(name, ratios))
    return section


def _nominal(planner: Planner) -> Iterator[Plan]:
    """Nominal plans to random targets, those that forgive anyway left out."""
    for target in reachable_targets(planner.scene, SEED):
        plan = planner.plan(target)
        if plan.solved and spread(plan) > HARD:
            yield planner.plan(target)


def spread(plan: Plan) -> float:
    """95 % quantile [m] of the scaled error about the plan's own landing."""
    return float(np.quantile(sweep(plan, samples=SAMPLES).errors["scaled"], 0.95))


def otherwise(plan: Plan) -> float:
    """The same about the planned landing, with friction and opening not as planned."""
    scene = plan.scene
    contact = dataclasses.replace(scene.contact, friction=FRICTION * scene.contact.friction)
    assert scene.gripper.opening is not None
    gripper = dataclasses.replace(scene.gripper, opening=OPENING * scene.gripper.opening)
    changed = dataclasses.replace(plan, scene=scene.replace(contact=contact, gripper=gripper))
    assert plan.throw is not None
    landing, pose = plan.throw.final.landing, sweep(changed, samples=SAMPLES).landings.pose
    length, angle = scene.object.length, plan.target.theta is not None
    error = scaled_error(pose[:, 0] - landing.x, pose[:, 1] - landing.theta, length, angle)
    return float(np.quantile(error, 0.95))


def _made(planner: Planner, nominal: Plan, method: str) -> Robust:
    """The robust plan to a nominal plan's target."""
    plan = planner.plan(nominal.target, robust=method)
    seconds = plan.time["total"] - plan.time["build"]
    if not plan.solved:
        return Robust(plan, seconds, math.inf, math.inf)
    return Robust(
        plan, seconds, spread(plan) / spread(nominal), otherwise(plan) / otherwise(nominal)
    )


def _row(method: str, found: list[Robust], nominal: list[Plan]) -> list[Cell]:
    solved = [robust for robust in found if robust.plan.solved]
    errors = [robust.plan.error_sent() for robust in solved]
    worst = np.max(errors, axis=0) if errors else np.full(2, math.nan)
    usual = np.array([plan.time["total"] - plan.time["build"] for plan in nominal])
    slower = np.median([robust.seconds for robust in found] / usual)
    solves = np.array([robust.plan.time["solve"] for robust in found])
    solver = np.median(solves / [plan.time["solve"] for plan in nominal])
    loads = [robust.plan.peak_load for robust in solved if robust.plan.peak_load is not None]
    return [
        method,
        len(solved),
        *_quantiles([robust.ratio for robust in found], (50, 75, 90)),
        *_quantiles([robust.otherwise for robust in found], (50, 90)),
        1e3 * float(worst[0]),
        math.degrees(float(worst[1])),
        float(solver),
        float(slower),
        float(np.median(loads)) if loads else None,
    ]


def _quantiles(values: list[float], shares: tuple[int, ...]) -> list[Cell]:
    """Quantiles of numbers of which some may be infinite: one of them, not a mean of two."""
    found = np.percentile(values, shares, method="higher")
    return [float(v) if math.isfinite(v) else "no plan" for v in found]


def _table(name: str, rows: list[list[Cell]]) -> Table:
    return Table(
        f"robust-{name}",
        f"Scene {name}: spread as a share of the nominal plan's",
        (
            "method",
            "solved",
            "median",
            "75 %",
            "90 %",
            "otherwise, median",
            "90 %",
            "worst error [mm]",
            "[deg]",
            "solve, times nominal",
            "plan, times nominal",
            "peak load, share of friction",
        ),
        rows,
        2,
    )


def _picture(name: str, ratios: dict[str, Array]) -> Picture:
    def draw(path: Path) -> None:
        from .robust_picture import draw_ratios

        draw_ratios(ratios, path)

    caption = f"Scene {name}: spread of robust plans over the nominal plans', a dot a target"
    return Picture(f"robust-{name}", caption, draw)
