"""Section: contact parameters from measured throws, and the models judged on them."""

from __future__ import annotations

import math
import os
import statistics
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from ...problems import ThrowData
from ..identify import (
    Grid,
    Identified,
    Making,
    Predictor,
    Validation,
    crossed_table,
    draw_grid,
    error_table,
    errors_by_throw,
    estimated_seconds,
    factor_table,
    grid_of,
    head,
    identify,
    make_throws,
    measured,
    notes,
    parameter_table,
    validate,
)
from ..sweep import executor_of
from .learning_runs import BELIEVED, JUDGED, NOISE, REALITY, TRUTH, Lesson
from .page import Cell, Effort, Picture, Section, Table

#: Seed of the batch, and models with a grid; what is only timed.
SEED, MODELS, TIMED = 1, ("ls", "sp", "ls-step"), "ils"
#: Processes that share a grid.
WORKERS = 2
#: Learning: models, numbers of throws and of seeds of the noise, quick and full.
LEARNERS = ("sp", "ls-step")
COUNTS = {True: (3,), False: (1, 2, 3, 5, 10)}
SEEDS = (1, 5)


def make(effort: Effort) -> Section:
    """The section: grids and fits, Tables III and IV, learning from few throws."""
    section = Section("throws", "Contact parameters from measured throws")
    making = Making(repeats=effort.of(1, 5), factors=not effort.quick, seed=SEED)
    data, _ = make_throws(making, lambda *_: None)
    numbers = [i for i, t in enumerate(data.throws) if t.factors["set"] == "batch"]
    batch = data.picked(numbers[:: effort.of(3, 1)])
    effort.tell(1, 4)
    _add_identified(section, batch, not effort.quick)
    effort.tell(2, 4)
    if not effort.quick:
        _add_validated(section, validate(data))
    effort.tell(3, 4)
    _add_learned(section, effort)
    return section


def _add_identified(section: Section, data: ThrowData, timed: bool) -> None:
    """Grids with and without compiled code, and fits; timed: the time of a slow model, too."""
    true = data.truth["friction"] * data.truth["patch_radius"]
    section.add(
        f"{len(data.throws)} synthetic throws on the paper's design (`throwplan make-throws`, seed "
        f"{SEED}): {data.shared.synthetic}. True friction × patch radius μ r_p = "
        f"{1e3 * true:.3g} mm. Each model's "
        "mean scaled error over a 20 × 20 grid of friction and patch radius, by "
        f"{WORKERS} processes with compiled batches and without, and its continuous fit "
        "(`throwplan identify`)."
    )
    with executor_of(WORKERS, None) as executor:
        found = {
            model: identify(data, model, executor=executor, workers=WORKERS) for model in MODELS
        }
    predictor, truth = Predictor(data), measured(data)
    with _uncompiled() as executor:
        plain = {
            model: grid_of(
                predictor, model, truth, fixed=(0.0, 1.0), executor=executor, workers=WORKERS
            )
            for model in MODELS
        }
    each = estimated_seconds(predictor, TIMED, truth) if timed else None
    rows = [_identified_row(one, plain[model], true) for model, one in found.items()]
    if each is not None:
        whole = each * len(data.throws) * 400
        rows.append([TIMED, *[None] * 7, 1e3 * each, whole])
    grids = [one.grid for one in found.values() if one.grid is not None]
    count, fast = sum(g.predictions for g in grids), sum(g.seconds for g in grids)
    slow = sum(g.seconds for g in plain.values())
    section.add(
        Table(
            "identified",
            "Grid and fit by model; products as a share of the truth",
            (
                *("model", "grid, least error [mm]", "grid, μ r_p / truth"),
                *("fit, error [mm]", "fit, μ r_p / truth", "± of it"),
                *("grid [s]", "not compiled [s]", "one prediction [ms]", "grid, one process [s]"),
            ),
            rows,
        ),
        f"{count:,} predictions took {fast:.1f} s, {slow:.1f} s without compiled code, with "
        "splines of the measured hands and scoring. ± is what the noise leaves open; it knows "
        "nothing of a model's own error, so a product may be off by many times that. A model "
        "without a fit has none: its landings jump with the parameters.",
    )
    section.short.append(_short(rows))
    if timed:
        section.add(
            f"`{TIMED}` has no batch: it was timed on a few throws, and the time of its grid is "
            "extrapolated from them."
        )
    for model, one in found.items():
        words = f"Mean scaled error over friction and patch radius by {model}, lowest 10 % hatched"
        assert one.grid is not None
        cells = _cells(f"throws-grid-{model}", one.grid)
        section.add(Picture(f"throws-grid-{model}", words, _grid_drawing(one), cells))


def _grid_drawing(one: Identified) -> Callable[[Path], None]:
    return lambda path: draw_grid(one, path)


