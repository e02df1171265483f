"""Contact parameters fitted to measured landings: robust least squares with a prior.

Residuals are (dx / sigma_x, dtheta / sigma_theta) of every throw. The sigmas are the
measurement's noise, or what the residuals scatter by where that is more: then the model
errs, too. The loss grows linearly beyond two sigmas (soft L1), so that a throw that went
wrong pulls little.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems import InputError
from .fit_belief import UNKNOWNS, Belief, parameters_at
from .fit_identifiable import check_identifiable
from .fit_landing import landings_of
from .fit_problem import BEND, NO_LANDING, Problem, bounds_of, prior_terms, scale_precision
from .fit_together import landings_together
from .measured import Measured
from .predict import Predictor

Array = npt.NDArray[np.float64]

#: Fewest throws from which a scatter beyond the noise is estimated.
ENOUGH = 6
#: Refits with estimated sigmas, at most.
REFITS = 2


@dataclass(frozen=True)
class Fit:
    """A fit of one model.

    posterior; sigma: (x [m], theta [rad]) that the residuals were weighed by; scatter: by
    how much they exceed the measurement's noise, 1 or more; at_bound: unknowns that ended
    at the edge of their range; missed: throws without a landing there.
    """

    model: str
    posterior: Belief
    sigma: tuple[float, float]
    scatter: tuple[float, float]
    cost: float
    missed: int
    at_bound: tuple[str, ...]
    derivatives: str
    evaluations: int
    starts: int
    seconds: float

    def to_dict(self) -> dict[str, Any]:
        """As JSON."""
        return {
            **self.posterior.to_dict(),
            "sigma": {"x": self.sigma[0], "theta": self.sigma[1]},
            "scatter": {"x": self.scatter[0], "theta": self.scatter[1]},
            "cost": self.cost,
            "missed": self.missed,
            "at_bound": list(self.at_bound),
            "derivatives": self.derivatives,
            "evaluations": self.evaluations,
            "seconds": self.seconds,
        }


def fit_to(
    predictor: Predictor,
    model: str,
    truth: Measured,
    names: tuple[str, ...],
    starts: Array,
    prior: Belief | None = None,
) -> Fit:
    """The unknowns `names` fitted by `model` from every start (S, P).

    prior: of the same unknowns. Without one the friction is held weakly near 0.6 (a factor
    of two) and a scale of the grip force near 1 (10 %), because throws see little but
    their products. InputError where the throws cannot tell the unknowns.
    """
    begun = time.perf_counter()
    shared = predictor.data.shared
    problem = Problem(
        landings_of(predictor, model, names),
        truth,
        names,
        np.array([shared.position_noise, shared.angle_noise]),
        *prior_terms(names, prior),
    )
    best = min((problem.solved(start) for start in starts), key=lambda found: found[1])
    point, noise = best[0], problem.sigma
    if not np.isfinite(problem.landed(point)[0]).all(axis=1).any():
        height = f"landing_height = {shared.landing_height:g}"
        raise InputError(f"no landing: no throw comes down to {height} by {model}")
    for _ in range(REFITS if len(truth.landing) >= ENOUGH else 0):
        sigma = np.maximum(noise, problem.scatter(point))
        if np.allclose(sigma, problem.sigma, rtol=0.02):
            break
        problem.sigma = sigma
        best = problem.solved(point)
        point = best[0]
    if prior is None:
        check_identifiable(problem.slopes(point), names, scale_precision(names))
    return Fit(
        model,
        Belief(names, point, problem.covariance(point)),
        (float(problem.sigma[0]), float(problem.sigma[1])),
        (float(problem.sigma[0] / noise[0]), float(problem.sigma[1] / noise[1])),
        best[1],
        int((~np.isfinite(problem.landed(point)[0]).all(axis=1)).sum()),
        problem.at_bound(point),
        problem.landings.derivatives,
        problem.evaluations,
        len(starts),
        time.perf_counter() - begun,
    )


def unknowns(delay: bool, grip_scale: bool) -> tuple[str, ...]:
    """Names of what is to be fitted."""
    return tuple(
        n for n in UNKNOWNS if (n != "delay" or delay) and (n != "grip_scale" or grip_scale)
    )


def costs_at(
    predictor: Predictor,
    model: str,
    truth: Measured,
    sigma: tuple[float, float],
    names: tuple[str, ...],
    prior: Belief | None,
    points: Array,
) -> Array:
    """A fit's cost (M,) at points (M, P), in one batch of predictions."""
    inside = np.clip(points, *bounds_of(names))
    found = landings_together(predictor, model, parameters_at(names, inside))
    off = (found - truth.landing[:, None]) / np.array(sigma)
    off[~np.isfinite(off).all(axis=2)] = NO_LANDING
    bent = 2 * BEND**2 * (np.sqrt(1.0 + (off / BEND) ** 2) - 1.0)
    mean, precision = prior_terms(names, prior)
    away = points - mean
    before = np.einsum("mi,ij,mj->m", away, precision, away)
    return np.asarray((bent.sum(axis=(0, 2)) + before) / 2)
