"""Section `throws`: contact parameters from measured throws, effects of factors, learning from few.

The throws are synthetic, on the paper's design, by a meshed patch with stated noise. They show how
models differ and whether a fit finds the truth, not how well a model predicts real throws.
"""

from __future__ import annotations

import dataclasses
import math
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from throwplan import (
    Plan,
    Planner,
    Pose,
    Scene,
    ThrowData,
    identify,
    load_scene,
    load_throws,
    throw_data,
    thrown,
)
from throwplan.core.compile import scratch_folder
from throwplan.models import Array
from throwplan.models.release import SLIDING_PIVOT, STEPPED_SURFACE
from throwplan.planner.identify import Grid, Predictor, grid_of
from throwplan.planner.show import BLUE, GREEN, RED, Row, Table, shown

from .page import Effort, Picture, ReportSection, number, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure


#: Seed of the throws.
SEED = 1
#: Models that are fitted and used for learning.
FITTED = (SLIDING_PIVOT, STEPPED_SURFACE)
#: Models with a grid; landings by `ls` are no smooth function of the contact.
GRIDS = ("ls", *FITTED)
#: Factors of the paper's Fig. 20: column of throws.csv, and its two labels.
FACTORS = {
    "com": ("com1", "com2"),
    "pitch": ("p1", "p3"),
    "release": ("a1", "a6"),
    "surface": ("plastic", "papertape"),
    "payload": ("metal", "plastic"),
    "moi": ("small", "large"),
}
#: Numbers of throws to learn from: quick, full.
COUNTS = ((3,), (1, 2, 3, 5, 10))
#: Number of seeds of the measurement's noise: quick, full.
SEEDS = (1, 5)
#: True friction, patch radius [m] and delay [s] of the gripper.
TRUTH = {"friction": 1.1, "patch_radius": 0.00325, "delay": 0.010}
#: True mu r_p [m].
PRODUCT = TRUTH["friction"] * TRUTH["patch_radius"]
#: Release model that stands for reality.
REALITY = "patch"
#: The prior's mu r_p over the true one.
BELIEVED = 0.6
#: Noise of a measured landing: x [m], theta [rad].
NOISE = (0.002, math.radians(0.5))
#: Distances [m, deg] of the goals from the scene's own target.
WAYS = (
    *((0.0, 0), (-0.15, 20), (0.1, -25), (-0.05, 40), (-0.1, -40)),
    *((0.05, 15), (-0.2, -10), (0.12, 5), (-0.08, 60), (0.03, -15)),
)
#: Number of goals, the first ones, that are thrown again.
JUDGED = 3


def make(effort: Effort) -> ReportSection:
    """Grids and fits, effects of factors, learning from few throws."""
    step = effort.counter(4)
    data = _synthetic(effort.of(1, 5))
    batch = data.picked(_rows(data, "set", "batch")[:: effort.of(3, 1)])
    step()
    grids = {model: grid_of(Predictor.of(batch), model) for model in GRIDS}
    identified = _identified(batch, grids)
    step()
    factors = _factors(data)
    step()
    learning, before = _learning(effort)
    step()
    words = "Learning: real scaled error of throws planned after the first throws"
    return ReportSection(
        "throws",
        "Contact parameters from measured throws",
        [
            f"{len(batch.throws)} synthetic throws (`throwplan make-throws`): "
            f"{data.shared.synthetic}.",
            _fitted(identified),
            f"Learning: scene `pose`, believed with {100 * (1 - BELIEVED):.0f} % less μ r_p and "
            f"without the delay of {1e3 * TRUTH['delay']:.0f} ms; reality is the meshed patch, "
            f"landings have noise of {1e3 * NOISE[0]:.0f} mm and {math.degrees(NOISE[1]):.1f}°. "
            f"Before any throw the mean real scaled error is {1e3 * before:.1f} mm; "
            f"{_learned(learning)}.",
        ],
        [identified, factors, learning],
        [
            Picture("throws", words, _draw_learning(learning)),
            Picture("throws-grid", "Mean pose error by `sp`", _draw_grid(grids[SLIDING_PIVOT])),
        ],
    )


