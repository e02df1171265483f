"""Section `planner`: error against run time, over meshes, integrators and solvers.

Each setting plans to the same random targets, one after the other with the default's, whose time
is its measure. The error before correction is how far the exact throw of the planned motion lands
from where the NLP believes: what smoothing, mesh and integrator cost. What a plan ends with, after
its corrections, is the final error.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import time
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene, load_scene
from ..compile import Compile
from ..ocp import Request
from ..plan import Planner, SolverName
from ..result import Plan
from .drawing import draw_settings
from .measure import pareto, quantiles, reachable_targets, warmed
from .page import Effort, Picture, ReportSection, ReportTable, Row

Array = npt.NDArray[np.float64]

#: Seed of the targets; scenes with their targets: quick, full.
SEED, TARGETS = 2, {"cup": (2, 14), "hand-flip": (2, 14)}
#: Scene, seed and number of targets of the other solvers: quick, full.
RIVALS = ("pose", 1, (1, 50))
#: Each setting by itself, the others as they usually are: quick, full.
CARRY = ((6,), (3, 4, 5, 6, 8, 10, 15))
OPENING = ((8,), (4, 6, 8, 12, 16, 24, 32))
GRADING = ((), (1.0, 1.25, 1.5, 2.0, 3.0))
EPSILON = ((0.01,), (0.3, 0.1, 0.03, 0.02, 0.015, 0.01, 0.003, 0.001))
#: Intervals of the opening, with Runge-Kutta steps in each.
STEPS = (((8, 2),), ((4, 1), (8, 1), (16, 1), (4, 2), (8, 2), (16, 4)))
#: By how much solving time, error and effort must differ to decide. Times differ by chance, and
#: errors of coarse meshes cancel by chance. The effort does not, but half a percent of it is not
#: worth a tenth of the time.
MARGINS = (0.1, 0.1, 5e-3)
#: A setting that solves a smaller share of the targets is not compared.
SOLVED = 0.9
#: SLSQP's iterations, and the largest breach of a row that still counts as solved.
ITERATIONS, FEASIBLE = 200, 1e-4


@dataclass(frozen=True)
class Variant:
    """One way to pose and solve: mesh settings other than the usual, solver, compiled."""

    mesh: tuple[tuple[str, float | str], ...] = ()
    solver: SolverName = "fatrop"
    compiling: Compile = "no"

    @property
    def words(self) -> str:
        """What differs from the default."""
        return ", ".join(f"{name} {value}" for name, value in self.mesh) or "default"


@dataclass(frozen=True)
class VariantRuns:
    """What came of a variant's plans to M targets.

    before (M,): scaled error [m] before correction; final (M,): after, NaN if not solved; cost
    (M,): of the throw; solve, plan, usual (M,): times [s], of the default's solve just before.
    """

    variant: Variant
    before: Array
    final: Array
    cost: Array
    solve: Array
    plan: Array
    usual: Array
    iterations: Array
    trouble: str

    @property
    def solved(self) -> int:
        """How many plans are solved."""
        return int(np.isfinite(self.final).sum())


def variants(quick: bool) -> list[Variant]:
    """All that is measured, the default first."""
    which = int(not quick)
    found = [Variant(), Variant(solver="ipopt")]
    settings = {"carry": CARRY, "opening": OPENING, "grading": GRADING, "epsilon": EPSILON}
    for name, values in settings.items():
        found += [Variant(((name, value),)) for value in values[which]]
    for opening, substeps in STEPS[which]:
        mesh = (("integrator", "rk4"), ("opening", opening), ("substeps", substeps))
        found.append(Variant(mesh))
    if not quick:
        found += [Variant(compiling="wait"), Variant(solver="ipopt", compiling="wait")]
    usual = dataclasses.asdict(load_scene("cup").mesh)
    changed = [v for v in found if not v.mesh or any(usual[k] != value for k, value in v.mesh)]
    return list(dict.fromkeys(changed))


def make(effort: Effort) -> ReportSection:
    """All settings on all scenes, and other solvers of the same NLP."""
    tried = variants(effort.quick)
    step = effort.counter(len(TARGETS) * len(tried) + 1)
    rows, scenes = list[Row](), dict[str, list[VariantRuns]]()
    for name, sizes in TARGETS.items():
        scene = load_scene(name)
        targets = list(itertools.islice(reachable_targets(scene, SEED), effort.of(*sizes)))
        usual, scenes[name] = warmed(scene, targets[:1], "no"), []
        for variant in tried:
            scenes[name].append(measured(scene, targets, variant, usual))
            step()
        rows += _rows(name, scenes[name])
    name, seed, sizes = RIVALS
    scene = load_scene(name)
    others = list(itertools.islice(reachable_targets(scene, seed), effort.of(*sizes)))
    solvers = rivals(scene, others)
    step()
    table = ReportTable("planner-settings", "All settings", rows)
    words = "Error before correction over solving time, medians"
    return ReportSection(
        "planner",
        "The planner: error against run time",
        [
            *(_default(name, found) for name, found in scenes.items()),
            "The table has the settings that no other beats in solving time, error before "
            "correction and effort at once, and the default "
            f"(`{_mesh(load_scene('cup'))}`, FATROP, then IPOPT where that fails). Effort: the "
            "NLP's cost, squared accelerations and jerks.",
        ],
        [_together(list(scenes.values())), table, solvers],
        [Picture("planner", words, lambda path: draw_settings(table, path))],
    )


def measured(scene: Scene, targets: list[Pose], variant: Variant, usual: Planner) -> VariantRuns:
    """A variant on all targets; building and compiling are not in the times."""
    mesh = dataclasses.replace(scene.mesh, **dict(variant.mesh))  # type: ignore[arg-type]
    scene = scene.replace(mesh=mesh)
    planner = warmed(scene, targets[:1], variant.compiling, variant.solver)
    first, plans = [], []
    for target in targets:
        first.append(usual.plan(target, solver="fatrop").time["solve"])
        plans.append(planner.plan(target, solver=variant.solver))
    length = scene.object.length
    errors = [_errors(plan, length) for plan in plans]
    return VariantRuns(
        variant,
        np.array([before for before, _ in errors]),
        np.array([final for _, final in errors]),
        np.array([plan.throw.solution.cost if plan.throw else math.nan for plan in plans]),
        np.array([plan.time["solve"] for plan in plans]),
        np.array([plan.time["total"] - plan.time["build"] for plan in plans]),
        np.array(first),
        np.array([plan.iterations for plan in plans]),
        "; ".join(dict.fromkeys(plan.message for plan in plans if not plan.solved)),
    )


def _errors(plan: Plan, length: float) -> tuple[float, float]:
    """Scaled errors [m] before correction and at the end; NaN without a solved throw."""
    if not plan.solved or plan.throw is None:
        return math.nan, math.nan
    x, _, theta = plan.throw.planned_landing
    exact = plan.throw.exact.landing
    turned = 0.0 if plan.target.theta is None else abs(exact.theta - theta)
    position, angle = plan.error_sent()
    return abs(exact.x - x) + turned * length / 2, position + angle * length / 2


def points(found: list[VariantRuns]) -> Array:
    """(N, 3): solving time [ms], error before correction [mm], effort over the default's.

    The default's medians times the medians of the ratios to it for the same targets: targets
    differ far more than settings do, and machines change their speed. Infinite where fewer than
    nine of ten plans are solved.
    """
    made = np.full((len(found), 3), np.inf)
    first = found[0]
    usual = (1e3 * np.median(first.solve), 1e3 * np.nanmedian(first.before), 1.0)
    for row, one in zip(made, found, strict=True):
        if one.solved >= SOLVED * len(one.final):
            ratios = (one.solve / one.usual, one.before / first.before, one.cost / first.cost)
            row[:] = np.multiply(usual, [np.nanmedian(ratio) for ratio in ratios])
    return made


def best_of(figures: Array) -> list[bool]:
    """Which of (N, 3) no other beats."""
    kept = np.flatnonzero(np.isfinite(figures).all(axis=1))
    best = {int(kept[k]) for k in pareto(*figures[kept].T, margins=MARGINS)}
    return [k in best for k in range(len(figures))]


def _rows(name: str, found: list[VariantRuns]) -> list[Row]:
    """A row for each variant; compiled ones are compared among themselves."""
    figures, best = points(found), [False] * len(found)
    for kind in ("no", "wait"):
        alike = [k for k, one in enumerate(found) if one.variant.compiling == kind]
        for k, star in zip(alike, best_of(figures[alike]), strict=True):
            best[k] = star
    rows = list[Row]()
    for one, (solve, error, cost), star in zip(found, figures.tolist(), best, strict=True):
        compared, final = math.isfinite(solve), 1e3 * one.final
        rows.append(
            {
                "scene": name,
                "setting": one.variant.words,
                "solver": one.variant.solver,
                "compiled": "yes" if one.variant.compiling == "wait" else "no",
                "solved": one.solved,
                "error before correction [mm]": error if compared else None,
                "solve [ms]": solve if compared else None,
                "effort, % above the default's": 100 * (cost - 1) if compared else None,
                "iterations": quantiles(one.iterations, 50)[0],
                "plan [ms]": 1e3 * quantiles(one.plan, 50)[0],
                "final error, worst [mm]": float(np.nanmax(final)) if one.solved else None,
                "Pareto set": "yes" if star else "",
                "trouble": one.trouble or None,
            }
        )
    return rows


def _together(scenes: list[list[VariantRuns]]) -> ReportTable:
    """The settings that no other beats over all scenes (geometric means), and the default."""
    figures = np.exp(np.mean([np.log(points(found)) for found in scenes], axis=0))
    plain = [k for k, one in enumerate(scenes[0]) if one.variant.compiling == "no"]
    best = {plain[k] for k, star in enumerate(best_of(figures[plain])) if star}
    rows = list[Row]()
    for k in sorted({0} | best, key=lambda k: float(figures[k, 0])):
        variant, (time, error, cost) = scenes[0][k].variant, figures[k].tolist()
        row: Row = {
            "setting": variant.words,
            "solver": variant.solver,
            "solve [ms]": time,
            "times the default's": time / float(figures[0, 0]),
            "error [mm]": error,
            "times its error": error / float(figures[0, 1]),
            "effort, % above its": 100 * (cost - 1),
            "Pareto set": "yes" if k in best else "no",
        }
        rows.append(row)
    return ReportTable("planner-choice", "Settings to choose from", rows, short=True)


def _default(name: str, found: list[VariantRuns]) -> str:
    """What the default does on a scene."""
    first = found[0]
    ipopt = next(one for one in found if one.variant.solver == "ipopt")
    slower = float(np.median(ipopt.solve / ipopt.usual))
    fast = [one for one in found if one.variant.compiling == "wait"]
    compiled = f" ({1e3 * float(np.median(fast[0].plan)):.0f} ms compiled)" if fast else ""
    return (
        f"`{name}`: the default takes {1e3 * float(np.median(first.plan)):.0f} ms a plan"
        f"{compiled}, "
        f"{first.solved} of {len(first.final)} solved, at most "
        f"{1e3 * float(np.nanmax(first.final)):.2g} mm left; IPOPT's solves take {slower:.1f} "
        "times as long."
    )


def _mesh(scene: Scene) -> str:
    """The settings of the NLP, as a scene file has them."""
    mesh = scene.mesh
    words = f"carry = {mesh.carry}, opening = {mesh.opening}, grading = {mesh.grading:g}"
    return f'{words}, integrator = "{mesh.integrator}", epsilon = {mesh.epsilon:g}'


def rivals(scene: Scene, targets: list[Pose]) -> ReportTable:
    """The same NLP solved by other means; from the table's releases, or from one solved throw."""
    planner = warmed(scene, targets[:1], "no")
    warmed(scene, targets[:1], "no", "ipopt")
    shooting, start = SingleShooting(scene), planner.plan()
    planner.plan(warm=start)
    found: dict[tuple[str, str], list[tuple[bool, float]]] = {}
    for target in targets:
        plans = {
            ("FATROP", "table"): planner.plan(target, solver="fatrop"),
            ("IPOPT", "table"): planner.plan(target, solver="ipopt"),
            ("FATROP", "the scene's own throw"): planner.plan(target, warm=start),
        }
        for way, plan in plans.items():
            found.setdefault(way, []).append((plan.solved, plan.time["solve"]))
        way = ("SLSQP, single shooting", "the scene's own throw")
        found.setdefault(way, []).append(shooting.solve(target))
    usual = float(np.median([seconds for _, seconds in found["FATROP", "table"]]))
    rows = list[Row]()
    for (solver, begin), answers in found.items():
        times = quantiles([seconds for _, seconds in answers], 50, 99)
        row: Row = {
            "solver": solver,
            "start": begin,
            "targets": len(answers),
            "solved": sum(solved for solved, _ in answers),
            "solve, median [ms]": 1e3 * times[0],
            "solve, 99 % [ms]": 1e3 * times[1],
            "times FATROP's": times[0] / usual,
        }
        rows.append(row)
    return ReportTable("planner-solvers", f"Other solvers, scene {scene.name}", rows)