def _short(rows: list[list[Cell]]) -> str:
    """How well parameters are found."""
    fits = [f"`{row[0]}` {row[4]:.3g}" for row in rows if isinstance(row[4], float)]
    return (
        "Friction times patch radius fitted to synthetic throws, as a share of the truth: "
        f"{', '.join(fits)}."
    )


def _cells(name: str, grid: Grid) -> Table:
    """The grid's cells, one in a row."""
    rows: list[list[Cell]] = [
        [float(grid.friction[i]), float(grid.patch_radius[j]), float(error)]
        for (i, j), error in np.ndenumerate(grid.error)
    ]
    columns = ("friction", "patch radius [m]", "mean scaled error [m]")
    return Table(name, "", columns, rows)


def _identified_row(one: Identified, plain: Grid, true: float) -> list[Cell]:
    grid, fit = one.grid, one.fit
    assert grid is not None
    fitted: list[Cell] = [None] * 3
    if fit is not None and one.error is not None:
        belief = one.posterior
        fitted = [1e3 * one.error, belief.product / true, belief.product_deviation]
    least = 1e3 * float(grid.error.min())
    one_each = 1e3 * grid.workers * grid.seconds / grid.predictions
    shares: list[Cell] = [least, grid.product / true, *fitted, grid.seconds, plain.seconds]
    return [one.model, *shares, one_each, grid.workers * grid.seconds]


def _uncompiled() -> ProcessPoolExecutor:
    """Processes that find no compiler."""
    return ProcessPoolExecutor(WORKERS, get_context("spawn"), _hide_compiler)


def _hide_compiler() -> None:
    os.environ["THROWPLAN_COMPILE"] = "0"


def _add_validated(section: Section, found: Validation) -> None:
    """Tables III and IV, cross-validation, and pictures."""
    from ..identify import factors_picture
    from ..identify import validation_pictures as pictures

    section.add(
        f"The models judged on all {len(found.data.throws)} throws (`throwplan validate`, "
        f"{found.seconds:.0f} s): "
        + "; ".join(head(found)[:1])
        + ". "
        + ". ".join(notes(found))
        + "."
    )
    for table in (parameter_table(found), error_table(found), crossed_table(found)):
        words = table.words()
        section.add(Table(f"throws-{table.name}", table.caption, words[0], words[1:]))
    section.add(
        "Times of one release here are those of a measured hand motion with its splines, "
        "`sp` with events located; section models has given motions."
    )
    every, factors = errors_by_throw(found), factor_table(found).words()
    section.add(
        Picture(
            "throws-errors",
            "Predicted less measured landings by model",
            lambda path: pictures.save(pictures.errors_picture(found), path),
            Table("throws-every", "", every[0], every[1:]),
        ),
        Picture(
            "throws-factors",
            "What a change of one factor does, measured and predicted; errors in both conditions",
            lambda path: pictures.save(factors_picture(found), path),
            Table("throws-factors", "", factors[0], factors[1:]),
        ),
    )


def _add_learned(section: Section, effort: Effort) -> None:
    """Landing error over the number of throws learned from."""
    lesson, seeds = Lesson(), range(effort.of(*SEEDS))
    rows: list[list[Cell]] = []
    for model in LEARNERS:
        for count in COUNTS[effort.quick]:
            found = [lesson.after(count, model, seed) for seed in seeds]
            errors = [one.error for one in found]
            products = [one.product for one in found]
            middle = statistics.median(errors)
            rows.append(
                [
                    model,
                    count,
                    1e3 * middle,
                    1e3 * max(errors),
                    lesson.before / middle,
                    lesson.before / max(errors),
                    min(products),
                    max(products),
                ]
            )
    section.add(
        f"Learning from few throws: scene `pose`, whose belief of μ r_p is "
        f"{100 * (1 - BELIEVED):.0f} % too low and knows nothing of a delay of "
        f"{1e3 * TRUTH['delay']:.0f} ms; reality is the meshed patch (`{REALITY}`). Landings are "
        f"measured with noise of {1e3 * NOISE[0]:.0f} mm and {math.degrees(NOISE[1]):.1f}°, "
        f"{len(seeds)} seeds. Before any throw the mean real scaled error of {JUDGED} targets is "
        f"{1e3 * lesson.before:.1f} mm. A single throw cannot tell the "
        "delay from μ r_p by itself; what `sp` leaves is in part its own distance to the patch.",
        Table(
            "learning",
            "Mean real landing error of throws planned after k throws",
            (
                *("learned by", "throws k", "error, median [mm]", "error, worst [mm]"),
                *("times better, median", "times better, worst"),
                *("μ r_p / truth, least", "μ r_p / truth, most"),
            ),
            rows,
        ),
    )
