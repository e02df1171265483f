"""Numbers that describe many landings: success, quantiles, shares of the variance."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Standard normal deviate of a two-sided 95 % confidence interval.
NORMAL_95 = 1.959963984540054
#: Quantiles that are reported [%].
QUANTILES = (50, 90, 95, 99)
#: Landings that differ by less [m, rad] differ by rounding and the models' steps alone.
NOTHING = 1e-5
#: Degree of the polynomials behind the shares of the variance, and the samples they need
#: for each coefficient.
DEGREE, SAMPLES_EACH = 8, 10


def wilson(successes: int, count: int) -> tuple[float, float]:
    """Wilson's 95 % confidence interval of a probability seen as `successes` of `count`.

    E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209. For independent samples; those of a
    Sobol sequence scatter less, so that the interval is rather too wide.
    """
    z2 = NORMAL_95**2 / count
    rate = successes / count
    middle = rate + z2 / 2
    half = math.sqrt(z2 * (rate * (1 - rate) + z2 / 4))
    low, high = (middle - half) / (1 + z2), (middle + half) / (1 + z2)
    # At the ends the closed form is exact but for its rounding.
    return (0.0 if successes == 0 else low), (1.0 if successes == count else high)


def quantiles(errors: Array) -> dict[str, float]:
    """The least error (N,) that so many per cent of the throws do not exceed.

    A throw without a landing (NaN) is infinitely far off.
    """
    known = np.where(np.isnan(errors), np.inf, errors)
    values = np.quantile(known, np.array(QUANTILES) / 100, method="inverted_cdf")
    return {str(name): float(value) for name, value in zip(QUANTILES, values, strict=True)}


def scaled_error(dx: Array, dtheta: Array, length: float, theta_counts: bool) -> Array:
    """e = |dx| + |dtheta| length / 2 [m], (39); |dx| where the target leaves theta open."""
    turned = np.abs(dtheta) * length / 2 if theta_counts else 0.0
    return np.asarray(np.abs(dx) + turned)


def variance_shares(values: Array, result: Array) -> list[float]:
    """First-order Sobol index of each parameter: Var(E[result | parameter]) / Var(result).

    values (N, P), result (N,). The conditional mean is a polynomial fitted to the sample
    itself (Lewandowski, Cooke and Duintjer Tebbens, "Sample-based estimation of
    correlation ratio with polynomial approximation", ACM TOMACS 18 (2007) 3), its R^2
    adjusted for the number of coefficients. No further throws are needed, and it keeps
    its meaning for correlated parameters, whose shares then overlap.
    """
    known = np.isfinite(result)
    values, result = values[known], result[known]
    if result.size < 3 or float(np.ptp(result)) < NOTHING:
        return [0.0] * values.shape[1]
    return [_share(column, result) for column in values.T]


def _share(column: Array, result: Array) -> float:
    """Adjusted R^2 of a polynomial in `column` (N,) fitted to `result` (N,)."""
    low, high = float(column.min()), float(column.max())
    # A few measured values carry no higher polynomial.
    different = np.unique(column).size
    degree = min(DEGREE, different - 1, (result.size - 1) // SAMPLES_EACH)
    if degree < 1 or high <= low:
        return 0.0
    basis = np.polynomial.legendre.legvander(2 * (column - low) / (high - low) - 1, degree)
    q, _ = np.linalg.qr(basis)
    off = result - result.mean()
    explained = float(((q.T @ off) ** 2).sum() / (off @ off))
    adjusted = 1 - (1 - explained) * (result.size - 1) / (result.size - 1 - degree)
    return min(max(adjusted, 0.0), 1.0)
