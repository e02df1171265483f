"""Conditions of measured throws by the labels of their factors, and surfaces of the pads."""

from __future__ import annotations

import numpy as np

from ...models import Indices
from ...problems.throws import ThrowData

#: Columns of throws.csv that define a condition, if the data have them: the paper's six factors.
FACTORS = ("com", "pitch", "release", "surface", "payload", "moi")
#: Columns that group throws and define no condition.
GROUPS = ("repeat", "set")
#: Label in column `set` of throws outside the batch, which vary a single factor.
SINGLE_FACTOR = "factors"
#: Column with the pads' surface, which has contact parameters of its own.
SURFACE = "surface"


def batch_rows(data: ThrowData) -> Indices:
    """Rows of the throws that parameters are fitted to: of the batch, on its surface."""
    rows = batch_surface(data)
    batch = [i for i in rows if data.throws[i].factors.get("set") != SINGLE_FACTOR]
    return np.array(batch or rows, int)


def batch_surface(data: ThrowData) -> list[int]:
    """Rows of the throws on the most frequent surface: one contact fits one surface."""
    labels = [throw.factors.get(SURFACE, "") for throw in data.throws]
    frequent = max(dict.fromkeys(labels), key=labels.count)
    return [i for i, label in enumerate(labels) if label == frequent]


def conditions(data: ThrowData) -> list[tuple[str, ...]]:
    """The condition of each throw; without factors every throw has its own."""
    known = [name for name in data.factors if name in FACTORS]
    columns = known or [name for name in data.factors if name not in GROUPS]
    if not columns:
        return [(throw.name,) for throw in data.throws]
    return [tuple(throw.factors[name] for name in columns) for throw in data.throws]
