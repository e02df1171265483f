"""What one throwing condition does to the landing, measured and predicted (Fig. 20)."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ...models import Array, Indices
from ...problems import InputError, ThrowData, hint_at

#: The paper's six factors by their columns, and whether labels that are numbers go up (1), down
#: (-1) or as they come (0) from condition A to condition B.
KNOWN = {"com": 1, "pitch": -1, "release": -1, "surface": 0, "payload": 0, "moi": 1}
#: Columns that say which throws belong together: no conditions.
NO_FACTORS = ("repeat", "set")
#: The label of `set` for throws that vary one factor only and are not of the batch.
APART = "factors"
#: The factor whose labels need contact parameters of their own.
SURFACE = "surface"
#: Below it the two conditions' errors differ significantly.
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
    """The throws that parameters are fitted to: those on the surface that most are on, and of
    these not the ones that vary one factor apart."""
    rows = usual_surface(data)
    return np.array([i for i in rows if data.throws[i].factors.get("set") != APART] or rows, int)


def usual_surface(data: ThrowData) -> list[int]:
    """The throws on the surface that most throws are on: one contact cannot fit two."""
    labels = [throw.factors.get(SURFACE, "") for throw in data.throws]
    usual = max(dict.fromkeys(labels), key=labels.count)
    return [i for i, label in enumerate(labels) if label == usual]


def condition_columns(data: ThrowData) -> list[str]:
    """Columns whose labels make a condition: the known factors, or else all."""
    known = [name for name in data.factors if name in KNOWN]
    return known or [name for name in data.factors if name not in NO_FACTORS]


def conditions(data: ThrowData) -> list[tuple[str, ...]]:
    """Every throw's condition; without such columns each throw is one of its own."""
    columns = condition_columns(data)
    if not columns:
        return [(throw.name,) for throw in data.throws]
    return [tuple(throw.factors[name] for name in columns) for throw in data.throws]


def comparisons(data: ThrowData, more: Iterable[str] = ()) -> tuple[list[Comparison], list[str]]:
    """The known factors and `more` that the data have; and a line for each one left out."""
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
            f"{', '.join(there) or 'there is none'}{hint_at(name, there)}"
        )
    if len(data.factors[name]) < 2:
        raise InputError(f"--factor {name}: all throws have '{data.factors[name][0]}'")


def _comparison(data: ThrowData, factor: str, labels: list[str]) -> Comparison:
    """Inside the batch where the factor varies there; else of the throws that vary it."""
    batch = batch_rows(data)
    usual = data.picked(list(batch)).factors.get(factor, [])
    rows = list(range(len(data.throws)))
    if len(usual) > 1:
        labels, rows = usual, batch.tolist()
    elif len(labels) > 2:
        # Both conditions were thrown apart, under names of their own.
        labels = [label for label in labels if label not in usual]
    first, *_, last = _ordered(factor, labels)
    a, b = ([i for i in rows if data.throws[i].factors[factor] == end] for end in (first, last))
    a, b = _alike(data, factor, a, b)
    return Comparison(factor, (first, last), np.array(a, int), np.array(b, int))


def _alike(
    data: ThrowData, factor: str, first: list[int], second: list[int]
) -> tuple[list[int], list[int]]:
    """Throws of each side whose other conditions appear on the other side too, if any do."""
    others = [name for name in condition_columns(data) if name != factor]

    def rest(i: int) -> tuple[str, ...]:
        return tuple(data.throws[i].factors[name] for name in others)

    both = {rest(i) for i in first} & {rest(i) for i in second}
    if not both:
        return first, second
    return [i for i in first if rest(i) in both], [i for i in second if rest(i) in both]


def _ordered(factor: str, labels: list[str]) -> list[str]:
    """Labels by their numbers, if each has one and the factor is known; else as they come."""
    way = KNOWN.get(factor, 0)
    numbers = [_number(label) for label in labels]
    if way and not any(np.isnan(numbers)):
        return [labels[i] for i in np.argsort(way * np.array(numbers), kind="stable")]
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
    """Mean and standard deviation over the first axis; NaN where there is nothing."""
    if not len(values):
        nothing = np.full(values.shape[1:], np.nan)
        return nothing, nothing
    return values.mean(axis=0), values.std(axis=0)


def _mann_whitney(first: Array, second: Array) -> float:
    """p-value of the two-sided Mann-Whitney U test; NaN where a side is empty."""
    from scipy.stats import mannwhitneyu

    if not first.size or not second.size:
        return float("nan")
    return float(mannwhitneyu(first, second).pvalue)