class SingleShooting:
    """SciPy's SLSQP on the NLP of a scene in its first state and controls alone.

    The states follow from these, which needs an explicit integrator.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene.replace(
            mesh=dataclasses.replace(scene.mesh, integrator="rk4", substeps=2)
        )
        plan = Planner(self._scene, compiling="no").plan()
        assert plan.throw is not None
        self._mover, self._nlp, nlp = plan.mover, plan.throw.nlp, plan.throw.nlp
        p = nlp.problem["p"]
        states, controls, _ = nlp.sizes
        free, places = [ca.MX.sym("x0", states[0])], list(range(states[0]))
        state, pieces, rows = free[0], list[ca.MX](), list[int]()
        for k, link in enumerate(nlp.links):
            free.append(ca.MX.sym(f"u{k}", controls[k]))
            places += range(link.v.start + states[k], link.v.stop)
            pieces.append(ca.vertcat(state, free[-1]))
            outputs, _ = link.functions.value(pieces[-1], p[link.data], p)
            state = outputs[: link.gap.stop - link.gap.start]
            rows += range(link.rows.start, link.rows.stop)
        z, x = ca.vertcat(*free), ca.vertcat(*pieces)
        f, g = ca.Function("w", [nlp.problem["x"], p], [nlp.problem["f"], nlp.problem["g"]])(x, p)
        g = ca.vertcat(x, g[rows])
        self._rows, self._start = rows, plan.throw.solution.x[places]
        self._value = ca.Function("v", [z, p], [f, g])
        self._slope = ca.Function("s", [z, p], [ca.gradient(f, z), ca.jacobian(g, z)])

    def solve(self, target: Pose) -> tuple[bool, float]:
        """Whether SLSQP gets from the scene's own throw to a target, and its time [s]."""
        from scipy.optimize import minimize

        nlp, scene = self._nlp, self._scene.aimed_at(target)
        request = Request(scene, self._mover, target)
        p, (low, high) = nlp.numbers(request), nlp.bounds(request)
        lower = np.concatenate([low, nlp.lbg[self._rows]])
        upper = np.concatenate([high, nlp.ubg[self._rows]])
        same = lower == upper
        under, over = np.isfinite(lower) & ~same, np.isfinite(upper) & ~same

        def values(z: Array) -> Array:
            return np.asarray(self._value(z, p)[1], float).ravel()

        def slopes(z: Array) -> Array:
            return np.asarray(self._slope(z, p)[1].full())

        rows: list[dict[str, Any]] = [
            {"type": "eq", "fun": lambda z: (values(z) - lower)[same],
             "jac": lambda z: slopes(z)[same]},
            {"type": "ineq",
             "fun": lambda z: np.append((values(z) - lower)[under], (upper - values(z))[over]),
             "jac": lambda z: np.vstack([slopes(z)[under], -slopes(z)[over]])},
        ]  # fmt: skip
        begin = time.perf_counter()
        result = minimize(
            lambda z: float(self._value(z, p)[0]),
            self._start,
            jac=lambda z: np.array(self._slope(z, p)[0]).ravel(),
            method="SLSQP",
            constraints=rows,
            options={"maxiter": ITERATIONS, "ftol": 1e-6},
        )
        seconds = time.perf_counter() - begin
        g = values(result.x)
        breach = float(np.nanmax(np.maximum(lower - g, g - upper)))
        return bool(np.isfinite(breach) and breach <= FEASIBLE), seconds
