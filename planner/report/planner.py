"""Section: the planner's error against its run time, over meshes, integrators and solvers."""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...problems.load import load_scene
from ...problems.scene import Pose, Scene
from ..check import throw
from ..compiled import Compile
from ..correction import Search
from ..guess import guess_from
from ..motion import opening_start, planned_motion
from ..numbers import bounds, opening_nodes, parameter_values
from ..planner import Planner
from ..reach_study import reachable_targets
from ..smooth import SmoothingError, send
from .page import Cell, Effort, Picture, Section, Table
from .pareto import pareto

Array = npt.NDArray[np.float64]

#: Seed of the targets; scenes with their targets: quick, full.
SEED, TARGETS = 2, {"pose": (4, 30), "hand-flip": (4, 30)}
#: Each setting by itself, the others as they usually are: quick, full.
CARRY = ((6,), (3, 4, 5, 6, 8, 10, 15, 20))
OPENING = ((4, 8, 16), (4, 6, 8, 10, 12, 16, 24, 32))
GRADING = ((), (1.0, 1.25, 1.5, 2.0, 3.0))
EPSILON = ((0.1, 0.01), (0.3, 0.1, 0.03, 0.01, 0.003, 0.001))
#: Intervals of the opening, with Runge-Kutta steps in each.
STEPS = (((8, 2),), ((4, 1), (8, 1), (16, 1), (4, 2), (8, 2), (12, 2), (8, 4), (16, 4)))


@dataclass(frozen=True)
class Variant:
    """One way to pose and solve: mesh settings other than the usual, solver, compiled."""

    mesh: tuple[tuple[str, float | str], ...] = ()
    solver: str = "fatrop"
    compiling: Compile = "no"

    @property
    def words(self) -> str:
        """What differs from the default."""
        return ", ".join(f"{name} {value}" for name, value in self.mesh) or "as it is"


@dataclass(frozen=True)
class Measured:
    """What came of a variant's first solves, and of its whole plans.

    solved: first solves that converged; exact, sent (N, 2): their landing errors without
    correction [m, rad], of the planned motion and of what is sent; solve [s], iterations
    (N,); plans: that ended as solved; plan [s] (M,); final (M, 2): the errors of these.
    """

    solved: int
    exact: Array
    sent: Array
    solve: Array
    iterations: Array
    plans: int
    plan: Array
    final: Array
    trouble: str


def variants(effort: Effort) -> list[Variant]:
    """All that is measured, the usual settings first."""
    which = int(not effort.quick)
    found = [Variant(), Variant(solver="ipopt")]
    found += [Variant((("carry", n),)) for n in CARRY[which]]
    found += [Variant((("opening", n),)) for n in OPENING[which]]
    found += [Variant((("grading", n),)) for n in GRADING[which]]
    found += [Variant((("epsilon", n),)) for n in EPSILON[which]]
    for opening, substeps in STEPS[which]:
        mesh = (("integrator", "rk4"), ("opening", opening), ("substeps", substeps))
        found.append(Variant(mesh))
    if not effort.quick:
        found += [Variant(compiling="wait"), Variant(solver="ipopt", compiling="wait")]
        found.append(Variant((("opening", 16),), compiling="wait"))
    usual = dataclasses.asdict(load_scene("pose").mesh)
    changed = [v for v in found if not v.mesh or any(usual[k] != value for k, value in v.mesh)]
    return list(dict.fromkeys(changed))


