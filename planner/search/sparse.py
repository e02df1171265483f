"""Where landings are sparse: which releases to draw more beside."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Bins across the range of landings, each way.
BINS = 40
#: How much more often a bin at the edge of the reached ones is taken.
EDGE = 3.0


def sparse_parents(
    x: Array, theta: Array, count: int, rng: np.random.Generator
) -> npt.NDArray[np.int_]:
    """Indices (count,) of landings, drawn so that each filled bin is as likely as the next.

    x (N,) [m], theta (N,) [rad]; entries that are not finite are not taken.
    """
    finite = np.flatnonzero(np.isfinite(x) & np.isfinite(theta))
    if len(finite) == 0:
        return np.zeros(0, int)
    i, j = _bins(x[finite]), _bins(theta[finite])
    filled = np.zeros((BINS + 2, BINS + 2))
    np.add.at(filled, (i + 1, j + 1), 1.0)
    empty = filled == 0
    edge = np.zeros_like(empty)
    for axis in (0, 1):
        for step in (-1, 1):
            edge |= np.roll(empty, step, axis)
    weight = np.where(edge, EDGE, 1.0)[i + 1, j + 1] / filled[i + 1, j + 1]
    return np.asarray(rng.choice(finite, count, p=weight / weight.sum()))


def _bins(values: Array) -> npt.NDArray[np.int_]:
    low, width = values.min(), max(float(np.ptp(values)), 1e-9)
    return np.asarray(np.minimum(((values - low) / width * BINS).astype(int), BINS - 1))