def _synthetic(repeats: int) -> ThrowData:
    """The data of `throwplan make-throws --factors`."""
    words = ["make-throws", "--factors", "--repeats", str(repeats), "--seed", str(SEED), "--out"]
    with scratch_folder(Path(tempfile.gettempdir())) as folder:
        command = [sys.executable, "-m", "throwplan", *words, str(folder)]
        subprocess.run(command, check=True, capture_output=True)
        return load_throws(folder)


def _rows(data: ThrowData, factor: str, label: str) -> list[int]:
    """The throws with a label."""
    return [i for i, throw in enumerate(data.throws) if throw.factors[factor] == label]


def _factors(data: ThrowData) -> Table:
    """Shifts of the mean landing from one label of a factor to the other (Fig. 20)."""
    landed = np.array([(t.landing[0], t.landing[2]) for t in data.throws if t.landing is not None])
    landings = {"measured": landed} | {model: _predicted(data, model) for model in FITTED}
    rows = list[Row]()
    for factor, labels in FACTORS.items():
        group = "batch" if factor in ("com", "pitch", "release") else "factors"
        sides = [
            [i for i in _rows(data, factor, label) if data.throws[i].factors["set"] == group]
            for label in labels
        ]
        row: Row = {"factor": f"{factor}: {' → '.join(labels)}"}
        row["throws"] = ", ".join(str(len(side)) for side in sides)
        for source, values in landings.items():
            x, theta = values[sides[1]].mean(axis=0) - values[sides[0]].mean(axis=0)
            row |= {f"{source}: x [mm]": 1e3 * x, f"{source}: θ [deg]": math.degrees(theta)}
        rows.append(row)
    return Table("throws-factors", "Shift of the mean landing by factor", rows, short=True)


def _predicted(data: ThrowData, model: str) -> Array:
    """Landings (T, 2) with the contact fitted to each surface."""
    found = np.empty((len(data.throws), 2))
    for surface in data.factors["surface"]:
        rows = _rows(data, "surface", surface)
        part = data.picked(rows)
        found[rows] = thrown(part, model, identify(part, model).posterior.values())
    return found


def _identified(data: ThrowData, grids: Mapping[str, Grid]) -> Table:
    """Grids and fits, a row for each model."""
    true, rows = data.truth["friction"] * data.truth["patch_radius"], list[Row]()
    for model, grid in grids.items():
        row: Row = {
            "model": model,
            "grid, least error [mm]": 1e3 * float(grid.error.min()),
            "grid, μ r_p / truth": math.prod(grid.contact(grid.best())) / true,
            "fit, error [mm]": None,
            "fit, μ r_p / truth": None,
            "± of it": None,
            "predictions": grid.predictions,
            "grid [s]": grid.seconds,
        }
        if model in FITTED:
            one = identify(data, model)
            row |= {
                "fit, error [mm]": 1e3 * one.error,
                "fit, μ r_p / truth": one.posterior.product / true,
                "± of it": one.posterior.product_deviation,
            }
        rows.append(row)
    return Table("throws-identified", "Grid and fit by model", rows)


def _fitted(table: Table) -> str:
    """The results of grids and fits as sentences."""
    fits = ", ".join(
        f"`{row['model']}` {shown(row['fit, μ r_p / truth'])}"
        for row in table.rows
        if row["fit, μ r_p / truth"] is not None
    )
    count, time = (sum(map(number, table.column(name))) for name in ("predictions", "grid [s]"))
    return (
        f"Friction times patch radius μ r_p by the fits, over the truth: {fits}. {count:,.0f} "
        f"predictions of the grids take {time:.1f} s."
    )


def _learning(effort: Effort) -> tuple[Table, float]:
    """Real error over the number of throws learned from; and before any throw [m]."""
    scene = _believed(load_scene("pose"))
    plans = _planned(scene, WAYS)
    landings = thrown(throw_data(plans), REALITY, TRUTH)
    before = _error(plans[:JUDGED], landings[:JUDGED])
    rows = list[Row]()
    for model in FITTED:
        for count in COUNTS[not effort.quick]:
            found = [
                _after(scene, plans[:count], landings[:count], model, seed)
                for seed in range(effort.of(*SEEDS))
            ]
            errors, products = [one[0] for one in found], [one[1] for one in found]
            middle, worst = statistics.median(errors), max(errors)
            row: Row = {
                "learned by": model,
                "throws": count,
                "error, median [mm]": 1e3 * middle,
                "error, worst [mm]": 1e3 * worst,
                "times better, median": before / middle,
                "times better, worst": before / worst,
                "μ r_p / truth, least": min(products),
                "μ r_p / truth, most": max(products),
            }
            rows.append(row)
    return Table("throws-learning", "Learning from few throws", rows), before