def make(effort: Effort) -> Section:
    """The section."""
    section = Section("planner", "The planner: error against run time")
    section.add(
        "Every target is solved once from the nearest sampled release; `exact` is where the "
        "non-smooth sliding pivot lands that planned motion, `sent` where it lands what Ruckig "
        "makes of it, both before any correction: the error of smoothing, mesh and sending. "
        "`final` is what is left after the planner's own corrections, with the time of the "
        "whole plan. Errors are the scaled ones (position and half the bar's length times the "
        "angle). Solving times are the processor's. All opening intervals are multiple "
        "shooting; `gauss` is two-point collocation inside each, its accelerations unknowns of "
        "the NLP. Rows differ from the default by "
        f"what is named. Random targets in reach, seed {SEED}. ★: no other row of the "
        "same kind (compiled or not) has both less exact error and less solving time."
    )
    asked = variants(effort)
    total = len(TARGETS) * len(asked)
    for number, (name, sizes) in enumerate(TARGETS.items()):
        scene = load_scene(name)
        targets = list(itertools.islice(reachable_targets(scene, SEED), effort.of(*sizes)))
        found: list[Measured] = []
        for k, variant in enumerate(asked):
            effort.tell(number * len(asked) + k, total)
            found.append(measured(scene, targets, variant))
        best = [False] * len(found)
        for kind in ("no", "wait"):
            # Compiled ones are compared among themselves.
            alike = [k for k, variant in enumerate(asked) if variant.compiling == kind]
            for k, star in zip(alike, best_of([found[k] for k in alike]), strict=True):
                best[k] = star
        section.add(_table(name, targets, asked, found, best), _words(asked, found, best))
        section.add(_picture(name, asked, found, best))
    return section


def measured(scene: Scene, targets: list[Pose], variant: Variant) -> Measured:
    """A variant on all targets; building and compiling are not in the times."""
    mesh = dataclasses.replace(scene.mesh, **dict(variant.mesh))  # type: ignore[arg-type]
    scene = scene.replace(mesh=mesh)
    planner = Planner(scene, compiling=variant.compiling)
    planner.plan(targets[0], solver=variant.solver)  # type: ignore[arg-type]
    first = [_first(planner, target, variant.solver) for target in targets]
    plans = [planner.plan(target, solver=variant.solver) for target in targets]  # type: ignore[arg-type]
    done = [plan for plan in plans if plan.solved]
    good = [entry for entry in first if not entry[-1]]
    return Measured(
        len(good),
        np.array([entry[0] for entry in good]).reshape(-1, 2),
        np.array([entry[1] for entry in good]).reshape(-1, 2),
        np.array([entry[2] for entry in first]),
        np.array([entry[3] for entry in first]),
        len(done),
        np.array([plan.time["total"] - plan.time["build"] for plan in plans]),
        np.array([plan.error_sent() for plan in done]).reshape(-1, 2),
        "; ".join(dict.fromkeys(entry[-1] for entry in first if entry[-1])),
    )


def _first(
    planner: Planner, target: Pose, solver: str
) -> tuple[tuple[float, float], tuple[float, float], float, int, str]:
    """One solve: errors of what is planned and sent, seconds, iterations, trouble."""
    scene, mover, search = planner.scene.aimed_at(target), planner.mover, Search(planner.scene)
    releases = planner.releases()
    index = planner.starts(target)[0][0]
    flight = float(releases.landings(target.z, scene.gravity)[2][index])
    problem = planner.bench.problem(target, solver, search)
    nlp = problem.nlp
    guess = guess_from(nlp, scene, mover, releases, index, flight)
    numbers = nlp.parameters.vector(parameter_values(scene, mover, target))
    limits, begin = bounds(nlp, scene, mover), time.process_time()
    found = problem.solver.solve(guess, numbers, limits)
    seconds = time.process_time() - begin
    none = math.nan, math.nan
    if not found.success:
        return none, none, seconds, found.iterations, f"{solver} did not converge"
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    planned, at = planned_motion(nlp, mover, found.x, nodes), opening_start(nlp, found.x)
    exact = throw(scene, mover, planned, at, target.z).miss(target)
    try:
        motion = planned if scene.robot is None else send(mover, planned)
    except SmoothingError as error:
        return exact, none, seconds, found.iterations, str(error)
    sent = throw(scene, mover, motion, at, target.z).miss(target)
    return exact, sent, seconds, found.iterations, ""


