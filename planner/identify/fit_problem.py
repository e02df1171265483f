"""The least-squares problem of a fit: residuals, their derivatives, loss and prior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .fit_belief import Belief
from .fit_landing import MOST_DELAY, Landings
from .fit_scene import ASSUMED
from .measured import Measured

Array = npt.NDArray[np.float64]

#: Where the unknowns may lie: mu, r_p [m], delay [s], scale.
RANGES = {
    "friction": (0.05, 3.0),
    "patch_radius": (2e-4, 0.05),
    "delay": (-MOST_DELAY, MOST_DELAY),
    "grip_scale": (0.3, 3.0),
}
#: Median and relative deviation of the friction where no prior is given: throws see little
#: but mu r_p, and a fit would wander along the ridge.
WEAK_FRICTION = (0.6, 0.7)
#: Residuals in sigmas from which on they count linearly.
BEND = 2.0
#: Residual of a throw without a predicted landing, in sigmas.
NO_LANDING = 100.0
#: Most evaluations of one start.
MOST_EVALUATIONS = 40


@dataclass
class Problem:
    """Residuals, derivatives and loss of one fit; remembers its last evaluation."""

    landings: Landings
    truth: Measured
    names: tuple[str, ...]
    sigma: Array
    mean: Array
    precision: Array
    evaluations: int = 0
    _last: tuple[Array, tuple[Array, Array]] | None = None

    def __post_init__(self) -> None:
        values, vectors = np.linalg.eigh(self.precision)
        self._root: Array = np.asarray(np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T)

    def landed(self, point: Array) -> tuple[Array, Array]:
        """Landings (T, 2) and derivatives (T, 2, P)."""
        if self._last is None or not np.array_equal(self._last[0], point):
            self._last = point.copy(), self.landings.at(point)
            self.evaluations += 1
        return self._last[1]

    def residuals(self, point: Array) -> Array:
        """(2 T + P,): throws, then the prior."""
        off = (self.landed(point)[0] - self.truth.landing) / self.sigma
        off[~np.isfinite(off).all(axis=1)] = NO_LANDING
        return np.concatenate([off.ravel(), self._root @ (point - self.mean)])

    def slopes(self, point: Array) -> Array:
        """Derivatives (T, 2, P) of the throws' residuals; zero where nothing lands."""
        landing, slopes = self.landed(point)
        good = np.isfinite(np.concatenate([landing[..., None], slopes], axis=2)).all(axis=(1, 2))
        return np.asarray(np.where(good[:, None, None], slopes, 0.0) / self.sigma[:, None])

    def jacobian(self, point: Array) -> Array:
        """Derivatives of the residuals."""
        return np.vstack([self.slopes(point).reshape(-1, len(self.names)), self._root])

    def loss(self, squares: Array) -> Array:
        """Soft L1 for the throws, squares for the prior: value and two derivatives."""
        bent = 1.0 + squares / BEND**2
        rho = np.array(
            [2 * BEND**2 * (np.sqrt(bent) - 1.0), bent**-0.5, -0.5 * bent**-1.5 / BEND**2]
        )
        rows = len(self.names)
        rho[:, -rows:] = np.array([squares[-rows:], np.ones(rows), np.zeros(rows)])
        return rho

    def bounds(self) -> tuple[Array, Array]:
        """Lowest and highest unknowns."""
        return bounds_of(self.names)

    def solved(self, start: Array) -> tuple[Array, float]:
        """Where the fit from one start ends, and its cost."""
        from scipy.optimize import least_squares

        low, high = self.bounds()
        found = least_squares(
            self.residuals,
            np.clip(start, low + 1e-6, high - 1e-6),
            self.jacobian,
            (low, high),
            x_scale=np.array([0.01 if name == "delay" else 1.0 for name in self.names]),
            loss=self.loss,
            max_nfev=MOST_EVALUATIONS,
            xtol=3e-4,
            ftol=1e-4,
        )
        return np.asarray(found.x), float(found.cost)

    def cost(self, point: Array) -> float:
        """Half the sum of the losses."""
        return float(self.loss(self.residuals(point) ** 2)[0].sum() / 2)

    def scatter(self, point: Array) -> Array:
        """Robust standard deviation of the residuals (2,): x [m], theta [rad]."""
        off = np.abs(self.landed(point)[0] - self.truth.landing)
        count = len(off)
        free = np.sqrt(count / max(count - len(self.names) / 2, 1.0))
        return np.asarray(1.4826 * np.nanmedian(off, axis=0) * free)

    def covariance(self, point: Array) -> Array:
        """(P, P): Gauss-Newton's, with the weights of the loss and the prior."""
        weights = self.loss(self.residuals(point) ** 2)[1]
        jacobian = self.jacobian(point)
        information = jacobian.T @ (weights[:, None] * jacobian)
        return np.asarray(np.linalg.pinv(information, hermitian=True))

    def at_bound(self, point: Array) -> tuple[str, ...]:
        """Unknowns at the edge of their range."""
        low, high = self.bounds()
        room = np.minimum(point - low, high - point) / (high - low)
        return tuple(n for n, left in zip(self.names, room, strict=True) if left < 1e-3)


def bounds_of(names: tuple[str, ...]) -> tuple[Array, Array]:
    """Lowest and highest unknowns (P,)."""
    ranges = np.array([RANGES[name] for name in names], float)
    for row, name in zip(ranges, names, strict=True):
        if name != "delay":
            row[:] = np.log(row)
    return ranges[:, 0], ranges[:, 1]


def prior_terms(names: tuple[str, ...], prior: Belief | None) -> tuple[Array, Array]:
    """Mean (P,) and precision (P, P) of what is known beforehand."""
    if prior is not None:
        return prior.mean, np.asarray(np.linalg.inv(prior.covariance), float)
    mean, precision = np.zeros(len(names)), scale_precision(names)
    i = names.index("friction")
    mean[i], precision[i, i] = np.log(WEAK_FRICTION[0]), WEAK_FRICTION[1] ** -2
    return mean, precision


def scale_precision(names: tuple[str, ...]) -> Array:
    """Precision (P, P) that holds the grip force's scale near 1."""
    held = [ASSUMED["grip_scale"] ** -2 if name == "grip_scale" else 0.0 for name in names]
    return np.diag(held)
