"""Instants of the opening at which an exact release takes its steps.

Denser towards the end, where the grip vanishes and the body slides, with a node wherever
the hand's motion or the release itself has a kink: a step over a kink loses its order.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Steps shrink towards the end as its distance to the power 1 - 1 / POWER.
POWER = 1.5
#: Kinks nearer than this share of the opening to each other or to its ends are one.
APART = 1e-9


def graded_shares(kinks: Array, steps: int) -> Array:
    """Stretched shares (steps + 1,) of the opening, 0 to 1, with nodes at `kinks`.

    kinks: shares of the opening. Steps are even in the stretched share, as far as the
    kinks let them. More kinks than steps are left out.
    """
    inner = np.sort(kinks)
    inner = inner[(inner > APART) & (inner < 1.0 - APART)]
    inner = inner[np.diff(inner, prepend=0.0) > APART]
    if inner.size >= steps:
        return np.linspace(0.0, 1.0, steps + 1)
    ends = np.concatenate([[0.0], 1.0 - (1.0 - inner) ** (1.0 / POWER), [1.0]])
    # Cumulated steps: as the stretched shares ask, but one at least between two kinks.
    cumulated = np.maximum.accumulate(np.rint(ends * steps) - np.arange(ends.size))
    cumulated = np.minimum(cumulated + np.arange(ends.size), steps - np.arange(ends.size)[::-1])
    return np.asarray(np.interp(np.arange(steps + 1), cumulated, ends))


def halved(shares: Array) -> Array:
    """The same with twice as many steps."""
    even = np.interp(np.arange(2 * shares.size - 1), 2 * np.arange(shares.size), shares)
    return np.asarray(even)


def instants(shares: Array, duration: float) -> Array:
    """Times [s] of stretched shares of an opening of `duration` [s]."""
    return np.asarray(duration * (1.0 - (1.0 - shares) ** POWER))
