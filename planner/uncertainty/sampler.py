"""Samples of the uncertain parameters: a scene's [uncertainty], and what is assumed beside it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models import Array, ReadOnly
from ...problems import Distribution, Scene

#: Bases of the columns of `even_shares`.
PRIMES = (2, 3, 5, 7, 11, 13, 17, 19, 23, 29, 31, 37, 41, 43, 47)
#: Shares keep this distance to 0 and 1, which are no quantiles of a normal value.
LEAST_SHARE = 2.0**-31
#: Standard deviations in the range of a normal value; one draw in 10^19 is outside.
COVERED = 9.0


def even_shares(size: int, first: int, count: int, seed: int) -> Array:
    """Points `first` to `first + count` (count, size) between 0 and 1 of Halton's sequence, which
    fills the cube evenly: number k's digits in a prime base, mirrored at the point.

    The digits of each place are permuted at random (Owen 2017), as columns of large bases are
    alike without.
    """
    rng, numbers = np.random.default_rng(seed), np.arange(first, first + count)
    shares = np.zeros((count, size))
    for i in range(size):
        base = PRIMES[i]
        rest, unit = numbers, 1.0
        while unit > LEAST_SHARE:
            unit /= base
            rest, digits = np.divmod(rest, base)
            shares[:, i] += unit * rng.permutation(base)[digits]
    return np.clip(shares, LEAST_SHARE, 1.0 - LEAST_SHARE)


@dataclass(frozen=True)
class Sampler(ReadOnly):
    """Draws of the uncertain parameters `names`; sample k depends on the seed only.

    spreads: their distributions in SI units; ranges: lowest and highest possible values,
    where normal ones are cut off; factor (P, P): Cholesky factor of the normal scores'
    correlation, None for independent parameters.
    """

    names: tuple[str, ...]
    spreads: tuple[Distribution, ...]
    ranges: tuple[tuple[float, float], ...]
    factor: Array | None
    seed: int

    def draw(self, first: int, count: int) -> Array:
        """Samples `first` to `first + count` of the sequence: (count, P), columns as `names`."""
        shares = even_shares(len(self.names), first, count, self.seed)
        if self.factor is not None:
            from scipy.special import ndtr, ndtri

            shares = ndtr(ndtri(shares) @ self.factor.T)
        columns = [
            _quantile(spread, share, bounds)
            for spread, share, bounds in zip(self.spreads, shares.T, self.ranges, strict=True)
        ]
        return np.column_stack([np.zeros((count, 0)), *columns])

    def quantiles(self, name: str, shares: Array) -> Array:
        """Values of a parameter below which `shares` (N,) of it lie."""
        i = self.names.index(name)
        return _quantile(self.spreads[i], shares, self.ranges[i])

    def reach(self, name: str, value: float) -> tuple[float, float]:
        """Lowest and highest value that is drawn; `value` where the parameter is certain."""
        if name not in self.names:
            return value, value
        spread = self.spreads[self.names.index(name)]
        more = COVERED * (spread.normal or 0.0)
        return spread.reach[0] - more, spread.reach[1] + more

    def openings(self, scene: Scene) -> tuple[float, float, float]:
        """The earliest and the latest opening [s] beside the mean delay, and the longest one."""
        mean, opening = scene.mean_delay, scene.gripper.profile().opening
        low, high = self.reach("delay", mean)
        return low - mean, high - mean, max(opening, self.reach("opening", opening)[1])


def sampler_of(scene: Scene, seed: int) -> Sampler:
    """Draws of what is uncertain in a scene."""
    section = scene.uncertain
    spreads, ranges = section.about(scene.values), scene.ranges
    return Sampler(
        section.names,
        tuple(spreads.values()),
        tuple(ranges[name] for name in spreads),
        np.asarray(np.linalg.cholesky(section.matrix), float) if section.correlation else None,
        seed,
    )


def _quantile(spread: Distribution, shares: Array, bounds: tuple[float, float]) -> Array:
    """Values of a distribution below which `shares` (N,) of it lie; normal ones cut off."""
    if spread.samples:
        ordered = np.sort(np.array(spread.samples))
        return np.asarray(ordered[np.minimum(shares * ordered.size, ordered.size - 1).astype(int)])
    mean = spread.expected
    if spread.uniform is not None:
        return np.asarray(mean + spread.uniform * (2.0 * shares - 1.0))
    from scipy.special import ndtr, ndtri

    deviation = spread.deviation
    low, high = (float(ndtr((bound - mean) / deviation)) for bound in bounds)
    values = mean + deviation * ndtri(low + shares * (high - low))
    return np.asarray(np.clip(values, *bounds))