def _scaled(errors: Array, scene_length: float = 0.26) -> Array:
    """Scaled errors (N,) [m] of (N, 2) [m, rad]; the built-in scenes' bar is 0.26 m long."""
    return np.asarray(np.abs(errors) @ [1.0, scene_length / 2])


def best_of(found: list[Measured]) -> list[bool]:
    """Which are on the Pareto set of median exact error and median solving time."""
    points = [_point(one) for one in found]
    kept = [k for k, point in enumerate(points) if np.isfinite(point).all()]
    best = pareto(*zip(*[points[k] for k in kept], strict=True)) if kept else []
    stars = {kept[k] for k in best}
    return [k in stars for k in range(len(found))]


def _point(one: Measured) -> tuple[float, float]:
    """Median solving time [ms] and exact error [mm]; infinite if few solves converge."""
    if one.solved < 0.9 * len(one.solve):
        return math.inf, math.inf
    return 1e3 * float(np.median(one.solve)), 1e3 * float(np.median(_scaled(one.exact)))


def _table(
    name: str,
    targets: list[Pose],
    asked: list[Variant],
    found: list[Measured],
    best: list[bool],
) -> Table:
    rows: list[list[Cell]] = []
    for variant, one, star in zip(asked, found, best, strict=True):
        errors = [_scaled(e) for e in (one.exact, one.sent, one.final)]
        rows.append(
            [
                ("★ " if star else "") + variant.words,
                variant.solver,
                "yes" if variant.compiling == "wait" else "no",
                one.solved,
                *(_share(errors[0], q) for q in (50, 95)),
                *(_share(errors[1], q) for q in (50, 95)),
                1e3 * float(np.median(one.solve)),
                float(np.median(one.iterations)),
                one.plans,
                _share(errors[2], 100),
                1e3 * float(np.median(one.plan)),
                one.trouble or None,
            ]
        )
    columns = (
        *("setting", "solver", "compiled", "first solves", "exact, median [mm]", "95 % [mm]"),
        *("sent, median [mm]", "95 % [mm]", "solve [ms]", "iterations", "plans solved"),
        *("final, worst [mm]", "plan [ms]", "trouble"),
    )
    caption = f"Scene {name}: {len(targets)} targets, one setting changed at a time"
    return Table(f"planner-{name}", caption, columns, rows)


def _share(errors: Array, share: float) -> Cell:
    return 1e3 * float(np.percentile(errors, share)) if len(errors) else None


def _words(asked: list[Variant], found: list[Measured], best: list[bool]) -> str:
    """Where the usual settings stand."""
    mine, exact = _point(found[0]), _scaled(found[0].exact)
    better = [
        variant.words
        for variant, one in zip(asked, found, strict=True)
        if variant.compiling == "no"
        and all(a <= b for a, b in zip(_point(one), mine, strict=True))
        and _point(one) != mine
    ]
    where = "is on the Pareto set"
    if not best[0]:
        where = f"is beaten in both by {'; '.join(better)}" if better else "fails too often"
    return (
        f"The default {where}: {1e3 * float(np.median(exact)):.2g} mm before correction at "
        f"{mine[0]:.1f} ms a solve, {found[0].plans} of {len(found[0].plan)} plans solved with at "
        f"most {1e3 * float(_scaled(found[0].final).max(initial=0.0)):.2g} mm left."
    )


def _picture(name: str, asked: list[Variant], found: list[Measured], best: list[bool]) -> Picture:
    def draw(path: Path) -> None:
        from .planner_picture import draw_settings

        kinds = [_kind(variant) for variant in asked]
        labels = [variant.words for variant in asked]
        draw_settings(path, np.array([_point(one) for one in found]), kinds, labels, best)

    caption = f"Scene {name}: error before correction against solving time, medians"
    return Picture(f"planner-{name}", caption, draw)


def _kind(variant: Variant) -> str:
    """The family a variant is drawn in."""
    if variant.compiling == "wait":
        return "compiled"
    if variant.solver == "ipopt":
        return "IPOPT"
    return variant.mesh[0][0] if variant.mesh else "default"
