"""Section: how many random targets are thrown to, how fast, and what is said of the others.

Targets in reach come from random exact throws (`planner.reach_study`), not from the
planner's table. Targets out of reach are far from every landing of sampled releases; one
that is solved all the same, under the exact check, was in reach after all.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import math
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene, load_scene
from ..check import make_mover
from ..compile import Compile, c_compiler
from ..plan import Planner
from ..result import Status
from ..search import ReleaseSampler
from ..sweep import executor_of
from .following import following
from .map_targets import map_targets
from .page import Cell, Effort, Picture, Section, Table
from .reach_study import Outcome, outcomes, reachable_targets
from .rivals import rivals
from .warmed import warmed

#: Seed of the targets.
SEED = 1
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
#: Plans before any is timed: the rows they ask for are compiled.
FIRST = 50
#: Processes that make the targets; nothing is timed meanwhile.
WORKERS = 2
#: Sampled releases that say what is in reach, in draws of this many states.
DRAWS, DRAW = (2, 10), 20_000
#: Targets out of reach are farther than this from all of them: x [m] or theta [rad] ...
FAR = (0.1, math.radians(20))
#: ... and looked for this far beyond the landings.
ROUND = np.array([1.0, 2.0])
#: Middles of a map's bins that are thrown to, and the map's sampled states.
ON_MAP, SAMPLED = 40, 200_000


def make(effort: Effort) -> Section:
    """The section; compiled functions are made first where a C compiler is there."""
    section = Section("reach", "Any reachable target")
    section.add(
        "Targets are where random exact throws land: a polynomial run-up to a random state, "
        "opening at constant acceleration, brake; sent at 1 kHz, with all limits, 10 % of the "
        "grip kept free, workspace and cup checked. The planner's own table has no part in "
        f"them. Seed {SEED}. Errors are of what is sent, by the exact model; times are of a "
        "whole plan (guess, solve, Ruckig, check, correction) and of its solves, without what is "
        "built once for all plans."
    )
    steps = [name for name, sizes in TARGETS.items() if effort.of(*sizes)]
    counts = [effort.of(*TARGETS[name]) for name in steps]
    total, rows, lost, notes = len(steps) + 5, [], [], []
    kept: dict[str, tuple[Planner, list[Outcome]]] = {}
    effort.tell(0, total)
    with executor_of(1 if effort.quick else WORKERS, None) as executor:
        run = map if executor is None else executor.map
        inside_of = dict(zip(steps, run(_targets, steps, counts), strict=True))
    for done, (name, targets) in enumerate(inside_of.items()):
        effort.tell(done, total)
        scene = load_scene(name)
        for compiling in ("wait", "no"):
            first = targets[: effort.of(2, FIRST)]
            planner = warmed(scene, first, compiling)
            some = targets if compiling == "wait" else targets[: effort.of(10, 100)]
            results = list(outcomes(planner, some))
            ready = compiling == "wait" and c_compiler() is not None
            rows.append([name, "yes" if ready else "no", None, *_figures(results)])
            if name in PREPARED and not effort.quick:
                ahead, words = _prepared(scene, first, compiling)
                notes += words
                figures = _figures(list(outcomes(ahead, some)))
                rows.append([name, "yes" if ready else "no", ahead.prepared, *figures])
            if compiling == "wait":
                kept[name] = planner, results
                lost += [[name, *_unsolved(result)] for result in results if not result.plan.solved]
    section.add(_table("reach-inside", "Random targets in reach", rows))
    if any(row[2] for row in rows):
        took = f" Making them took {'; '.join(notes)}." if notes else ""
        section.add(
            "`prepared`: how many solved throws `Planner.prepare` had laid by beforehand, in the "
            f"cache folder, for plans to start from.{took}"
        )
    section.add(_lost("reach-lost", "Targets in reach without a throw, and why", lost))
    effort.tell(len(steps), total)
    planner, inside = kept["pose"]
    draws = effort.of(*DRAWS)
    beyond = outside(planner.scene, effort.of(5, 300), SEED, draws)
    far = list(outcomes(planner, beyond))
    section.add(*_outside(far, draws * DRAW))
    section.add(
        Picture(
            "reach-map",
            "Scene pose: targets in reach and out of reach, with the nearest pose that the "
            "planner named for those",
            lambda path: _draw(inside, far, path),
            _every(inside, far),
        )
    )
    effort.tell(len(steps) + 1, total)
    section.add(following(effort))
    effort.tell(len(steps) + 2, total)
    section.add(
        _truer(effort),
        "The sliding pivot counts by default, as it is in the published planner. Where pads are "
        'rigid and touch all over, `[tolerance] model = "ls-step"` is the nearer law (section '
        "models): the same NLP, corrected until the limit surface lands what is sent.",
    )
    effort.tell(len(steps) + 3, total)
    if not effort.quick:
        section.add(*map_targets(SAMPLED, ON_MAP))
    effort.tell(len(steps) + 4, total)
    section.short.append(_short(rows))
    section.add(rivals(planner.scene, [r.target for r in inside[: effort.of(3, 50)]]))
    return section


def _targets(name: str, count: int) -> list[Pose]:
    """Random targets in reach of a scene."""
    return list(itertools.islice(reachable_targets(load_scene(name), SEED), count))


def _prepared(scene: Scene, first: list[Pose], compiling: Compile) -> tuple[Planner, list[str]]:
    """A planner with prepared throws, and what these took if they were not there."""
    planner, made = warmed(scene, first, compiling), []
    start = time.perf_counter()
    planner.prepare(progress=lambda done, total: made.append(done))
    seconds = time.perf_counter() - start
    return planner, [f"{seconds:.0f} s for `{scene.name}`"] if made else []


def _percentiles(values: list[float]) -> list[Cell]:
    return [float(v) for v in np.percentile(values, [50, 99])]


def _own(result: Outcome) -> float:
    """A plan's time [s] without what is built (and compiled) once for all plans."""
    return result.seconds - result.plan.time["build"]


