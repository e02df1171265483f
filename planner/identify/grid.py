"""The error landscape over friction and patch radius: a grid, as in Fig. 15."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems import ThrowData
from .measured import Measured, errors, scaled
from .predict import BATCHES, Parameters, Predictor

Array = npt.NDArray[np.float64]
#: Called with the throws that are done and all of them.
Progress = Callable[[int, int], None]

#: The paper's grid: 0.25 to 1.2, and 2.5 to 12 mm.
FRICTION = np.linspace(0.25, 1.2, 20)
PATCH_RADIUS = np.linspace(0.0025, 0.012, 20)
#: Scaled error [m] of a throw for which a model predicts no landing.
MISSED = 10.0
#: Throws per piece of work of a worker process.
PIECE = 6
#: Longest time [s] that a grid may take by a model without a batch.
PATIENCE = 300.0
#: What such a model is timed on: so many throws, and so many cells of each.
TIMED_THROWS, TIMED_CELLS = 5, 4


@dataclass(frozen=True)
class Grid:
    """Mean scaled error (F, R) [m] over all throws for `friction` (F,), `patch_radius` (R,).

    missed (F, R): throws without a predicted landing, which count as 10 m; seconds: of the
    work; workers: processes that shared it; delay [s] and grip_scale: held at these.
    """

    model: str
    friction: Array
    patch_radius: Array
    error: Array
    missed: npt.NDArray[np.int_]
    throws: int
    seconds: float
    workers: int = 1
    delay: float = 0.0
    grip_scale: float = 1.0

    @property
    def best(self) -> tuple[int, int]:
        """The cell of the lowest mean error."""
        i, j = np.unravel_index(int(np.argmin(self.error)), self.error.shape)
        return int(i), int(j)

    @property
    def optimum(self) -> tuple[float, float]:
        """friction and patch_radius [m] of the best cell."""
        i, j = self.best
        return float(self.friction[i]), float(self.patch_radius[j])

    @property
    def product(self) -> float:
        """mu r_p [m] of the best cell."""
        return self.optimum[0] * self.optimum[1]

    @property
    def lowest(self) -> npt.NDArray[np.bool_]:
        """The cells of the lowest 10 % of errors."""
        return np.asarray(self.error <= np.quantile(self.error, 0.1))

    @property
    def predictions(self) -> int:
        """Throws times cells."""
        return self.throws * self.error.size

    def starts(self, count: int) -> Array:
        """Logarithms (S, 2) of the best cells that lie apart, for a fit to start from."""
        order = np.argsort(self.error, axis=None)
        chosen: list[tuple[float, float]] = []
        for place in order:
            i, j = np.unravel_index(int(place), self.error.shape)
            point = (float(np.log(self.friction[i])), float(np.log(self.patch_radius[j])))
            if all(np.hypot(*np.subtract(point, other)) > 0.3 for other in chosen):
                chosen.append(point)
            if len(chosen) == count:
                break
        return np.array(chosen)

    def error_near(self, point: Array) -> float:
        """Error [m] of the cell at logarithms (2,) of friction and patch_radius."""
        i = int(np.argmin(np.abs(np.log(self.friction) - point[0])))
        return float(self.error[i, int(np.argmin(np.abs(np.log(self.patch_radius) - point[1])))])

    def to_dict(self) -> dict[str, Any]:
        """As JSON, without the map itself."""
        return {
            "friction": self.optimum[0],
            "patch_radius": self.optimum[1],
            "product": self.product,
            "least_error": float(self.error.min()),
            "most_error": float(self.error.max()),
            "missed": int(self.missed.sum()),
            "delay": self.delay,
            "grip_scale": self.grip_scale,
            "predictions": self.predictions,
            "seconds": self.seconds,
            "time_per_throw": self.workers * self.seconds / self.predictions,
        }


def grid_of(
    predictor: Predictor,
    model: str,
    truth: Measured,
    axes: tuple[Array, Array] = (FRICTION, PATCH_RADIUS),
    fixed: tuple[float, float] = (0.0, 1.0),
    executor: Executor | None = None,
    workers: int = 1,
    progress: Progress | None = None,
) -> Grid:
    """The error landscape of a model; `fixed`: delay [s] and scale of the grip force."""
    friction, radius = axes
    cells = np.meshgrid(friction, radius, indexing="ij")
    parameters = Parameters(
        cells[0].ravel(), cells[1].ravel(), np.array([fixed[0]]), np.array([fixed[1]])
    )
    start = time.perf_counter()
    count = len(predictor.data.throws)
    if executor is None:
        landing = predictor.predict(model, parameters, progress).landing
    else:
        landing = _shared(predictor.data, model, parameters, executor, progress)
    off = scaled(landing[..., :2] - truth.landing[:, None], truth.arm)
    lost = ~np.isfinite(off)
    off[lost] = MISSED
    shape, seconds = cells[0].shape, time.perf_counter() - start
    mean, missed = off.mean(axis=0).reshape(shape), lost.sum(axis=0).reshape(shape)
    return Grid(model, friction, radius, mean, missed, count, seconds, workers, *fixed)


def _shared(
    data: ThrowData,
    model: str,
    parameters: Parameters,
    executor: Executor,
    progress: Progress | None,
) -> Array:
    """Landings (T, M, 3) by worker processes, some throws at a time."""
    count, done = len(data.throws), 0
    pieces = [list(range(i, min(i + PIECE, count))) for i in range(0, count, PIECE)]
    work = {
        executor.submit(predict_piece, data.picked(piece), model, parameters): piece
        for piece in pieces
    }
    landing = np.full((count, parameters.count, 3), np.nan)
    for future in as_completed(work):
        landing[work[future]] = future.result()
        done += len(work[future])
        if progress is not None:
            progress(done, count)
    return landing


def predict_piece(data: ThrowData, model: str, parameters: Parameters) -> Array:
    """Landings (T, M, 3) of some throws, in a process of its own."""
    return Predictor(data).predict(model, parameters).landing


def estimated_seconds(predictor: Predictor, model: str, truth: Measured) -> float | None:
    """Time [s] of one prediction by a model without a batch, timed on a few throws and cells.

    None for models that take many parameters at once: those are run in full.
    """
    if model in BATCHES:
        return None
    throws = np.unique(np.linspace(0, len(predictor.data.throws) - 1, TIMED_THROWS).astype(int))
    some = Predictor(predictor.data.picked([int(i) for i in throws]))
    few = np.linspace(0, len(FRICTION) - 1, TIMED_CELLS).astype(int)
    parameters = Parameters(FRICTION[few], PATCH_RADIUS[few])
    start = time.perf_counter()
    some.predict(model, parameters)
    return (time.perf_counter() - start) / (len(throws) * TIMED_CELLS)


def mean_error(
    predictor: Predictor, model: str, truth: Measured, parameters: Parameters
) -> tuple[float, int]:
    """Mean scaled error [m] at one parameter set, and the throws without a landing."""
    found = predictor.predict(model, parameters)
    off = scaled(errors(found, truth), truth.arm)[:, 0]
    lost = ~np.isfinite(off)
    return float(np.where(lost, MISSED, off).mean()), int(lost.sum())
