"""Where a fit starts."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .fit import costs_at
from .fit_belief import Belief
from .grid import grid_of
from .measured import Measured
from .predict import BATCHES, Predictor

Array = npt.NDArray[np.float64]

#: Draws of a prior that are looked at, a power of two; the best of them are starts.
DRAWS = 128
#: Starts of a fit from a grid, and from a prior beside its mean.
STARTS, PRIOR_DRAWS = 3, 2
#: Cells of the small grid that a fit without a prior starts from, mu and r_p [m].
SMALL = (np.geomspace(0.2, 1.5, 6), np.geomspace(0.0015, 0.015, 6))
#: Delays [s] that are tried there, where a delay is fitted.
DELAYS = (-0.015, 0.0, 0.015)


def starts_from_prior(
    predictor: Predictor, model: str, truth: Measured, prior: Belief, draws: int = DRAWS
) -> Array:
    """The prior's mean, and those of its draws that suit the throws best (S, P)."""
    if model not in BATCHES:
        return prior.mean[None]
    from scipy.special import ndtri
    from scipy.stats import qmc

    shares = qmc.Sobol(len(prior.names), rng=np.random.default_rng(0)).random(draws)
    scores = ndtri(np.clip(shares, 1e-3, 1 - 1e-3))
    draws_of = prior.mean + scores @ np.linalg.cholesky(prior.covariance).T
    points = np.vstack([prior.mean, draws_of])
    shared = predictor.data.shared
    sigma = (shared.position_noise, shared.angle_noise)
    costs = costs_at(predictor, model, truth, sigma, prior.names, prior, points)
    best = points[1:][np.argsort(costs[1:])[:PRIOR_DRAWS]]
    return np.vstack([prior.mean, best])


def starts_from_grid(
    predictor: Predictor, model: str, truth: Measured, names: tuple[str, ...]
) -> Array:
    """The best cells (S, P) of a small grid, with several delays if one is fitted."""
    delays = DELAYS if "delay" in names else (0.0,)
    grids = [grid_of(predictor, model, truth, SMALL, (delay, 1.0)) for delay in delays]
    cells = [
        (grid, delay, cell)
        for grid, delay in zip(grids, delays, strict=True)
        for cell in grid.starts(STARTS)
    ]
    cells.sort(key=lambda found: found[0].error_near(found[2]))
    starts = np.zeros((min(len(cells), STARTS), len(names)))
    for start, (_, delay, cell) in zip(starts, cells, strict=False):
        start[:2] = cell
        if "delay" in names:
            start[names.index("delay")] = delay
    return starts
