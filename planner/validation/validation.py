"""Release models on measured throws: parameters, errors, cross-validation.

Every model gets its best parameters on the batch (Table III), as in the paper; its predictions with
these are compared with the measurement (Table IV).
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from ...models import Array, Indices
from ...models.release import SLIDING_PIVOT, STEPPED_SURFACE
from ...problems.throws import ThrowData
from ..identify import (
    AXES,
    SURFACE,
    Grid,
    Predictor,
    batch_rows,
    check_model,
    conditions,
    grid_of,
    parameter_sets,
)
from ..workers import Progress

#: about(words) announces a part of the work and returns its progress(done, total).
About = Callable[[str], Progress]

#: Models of Tables III and IV.
PAPER_MODELS = ("ls", SLIDING_PIVOT, "sp-paper", STEPPED_SURFACE)
#: Number of folds of a cross-validation.
FOLDS = 6


@dataclass(frozen=True)
class CrossValidation:
    """Errors with parameters from all throws, and from all folds but the judged one.

    inside, outside, more (3,): mean pose errors [m] of the two and of their difference, with the
    ends of 95 % intervals; parameters (K, 2): mu, r_p [m] of each of K folds.
    """

    inside: Array
    outside: Array
    more: Array
    parameters: Array


@dataclass(frozen=True)
class ModelCheck:
    """One model on all T throws.

    grid: errors of the batch, which gives the parameters; parameters: (mu, r_p [m]) by surface, ""
    for the batch; landing (T, 2): predicted less measured x [m], theta [rad]; twist (T, 2): the
    same of v_x [m/s], omega [rad/s]; single (n,): seconds of one release; batched: seconds of one
    prediction in a batch.
    """

    grid: Grid
    parameters: dict[str, tuple[float, float]]
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

    predictor: of all T throws; batch: rows that give the parameters; conditions (T,): of the
    throws; surface (T,): whose parameters a throw has, "" for those of the batch; seconds: of the
    work.
    """

    data: ThrowData
    predictor: Predictor
    batch: Indices
    conditions: list[tuple[str, ...]]
    surface: list[str]
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
    data: ThrowData, models: Sequence[str] = PAPER_MODELS, about: About | None = None
) -> Validation:
    """Compare `models` on a data set; InputError for an unknown model, throws that never land."""
    start = time.perf_counter()
    for model in models:
        check_model(model)
    batch, labels = batch_rows(data), [throw.factors.get(SURFACE, "") for throw in data.throws]
    usual = {labels[i] for i in batch}
    surface = ["" if label in usual else label for label in labels]
    found = Validation(data, Predictor.of(data), batch, conditions(data), surface, {}, 0.0)
    show = about or (lambda _: lambda *_: None)
    checks = {model: _checked(found, model, show) for model in dict.fromkeys(models)}
    return dataclasses.replace(found, checks=checks, seconds=time.perf_counter() - start)


def _checked(found: Validation, model: str, about: About) -> ModelCheck:
    """One model's parameters and errors on the throws of a validation."""
    predictor, truth, surface = found.predictor, found.predictor.truth, np.array(found.surface)
    (landing, twist), parameters = np.empty((2, surface.size, 2)), {}
    # The first prediction loads libraries: it is not timed.
    first = Predictor.of(found.data.picked(found.batch[:1]))
    first.detached(model, parameter_sets(AXES[0][0], AXES[1][0]))
    cells = AXES[0].size * AXES[1].size
    grid = grid_of(predictor, model, progress=about(f"{model}: {cells} contacts"))
    for label in dict.fromkeys(["", *found.surface]):
        rows = np.flatnonzero(surface == label)
        cell = grid.best(rows if label else found.batch)
        parameters[label] = grid.contact(cell)
        detach = grid.detach[rows, *cell]
        landing[rows] = predictor.landed(detach) - truth.landing[rows]
        twist[rows] = detach[:, [3, 5]] - truth.twist[rows]
    batch = grid.part(found.batch)
    return ModelCheck(
        batch,
        parameters,
        landing,
        twist,
        _release_seconds(found, model, parameters[""], about(f"{model}: single releases")),
        grid.seconds / grid.predictions,
        cross_validated(batch, [found.conditions[i] for i in found.batch]),
    )


def _release_seconds(
    found: Validation, model: str, pair: tuple[float, float], show: Progress
) -> Array:
    """Seconds of single releases of about 20 throws of the batch."""
    rows, spent = found.batch[:: max(1, len(found.batch) // 20)], []
    # The first release loads libraries: it is not timed.
    for done, row in enumerate([rows[0], *rows]):
        start = time.perf_counter()
        found.predictor.released(model, int(row), parameter_sets(*pair)[0])
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
    """Cross-validation over the grid by conditions (S,); None below 5 throws or 2 conditions."""
    count = len(set(known))
    if len(known) < 5 or count < 2:
        return None
    folds, scored = min(FOLDS, count), grid.scored
    fold = fold_of(known, folds)
    outside, cells = np.empty(len(known)), [grid.best(fold != k) for k in range(folds)]
    for k, cell in enumerate(cells):
        outside[fold == k] = scored[fold == k, *cell]
    inside = scored[:, *grid.best()]
    judged = np.column_stack([inside, outside, outside - inside])
    ends = np.quantile(bootstrap(judged, known), (0.025, 0.975), axis=0)
    means = np.vstack([judged.mean(axis=0), ends]).T
    parameters = np.array([grid.contact(cell) for cell in cells])
    return CrossValidation(means[0], means[1], means[2], parameters)


def bootstrap(values: Array, known: Sequence[Hashable]) -> Array:
    """Means (2000, n) of the columns of values (S, n) over resampled conditions.

    Conditions are drawn, not throws: the errors of a condition's repeats are correlated.
    """
    names = {name: i for i, name in enumerate(dict.fromkeys(known))}
    member = np.array([names[name] for name in known])
    totals = np.array([values[member == i].sum(axis=0) for i in range(len(names))])
    counts = np.bincount(member)
    drawn = np.random.default_rng(0).integers(len(names), size=(2000, len(names)))
    return np.asarray(totals[drawn].sum(axis=1) / counts[drawn].sum(axis=1)[:, None])
