"""Section `throws`: contact parameters from measured throws, models judged on them, learning.

The throws are synthetic, on the paper's design, by a meshed patch with stated noise: they tell how
models differ and whether a fit finds the truth, not how well a model predicts real throws.
"""

from __future__ import annotations

import dataclasses
import math
import os
import statistics
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene, ThrowData, load_scene
from ..identify import (
    Identified,
    Making,
    as_dict,
    identify,
    make_throws,
    throw_data,
    thrown,
    validate,
)
from ..plan import Planner
from ..result import Plan
from ..sweep import executor_of
from .drawing import draw_learning
from .measure import LANES
from .page import Cell, Effort, Picture, Section, Table

Array = npt.NDArray[np.float64]

#: Seed of the throws, and models with a grid.
SEED, MODELS = 1, ("ls", "sp", "ls-step")
#: Learning: models, numbers of throws, and seeds of the noise: quick, full.
LEARNERS = ("sp", "ls-step")
COUNTS, SEEDS = ((3,), (1, 2, 3, 5, 10)), (1, 5)
#: Reality of the learning: friction, patch radius [m] and delay of the gripper [s]; what rubs
#: there; the share of the true mu r_p that is believed.
TRUTH = {"friction": 1.1, "patch_radius": 0.00325, "delay": 0.010}
PRODUCT = TRUTH["friction"] * TRUTH["patch_radius"]
REALITY, BELIEVED = "patch", 0.6
#: Noise of a measured landing: x [m], theta [rad].
NOISE = (0.002, math.radians(0.5))
#: Goals: how far [m, deg] from the scene's own target. The first `JUDGED` are thrown again.
WAYS = (
    *((0.0, 0), (-0.15, 20), (0.1, -25), (-0.05, 40), (-0.1, -40)),
    *((0.05, 15), (-0.2, -10), (0.12, 5), (-0.08, 60), (0.03, -15)),
)
JUDGED = 3


def make(effort: Effort) -> Section:
    """Grids and fits, the models judged, learning from few throws."""
    section = Section("throws", "Contact parameters from measured throws")
    making = Making(repeats=effort.of(1, 5), factors=not effort.quick, seed=SEED)
    data, _ = make_throws(making)
    numbers = [i for i, t in enumerate(data.throws) if t.factors["set"] == "batch"]
    batch = data.picked(numbers[:: effort.of(3, 1)])
    effort.tell(1, 4)
    identified, words = _identified(batch)
    effort.tell(2, 4)
    tables = [identified] if effort.quick else [identified, _validated(validate(data))]
    effort.tell(3, 4)
    learning, before = _learning(effort)
    section.figures += [
        f"{len(batch.throws)} synthetic throws (`throwplan make-throws`): {data.shared.synthetic}.",
        words,
        f"Learning: scene `pose`, believed with {100 * (1 - BELIEVED):.0f} % less μ r_p and "
        f"without the delay of {1e3 * TRUTH['delay']:.0f} ms; reality is the meshed patch, "
        f"landings have noise of {1e3 * NOISE[0]:.0f} mm and {math.degrees(NOISE[1]):.1f}°. Before "
        f"any throw the mean real scaled error is {1e3 * before:.1f} mm; {_learned(learning)}.",
    ]
    section.tables += [*tables, learning]
    caption = "Learning: real scaled error of throws planned after the first throws"
    section.pictures.append(Picture("throws", caption, lambda path: draw_learning(learning, path)))
    return section


def _identified(data: ThrowData) -> tuple[Table, str]:
    """Grids with and without compiled code, and fits; and what to take from them."""
    true = data.truth["friction"] * data.truth["patch_radius"]
    with executor_of(LANES, None) as executor:
        found = [identify(data, m, executor=executor, workers=LANES) for m in MODELS]
    with ProcessPoolExecutor(LANES, get_context("spawn"), _hide_compiler) as executor:
        plain = [identify(data, m, executor=executor, workers=LANES) for m in MODELS]
    rows = [_row(one, other, true) for one, other in zip(found, plain, strict=True)]
    columns = (
        *("model", "grid, least error [mm]", "grid, μ r_p / truth", "fit, error [mm]"),
        *("fit, μ r_p / truth", "± of it", "grid [s]", "grid not compiled [s]"),
    )
    table = Table("throws-identified", "Grid and fit by model", columns, rows)
    fits = ", ".join(f"`{row[0]}` {row[4]:.3g}" for row in rows if row[4] is not None)
    count = sum(one.grid.predictions for one in found if one.grid is not None)
    times = [sum(float(row[i] or 0.0) for row in rows) for i in (6, 7)]
    words = (
        f"Friction times patch radius μ r_p by the fits, over the truth: {fits}. {count:,} "
        f"predictions of the grids take {times[0]:.0f} s by {LANES} processes, {times[1]:.0f} s "
        "without compiled code."
    )
    return table, words


