"""Bins of a map: widths that fit its landings, and where a landing lies."""

from __future__ import annotations

import itertools
import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]

#: Bin widths [m, rad], finest first. The first is taken that leaves a reached bin FILL
#: landings on average and at most BINS bins on each axis.
WIDTHS = tuple(
    (x, math.radians(degrees))
    for x, degrees in ((0.02, 5.0), (0.04, 10.0), (0.06, 15.0), (0.1, 22.5), (0.2, 45.0))
)
FILL, BINS = 10.0, 400


def edges_of(axes: list[Array]) -> list[Array]:
    """Edges of the bins on each axis (x, or x and theta): multiples of one of WIDTHS.

    Landings too far apart for WIDTHS get bins of twice, four times, ... the last of them.
    """
    coarser = (tuple(2.0**k * width for width in WIDTHS[-1]) for k in itertools.count(1))
    for number, widths in enumerate(itertools.chain(WIDTHS, coarser)):
        if any(np.ptp(v) > (BINS - 2) * w for v, w in zip(axes, widths, strict=False)):
            continue
        edges = [_multiples(v, w) for v, w in zip(axes, widths, strict=False)]
        found = [places(e, v) for e, v in zip(edges, axes, strict=True)]
        reached = np.unique(np.column_stack(found), axis=0)
        if len(axes[0]) >= FILL * len(reached) or number >= len(WIDTHS) - 1:
            break
    return edges


def _multiples(values: Array, width: float) -> Array:
    """Multiples of `width` around all values, none of which is on the last by rounding."""
    first = math.floor(float(values.min()) / width - 1e-9)
    last = math.floor(float(values.max()) / width + 1e-9) + 1
    return np.asarray(np.arange(first, last + 1) * width, dtype=np.float64)


def places(edges: Array, values: Array) -> Counts:
    """Index (N,) of the bin of each value, -1 or len(edges) - 1 outside."""
    return np.asarray(np.searchsorted(edges, values, side="right") - 1, dtype=np.int64)


def place(edges: Array, value: float) -> int:
    """Index of a value's bin, -1 outside."""
    found = int(places(edges, np.array([value]))[0]) if math.isfinite(value) else -1
    return found if found < len(edges) - 1 else -1