def _figures(results: list[Outcome]) -> list[Cell]:
    """Counts, times [ms] and worst errors [mm, deg] of some plans."""
    solved = [result for result in results if result.plan.solved]
    worst = np.max([result.error for result in solved], axis=0) if solved else [math.nan] * 2
    return [
        len(results),
        len(solved),
        *_percentiles([1e3 * _own(result) for result in results]),
        *_percentiles([1e3 * result.plan.time["solve"] for result in results]),
        1e3 * float(worst[0]),
        math.degrees(float(worst[1])),
    ]


def _short(rows: list[list[Cell]]) -> str:
    """How much is thrown to, and how fast."""
    compiled = [row for row in rows if row[1] == "yes"] or rows
    words = []
    for name, _, prepared, count, solved, plan, *_ in compiled:
        if prepared is None:
            words.append(f"`{name}` {solved} of {count}, {plan:.3g} ms a plan")
        else:
            words[-1] += f" ({plan:.3g} ms prepared)"
    return f"Random targets in reach that are thrown to: {'; '.join(words)}."


def _table(name: str, caption: str, rows: list[list[Cell]]) -> Table:
    columns = (
        "scene",
        "compiled",
        "prepared",
        "targets",
        "solved",
        "plan, median [ms]",
        "plan, 99 % [ms]",
        "solve, median [ms]",
        "solve, 99 % [ms]",
        "worst error [mm]",
        "worst error [deg]",
    )
    return Table(name, caption, columns, rows)


def _unsolved(result: Outcome) -> list[Cell]:
    pose = result.target
    return [pose.plane_x, _degrees(pose.theta), result.plan.status, result.plan.message]


def _lost(name: str, caption: str, rows: list[list[Cell]]) -> Table | str:
    """The targets that were not reached, or words that there are none."""
    if not rows:
        return f"{caption}: none."
    return Table(name, caption, ("scene", "x [m]", "theta [deg]", "status", "why"), rows, 4)


def outside(scene: Scene, count: int, seed: int, draws: int = DRAWS[1]) -> list[Pose]:
    """Targets far from every landing of so many draws of releases."""
    sampler = ReleaseSampler(scene, make_mover(scene))
    assert scene.target is not None
    landings = []
    for draw in range(draws):
        x, theta, _ = sampler.draw(DRAW, seed=1000 + draw).landings(scene.target.z, scene.gravity)
        landings.append(np.column_stack([x, theta])[np.isfinite(x)])
    known = np.vstack(landings)
    rng = np.random.default_rng(seed)
    low, high = known.min(axis=0), known.max(axis=0)
    found: list[Pose] = []
    while len(found) < count:
        x, theta = rng.uniform(low - ROUND, high + ROUND)
        near = (np.abs(known - [x, theta]) < FAR).all(axis=1)
        if not near.any():
            found.append(scene.target.in_plane(x, theta))
    return found


