"""Sliding pivots on hands whose acceleration steps: no integration step across such a kink."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ...models import BatchRelease, ReleaseBatch, graded, pivot_law, step_batch, with_middles

Array = npt.NDArray[np.float64]

#: The hand is asked for this far [s] inside an integration step's ends.
INSIDE = 1e-9


def kinked_steps(
    batch: ReleaseBatch, steps: int, kinks: Callable[[ReleaseBatch], Array]
) -> BatchRelease:
    """The sliding pivot in `steps` graded steps, cut at the kinks of the hands' motions.

    kinks: their times (K, N) [s] after each opening of some throws. Across a kink the
    Runge-Kutta steps would be of first order only.
    """
    even = graded(steps)[:, None]

    def shares(part: ReleaseBatch) -> Array:
        kinked = np.clip(kinks(part) / part.opening, 0.0, 1.0)
        nodes = np.vstack([np.repeat(even, part.count, axis=1), kinked])
        return with_middles(np.sort(nodes, axis=0))

    return step_batch(batch, pivot_law, shares, INSIDE)
