"""Contact parameters fitted to measured landings: robust least squares with a prior.

Residuals are (dx / sigma_x, dtheta / sigma_theta) of every throw. The sigmas are the measurement's
noise, or the scatter of the residuals if that is larger: then the model errs, too. The loss grows
linearly beyond two sigmas (soft L1), so that a failed throw has small influence.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..models import Array
from ..problems import InputError
from .belief import ASSUMED, Belief, sets_at
from .predict import Predictor

#: Ranges of the unknowns: friction, patch radius [m], delay [s], scale of the grip force.
RANGES = {
    "friction": (0.05, 3.0),
    "patch_radius": (2e-4, 0.05),
    "delay": (-0.03, 0.03),
    "grip_scale": (0.3, 3.0),
}
CURE = "give throws with other motions or objects, or --prior SCENE"


@dataclass(frozen=True)
class FitSettings:
    """Settings of a fit.

    delay_step [s], log_step: steps of central differences, of the delay and of logarithms.
    friction, friction_deviation: median and relative deviation of the friction without a prior;
    landings hardly depend on more than mu r_p, and a fit would drift along that ridge.
    loss_bend: residual [sigmas] above which the loss is linear.
    no_landing: residual [sigmas] of a throw without a predicted landing.
    max_evaluations: of the model in one solve.
    scatter_throws, refits: fewest throws for an estimate of the scatter, and solves with it.
    start_friction, start_radius [m], start_delays [s]: grid of candidate starts without a prior.
    min_variety: least relative spread of the derivatives of different throws; repeated throws of
    an arm differ by 0.03 to 0.2, throws of different motions by 0.8.
    delay_unit [s]: a deviation of the delay above it is refused, as one above 1 of a logarithm.
    """

    delay_step: float = 2e-4
    log_step: float = 0.01
    friction: float = 0.6
    friction_deviation: float = 0.7
    loss_bend: float = 2.0
    no_landing: float = 100.0
    max_evaluations: int = 40
    scatter_throws: int = 6
    refits: int = 2
    start_friction: tuple[float, ...] = tuple(np.geomspace(0.2, 1.5, 6))
    start_radius: tuple[float, ...] = tuple(np.geomspace(0.0015, 0.015, 6))
    start_delays: tuple[float, ...] = (-0.015, 0.0, 0.015)
    min_variety: float = 0.2
    delay_unit: float = 0.03


SETTINGS = FitSettings()


class FitProblem:
    """Residuals, derivatives and loss of one fit at points (P,), which are means of beliefs.

    Without a prior of the unknowns `names` the friction has a weak one at 0.6 (a factor of two)
    and the grip force's scale one at 1 (10 %), because throws show little more than their products.
    sigma (2,): x [m] and theta [rad] of the residuals, at first `noise`, the measurement's.
    evaluated(n) is called with each evaluation's number. The last evaluation is kept: least squares
    asks for residuals and derivatives in turn, and one batch has both.
    """

    def __init__(
        self,
        predictor: Predictor,
        model: str,
        names: tuple[str, ...],
        prior: Belief | None,
        evaluated: Callable[[int], object],
    ) -> None:
        self.predictor, self.model, self.names, self.prior = predictor, model, names, prior
        self.evaluated, self.evaluations = evaluated, 0
        shared = predictor.data.shared
        self.noise = self.sigma = np.array([shared.position_noise, shared.angle_noise])
        late = np.array([name == "delay" for name in names])
        self.steps = np.where(late, SETTINGS.delay_step, SETTINGS.log_step)
        ranges = [
            RANGES[name] if name == "delay" else np.log(np.array(RANGES[name])) for name in names
        ]
        self.bounds = np.array(ranges).T
        if prior is None:
            self.mean, precision = np.zeros(len(names)), _scale_precision(names)
            i = names.index("friction")
            self.mean[i] = np.log(SETTINGS.friction)
            precision[i, i] = SETTINGS.friction_deviation**-2
        else:
            self.mean, precision = prior.mean, np.asarray(np.linalg.inv(prior.covariance), float)
        values, vectors = np.linalg.eigh(precision)
        self._root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
        self._last: tuple[Array, Array] | None = None

    def missed_by(self, points: Array) -> Array:
        """Predicted less measured x [m], theta [rad] (M, T, 2) at points (M, P)."""
        self.evaluations += 1
        self.evaluated(self.evaluations)
        landing = self.predictor.landings(self.model, sets_at(self.names, points))
        return np.asarray(landing.swapaxes(0, 1) - self.predictor.truth)

    def fitted(self, start: Array | None = None) -> tuple[Array, float]:
        """The fit (P,) and its cost; `sigma` is then that of its residuals.

        start (P,): of a fit nearby. InputError if no throw lands.
        """
        starts = self._starts() if start is None else start[None]
        point, cost = min((self._solved(one) for one in starts), key=lambda found: found[1])
        if not np.isfinite(self.missed_by(point[None])).any():
            height = f"landing_height = {self.predictor.data.shared.landing_height:g}"
            raise InputError(f"no landing: no throw comes down to {height} by {self.model}")
        count = len(self.predictor.data.throws)
        for _ in range(SETTINGS.refits if count >= SETTINGS.scatter_throws else 0):
            sigma = np.maximum(self.noise, self._scatter(point))
            if np.allclose(sigma, self.sigma, rtol=0.02):
                break
            self.sigma = sigma
            point, cost = self._solved(point)
        return point, cost

    def check(self, point: Array) -> None:
        """InputError if the throws cannot tell the unknowns at a fit (P,) without a prior."""
        if self.prior is None:
            slopes = self._jacobian(point)[: -len(self.names)].reshape(-1, 2, len(self.names))
            _check_identifiable(slopes, self.names)

    def cost(self, point: Array, sigma: Array) -> float:
        """The cost of a fit (P,) with other `sigma` (2,)."""
        residuals = self._weighted(self._rows(point)[:1] * (self.sigma / sigma), point[None])[0]
        return float(self._loss(residuals**2)[0].sum()) / 2

    def belief(self, point: Array) -> Belief:
        """The fit (P,) as a belief."""
        return Belief(self.names, point, self.covariance(point))

    def covariance(self, point: Array) -> Array:
        """(P, P): Gauss-Newton's, with the weights of the loss and the prior."""
        weights, jacobian = self._loss(self._residuals(point) ** 2)[1], self._jacobian(point)
        information = jacobian.T @ (weights[:, None] * jacobian)
        return np.asarray(np.linalg.pinv(information, hermitian=True))

    def _rows(self, point: Array) -> Array:
        """Landing errors at a point and one step to either side along each unknown."""
        if self._last is None or not np.array_equal(self._last[0], point):
            moves = np.diag(self.steps)
            points = np.vstack([point, point + moves, point - moves])
            self._last = point.copy(), self.missed_by(points)
        return self._last[1]

    def _weighted(self, off: Array, points: Array) -> Array:
        """Residuals (M, 2 T + P) of landing errors at points: throws, then prior."""
        residuals = off / self.sigma
        residuals[~np.isfinite(residuals).all(axis=2)] = SETTINGS.no_landing
        prior = (points - self.mean) @ self._root.T
        return np.hstack([residuals.reshape(len(points), -1), prior])

    def _residuals(self, point: Array) -> Array:
        return np.asarray(self._weighted(self._rows(point)[:1], point[None])[0])

    def _jacobian(self, point: Array) -> Array:
        """Derivatives (2 T + P, P) of the residuals; zero for a throw without a landing."""
        ahead, behind = np.split(self._rows(point)[1:] / self.sigma, 2)
        slopes = (ahead - behind) / (2 * self.steps[:, None, None])
        slopes[:, ~np.isfinite(slopes).all(axis=(0, 2))] = 0.0
        return np.vstack([slopes.reshape(len(self.names), -1).T, self._root])

    def _loss(self, squares: Array) -> Array:
        """Soft L1 for the throws, squares for the prior: value and two derivatives."""
        bend, count = SETTINGS.loss_bend**2, len(self.names)
        bent = 1.0 + squares / bend
        found = np.array([2 * bend * (bent**0.5 - 1), bent**-0.5, -(bent**-1.5) / (2 * bend)])
        prior = squares[-count:]
        found[:, -count:] = [prior, np.ones_like(prior), np.zeros_like(prior)]
        return found

    def _solved(self, start: Array) -> tuple[Array, float]:
        """The fit from one start, and its cost."""
        from scipy.optimize import least_squares

        low, high = self.bounds
        found = least_squares(
            self._residuals,
            np.clip(start, low + 1e-6, high - 1e-6),
            self._jacobian,
            (low, high),
            x_scale=np.array([0.01 if name == "delay" else 1.0 for name in self.names]),
            loss=self._loss,
            max_nfev=SETTINGS.max_evaluations,
            xtol=3e-4,
            ftol=1e-4,
        )
        return np.asarray(found.x), float(found.cost)

    def _starts(self) -> Array:
        """The best of a grid of friction, radius and delay (1, P); with a prior, which goes with
        few throws that several values explain, the best three of its mean and the grid (3, P)."""
        delays = SETTINGS.start_delays if "delay" in self.names else (0.0,)
        grid = itertools.product(
            np.log(SETTINGS.start_friction), np.log(SETTINGS.start_radius), delays
        )
        heads = ("friction", "patch_radius", "delay")
        known = [dict(zip(heads, values, strict=True)) for values in grid]
        points = np.array([[one.get(name, 0.0) for name in self.names] for one in known])
        if self.prior is not None:
            points = np.vstack([self.prior.mean, points])
        residuals = self._weighted(self.missed_by(points), points)
        best = np.argsort([self._loss(row**2)[0].sum() for row in residuals])
        return np.asarray(points[best[: 1 if self.prior is None else 3]])

    def _scatter(self, point: Array) -> Array:
        """Robust standard deviation of the residuals (2,): x [m], theta [rad]."""
        off = np.abs(self._rows(point)[0])
        free = np.sqrt(len(off) / max(len(off) - len(self.names) / 2, 1.0))
        return np.asarray(1.4826 * np.nanmedian(off, axis=0) * free)