def _believed(scene: Scene) -> Scene:
    """The scene with friction and patch radius too small."""
    contact = scene.contact
    shrink = math.sqrt(BELIEVED * PRODUCT / (contact.friction * contact.patch_radius))
    contact = dataclasses.replace(
        contact, friction=shrink * contact.friction, patch_radius=shrink * contact.patch_radius
    )
    return scene.replace(contact=contact)


def _after(
    scene: Scene, plans: list[Plan], landings: Array, model: str, seed: int
) -> tuple[float, float]:
    """Mean real error [m] after these throws, measured with noise; and mu r_p over the truth."""
    noise = np.random.default_rng(seed).normal(size=(len(WAYS), 2))[: len(plans)] * NOISE
    pairs = [(float(x), float(theta)) for x, theta in landings + noise]
    data = throw_data(plans, pairs, *NOISE)
    found = identify(data, model, prior=scene, delay=True)
    again = _planned(found.apply(scene), WAYS[:JUDGED])
    error = _error(again, thrown(throw_data(again), REALITY, TRUTH))
    return error, found.posterior.product / PRODUCT


def _planned(scene: Scene, ways: Sequence[tuple[float, float]]) -> list[Plan]:
    """Solved plans to the scene's target moved by some distances."""
    planner, aim = Planner(scene, library=False), scene.aim
    assert aim.theta is not None
    goals = [Pose(aim.x + dx, aim.z, aim.theta + math.radians(turn)) for dx, turn in ways]
    plans = [planner.plan(goal) for goal in goals]
    lost = [goal for goal, plan in zip(goals, plans, strict=True) if not plan.solved]
    assert not lost, f"no plan to {lost}"
    return plans


def _error(plans: list[Plan], landings: Array) -> float:
    """Mean pose error [m]."""
    dx, dtheta = (landings - [[plan.target.x, plan.target.theta] for plan in plans]).T
    return float(plans[0].scene.object.pose_error(dx, dtheta).mean())


def _learned(table: Table) -> str:
    """The results of learning from three throws as a sentence."""
    return "after three it is " + ", ".join(
        f"{shown(row['times better, median'])} times smaller by `{row['learned by']}` in the "
        f"median ({shown(row['times better, worst'])} at least)"
        for row in table.where(throws=3)
    )


def _draw_grid(grid: Grid) -> Figure:
    """The mean pose error over friction and patch radius, the lowest 10 % encircled (Fig. 15)."""
    figure, ((axis,),) = panels(7.0, 5.0)
    mu, radius, error = grid.friction, 1e3 * grid.patch_radius, 100 * grid.error.T
    top, low = np.quantile(error, (0.98, 0.1))
    mesh = axis.pcolormesh(mu, radius, error, cmap="inferno", vmax=top, shading="nearest")
    axis.contour(mu, radius, error, [low], colors="white", linewidths=1.0)
    label = "mean pose error [cm]: position plus angle times half the length"
    figure.colorbar(mesh, label=label, extend="max")
    i, j = grid.best()
    axis.plot(mu[i], radius[j], "X", color=RED, ms=11, mec="white")
    axis.set(xlabel="friction μ", ylabel="patch radius r_p [mm]")
    return figure


def _draw_learning(rows: Table) -> Figure:
    """Real landing error over the number of throws that were learned from."""
    figure, ((axis,),) = panels(7.0, 4.0)
    some = rows.rows
    for model, colour in zip(dict.fromkeys(rows.column("learned by")), (BLUE, GREEN), strict=False):
        mine = [row for row in some if row["learned by"] == model]
        counts = [row["throws"] for row in mine]
        for column, line in (("error, median [mm]", "-"), ("error, worst [mm]", ":")):
            words = f"{model}, {column.split(', ')[1].removesuffix(' [mm]')}"
            axis.plot(
                counts, [row[column] for row in mine], line, marker="o", color=colour, label=words
            )
    axis.set(xlabel="throws learned from", ylabel="real scaled error [mm]", yscale="log")
    axis.legend(frameon=False, fontsize=8)
    return figure
