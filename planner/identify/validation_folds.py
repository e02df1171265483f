"""Cross-validation by conditions, and how sure a mean error is."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .best_cell import CellErrors

Array = npt.NDArray[np.float64]

#: Parts that the conditions are divided into, and fewest throws that this is done for.
FOLDS, FEWEST_THROWS = 6, 5
#: Resampled sets of conditions, and the quantiles that are given.
RESAMPLED, INTERVAL = 2000, (0.025, 0.975)


@dataclass(frozen=True)
class Crossed:
    """Parameters fitted to all throws, and to all but the judged condition's fold.

    inside, outside: mean scaled errors [m] of the two; intervals (2,) of 95 %;
    more: outside less inside with its interval (3,); folds; throws;
    parameters (K, 2): mu, r_p [m] of each fold.
    """

    inside: float
    inside_interval: Array
    outside: float
    outside_interval: Array
    more: Array
    folds: int
    throws: int
    conditions: int
    parameters: Array


def fold_of(conditions: Sequence[Hashable], folds: int = FOLDS, seed: int = 0) -> Array:
    """The fold (S,) of every throw: all of a condition in the same one, sizes alike."""
    names = list(dict.fromkeys(conditions))
    order = np.random.default_rng(seed).permutation(len(names))
    fold = {names[i]: k % folds for k, i in enumerate(order)}
    return np.array([fold[name] for name in conditions])


def cross_validated(cells: CellErrors, conditions: Sequence[Hashable]) -> Crossed | None:
    """Cross-validation over the grid; None for too few throws or conditions."""
    count = len(set(conditions))
    if len(conditions) < FEWEST_THROWS or count < 2:
        return None
    folds = min(FOLDS, count)
    fold = fold_of(conditions, folds)
    outside, parameters = np.empty(len(conditions)), []
    for k in range(folds):
        cell = cells.best(fold != k)
        outside[fold == k] = cells.error[fold == k, cell]
        parameters.append((cells.friction[cell], cells.patch_radius[cell]))
    inside = cells.error[:, cells.best()]
    drawn = bootstrap(np.column_stack([inside, outside, outside - inside]), conditions)
    low, high = np.quantile(drawn, INTERVAL, axis=0)
    means = [float(np.nanmean(v)) for v in (inside, outside, outside - inside)]
    return Crossed(
        means[0],
        np.array([low[0], high[0]]),
        means[1],
        np.array([low[1], high[1]]),
        np.array([means[2], low[2], high[2]]),
        folds,
        len(conditions),
        count,
        np.array(parameters),
    )


def bootstrap(values: Array, conditions: Sequence[Hashable], seed: int = 0) -> Array:
    """Means (RESAMPLED, n) of the columns of values (S, n) over conditions drawn anew.

    Conditions, not throws, are drawn: the repeats of one err alike.
    """
    names = {name: i for i, name in enumerate(dict.fromkeys(conditions))}
    member = np.array([names[name] for name in conditions])
    there = np.isfinite(values)
    known = np.where(there, values, 0.0)
    totals = np.array([known[member == i].sum(axis=0) for i in range(len(names))])
    counts = np.array([there[member == i].sum(axis=0) for i in range(len(names))])
    chosen = np.random.default_rng(seed).integers(len(names), size=(RESAMPLED, len(names)))
    with np.errstate(invalid="ignore", divide="ignore"):
        means = totals[chosen].sum(axis=1) / counts[chosen].sum(axis=1)
    return np.asarray(means[np.isfinite(means).all(axis=1)])
