"""One-dimensional friction laws: Coulomb, Karnopp and viscous-smoothed, (17)-(18).

Forces in N on a block of mass m that an external force pulls; velocities in m/s. Each
law takes velocity, external force and friction limit mu f_N, as numbers or arrays.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def coulomb(velocity: npt.ArrayLike, external: npt.ArrayLike, limit: npt.ArrayLike) -> Array:
    """Friction force by Coulomb's law; NaN at the onset, where the law says nothing."""
    v, f, most = (np.asarray(value, float) for value in (velocity, external, limit))
    still = np.where(np.abs(f) <= most, -f, np.nan)
    return np.asarray(np.where(v == 0, still, -np.sign(v) * most))


def karnopp(
    velocity: npt.ArrayLike, external: npt.ArrayLike, limit: npt.ArrayLike, dead_zone: float
) -> Array:
    """Friction force by Karnopp's law (18): inside the dead zone [m/s] it opposes the pull."""
    v, f, most = (np.asarray(value, float) for value in (velocity, external, limit))
    still = -np.sign(f) * np.minimum(np.abs(f), most)
    return np.asarray(np.where(np.abs(v) <= dead_zone, still, -np.sign(v) * most))


def viscous_smoothed(velocity: npt.ArrayLike, limit: npt.ArrayLike, half_band: float) -> Array:
    """Friction force that grows linearly up to the half-band d [m/s], then stays."""
    v, most = np.asarray(velocity, float), np.asarray(limit, float)
    return np.asarray(-np.clip(v / half_band, -1.0, 1.0) * most)
