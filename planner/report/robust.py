"""Section: robust plans against nominal ones, on random targets, by exact throws."""

from __future__ import annotations

import collections
import dataclasses
import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...problems import COMPARED_METHODS, ROBUST_METHODS, Pose, load_scene
from ..plan import Planner
from ..result import Plan
from ..sweep import executor_of, scaled_error, sweep
from .page import Cell, Effort, Picture, Section, Table, shown
from .reach_study import reachable_targets

Array = npt.NDArray[np.float64]

#: Seed of the targets, and throws of each plan under uncertainty.
SEED, SAMPLES = 7, 256
#: Throws by which targets are left out.
FEW = 32
#: Targets whose nominal throw forgives +-10 ms already [m, scaled error] are left out.
HARD = 2e-3
#: The opening as it was not planned: friction and opening time times these.
FRICTION, OPENING = 0.7, 1.2
#: Scenes with their targets: quick, full.
TARGETS = {"delay": (1, 60), "hand-flip": (1, 15)}
#: Methods that all targets are planned with; the others and the baselines have the first
#: `SOME` targets.
QUICK_METHODS, MAIN = ("quiet", "joint-velocity"), ("auto", "quiet")
SOME = 5
#: Processes that share the targets.
WORKERS = 2


@dataclass(frozen=True)
class Robust:
    """One method at one target: 95 % spreads [m] over the nominal plan's, times [s] over the
    nominal plan's, error of what is sent (m, rad), the window's largest load, why there is no
    plan."""

    solved: bool
    ratio: float
    otherwise: float
    plan_time: float
    solve_time: float
    error: tuple[float, float]
    load: float | None
    why: str = ""


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
        f"plan counts as infinite. `auto` and `quiet` have all targets, the others the first "
        f"{SOME}, shared by {WORKERS} processes; nothing is compiled. Random targets in reach, "
        f"seed {SEED}; those whose nominal spread is under {1e3 * HARD:.0f} mm are left out.",
        "The methods: `quiet`, the hand follows the object's free flight while the pads may open; "
        "`scenarios`, four other openings in the NLP; `stationary`, constant joint accelerations; "
        "`auto`, `quiet` from several throws, and beside those that cannot be quiet "
        "`joint-velocity`, then `scenarios`. For comparison only: `quiet-exactly`, no load at "
        "all; `hand-velocity` and `joint-velocity`, these rates held constant. "
        "Peak load is the largest wrench between pads and object while they may open, over the "
        "full grip's limit.",
    )
    methods = QUICK_METHODS if effort.quick else (*ROBUST_METHODS, *COMPARED_METHODS)
    counts = {name: effort.of(*sizes) for name, sizes in TARGETS.items()}
    done, total = 0, sum(counts.values())
    for name, count in counts.items():
        nominal = list(itertools.islice(_nominal(_planner(name)), count))
        spreads = np.array([spread(plan) for plan in nominal])
        jobs = [
            (name, plan.target, [m for m in methods if m in MAIN or number < SOME])
            for number, plan in enumerate(nominal)
        ]
        found: dict[str, list[Robust]] = {method: [] for method in methods}
        with executor_of(1 if effort.quick else WORKERS, None) as executor:
            run = map if executor is None else executor.map
            for made in run(_studied, jobs):
                for method, robust in made.items():
                    found[method].append(robust)
                done += 1
                effort.tell(done, total)
        rows = [_row(method, found[method]) for method in methods]
        ratios = {m: np.array([robust.ratio for robust in found[m]]) for m in methods}
        section.add(
            f"Scene `{name}`: {len(nominal)} targets, nominal spread median "
            f"{1e3 * np.median(spreads):.1f} mm, worst {1e3 * spreads.max():.1f} mm."
        )
        section.add(_table(name, rows), _picture(name, ratios))
        told = {str(row[0]): row for row in rows}
        best = told[methods[0]]
        section.short.append(
            f"A gripper up to 10 ms early or late, `{name}`: `--robust {best[0]}` scatters "
            f"{shown(best[3])} times as much as the nominal throw in the median, "
            f"{shown(best[5])} times at most for 90 %, and plans {shown(best[11])} times as "
            "long."
        )
    return section


def _nominal(planner: Planner) -> Iterator[Plan]:
    """Nominal plans to random targets, those that forgive anyway left out."""
    for target in reachable_targets(planner.scene, SEED):
        plan = planner.plan(target)
        if plan.solved and spread(plan, FEW) > HARD:
            yield planner.plan(target)


def spread(plan: Plan, samples: int = SAMPLES) -> float:
    """95 % quantile [m] of the scaled error about the plan's own landing."""
    return float(np.quantile(sweep(plan, samples=samples).errors["scaled"], 0.95))


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


@cache
def _planner(name: str) -> Planner:
    """A process's own planner of a scene."""
    return Planner(load_scene(name), compiling="no")


def _studied(job: tuple[str, Pose, list[str]]) -> dict[str, Robust]:
    """Robust plans to one target, by method, against its nominal plan."""
    name, target, methods = job
    planner = _planner(name)
    planner.plan(target)
    nominal = planner.plan(target)
    usual, other = spread(nominal), otherwise(nominal)
    made = {}
    for method in methods:
        plan = planner.plan(target, robust=method)
        solved = plan.solved
        made[method] = Robust(
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


def _row(method: str, found: list[Robust]) -> list[Cell]:
    solved = [robust for robust in found if robust.solved]
    errors = [robust.error for robust in solved]
    worst = np.max(errors, axis=0) if errors else np.full(2, math.nan)
    slower = np.median([robust.plan_time for robust in found])
    solver = np.median([robust.solve_time for robust in found])
    loads = [robust.load for robust in solved if robust.load is not None]
    return [
        method,
        len(found),
        len(solved),
        *_quantiles([robust.ratio for robust in found], (50, 75, 90)),
        *_quantiles([robust.otherwise for robust in found], (50, 90)),
        1e3 * float(worst[0]),
        math.degrees(float(worst[1])),
        float(solver),
        float(slower),
        float(np.median(loads)) if loads else None,
        _causes(found),
    ]


def _causes(found: list[Robust]) -> Cell:
    """Why there are no plans, most frequent first."""
    counts = collections.Counter(robust.why for robust in found if not robust.solved)
    words = [f"{count} × {why}" for why, count in counts.most_common(2)]
    return "; ".join(words) or None


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
            "targets",
            "solved",
            "median",
            "75 %",
            "90 %",
            "otherwise, median",
            "otherwise, 90 %",
            "worst error [mm]",
            "worst error [deg]",
            "solve, times nominal",
            "plan, times nominal",
            "peak load, share of friction",
            "without a plan",
        ),
        rows,
        2,
    )


def _picture(name: str, ratios: dict[str, Array]) -> Picture:
    from .robust_picture import LEAST, draw_ratios

    def draw(path: Path) -> None:
        draw_ratios(ratios, path)

    caption = (
        f"Scene {name}: spread of robust plans over the nominal plans', a dot a target (no lower "
        f"than {LEAST:g}); × no plan; bar: median"
    )
    # In the order of the targets; infinite without a plan.
    dots: list[list[Cell]] = [
        [method, number, float(ratio)]
        for method, found in ratios.items()
        for number, ratio in enumerate(found, start=1)
    ]
    data = Table(f"robust-{name}-targets", "", ("method", "target", "spread / nominal"), dots)
    return Picture(f"robust-{name}", caption, draw, data)
