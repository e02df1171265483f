"""Release models on measured throws: parameters, errors, cross-validation.

Every model gets its best parameters on the batch (Table III), as in the paper; its predictions with
these are compared with the measurement (Table IV).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from ...models import Array, Indices
from ...models.release import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems.throws import ThrowData
from .conditions import SURFACE, batch_rows, conditions
from .grid import AXES, CELLS, Grid, grid_of
from .predict import Predictor, Progress, check_model, parameter_sets

#: about(words) announces a part of the work and returns its progress(done, total).
About = Callable[[str], Progress]

#: Models of the two tables.
PAPER_MODELS = ("ls", SLIDING_PIVOT, "sp-paper", STEPPED_SURFACE)
#: Number of throws whose single releases are timed.
TIMED = 20
#: Number of folds of a cross-validation.
FOLDS = 6
#: Fewest throws for a cross-validation.
FEWEST_THROWS = 5
#: Number of bootstrap samples of the conditions.
RESAMPLED = 2000
#: Quantiles at the ends of the interval.
INTERVAL = (0.025, 0.975)


@dataclass(frozen=True)
class CrossValidation:
    """Errors with parameters from all throws, and from all folds but the judged one.

    inside, outside, more (3,): mean pose errors [m] of the two and of their difference, with the
    ends of 95 % intervals; folds; throws; parameters (K, 2): mu, r_p [m] of each fold.
    """

    inside: Array
    outside: Array
    more: Array
    folds: int
    throws: int
    parameters: Array


@dataclass(frozen=True)
class ModelCheck:
    """One model on all T throws.

    grid: errors of the batch, which gives the parameters; parameters: (mu, r_p [m]) by surface, ""
    for the batch; surface (T,): the parameters used; landing (T, 2): predicted
    less measured x [m], theta [rad]; twist (T, 2): the same of v_x [m/s], omega [rad/s];
    single (n,): seconds of one release; batched: seconds of one prediction in a batch.
    """

    model: str
    grid: Grid
    parameters: dict[str, tuple[float, float]]
    surface: list[str]
    landing: Array
    twist: Array
    single: Array
    batched: float
    crossed: CrossValidation | None

    @property
    def at_edge(self) -> list[str]:
        """Surfaces ("" for the batch) with parameters at the edge of the grid."""
        axes = self.grid.friction, self.grid.patch_radius
        return [
            surface
            for surface, pair in self.parameters.items()
            if any(value in (axis[0], axis[-1]) for value, axis in zip(pair, axes, strict=True))
        ]


@dataclass(frozen=True)
class Validation:
    """Release models compared on a data set.

    predictor: of all throws; batch: rows that give the parameters; conditions: of all throws;
    seconds: of the work.
    """

    data: ThrowData
    predictor: Predictor
    batch: Indices
    conditions: list[tuple[str, ...]]
    checks: dict[str, ModelCheck]
    seconds: float

    def scaled(self, model: str) -> Array:
        """Pose error (39) (T,) [m] of a model: position plus angle times half the length."""
        return self.predictor.truth.scaled(self.checks[model].landing)

    @property
    def tracked(self) -> bool:
        """Whether any throw of the batch has a measured twist in flight."""
        return bool(np.isfinite(self.predictor.truth.twist[self.batch]).any())


def validate(
    data: ThrowData,
    models: Sequence[str] = PAPER_MODELS,
    about: About | None = None,
) -> Validation:
    """Compare `models` on a data set; InputError for an unknown model, throws that never land."""
    start = time.perf_counter()
    for model in models:
        check_model(model)
    work = _ModelComparison(Predictor.of(data), about or (lambda _: lambda *_: None))
    checks = {model: work.check(model) for model in dict.fromkeys(models)}
    seconds = time.perf_counter() - start
    return Validation(data, work.predictor, work.batch, work.conditions, checks, seconds)


class _ModelComparison:
    """The shared data of all models of one validation."""

    def __init__(self, predictor: Predictor, about: About) -> None:
        data = predictor.data
        self.predictor, self.about = predictor, about
        self.batch, self.conditions = batch_rows(data), conditions(data)
        # The surface whose parameters a throw needs, "" for the batch's.
        labels = [throw.factors.get(SURFACE, "") for throw in data.throws]
        usual = {labels[i] for i in self.batch}
        self.surface = ["" if label in usual else label for label in labels]

    def check(self, model: str) -> ModelCheck:
        """One model's parameters and errors."""
        truth, shape = self.predictor.truth, (len(self.surface), 2)
        landing, twist, parameters = np.empty(shape), np.empty(shape), {}
        # The first prediction loads libraries: it is not timed.
        self.predictor.part(self.batch[:1]).detached(model, parameter_sets(AXES[0][0], AXES[1][0]))
        grid = grid_of(self.predictor, model, progress=self.about(f"{model}: {CELLS} contacts"))
        for label in dict.fromkeys(["", *self.surface]):
            rows = np.array([i for i, surface in enumerate(self.surface) if surface == label], int)
            cell = grid.best(rows if label else self.batch)
            parameters[label] = grid.contact(cell)
            detach = grid.detach[rows, *cell]
            landing[rows] = self.predictor.landed(detach) - truth.landing[rows]
            twist[rows] = detach[:, [3, 5]] - truth.twist[rows]
        batch = grid.part(self.batch)
        return ModelCheck(
            model,
            batch,
            parameters,
            self.surface,
            landing,
            twist,
            self.timed(model, parameters[""]),
            grid.seconds / grid.predictions,
            cross_validated(batch, [self.conditions[i] for i in self.batch]),
        )

    def timed(self, model: str, pair: tuple[float, float]) -> Array:
        """Seconds of single releases of some throws of the batch."""
        rows, spent = self.batch[:: max(1, len(self.batch) // TIMED)], []
        show = self.about(f"{model}: single releases")
        # The first release loads libraries: it is not timed.
        for done, row in enumerate([rows[0], *rows]):
            start = time.perf_counter()
            self.predictor.released(model, int(row), parameter_sets(*pair)[0])
            spent.append(time.perf_counter() - start)
            show(done, len(rows))
        return np.array(spent[1:])


def fold_of(known: Sequence[Hashable], folds: int = FOLDS) -> Array:
    """The fold (S,) of every throw: one fold per condition, of equal numbers of conditions."""
    names = list(dict.fromkeys(known))
    order = np.random.default_rng(0).permutation(len(names))
    fold = {names[i]: k % folds for k, i in enumerate(order)}
    return np.array([fold[name] for name in known])


def cross_validated(grid: Grid, known: Sequence[Hashable]) -> CrossValidation | None:
    """Cross-validation over the grid by conditions (S,); None if there are too few."""
    count = len(set(known))
    if len(known) < FEWEST_THROWS or count < 2:
        return None
    folds, scored = min(FOLDS, count), grid.scored
    fold = fold_of(known, folds)
    outside, cells = np.empty(len(known)), [grid.best(fold != k) for k in range(folds)]
    for k, cell in enumerate(cells):
        outside[fold == k] = scored[fold == k, *cell]
    inside = scored[:, *grid.best()]
    judged = np.column_stack([inside, outside, outside - inside])
    ends = np.quantile(bootstrap(judged, known), INTERVAL, axis=0)
    means = np.vstack([judged.mean(axis=0), ends]).T
    parameters = np.array([grid.contact(cell) for cell in cells])
    return CrossValidation(means[0], means[1], means[2], folds, len(known), parameters)


def bootstrap(values: Array, known: Sequence[Hashable]) -> Array:
    """Means (RESAMPLED, n) of the columns of values (S, n) over resampled conditions.

    Conditions are drawn, not throws: the errors of a condition's repeats are correlated.
    """
    names = {name: i for i, name in enumerate(dict.fromkeys(known))}
    member = np.array([names[name] for name in known])
    totals = np.array([values[member == i].sum(axis=0) for i in range(len(names))])
    counts = np.bincount(member)
    drawn = np.random.default_rng(0).integers(len(names), size=(RESAMPLED, len(names)))
    return np.asarray(totals[drawn].sum(axis=1) / counts[drawn].sum(axis=1)[:, None])
