"""What many landings come to: success, quantiles, and how they answer to each parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models import MODELS, Array
from ...problems import UNCERTAIN_PARAMETERS
from .samples import Sampler
from .throws import FURTHEST, Outcomes, Thrower

#: Quantiles that are reported [%].
QUANTILES = (50, 90, 95, 99)
#: Landings that differ by less [m, rad] differ by rounding and the models' steps alone.
NOTHING = 1e-5
#: Degree of the polynomials behind the shares of the variance, and the samples they need
#: for each coefficient.
DEGREE, SAMPLES_EACH = 8, 10
#: Steps of the central differences: this share of the standard deviation, and at most
#: this share of a positive value.
STEP, MOST = 0.05, 0.01
#: Sections of the delays up to `FURTHEST`, of the one with the first failure, and of its own.
SECTIONS = (100, 64, 64)
#: Quantiles between which a parameter swings.
OUTER = (0.05, 0.95)
#: The band over delay: delays, and draws of the other parameters at each; fewer for the
#: models that take milliseconds a throw.
BAND, SLOW_BAND = (41, 128), (21, 16)


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


def derivatives(thrower: Thrower, sampler: Sampler) -> dict[str, tuple[float, float]]:
    """d x / d p [m per unit] and d theta / d p [rad per unit] at the plan's own values.

    Central differences by the thrower's model, for each uncertain parameter.
    """
    count = len(thrower.names)
    steps = np.array([_step(thrower, sampler, i) for i in range(count)])
    values = np.repeat(thrower.nominal(), 2 * count, axis=0)
    for i, step in enumerate(steps):
        values[2 * i, i] += step
        values[2 * i + 1, i] -= step
    pose = thrower.throw(values).pose[:, :2]
    slopes = (pose[0::2] - pose[1::2]) / (2 * steps[:, None])
    return {name: (float(s[0]), float(s[1])) for name, s in zip(thrower.names, slopes, strict=True)}


def _step(thrower: Thrower, sampler: Sampler, i: int) -> float:
    name, value = thrower.names[i], thrower.nominal()[0, i]
    # One measured value has no deviation.
    step = STEP * sampler.spreads[i].deviation or 1e-4
    return min(step, MOST * value) if UNCERTAIN_PARAMETERS[name].scaled else step


@dataclass(frozen=True)
class DelayScan:
    """The largest delays [s] before and after the mean up to which every throw still succeeds.

    0 where the nominal one fails, None where none fails within `FURTHEST`.
    """

    early: float | None
    late: float | None


def scan_delays(thrower: Thrower) -> DelayScan:
    """Locates the first failure on either side, all else as planned."""
    if not thrower.succeeds(_at_delays(thrower, np.zeros(1)))[0]:
        return DelayScan(0.0, 0.0)
    return DelayScan(_largest_delay(thrower, -1.0), _largest_delay(thrower, 1.0))


def _largest_delay(thrower: Thrower, sign: float) -> float | None:
    low, high = 0.0, FURTHEST
    for sections in SECTIONS:
        ends = np.linspace(low, high, sections + 1)
        inside = thrower.succeeds(_at_delays(thrower, sign * ends[1:]))
        if inside.all() and high == FURTHEST:
            return None
        first = int(np.argmin(np.append(inside[:-1], False)))
        low, high = float(ends[first]), float(ends[first + 1])
    return sign * low


def _at_delays(thrower: Thrower, delays: Array, values: Array | None = None) -> Outcomes:
    """Throws with these delays (K,) beyond the mean, all else as planned or as `values`."""
    if values is None:
        values = thrower.nominal(len(delays))
    if "delay" in thrower.names:
        values = values.copy()
        values[:, thrower.names.index("delay")] = thrower.mean_delay + delays
        return thrower.throw(values)
    extended = thrower.with_parameter("delay")
    return extended.throw(np.column_stack([values, thrower.mean_delay + delays]))


def swings(thrower: Thrower, sampler: Sampler) -> Array:
    """Poses (P, 2, 3) with each parameter at its 5 and 95 % quantile, all else as planned."""
    values = np.repeat(thrower.nominal(), 2 * len(thrower.names), axis=0)
    for i, name in enumerate(thrower.names):
        values[2 * i : 2 * i + 2, i] = sampler.quantiles(name, np.array(OUTER))
    return thrower.throw(values).pose.reshape(-1, 2, 3)


def delay_band(
    thrower: Thrower, sampler: Sampler, limits: tuple[float, float]
) -> tuple[Array, Array]:
    """Delays (K,) [s] beyond the mean, and poses (K, M, 3) for M draws of all else there."""
    count, draws = BAND if MODELS[thrower.model].quick else SLOW_BAND
    delays = np.linspace(*limits, count)
    values = sampler.draw(0, draws)
    pose = _at_delays(thrower, np.repeat(delays, draws), np.tile(values, (count, 1))).pose
    return delays, pose.reshape(count, draws, 3)
