"""Scaled landing errors throw by throw over a grid of contact parameters, and its best cell.

The same grid as `grid_of`, kept for single throws: a mean over some of them then costs
nothing, so that cross-validation and other surfaces use the same predictions.
"""

from __future__ import annotations

import dataclasses
import time
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .grid import FRICTION, MISSED, PATCH_RADIUS, Progress
from .measured import Measured, errors, scaled
from .predict import Parameters, Predictions, Predictor
from .validation_predict import part_of, predicted

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int_]

#: Models fast enough for the whole grid and all throws.
FAST = ("sp", "sp-paper", "ls", "ls-step")
#: Cells of the others, as multiples of a fast model's best; and on how many throws at most.
AROUND = (0.75, 1.0, 1.33)
FEW_THROWS = 8


@dataclass(frozen=True)
class CellErrors:
    """What a model makes of S throws in M cells.

    rows (S,): the throws' numbers; friction, patch_radius [m] (M,); found: predictions
    (S, M); error (S, M): scaled errors [m], 10 m where the model gave no landing; seconds
    of all predictions.
    """

    model: str
    rows: Rows
    friction: Array
    patch_radius: Array
    found: Predictions
    error: Array
    seconds: float

    def mean(self, chosen: npt.NDArray[np.bool_] | None = None) -> Array:
        """Mean scaled error (M,) over `chosen` (S,) of the throws, or all."""
        error = self.error if chosen is None else self.error[chosen]
        return np.asarray(error.mean(axis=0))

    def best(self, chosen: npt.NDArray[np.bool_] | None = None) -> int:
        """The cell with the lowest mean."""
        return int(np.argmin(self.mean(chosen)))

    @property
    def missing(self) -> int:
        """Predictions without a landing."""
        return int((~np.isfinite(self.found.landing[..., 0])).sum())

    def part(self, rows: Rows) -> CellErrors:
        """Of these throws only, those that are there."""
        keep = np.isin(self.rows, rows)
        found = Predictions(self.found.detach[keep], self.found.landing[keep])
        return dataclasses.replace(self, rows=self.rows[keep], found=found, error=self.error[keep])


def whole_grid() -> Parameters:
    """The paper's 400 cells, mu slowest."""
    friction, radius = np.meshgrid(FRICTION, PATCH_RADIUS, indexing="ij")
    return Parameters(friction.ravel(), radius.ravel())


def cells_around(friction: float, patch_radius: float) -> Parameters:
    """9 cells around a point."""
    share = np.array(AROUND)
    first, second = np.meshgrid(friction * share, patch_radius * share, indexing="ij")
    return Parameters(first.ravel(), second.ravel())


def spread_rows(rows: Rows, most: int) -> Rows:
    """At most `most` of the rows, evenly."""
    if len(rows) <= most:
        return rows
    return np.asarray(rows[np.unique(np.linspace(0, len(rows) - 1, most).round().astype(int))])


def cell_errors(
    predictor: Predictor,
    truth: Measured,
    model: str,
    rows: Rows,
    cells: Parameters,
    progress: Progress | None = None,
) -> CellErrors:
    """Throw `rows` of the data by `model` in all cells."""
    friction, radius, *_ = cells.spread()
    # The first prediction of a process loads libraries.
    first = part_of(predictor, rows[:1])
    predicted(first, model, Parameters(friction[:1], radius[:1]), None)
    start = time.perf_counter()
    found = predicted(part_of(predictor, rows), model, cells, progress)
    seconds = time.perf_counter() - start
    part = Measured(truth.landing[rows], truth.twist[rows], truth.arm[rows])
    error = np.nan_to_num(scaled(errors(found, part), part.arm), nan=MISSED)
    return CellErrors(model, rows, friction, radius, found, error, seconds)