def _row(one: Identified, plain: Identified, true: float) -> list[Cell]:
    assert one.grid is not None and plain.grid is not None
    fitted: list[Cell] = [None] * 3
    if one.fit is not None and one.error is not None:
        belief = one.posterior
        fitted = [1e3 * one.error, belief.product / true, belief.product_deviation]
    least = 1e3 * float(one.grid.error.min())
    times = (one.grid.seconds, plain.grid.seconds)
    return [one.model, least, one.grid.product / true, *fitted, *times]


def _hide_compiler() -> None:
    """A process that finds no compiler."""
    os.environ["THROWPLAN_COMPILE"] = "0"


def _validated(found: Any) -> Table:
    """Tables III and IV, and the cross-validation, a row for each model."""
    rows: list[list[Cell]] = []
    for model, one in as_dict(found)["models"].items():
        best, crossed = one["parameters"]["batch"], one["cross_validation"]
        errors = [one["errors"][name] for name in ("v_x", "omega", "x", "theta")]
        means = [None if e is None else e[key] for e in errors for key in ("mae", "std")]
        product = best["friction"] * best["patch_radius"]
        other = crossed["cross_validated"][0] if crossed else None
        times = (1e3 * one["release_time"]["mean"], one["batch_time"] and 1e3 * one["batch_time"])
        rows.append([model, one["min_mean_error"], other, 1e3 * product, *means, *times])
    named = ("v_x [m/s]", "omega [rad/s]", "x [m]", "theta [rad]")
    columns = (
        *("model", "mean scaled error [m]", "cross-validated [m]", "μ r_p [mm]"),
        *(f"{name}, {key}" for name in named for key in ("MAE", "STD")),
        *("one release [ms]", "in a batch [ms]"),
    )
    caption = "Models judged (`throwplan validate`)"
    return Table("throws-validated", caption, columns, rows)


def _learning(effort: Effort) -> tuple[Table, float]:
    """Real error over the number of throws learned from; and before any throw [m]."""
    scene = _believed(load_scene("pose"))
    plans = _planned(scene, WAYS)
    landings = thrown(throw_data(plans), REALITY, TRUTH)
    before = _error(plans[:JUDGED], landings[:JUDGED])
    rows: list[list[Cell]] = []
    for model in LEARNERS:
        for count in COUNTS[not effort.quick]:
            found = [
                _after(scene, plans[:count], landings[:count], model, seed)
                for seed in range(effort.of(*SEEDS))
            ]
            errors, products = [one[0] for one in found], [one[1] for one in found]
            middle, worst = statistics.median(errors), max(errors)
            cells = [1e3 * middle, 1e3 * worst, before / middle, before / worst]
            rows.append([model, count, *cells, min(products), max(products)])
    columns = (
        *("learned by", "throws", "error, median [mm]", "error, worst [mm]"),
        *("times better, median", "times better, worst"),
        *("μ r_p / truth, least", "μ r_p / truth, most"),
    )
    return Table("throws-learning", "Learning from few throws", columns, rows), before


def _believed(scene: Scene) -> Scene:
    """The scene with friction and patch radius too small."""
    contact = scene.contact
    shrink = math.sqrt(BELIEVED * PRODUCT / (contact.friction * contact.patch_radius))
    contact = dataclasses.replace(
        contact,
        friction=shrink * contact.friction,
        patch_radius=shrink * contact.patch_radius,
    )
    return scene.replace(contact=contact)


def _after(
    scene: Scene, plans: list[Plan], landings: Array, model: str, seed: int
) -> tuple[float, float]:
    """Mean real error [m] after these throws, measured with noise; and mu r_p over the truth."""
    noise = np.random.default_rng(seed).normal(size=(len(WAYS), 2))[: len(plans)] * NOISE
    pairs = [(float(x), float(theta)) for x, theta in landings + noise]
    data = throw_data(plans, pairs, *NOISE)
    found = identify(data, model, prior=scene, delay=True, grid=False)
    again = _planned(found.apply(scene), WAYS[:JUDGED])
    error = _error(again, thrown(throw_data(again), REALITY, TRUTH))
    return error, found.posterior.product / PRODUCT


def _planned(scene: Scene, ways: Sequence[tuple[float, float]]) -> list[Plan]:
    """Solved plans to the scene's target, moved some ways."""
    planner, aim = Planner(scene, compiling="no"), scene.target
    assert aim is not None and aim.theta is not None
    goals = [Pose(aim.x + dx, aim.z, aim.theta + math.radians(turn)) for dx, turn in ways]
    plans = [planner.plan(goal) for goal in goals]
    lost = [goal for goal, plan in zip(goals, plans, strict=True) if not plan.solved]
    assert not lost, f"no plan to {lost}"
    return plans


def _error(plans: list[Plan], landings: Array) -> float:
    """Mean scaled error [m]."""
    off = np.abs(landings - [[plan.target.x, plan.target.theta] for plan in plans])
    return float((off @ [1.0, plans[0].scene.object.length / 2]).mean())


def _learned(table: Table) -> str:
    """What three throws are worth."""
    found = [row for row in table.rows if row[1] == 3]
    return "after three it is " + ", ".join(
        f"{row[4]:.3g} times smaller by `{row[0]}` in the median ({row[5]:.3g} at least)"
        for row in found
    )
