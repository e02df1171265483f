"""Effects of one throwing condition on the landing, measured and predicted (Fig. 20)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ...models import Array, Indices
from ...problems import InputError
from ...problems.throws import ThrowData

#: The paper's six factors by their columns; the order of numeric labels from condition A to B:
#: rising (1), falling (-1) or as in the file (0).
KNOWN = {"com": 1, "pitch": -1, "release": -1, "surface": 0, "payload": 0, "moi": 1}
#: Columns that group throws and are no conditions.
NO_FACTORS = ("repeat", "set")
#: The label of `set` for throws outside the batch that vary a single factor.
APART = "factors"
#: The factor with contact parameters for each label.
SURFACE = "surface"
#: p-value below which the errors of two conditions differ significantly.
SIGNIFICANT = 0.05


@dataclass(frozen=True)
class Comparison:
    """Throws of two conditions: rows first (A,) and second (B,) with the factor's labels."""

    factor: str
    labels: tuple[str, str]
    first: Indices
    second: Indices


@dataclass(frozen=True)
class FactorRow:
    """One model under both conditions; arrays (2,) are for x [m] and theta [rad].

    measured, predicted: shift of the mean landing from A to B; mean and std (2, 2):
    absolute errors by condition and quantity; p: Mann-Whitney U of the absolute errors.
    """

    comparison: Comparison
    model: str
    measured: Array
    predicted: Array
    mean: Array
    std: Array
    p: Array


def batch_rows(data: ThrowData) -> Indices:
    """The throws that parameters are fitted to: on the most frequent surface, in the batch."""
    rows = usual_surface(data)
    return np.array([i for i in rows if data.throws[i].factors.get("set") != APART] or rows, int)


def usual_surface(data: ThrowData) -> list[int]:
    """The throws on the most frequent surface: one contact cannot fit two."""
    labels = [throw.factors.get(SURFACE, "") for throw in data.throws]
    usual = max(dict.fromkeys(labels), key=labels.count)
    return [i for i, label in enumerate(labels) if label == usual]


def condition_columns(data: ThrowData) -> list[str]:
    """Columns that define a condition: the known factors, or else all."""
    known = [name for name in data.factors if name in KNOWN]
    return known or [name for name in data.factors if name not in NO_FACTORS]


def conditions(data: ThrowData) -> list[tuple[str, ...]]:
    """The condition of each throw; without such columns every throw is its own."""
    columns = condition_columns(data)
    if not columns:
        return [(throw.name,) for throw in data.throws]
    return [tuple(throw.factors[name] for name in columns) for throw in data.throws]


def comparisons(data: ThrowData, more: Iterable[str] = ()) -> tuple[list[Comparison], list[str]]:
    """Comparisons by the known factors and `more`; and a line for each that the data lack."""
    found, left_out = [], []
    more = list(dict.fromkeys(name for name in more if name not in KNOWN))
    for name in more:
        _check_factor(data, name)
    for factor in (*KNOWN, *more):
        labels = data.factors.get(factor, [])
        if len(labels) < 2:
            why = f"all throws have '{labels[0]}'" if labels else "no such column"
            left_out.append(f"{factor}: left out, {why}")
            continue
        found.append(_comparison(data, factor, labels))
    return found, left_out


def _check_factor(data: ThrowData, name: str) -> None:
    there = [n for n in data.factors if n not in NO_FACTORS]
    if name not in there:
        raise InputError(
            f"--factor {name}: must be a column of throws.csv that is a factor: "
            f"{', '.join(there) or 'there is none'}{InputError.hint(name, there)}"
        )
    if len(data.factors[name]) < 2:
        raise InputError(f"--factor {name}: all throws have '{data.factors[name][0]}'")


def _comparison(data: ThrowData, factor: str, labels: list[str]) -> Comparison:
    """Within the batch if the factor varies there; else among the throws that vary it alone."""
    batch = batch_rows(data)
    usual = data.picked(list(batch)).factors.get(factor, [])
    rows = list(range(len(data.throws)))
    if len(usual) > 1:
        labels, rows = usual, batch.tolist()
    elif len(labels) > 2:
        # Both conditions were thrown outside the batch, under their own labels.
        labels = [label for label in labels if label not in usual]
    first, *_, last = _ordered(factor, labels)
    a, b = ([i for i in rows if data.throws[i].factors[factor] == end] for end in (first, last))
    a, b = _alike(data, factor, a, b)
    return Comparison(factor, (first, last), np.array(a, int), np.array(b, int))


def _alike(
    data: ThrowData, factor: str, first: list[int], second: list[int]
) -> tuple[list[int], list[int]]:
    """Throws of each side whose other conditions occur on both sides, if any do."""
    others = [name for name in condition_columns(data) if name != factor]

    def rest(i: int) -> tuple[str, ...]:
        return tuple(data.throws[i].factors[name] for name in others)

    both = {rest(i) for i in first} & {rest(i) for i in second}
    if not both:
        return first, second
    return [i for i in first if rest(i) in both], [i for i in second if rest(i) in both]


def _ordered(factor: str, labels: list[str]) -> list[str]:
    """Labels by their numbers, if each has one and the factor is known; else as in the file."""
    order = KNOWN.get(factor, 0)
    numbers = [_number(label) for label in labels]
    if order and not any(np.isnan(numbers)):
        return [labels[i] for i in np.argsort(order * np.array(numbers), kind="stable")]
    return labels


def _number(label: str) -> float:
    """The number that a label starts with, NaN if none."""
    found = re.match(r"\s*[-+]?\d*\.?\d+(?:[eE][-+]?\d+)?", label)
    return float(found.group()) if found else float("nan")


def factor_rows(
    comparison: Comparison, landing: Array, errors: Mapping[str, Array]
) -> list[FactorRow]:
    """A row per model. landing (T, 2): measured; errors: by model (T, 2), NaN for none."""
    a, b = comparison.first, comparison.second
    measured = landing[b].mean(axis=0) - landing[a].mean(axis=0)
    rows = []
    for model, off in errors.items():
        sides = [np.abs(known_rows(off[side])) for side in (a, b)]
        predicted = [known_rows(landing[side] + off[side]) for side in (a, b)]
        shift = mean_std(predicted[1])[0] - mean_std(predicted[0])[0]
        mean, std = np.array([mean_std(side) for side in sides]).swapaxes(0, 1)
        p = np.array([_mann_whitney(sides[0][:, i], sides[1][:, i]) for i in range(2)])
        rows.append(FactorRow(comparison, model, measured, shift, mean, std, p))
    return rows


def known_rows(values: Array) -> Array:
    """The rows of finite numbers."""
    return np.asarray(values[np.isfinite(values).all(axis=1)])


def mean_std(values: Array) -> tuple[Array, Array]:
    """Mean and standard deviation over the first axis; NaN without rows."""
    if not len(values):
        nothing = np.full(values.shape[1:], np.nan)
        return nothing, nothing
    return values.mean(axis=0), values.std(axis=0)


def _mann_whitney(first: Array, second: Array) -> float:
    """p-value of the two-sided Mann-Whitney U test; NaN if a side is empty."""
    from scipy.stats import mannwhitneyu

    if not first.size or not second.size:
        return float("nan")
    return float(mannwhitneyu(first, second).pvalue)