def _scale_precision(names: tuple[str, ...]) -> Array:
    """Precision (P, P) that holds the grip force's scale near 1."""
    return np.diag([ASSUMED[name] ** -2 if name == "grip_scale" else 0.0 for name in names])


def _check_identifiable(slopes: Array, names: tuple[str, ...]) -> None:
    """InputError if all throws are of one kind, or do not depend on some combination.

    slopes (T, 2, P): derivatives of the residuals in sigmas. It is no error if only the product of
    friction and radius is identifiable: their deviations show that.
    """
    count, words = len(slopes), ", ".join(names)
    if count < 2:
        raise InputError(
            f"not identifiable: {count} throw for {words}: an error of the model cannot be told "
            f"from one of theirs; {CURE}"
        )
    spread = np.sqrt(((slopes - slopes.mean(axis=0)) ** 2).sum(axis=(1, 2)).mean())
    if spread <= SETTINGS.min_variety * np.sqrt((slopes**2).sum(axis=(1, 2)).mean()):
        raise InputError(
            f"not identifiable: {words}: all {count} throws are alike (their landings depend on "
            f"them in the same way within {100 * SETTINGS.min_variety:.0f} %), so that an error of "
            f"the model looks just like one of theirs; {CURE}"
        )
    rows = slopes.reshape(-1, len(names))
    units = np.array([SETTINGS.delay_unit if name == "delay" else 1.0 for name in names])
    information = (rows.T @ rows + _scale_precision(names)) * np.outer(units, units)
    ridge = np.array([{"friction": 1.0, "patch_radius": -1.0}.get(name, 0.0) for name in names])
    values, vectors = np.linalg.eigh(information)
    for value, vector in zip(values, vectors.T, strict=True):
        alone = abs(vector @ ridge) / np.sqrt(2.0)
        if value >= 1.0 or (alone > 0.9 and value > 1e-6):
            continue
        parts = [name for name, share in zip(names, vector, strict=True) if abs(share) > 0.3]
        together = " and ".join(parts) + (" in one combination" if len(parts) > 1 else "")
        raise InputError(
            f"not identifiable: {together}: these throws hardly depend on it (a change by a "
            f"factor of e, or by {1e3 * SETTINGS.delay_unit:.0f} ms, stays within the noise); "
            f"{CURE}"
        )
