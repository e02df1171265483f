"""Section `robust`: robust plans against plain ones in random scenes, judged on fresh samples."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from throwplan import (
    Cost,
    Distribution,
    InputError,
    Plan,
    Planner,
    Scene,
    Uncertainty,
    load_scene,
    sweep,
)
from throwplan.pictures import Row, Table

from .measure import number, reachable_targets
from .page import Effort, Section
from .processes import shared

#: Seed of the scenes.
SEED = 7
#: Number of samples of the sweep that judges a plan.
SAMPLES = 2000
#: Seed of these samples; planning uses another.
FRESH = 1
#: Base scenes: six arms and a free hand, poses, a position, a cup.
SCENES = (
    *("delay", "fr3", "iiwa14", "gen3", "ur5e", "xarm7"),
    *("hand-flip", "near-cup", "box", "flip"),
)
#: Number of scenes by their uncertain parameters: quick, full.
KINDS = {"delay": (1, 12), "delay, friction, patch radius, mass": (1, 12), "all": (1, 12)}
#: Least 95 % error [m] of a plain plan in the study; a smaller one leaves nothing to gain.
HARD = 2e-3
#: Most targets tried in a scene.
TARGETS = 12
#: Success rates differ if they do by more than this number of standard deviations.
DEVIATIONS = 2.0
#: Errors differ if they do by more than this share.
SHARE = 0.05


def make(effort: Effort) -> Section:
    """`--robust` against the plain plan in every scene."""
    jobs = [(kind, n) for kind, sizes in KINDS.items() for n in range(effort.of(*sizes))]
    step, rows = effort.counter(len(jobs)), list[Row]()
    for found in shared(_studied, jobs, quick=effort.quick):
        rows += found
        step()
    some = [_row(kind, [row for row in rows if row["uncertain"] == kind]) for kind in KINDS]
    return Section(
        "Robustness",
        f"`throwplan plan --robust` against the plan without a price of the load on the pads "
        "(*plain*: `[cost] quiet = 0`), in random scenes of six arms and a free hand whose plain "
        f"plan has a 95 % pose error above {1e3 * HARD:g} mm. Each is thrown {SAMPLES:,} times "
        "by samples that planning did not use. *Worse*: robust plans that succeed significantly "
        "less often, or as often with a larger error. Processor time, with building.",
        [Table("robust", "Robust against plain plans", some)],
        [Table("robust-scenes", "every scene", rows)],
    )


def scene_of(kind: str, count: int) -> Scene:
    """A scene with random object, pads, opening and uncertainty; count: of its kind."""
    rng = np.random.default_rng((SEED, list(KINDS).index(kind), count))
    scene = load_scene(SCENES[count % len(SCENES)])
    bar, pads, grip, cup = scene.object, scene.contact, scene.gripper, scene.cup is not None
    size, heavy = (float(np.exp(rng.uniform(-w, w))) for w in (0.0 if cup else 0.25, 0.45))
    bar = bar.changed(
        mass=heavy * bar.mass,
        inertia=heavy * size**2 * bar.inertia,
        length=size * bar.length,
        com=size * bar.com,
    )
    friction, radius = rng.uniform(0.5, 1.1), rng.uniform(0.0025, 0.006)
    pads = pads.changed(friction=friction, patch_radius=radius)
    if grip.file is None:
        grip = grip.changed(opening=rng.uniform(0.03, 0.08))
    uncertain = Uncertainty(**_uncertain(kind, rng))
    return scene.changed(object=bar, contact=pads, gripper=grip, uncertainty=uncertain)


def _uncertain(kind: str, rng: np.random.Generator) -> dict[str, Any]:
    """Random distributions of the uncertain parameters of a kind of scene."""

    def share(low: float, high: float) -> Distribution:
        return Distribution(normal=rng.uniform(low, high), relative=True)

    found = {"delay": Distribution(uniform=rng.uniform(0.003, 0.012))}
    found["opening"] = Distribution(uniform=0.0)
    if kind == "delay":
        return found
    found |= {"friction": share(0.05, 0.15), "patch_radius": share(0.05, 0.15)}
    found |= {"mass": share(0.01, 0.05)}
    if kind == "all":
        found |= {"opening": share(0.05, 0.15)}
        for name, low, high in (
            ("com_offset", 0.0005, 0.003),
            ("grasp_offset", 0.0005, 0.002),
            ("grasp_angle", math.radians(0.2), math.radians(1.0)),
        ):
            found[name] = Distribution(normal=rng.uniform(low, high))
    return found


def judged(plan: Plan) -> tuple[np.ndarray, float]:
    """Flags of the fresh samples that succeed, and the 95 % pose error [m]."""
    found = sweep(plan, SAMPLES, FRESH)
    error = found.to_dict()["quantiles"]["scaled"]["95"]
    return found.success, math.inf if error is None else float(error)


def is_worse(plain: tuple[np.ndarray, float], robust: tuple[np.ndarray, float]) -> bool:
    """Whether the robust plan is significantly worse than the plain one."""
    lost = int((plain[0] & ~robust[0]).sum())
    gained = int((robust[0] & ~plain[0]).sum())
    noise = DEVIATIONS * math.sqrt(lost + gained)
    if abs(lost - gained) > noise:
        return lost > gained
    return robust[1] > (1 + SHARE) * plain[1]


def _studied(job: tuple[str, int]) -> list[Row]:
    """The loud and the robust plan of one scene; no row without a loud one."""
    kind, count = job
    scene = scene_of(kind, count)
    try:
        planner = Planner(scene, library=False)
        loud = Planner(scene.replace(cost=Cost(quiet=0.0)), library=False)
    except InputError:
        return []
    for target in itertools.islice(reachable_targets(scene, SEED + count), TARGETS):
        plain = loud.plan(target)
        if not plain.solved:
            continue
        before = judged(plain)
        if before[1] < HARD:
            continue
        started = time.process_time()
        robust = planner.plan(target, robust=True)
        seconds = time.process_time() - started
        after = judged(robust)
        row: Row = {
            "uncertain": kind,
            "scene": scene.name,
            "count": count,
            "plain success [%]": 100 * float(before[0].mean()),
            "robust success [%]": 100 * float(after[0].mean()),
            "plain error [mm]": 1e3 * before[1],
            "robust error [mm]": 1e3 * after[1],
            "times less": before[1] / after[1],
            "worse": int(is_worse(before, after)),
            "plan [s]": seconds,
        }
        return [row]
    return []


def _row(kind: str, found: Sequence[Row]) -> Row:
    """All scenes of one kind."""

    def cells(name: str) -> list[float]:
        return [number(row[name]) for row in found] or [math.nan]

    return {
        "uncertain": kind,
        "scenes": len(found),
        "95 % error, plain [mm]": float(np.median(cells("plain error [mm]"))),
        "robust [mm]": float(np.median(cells("robust error [mm]"))),
        "plain over robust, median": float(np.median(cells("times less"))),
        "least": min(cells("times less")),
        "success, plain [%]": float(np.mean(cells("plain success [%]"))),
        "robust [%]": float(np.mean(cells("robust success [%]"))),
        "worse": int(sum(row["worse"] == 1 for row in found)),
        "plan, median [s]": float(np.median(cells("plan [s]"))),
        "longest [s]": max(cells("plan [s]")),
    }
