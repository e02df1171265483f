"""Release models on measured throws: parameters, errors, cross-validation, factors.

Every model gets the parameters that suit it best on the batch (Table III), as in the
paper; what it predicts with them is then compared with what was measured (Table IV).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...problems import ThrowData
from ..check import MODELS
from .best_cell import (
    FAST,
    FEW_THROWS,
    CellErrors,
    cell_errors,
    cells_around,
    spread_rows,
    whole_grid,
)
from .factors import SURFACE, FactorRow, batch_rows, comparisons, conditions, factor_rows
from .measured import Measured, measured, scaled
from .predict import BATCHES, Parameters, Predictor, check_model
from .validation_folds import Crossed, cross_validated
from .validation_predict import part_of, predicted, quick_predictor

Array = npt.NDArray[np.float64]
Rows = npt.NDArray[np.int_]
Progress = Callable[[int, int], None]
#: Told what comes next; gives what is told (done, total) of it.
About = Callable[[str], Progress]

#: Models of the two tables.
PAPER_MODELS = ("ls", "sp", "sp-paper", "ils", "ls-step")
#: Where the search of slow models begins.
GUIDE = "ls-step"
#: Throws whose single release is timed.
TIMED = 20


@dataclass(frozen=True)
class ModelCheck:
    """One model on all T throws.

    cells: its errors on the batch; parameters: (mu, r_p [m]) by surface, "" for the
    batch; surface (T,): which of them was used; landing (T, 2): predicted less measured
    x [m], theta [rad]; twist (T, 2): the same of v_x [m/s], omega [rad/s]; single (n,):
    seconds of one release; batched: seconds of one prediction in a batch, None if the
    model has none.
    """

    model: str
    cells: CellErrors
    parameters: dict[str, tuple[float, float]]
    surface: list[str]
    landing: Array
    twist: Array
    single: Array
    batched: float | None
    crossed: Crossed | None

    @property
    def friction(self) -> float:
        """mu* of the batch."""
        return self.parameters[""][0]

    @property
    def patch_radius(self) -> float:
        """r_p* of the batch [m]."""
        return self.parameters[""][1]

    @property
    def at_edge(self) -> list[str]:
        """Surfaces (empty: that of the batch) whose better parameters may lie outside."""
        known = self.cells.friction, self.cells.patch_radius
        ends = [(values.min(), values.max()) for values in known]
        # A slow model is searched around another model's best, surface by surface.
        searched = self.parameters.items() if self.whole else [("", self.parameters[""])]
        return [
            surface
            for surface, pair in searched
            if any(np.isclose(value, end).any() for value, end in zip(pair, ends, strict=True))
        ]

    @property
    def whole(self) -> bool:
        """Whether the whole grid was searched."""
        return self.model in FAST


@dataclass(frozen=True)
class Validation:
    """A data set judged.

    predictor: of all its throws; batch: rows the parameters are from; conditions: of all
    throws; factors: a list per comparison; left_out: factors that the data lack; seconds
    in all.
    """

    data: ThrowData
    predictor: Predictor
    truth: Measured
    batch: Rows
    conditions: list[tuple[str, ...]]
    checks: dict[str, ModelCheck]
    factors: list[list[FactorRow]]
    left_out: list[str]
    seconds: float

    def scaled(self, model: str) -> Array:
        """Scaled error (T,) [m] of a model, (39)."""
        return scaled(self.checks[model].landing[:, None], self.truth.arm)[:, 0]

    @property
    def tracked(self) -> bool:
        """Whether twists in flight are known of any throw of the batch."""
        return bool(np.isfinite(self.truth.twist[self.batch]).any())


def validate(
    data: ThrowData,
    models: Sequence[str] = PAPER_MODELS,
    factors: Sequence[str] = (),
    about: About | None = None,
) -> Validation:
    """Judge `models` on a data set; `factors`: columns beside the known ones to compare by.

    Raises InputError for an unknown model or factor and for throws that never land.
    """
    start = time.perf_counter()
    for model in models:
        check_model(model)
    compared, left_out = comparisons(data, factors)
    work = _Work(quick_predictor(data), measured(data), about or (lambda _: lambda *_: None))
    checks = {model: work.check(model) for model in dict.fromkeys(models)}
    off = {model: check.landing for model, check in checks.items()}
    rows = [factor_rows(comparison, work.truth.landing, off) for comparison in compared]
    spent = time.perf_counter() - start
    return Validation(
        data, work.predictor, work.truth, work.batch, work.conditions, checks, rows, left_out, spent
    )


class _Work:
    """What all models of one validation share."""

    def __init__(self, predictor: Predictor, truth: Measured, about: About) -> None:
        self.predictor, self.data = predictor, predictor.data
        self.truth, self.batch, self.about = truth, batch_rows(self.data), about
        self.conditions = conditions(self.data)
        self._grids: dict[str, CellErrors] = {}

    def groups(self) -> dict[str, Rows]:
        """Throws by the surface whose parameters they need, "" for the batch's."""
        labels = [throw.factors.get(SURFACE, "") for throw in self.data.throws]
        usual = {labels[i] for i in self.batch}
        own = [label for label in dict.fromkeys(labels) if label not in usual]
        keys = [label if label in own else "" for label in labels]
        return {key: np.array([i for i, k in enumerate(keys) if k == key]) for key in ("", *own)}

    def grid(self, model: str) -> CellErrors:
        """All throws in the whole grid, once."""
        if model not in self._grids:
            rows = np.arange(len(self.data.throws))
            show = self.about(f"{model}: 400 parameter sets")
            cells = cell_errors(self.predictor, self.truth, model, rows, whole_grid(), show)
            self._grids[model] = cells
        return self._grids[model]

    def check(self, model: str) -> ModelCheck:
        """One model's parameters and errors."""
        count = len(self.data.throws)
        landing, twist = np.full((count, 2), np.nan), np.full((count, 2), np.nan)
        surface, parameters, of_batch = [""] * count, {}, None
        for label, rows in self.groups().items():
            fitted = self.batch if label == "" else rows
            cells = self.cells(model, fitted)
            best = cells.best()
            pair = float(cells.friction[best]), float(cells.patch_radius[best])
            parameters[label] = pair
            landing[rows], twist[rows] = self.predicted(model, rows, pair)
            for i in rows:
                surface[i] = label
            of_batch = of_batch or cells
        assert of_batch is not None  # the batch comes first
        single = self.timed(model, parameters[""])
        batched = None
        if model in BATCHES:
            batched = of_batch.seconds / of_batch.friction.size / self.timed_throws(model)
        known = [self.conditions[i] for i in of_batch.rows]
        crossed = cross_validated(of_batch, known)
        return ModelCheck(
            model, of_batch, parameters, surface, landing, twist, single, batched, crossed
        )

    def timed_throws(self, model: str) -> int:
        """Throws in the batches that `CellErrors.seconds` is of."""
        return len(self.data.throws) if model in FAST else min(FEW_THROWS, len(self.batch))

    def cells(self, model: str, rows: Rows) -> CellErrors:
        """Errors that the parameters come from: a slow model's from some throws and cells."""
        if model in FAST:
            return self.grid(model).part(rows)
        guide = self.grid(GUIDE).part(rows)
        best = guide.best()
        cells = cells_around(float(guide.friction[best]), float(guide.patch_radius[best]))
        some = spread_rows(rows, FEW_THROWS)
        show = self.about(f"{model}: {cells.count} parameter sets around {GUIDE}'s best")
        return cell_errors(self.predictor, self.truth, model, some, cells, show)

    def predicted(self, model: str, rows: Rows, pair: tuple[float, float]) -> tuple[Array, Array]:
        """Errors (S, 2) of landing and twist with one parameter set."""
        if model in FAST:
            grid = self.grid(model)
            same = (grid.friction == pair[0]) & (grid.patch_radius == pair[1])
            cell = int(np.flatnonzero(same)[0])
            landing, detach = grid.found.landing[rows, cell], grid.found.detach[rows, cell]
        else:
            predictor = part_of(self.predictor, rows)
            parameters = Parameters(np.array(pair[:1]), np.array(pair[1:]))
            show = self.about(f"{model}: its best parameters")
            found = predicted(predictor, model, parameters, show)
            landing, detach = found.landing[:, 0], found.detach[:, 0]
        off = landing[:, :2] - self.truth.landing[rows]
        return off, detach[:, [3, 5]] - self.truth.twist[rows]

    def timed(self, model: str, pair: tuple[float, float]) -> Array:
        """Seconds of single releases of some throws of the batch."""
        chosen = spread_rows(self.batch, TIMED)
        predictor = part_of(self.predictor, chosen)
        show = self.about(f"{model}: single releases")
        spent = []
        for n, (throw, hand) in enumerate(zip(predictor.data.throws, predictor.hands, strict=True)):
            case = predictor.case(throw, hand, (*pair, 0.0, 1.0))
            if n == 0:
                MODELS[model].release(case)
            start = time.perf_counter()
            MODELS[model].release(case)
            spent.append(time.perf_counter() - start)
            show(n + 1, len(chosen))
        return np.array(spent)
