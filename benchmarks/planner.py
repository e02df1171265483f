"""Section `planner`: error against run time, over meshes and solvers.

Each setting plans to the same random targets, one after the other with the default's, whose time
is its measure. The error before correction is how far the exact throw of the planned motion lands
from where the NLP believes: what smoothing and mesh cost. What a plan ends with, after
its corrections, is the final error.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from throwplan import Plan, Planner, Pose, Scene, load_scene
from throwplan.models import Array
from throwplan.pictures import BLACK, BLUE, GREEN, GREY, ORANGE, RED, Row, Table
from throwplan.planner.planner import SolverName

from .measure import (
    pareto,
    planning_time,
    quantiles,
    reachable_targets,
    warmed,
    without_machine_code,
)
from .page import Effort, Picture, ReportSection, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: Seed of the targets.
SEED = 2
#: Number of targets of each scene: quick, full.
TARGETS = {"cup": (2, 14), "hand-flip": (2, 14)}
#: Values of one setting at a time, the others at their defaults: quick, full.
SETTINGS = {
    "carry": ((6,), (3, 4, 5, 6, 8, 10, 15)),
    "opening": ((8,), (4, 6, 8, 12, 16, 24, 32)),
    "grading": ((), (1.0, 1.25, 1.5, 2.0, 3.0)),
    "epsilon": ((0.01,), (0.3, 0.1, 0.03, 0.02, 0.015, 0.01, 0.003, 0.001)),
}
#: Relative differences of solving time, error and effort below which settings count as equal.
MARGINS = (0.1, 0.1, 5e-3)
#: Least share of solved targets of a setting that is compared.
SOLVED = 0.9
#: Colour, marker and line of a variant, by the first word of its name.
STYLES = {
    "carry": (BLUE, "o", "-"),
    "opening": (GREEN, "o", "-"),
    "grading": (ORANGE, "o", "-"),
    "epsilon": (RED, "o", "-"),
    "IPOPT": (GREY, "^", ""),
    "default": (BLACK, "D", ""),
}


@dataclass(frozen=True)
class Variant:
    """A variant of the planner: changed mesh settings, and solver."""

    mesh: tuple[tuple[str, float | str], ...] = ()
    solver: SolverName = "fatrop"

    @property
    def words(self) -> str:
        """Name of the variant: its difference from the default."""
        return ", ".join(f"{name} {value}" for name, value in self.mesh) or "default"


@dataclass(frozen=True)
class VariantRuns:
    """A variant's plans to M targets; usual (M,): times [s] of the default's solves just before."""

    variant: Variant
    plans: list[Plan]
    usual: Array

    @property
    def solved(self) -> int:
        """Number of solved plans."""
        return sum(plan.solved for plan in self.plans)

    @property
    def solve(self) -> Array:
        """Times (M,) [s] of the solves."""
        return np.array([plan.time["solve"] for plan in self.plans])

    @property
    def before(self) -> Array:
        """Scaled errors (M,) [m] before correction, NaN if not solved."""
        return np.array([_before(plan) for plan in self.plans])

    @property
    def deciding(self) -> Array:
        """Scaled errors (M,) [m] at the end, NaN if not solved."""
        return np.array([_final(plan) for plan in self.plans])

    @property
    def cost(self) -> Array:
        """Costs (M,) of the throws."""
        return np.array([p.throw.effort if p.throw else math.nan for p in self.plans])


def variants(quick: bool) -> list[Variant]:
    """All variants, the default first."""
    which = int(not quick)
    found = [Variant(), Variant(solver="ipopt")]
    for name, values in SETTINGS.items():
        found += [Variant(((name, value),)) for value in values[which]]
    usual = dataclasses.asdict(load_scene("cup").nlp)
    return [v for v in found if not v.mesh or any(usual[k] != value for k, value in v.mesh)]


@without_machine_code()
def make(effort: Effort) -> ReportSection:
    """All settings on all scenes."""
    tried = variants(effort.quick)
    step = effort.counter(len(TARGETS) * len(tried))
    rows, scenes = list[Row](), dict[str, list[VariantRuns]]()
    for name, sizes in TARGETS.items():
        scene = load_scene(name)
        targets = list(itertools.islice(reachable_targets(scene, SEED), effort.of(*sizes)))
        usual, scenes[name] = warmed(scene, targets[:1]), []
        for variant in tried:
            scenes[name].append(measured(scene, targets, variant, usual))
            step()
        rows += _rows(name, scenes[name])
    table = Table("planner-settings", "All settings", rows)
    words = "Error before correction over solving time, medians"
    return ReportSection(
        "planner",
        "The planner: error against run time",
        [
            *(_default(name, found) for name, found in scenes.items()),
            "The table has the settings that no other beats in solving time, error before "
            "correction and effort at once, and the default, all without machine code "
            f"(`{_mesh(load_scene('cup'))}`, FATROP alone). Effort: the "
            "NLP's cost, squared accelerations and jerks.",
        ],
        [_together(list(scenes.values())), table],
        [Picture("planner", words, _draw_settings(table))],
    )


def measured(scene: Scene, targets: list[Pose], variant: Variant, usual: Planner) -> VariantRuns:
    """A variant's plans to all targets; their times exclude building."""
    mesh = dataclasses.replace(scene.nlp, **dict(variant.mesh))  # type: ignore[arg-type]
    planner = warmed(scene.replace(nlp=mesh), targets[:1], variant.solver)
    first, plans = [], []
    for target in targets:
        first.append(usual.plan(target, solver="fatrop").time["solve"])
        plans.append(planner.plan(target, solver=variant.solver))
    return VariantRuns(variant, plans, np.array(first))