def _outside(results: list[Outcome], sampled: int) -> list[Table | str]:
    """What is said of targets far from all sampled landings."""
    counts = collections.Counter(result.plan.status for result in results)
    names: tuple[Status, ...] = ("out_of_reach", "solved", "not_converged")
    times = _percentiles([1e3 * _own(result) for result in results])
    columns = ("targets", *names, "plan, median [ms]", "plan, 99 % [ms]")
    caption = (
        f"Scene pose: targets farther than {100 * FAR[0]:.0f} cm or "
        f"{math.degrees(FAR[1]):.0f} deg from every landing of {sampled:,} sampled states"
    )
    row = [len(results), *(counts.get(name, 0) for name in names), *times]
    lost = [["pose", *_unsolved(r)] for r in results if r.plan.status == "not_converged"]
    return [
        Table("reach-outside", caption, columns, [row]),
        "A solved one is no mistake: its throw passed the exact check, so the samples, not the "
        "planner, had stopped short of the edge of what is in reach.",
        _lost("reach-outside-lost", "Neither thrown nor called out of reach", lost),
    ]


def _truer(effort: Effort) -> Table:
    """The landing by the limit surface, with either model as the one that counts."""
    scene, rows = load_scene("pose"), []
    targets = list(itertools.islice(reachable_targets(scene, SEED), effort.of(4, 60)))
    for model in ("sp", "ls-step"):
        tolerance = dataclasses.replace(scene.tolerance, model=model)
        planner = warmed(scene.replace(tolerance=tolerance), targets, "wait")
        plans = [result.plan for result in outcomes(planner, targets)]
        throws = [plan.throw.limit_surface.miss(plan.target) for plan in plans if plan.throw]
        x, theta = np.abs(throws).T
        rows.append(
            [model, len(plans), sum(plan.solved for plan in plans)]
            + [float(v) for v in 1e3 * np.percentile(x, [50, 100])]
            + [float(v) for v in np.degrees(np.percentile(theta, [50, 100]))]
            + [1e3 * float(np.median([plan.time[k] for plan in plans])) for k in ("solve", "total")]
        )
    return Table(
        "reach-model",
        "Scene pose: where the limit surface lands what is sent, by the model that the landing "
        "is made true for",
        (
            *("model that counts", "targets", "solved", "x, median [mm]", "x, worst [mm]"),
            *(
                "theta, median [deg]",
                "theta, worst [deg]",
                "solve, median [ms]",
                "plan, median [ms]",
            ),
        ),
        rows,
    )


def _every(inside: list[Outcome], far: list[Outcome]) -> Table:
    """What the picture shows: each target, what was said of it, the pose named instead."""
    columns = ("drawn", "x [m]", "theta [deg]", "status", "nearest x [m]", "nearest theta [deg]")
    rows: list[list[Cell]] = []
    for where, results in (("in reach", inside), ("far out", far)):
        for result in results:
            x, theta, status, _ = _unsolved(result)
            pose = result.plan.nearest
            named = [None, None] if pose is None else [pose.plane_x, _degrees(pose.theta)]
            rows.append([where, x, theta, status, *named])
    return Table("reach-targets", "", columns, rows)


def _degrees(angle: float | None) -> float | None:
    return None if angle is None else math.degrees(angle)


def _draw(inside: list[Outcome], far: list[Outcome], path: Path) -> None:
    """Targets in x and theta, with what was said of them."""
    from .reach_picture import draw_targets

    def places(poses: list[Pose]) -> npt.NDArray[np.float64]:
        return np.array([[pose.plane_x, pose.theta or 0.0] for pose in poses]).reshape(-1, 2)

    named = [r for r in far if r.plan.nearest is not None]
    draw_targets(
        path,
        solved=places([r.target for r in inside + far if r.plan.solved]),
        lost=places([r.target for r in inside + far if r.plan.status == "not_converged"]),
        outside=places([r.target for r in named]),
        nearest=places([r.plan.nearest for r in named if r.plan.nearest is not None]),
    )
