"""Samples of a scene's uncertain parameters: parts of one seeded Sobol sequence."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...models import Array
from ...problems import Distribution, Scene, Uncertainty

#: Half a cell of SciPy's 30-bit sequence; added to a share it excludes 0 and 1.
HALF_CELL = 2.0**-31
#: Standard deviations in the range of a normal value; one draw in 10^19 is outside.
COVERED = 9.0
#: Names of parameters, factor from SI, unit; all others are lengths or angles.
UNITS = (
    (("hand_vx", "hand_vz"), 1e3, "mm/s"),
    (("hand_omega",), math.degrees(1.0), "deg/s"),
    (("delay", "opening"), 1e3, "ms"),
    (("friction",), 1.0, ""),
    (("mass",), 1e3, "g"),
    (("inertia",), 1e6, "kg mm²"),
)


@dataclass(frozen=True)
class Sampler:
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
        from scipy.special import ndtr, ndtri
        from scipy.stats import qmc

        sequence = qmc.Sobol(len(self.names), rng=np.random.default_rng(self.seed))
        if first:
            sequence.fast_forward(first)
        # SciPy warns of draws other than powers of two; the first values of a longer draw are
        # equal.
        shares = sequence.random(1 << max(count - 1, 0).bit_length())[:count] + HALF_CELL
        if self.factor is not None:
            shares = ndtr(ndtri(shares) @ self.factor.T)
        columns = [
            quantile(spread, share, bounds)
            for spread, share, bounds in zip(self.spreads, shares.T, self.ranges, strict=True)
        ]
        return np.column_stack(columns)

    def quantiles(self, name: str, shares: Array) -> Array:
        """Values of a parameter below which `shares` (N,) of it lie."""
        i = self.names.index(name)
        return quantile(self.spreads[i], shares, self.ranges[i])

    def reach(self, name: str, value: float) -> tuple[float, float]:
        """Lowest and highest value that is drawn; `value` where the parameter is certain."""
        if name not in self.names:
            return value, value
        spread = self.spreads[self.names.index(name)]
        more = COVERED * (spread.normal or 0.0)
        return spread.reach[0] - more, spread.reach[1] + more


def sampler_of(scene: Scene, seed: int) -> Sampler:
    """Draws of the scene's [uncertainty], or of the default one."""
    section = scene.uncertainty or Uncertainty.USUAL
    names, values, ranges = section.names, scene.values, scene.ranges
    return Sampler(
        names,
        tuple(getattr(section, name).about(values[name]) for name in names),
        tuple(ranges[name] for name in names),
        np.asarray(np.linalg.cholesky(section.matrix), float) if section.correlation else None,
        seed,
    )


def quantile(spread: Distribution, shares: Array, bounds: tuple[float, float]) -> Array:
    """Values of a distribution below which `shares` (N,) of it lie; normal ones cut off."""
    from scipy.special import ndtr, ndtri

    if spread.samples:
        ordered = np.sort(np.array(spread.samples))
        return np.asarray(ordered[np.minimum(shares * ordered.size, ordered.size - 1).astype(int)])
    mean = spread.expected
    if spread.uniform is not None:
        return np.asarray(mean + spread.uniform * (2.0 * shares - 1.0))
    deviation = spread.deviation
    low, high = (float(ndtr((bound - mean) / deviation)) for bound in bounds)
    values = mean + deviation * ndtri(low + shares * (high - low))
    return np.asarray(np.clip(values, *bounds))


def words_of(section: Uncertainty) -> list[str]:
    """The uncertain parameters as text: one line each, in the units of the file."""
    lines = []
    for name in section.names:
        spread: Distribution = getattr(section, name)
        unit = np.degrees(1.0) if Uncertainty.PARAMETERS[name].degrees else 1.0
        times = " x the scene's" if spread.relative else ""
        if spread.uniform is not None:
            words = f"uniform +-{unit * spread.uniform:g}{times}"
        elif spread.normal is not None:
            words = f"normal, deviation {unit * spread.normal:g}{times}"
        else:
            words = f"{len(spread.samples)} given values{times}"
        about = "" if spread.mean is None else f" about {unit * spread.mean:g}"
        lines.append(f"{Uncertainty.PARAMETERS[name].key}: {words}{about}")
    return lines


def unit_of(name: str) -> tuple[float, str]:
    """Factor and unit in which people read a parameter."""
    for names, factor, unit in UNITS:
        if name in names:
            return factor, unit
    return (math.degrees(1.0), "deg") if Uncertainty.PARAMETERS[name].degrees else (1e3, "mm")