def _before(plan: Plan) -> float:
    """Scaled error [m] before correction; NaN without a solved throw."""
    if not plan.solved or plan.throw is None:
        return math.nan
    x, _, theta = plan.throw.planned_landing
    exact = plan.throw.exact.landing
    turned = 0.0 if plan.target.theta is None else exact.theta - theta
    return plan.scene.object.pose_error(exact.x - x, turned)


def _final(plan: Plan) -> float:
    """Scaled error [m] of the sent motion; NaN without a solved throw."""
    if not plan.solved:
        return math.nan
    return plan.scene.object.pose_error(*plan.error_sent())


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
        if one.solved >= SOLVED * len(one.plans):
            ratios = (one.solve / one.usual, one.before / first.before, one.cost / first.cost)
            row[:] = np.multiply(usual, [np.nanmedian(ratio) for ratio in ratios])
    return made


def best_of(figures: Array) -> list[bool]:
    """Flags of the rows of (N, 3) that no other row beats."""
    kept = np.flatnonzero(np.isfinite(figures).all(axis=1))
    best = {int(kept[k]) for k in pareto(*figures[kept].T, margins=MARGINS)}
    return [k in best for k in range(len(figures))]


def _rows(name: str, found: list[VariantRuns]) -> list[Row]:
    """A row for each variant."""
    figures, rows = points(found), list[Row]()
    for one, (solve, error, cost), star in zip(
        found, figures.tolist(), best_of(figures), strict=True
    ):
        compared, final = math.isfinite(solve), 1e3 * one.deciding
        whole = [planning_time(plan) for plan in one.plans]
        why = dict.fromkeys(plan.message for plan in one.plans if not plan.solved)
        rows.append(
            {
                "scene": name,
                "setting": one.variant.words,
                "solver": one.variant.solver,
                "solved": one.solved,
                "error before correction [mm]": error if compared else None,
                "solve [ms]": solve if compared else None,
                "effort, % above the default's": 100 * (cost - 1) if compared else None,
                "iterations": quantiles([plan.iterations for plan in one.plans], 50)[0],
                "plan [ms]": 1e3 * quantiles(whole, 50)[0],
                "final error, worst [mm]": float(np.nanmax(final)) if one.solved else None,
                "Pareto set": "yes" if star else "",
                "trouble": "; ".join(why) or None,
            }
        )
    return rows


def _together(scenes: list[list[VariantRuns]]) -> Table:
    """The settings that no other beats over all scenes (geometric means), and the default."""
    figures = np.exp(np.mean([np.log(points(found)) for found in scenes], axis=0))
    stars, rows = best_of(figures), list[Row]()
    for k in sorted(range(len(figures)), key=lambda k: float(figures[k, 0])):
        variant, (time, error, cost) = scenes[0][k].variant, figures[k].tolist()
        if k == 0 or stars[k]:
            row: Row = {
                "setting": variant.words,
                "solver": variant.solver,
                "solve [ms]": time,
                "times the default's": time / float(figures[0, 0]),
                "error [mm]": error,
                "times its error": error / float(figures[0, 1]),
                "effort, % above its": 100 * (cost - 1),
                "Pareto set": "yes" if stars[k] else "no",
            }
            rows.append(row)
    return Table("planner-choice", "Settings to choose from", rows, short=True)


def _default(name: str, found: list[VariantRuns]) -> str:
    """The default's results on a scene as a sentence."""
    first = found[0]
    ipopt = next(one for one in found if one.variant.solver == "ipopt")
    whole = [planning_time(plan) for plan in first.plans]
    return (
        f"`{name}`: the default takes {1e3 * float(np.median(whole)):.0f} ms a plan, "
        f"{first.solved} of {len(first.plans)} solved, at most "
        f"{1e3 * float(np.nanmax(first.deciding)):.2g} mm left; IPOPT's solves take "
        f"{float(np.median(ipopt.solve / ipopt.usual)):.1f} times as long."
    )


def _mesh(scene: Scene) -> str:
    """The settings of the NLP, as a scene file has them."""
    mesh = scene.nlp
    words = f"carry = {mesh.carry}, opening = {mesh.opening}, grading = {mesh.grading:g}"
    return f"{words}, epsilon = {mesh.epsilon:g}"


def _draw_settings(rows: Table) -> Figure:
    """Error before correction over solving time; a panel a scene, a line a setting's values."""
    scenes = list(dict.fromkeys(rows.column("scene")))
    figure, grid = panels(6.0 * len(scenes), 4.5, 1, len(scenes))
    for axis, scene in zip(grid[0], scenes, strict=True):
        known = [row for row in rows.where(scene=scene) if row["solve [ms]"] is not None]
        ringed = [row for row in known if row["Pareto set"]]
        for name, (colour, marker, line) in STYLES.items():
            some = [row for row in known if _family(row) == name]
            style: dict[str, Any] = {"color": colour, "marker": marker, "ls": line, "lw": 0.8}
            axis.plot(*_places(some), ms=5, label=name, **style)
        ring: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 12, "mfc": "none", "mec": BLACK}
        axis.plot(*_places(ringed), label="Pareto set", **ring)
        axis.set(xscale="log", yscale="log", title=str(scene), xlabel="solve [ms]")
    grid[0][0].set_ylabel("scaled error before correction [mm]")
    grid[0][-1].legend(fontsize=8)
    return figure


def _family(row: Row) -> str:
    """The setting that differs from the default, or the other solver."""
    words = str(row["setting"]).split(maxsplit=1)[0]
    return "IPOPT" if row["solver"] == "ipopt" else words


def _places(rows: Sequence[Row]) -> tuple[list[Any], list[Any]]:
    return [r["solve [ms]"] for r in rows], [r["error before correction [mm]"] for r in rows]
