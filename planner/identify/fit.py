"""Contact parameters fitted to measured landings: robust least squares with a prior.

Residuals are (dx / sigma_x, dtheta / sigma_theta) of every throw. The sigmas are the measurement's
noise, or the scatter of the residuals if that is larger: then the model errs, too. The loss grows
linearly beyond two sigmas (soft L1), so that a failed throw has small influence.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array
from ...problems import InputError
from .belief import ASSUMED, Belief, sets_at
from .predict import Predictor

#: Ranges of the unknowns: friction, patch radius [m], delay [s], scale of the grip force.
RANGES = {
    "friction": (0.05, 3.0),
    "patch_radius": (2e-4, 0.05),
    "delay": (-0.03, 0.03),
    "grip_scale": (0.3, 3.0),
}
#: Scales of the unknowns (delay [s], others relative): a standard deviation above 1 is refused.
UNITS = {"friction": 1.0, "patch_radius": 1.0, "delay": 0.03, "grip_scale": 1.0}
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
    wrong_scatter: residuals over noise that point to wrong units, turns or clocks.
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
    wrong_scatter: float = 30.0


SETTINGS = FitSettings()


@dataclass(frozen=True)
class Fit:
    """A fit of one model.

    posterior; sigma: (x [m], theta [rad]) of the residuals; scatter: sigma over the measurement's
    noise, 1 or more; at_bound: unknowns that ended at a bound of their range; missed: number of
    throws without a landing.
    """

    model: str
    posterior: Belief
    sigma: tuple[float, float]
    scatter: tuple[float, float]
    cost: float
    missed: int
    at_bound: tuple[str, ...]
    evaluations: int
    seconds: float

    def summary(self, error: float) -> list[str]:
        """Lines for people; error [m]: mean pose error of the landings."""
        belief, parts = self.posterior, []
        for name, value in belief.values().items():
            deviation = belief.deviation(name)
            if name == "delay":
                parts.append(f"delay {1e3 * value:.2f} +- {1e3 * deviation:.2f} ms")
                continue
            unit, factor = (" mm", 1e3) if name == "patch_radius" else ("", 1.0)
            parts.append(f"{name} {factor * value:.4g}{unit} +- {100 * deviation:.2g} %")
        lines = [
            f"    fit: {', '.join(parts)}",
            f"    mu r_p {1e3 * belief.product:.4g} mm +- {100 * belief.product_deviation:.2g} %, "
            f"mean pose error {100 * error:.3f} cm; {self.evaluations} evaluations, "
            f"{self.seconds:.1f} s",
        ]
        if max(self.scatter) > 1.0:
            wrong = ", or units, turns or clocks are wrong"
            lines.append(
                f"    residuals are {self.scatter[0]:.1f} (x) and {self.scatter[1]:.1f} (theta) "
                "times the measurement's noise: the model errs, or the noise is larger"
                + wrong
                * (max(self.scatter) > SETTINGS.wrong_scatter)
            )
        if self.at_bound:
            lines.append(
                f"    {', '.join(self.at_bound)}: at the bound of the search: give a --prior, or "
                "other throws"
            )
        return lines

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            **self.posterior.to_dict(),
            "sigma": {"x": self.sigma[0], "theta": self.sigma[1]},
            "scatter": {"x": self.scatter[0], "theta": self.scatter[1]},
            "cost": self.cost,
            "missed": self.missed,
            "at_bound": list(self.at_bound),
            "evaluations": self.evaluations,
            "seconds": self.seconds,
        }


def fit_to(
    predictor: Predictor,
    model: str,
    names: tuple[str, ...],
    prior: Belief | None = None,
    evaluated: Callable[[int], object] | None = None,
) -> Fit:
    """The unknowns `names` fitted by `model`.

    prior: of the same unknowns. Without one the friction has a weak prior at 0.6 (a factor of two)
    and the grip force's scale one at 1 (10 %), because throws show little more than their products.
    evaluated(n) is called with each evaluation's number. InputError if the throws cannot tell the
    unknowns.
    """
    start = time.perf_counter()
    shared = predictor.data.shared
    noise = np.array([shared.position_noise, shared.angle_noise])
    problem = _Problem(predictor, model, names, prior, noise, evaluated)
    point, cost = problem.solved(problem.start())
    if not np.isfinite(problem.missed_by(point[None])).any():
        height = f"landing_height = {shared.landing_height:g}"
        raise InputError(f"no landing: no throw comes down to {height} by {model}")
    count = len(predictor.data.throws)
    for _ in range(SETTINGS.refits if count >= SETTINGS.scatter_throws else 0):
        sigma = np.maximum(noise, problem.scatter(point))
        if np.allclose(sigma, problem.sigma, rtol=0.02):
            break
        problem.sigma = sigma
        point, cost = problem.solved(point)
    if prior is None:
        slopes = problem.jacobian(point)[: -len(names)].reshape(-1, 2, len(names))
        _check_identifiable(slopes, names)
    off = problem.missed_by(point[None])[0]
    low, high = problem.bounds
    at_bound = np.minimum(point - low, high - point) / (high - low) < 1e-3
    return Fit(
        model,
        Belief(names, point, problem.covariance(point)),
        (float(problem.sigma[0]), float(problem.sigma[1])),
        (float(problem.sigma[0] / noise[0]), float(problem.sigma[1] / noise[1])),
        cost,
        int((~np.isfinite(off).all(axis=1)).sum()),
        tuple(np.array(names)[at_bound].tolist()),
        problem.evaluations,
        time.perf_counter() - start,
    )


class _Problem:
    """Residuals, derivatives and loss of one fit; caches the last evaluation."""

    def __init__(
        self,
        predictor: Predictor,
        model: str,
        names: tuple[str, ...],
        prior: Belief | None,
        sigma: Array,
        evaluated: Callable[[int], object] | None,
    ) -> None:
        self.predictor, self.model = predictor, model
        self.names, self.prior, self.sigma, self.evaluations = names, prior, sigma, 0
        self._evaluated = evaluated or (lambda count: None)
        self.steps = np.full(len(names), SETTINGS.log_step)
        if "delay" in names:
            self.steps[names.index("delay")] = SETTINGS.delay_step
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
        self._evaluated(self.evaluations)
        landing = self.predictor.landings(self.model, sets_at(self.names, points))
        return np.asarray(landing.swapaxes(0, 1) - self.predictor.truth.landing)

    def rows(self, point: Array) -> Array:
        """Landing errors at a point and one step to either side along each unknown."""
        if self._last is None or not np.array_equal(self._last[0], point):
            moves = np.diag(self.steps)
            points = np.vstack([point, point + moves, point - moves])
            self._last = point.copy(), self.missed_by(points)
        return self._last[1]

    def weighted(self, off: Array, points: Array) -> Array:
        """Residuals (M, 2 T + P) of landing errors at points: throws, then prior."""
        residuals = off / self.sigma
        residuals[~np.isfinite(residuals).all(axis=2)] = SETTINGS.no_landing
        prior = (points - self.mean) @ self._root.T
        return np.hstack([residuals.reshape(len(points), -1), prior])

    def residuals(self, point: Array) -> Array:
        """Residuals (2 T + P,) at a point."""
        return np.asarray(self.weighted(self.rows(point)[:1], point[None])[0])

    def jacobian(self, point: Array) -> Array:
        """Derivatives (2 T + P, P) of the residuals; zero for a throw without a landing."""
        ahead, behind = np.split(self.rows(point)[1:] / self.sigma, 2)
        slopes = (ahead - behind) / (2 * self.steps[:, None, None])
        slopes[:, ~np.isfinite(slopes).all(axis=(0, 2))] = 0.0
        return np.vstack([slopes.reshape(len(self.names), -1).T, self._root])

    def loss(self, squares: Array) -> Array:
        """Soft L1 for the throws, squares for the prior: value and two derivatives."""
        bend, count = SETTINGS.loss_bend**2, len(self.names)
        bent = 1.0 + squares / bend
        found = np.array([2 * bend * (bent**0.5 - 1), bent**-0.5, -(bent**-1.5) / (2 * bend)])
        prior = squares[-count:]
        found[:, -count:] = [prior, np.ones_like(prior), np.zeros_like(prior)]
        return found

    def solved(self, start: Array) -> tuple[Array, float]:
        """The fit from one start, and its cost."""
        from scipy.optimize import least_squares

        low, high = self.bounds
        found = least_squares(
            self.residuals,
            np.clip(start, low + 1e-6, high - 1e-6),
            self.jacobian,
            (low, high),
            x_scale=np.array([0.01 if name == "delay" else 1.0 for name in self.names]),
            loss=self.loss,
            max_nfev=SETTINGS.max_evaluations,
            xtol=3e-4,
            ftol=1e-4,
        )
        return np.asarray(found.x), float(found.cost)

    def start(self) -> Array:
        """The prior's mean, or the best of a grid of friction, radius and delay (P,)."""
        if self.prior is not None:
            return self.prior.mean
        delays = SETTINGS.start_delays if "delay" in self.names else (0.0,)
        grid = list(itertools.product(SETTINGS.start_friction, SETTINGS.start_radius, delays))
        points = np.zeros((len(grid), len(self.names)))
        for point, (mu, radius, delay) in zip(points, grid, strict=True):
            known = {"friction": np.log(mu), "patch_radius": np.log(radius), "delay": delay}
            point[:] = [known.get(name, 0.0) for name in self.names]
        residuals = self.weighted(self.missed_by(points), points)
        return np.asarray(points[np.argmin([self.loss(row**2)[0].sum() for row in residuals])])

    def scatter(self, point: Array) -> Array:
        """Robust standard deviation of the residuals (2,): x [m], theta [rad]."""
        off = np.abs(self.rows(point)[0])
        free = np.sqrt(len(off) / max(len(off) - len(self.names) / 2, 1.0))
        return np.asarray(1.4826 * np.nanmedian(off, axis=0) * free)

    def covariance(self, point: Array) -> Array:
        """(P, P): Gauss-Newton's, with the weights of the loss and the prior."""
        weights, jacobian = self.loss(self.residuals(point) ** 2)[1], self.jacobian(point)
        information = jacobian.T @ (weights[:, None] * jacobian)
        return np.asarray(np.linalg.pinv(information, hermitian=True))


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
    rows, units = slopes.reshape(-1, len(names)), np.array([UNITS[name] for name in names])
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
            f"factor of e, or by {1e3 * UNITS['delay']:.0f} ms, stays within the noise); {CURE}"
        )
