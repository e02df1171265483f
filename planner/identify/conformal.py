"""A region for the next of exchangeable residuals, without a distribution: full conformal
prediction.

The score of a residual among N + 1 is its distance from their mean, in standard deviations of each
component, the larger component: a symmetric function of all N + 1. A candidate for the next
residual belongs to the region if its score among the N measured ones and itself is at most the
k-th smallest of theirs. If all N + 1 are exchangeable this holds for the true one with a
probability of k / (N + 1) or more, in finite samples and for any distribution, although the mean
comes from the same throws (Vovk, Gammerman and Shafer, Algorithmic Learning in a Random World,
2005). Split conformal prediction would need throws of their own for the mean; the jackknife+
guarantees 1 - 2 alpha only (Barber, Candes, Ramdas and Tibshirani, 2021).
"""

from __future__ import annotations

import numpy as np

from ...models import Array, Flags
from ...problems import rank_of

#: Candidates along each component, odd; the region's half widths are rounded up by one step.
SIDE = 61
#: Least variance [m², rad²]: that of equal residuals is 0.
TINY = 1e-24
#: Most residuals times candidates at once.
CHUNK = 4_000_000
#: Most enlargements and refinements of the grid of candidates.
ROUNDS = 40


def region(residuals: Array, level: float) -> Array:
    """Half widths (2,) of the smallest box about the mean that holds the conformal region.

    residuals (N, 2), N at least what the level needs. A new residual less the mean of these is
    inside with a probability of `level` or more.
    """
    about = residuals - residuals.mean(axis=0)
    rank, ticks = rank_of(len(about), level), np.linspace(-1.0, 1.0, SIDE)
    shares = np.stack(np.meshgrid(ticks, ticks, indexing="ij"), axis=-1).reshape(-1, 2)
    # A component without scatter still has a width.
    reach = 3.0 * np.abs(about).max(axis=0) + 1e-9
    for _ in range(ROUNDS):
        held = np.abs(shares[_belongs(about, shares * reach, rank)] * reach).max(axis=0)
        held += 2.0 * reach / (SIDE - 1)
        if (held >= reach).any():
            reach = np.where(held >= reach, 2.0 * reach, reach)
        elif (held > 0.9 * reach).all():
            break
        else:
            reach = 1.05 * held
    return np.asarray(held)


def _belongs(about: Array, candidates: Array, rank: int) -> Flags:
    """Flags (M,) of the candidates (M, 2) whose score among N residuals (N, 2) about their mean and
    itself is at most the `rank`-th smallest of these."""
    count, flags = len(about), list[Flags]()
    for part in np.array_split(candidates, max(count * len(candidates) // CHUNK, 1)):
        mean = part / (count + 1)
        square = ((about**2).sum(axis=0) + part**2) / (count + 1) - mean**2
        spread = np.sqrt(np.maximum(square, TINY))
        own = (np.abs(part - mean) / spread).max(axis=1)
        others = (np.abs(about - mean[:, None]) / spread[:, None]).max(axis=2)
        flags.append((others < own[:, None]).sum(axis=1) < rank)
    return np.concatenate(flags)
