"""The error landscape over friction and patch radius on a grid (Fig. 15)."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import Array, Indices
from .predict import Predictor, Progress, parameter_sets

Axes = tuple[Array, Array]

#: The paper's grid: 0.25 to 1.2, and 2.5 to 12 mm.
AXES: Axes = (np.linspace(0.25, 1.2, 20), np.linspace(0.0025, 0.012, 20))
CELLS = AXES[0].size * AXES[1].size
#: Pose error [m] of a throw for which a model predicts no landing.
MISSED = 10.0


@dataclass(frozen=True)
class Grid:
    """Pose errors of T throws for `friction` (F,) and `patch_radius` (R,) [m].

    errors (T, F, R) [m], NaN for a throw without a predicted landing; detach (T, F, R, 6):
    CoM states at the end of the opening; seconds: of the work.
    """

    model: str
    friction: Array
    patch_radius: Array
    errors: Array
    detach: Array
    seconds: float

    @property
    def throws(self) -> int:
        """Number of throws T."""
        return len(self.errors)

    @property
    def scored(self) -> Array:
        """errors, with `MISSED` for throws without a predicted landing."""
        return np.nan_to_num(self.errors, nan=MISSED)

    @property
    def error(self) -> Array:
        """Mean pose error (F, R) [m] over all throws."""
        return np.asarray(self.scored.mean(axis=0))

    @property
    def missed(self) -> Indices:
        """Number (F, R) of throws without a predicted landing."""
        return np.asarray(np.isnan(self.errors).sum(axis=0))

    def best(self, rows: npt.NDArray[Any] | slice = slice(None)) -> tuple[int, int]:
        """The cell with the lowest mean error over some of the throws."""
        mean = self.scored[rows].mean(axis=0)
        i, j = np.unravel_index(int(np.argmin(mean)), mean.shape)
        return int(i), int(j)

    def part(self, rows: Indices) -> Grid:
        """The grid of some of the throws, with their share of the time."""
        seconds = self.seconds * len(rows) / self.throws
        return replace(self, errors=self.errors[rows], detach=self.detach[rows], seconds=seconds)

    def contact(self, cell: tuple[int, int]) -> tuple[float, float]:
        """friction and patch_radius [m] of a cell."""
        return float(self.friction[cell[0]]), float(self.patch_radius[cell[1]])

    @property
    def predictions(self) -> int:
        """Throws times cells."""
        return int(self.errors.size)


def grid_of(
    predictor: Predictor,
    model: str,
    axes: Axes = AXES,
    progress: Progress | None = None,
) -> Grid:
    """The error landscape of a model."""
    shape = (len(predictor.data.throws), len(axes[0]), len(axes[1]))
    friction, radius = (cells.ravel() for cells in np.meshgrid(*axes, indexing="ij"))
    sets = parameter_sets(friction, radius)
    start = time.perf_counter()
    detach = predictor.detached(model, sets, progress)
    off = predictor.landed(detach) - predictor.truth.landing[:, None]
    errors, seconds = predictor.truth.scaled(off).reshape(shape), time.perf_counter() - start
    detach = detach.reshape(*shape, 6)
    return Grid(model, *axes, errors, detach, seconds)
