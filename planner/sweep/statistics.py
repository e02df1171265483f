"""Statistics of landings: quantiles, sensitivities to each parameter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...models import Array
from ...problems import Distribution, Uncertainty
from ..throw import ThrowBatch, release_model
from ..uncertainty import Sampler, with_delays

#: Reported quantiles of the errors [%].
QUANTILES = (50, 90, 95, 99)
#: Range of landings [m, rad] below which differences are rounding and errors of the models.
ROUNDING = 1e-5
#: Quantiles of a parameter at the two ends of its bar in the tornado.
OUTER = (0.05, 0.95)


@dataclass(frozen=True)
class StatisticsSettings:
    """Settings of variance shares, derivatives and delay.png.

    degree: highest, of the polynomials of the variance shares. samples_per_term: fewest samples for
    a coefficient of these. step: of central differences, in standard deviations. max_step: of a
    positive parameter, as a share of its value. band: number of delays in delay.png, and draws of
    the other parameters at each. slow_band: for models of milliseconds a throw.
    """

    degree: int = 8
    samples_per_term: int = 10
    step: float = 0.05
    max_step: float = 0.01
    band: tuple[int, int] = (41, 128)
    slow_band: tuple[int, int] = (21, 16)


SETTINGS = StatisticsSettings()


def quantiles(errors: Array) -> dict[str, float]:
    """Quantiles of the errors (N,) by their percentage; no landing (NaN) is an infinite error."""
    finite_errors = np.where(np.isnan(errors), np.inf, errors)
    values = np.quantile(finite_errors, np.array(QUANTILES) / 100, method="inverted_cdf")
    return {str(name): float(value) for name, value in zip(QUANTILES, values, strict=True)}


def variance_shares(values: Array, result: Array) -> list[float]:
    """First-order Sobol index of each parameter: Var(E[result | parameter]) / Var(result).

    values (N, P), result (N,). The conditional mean is a polynomial fitted to the sample
    itself (Lewandowski, Cooke and Duintjer Tebbens, "Sample-based estimation of
    correlation ratio with polynomial approximation", ACM TOMACS 18 (2007) 3), its R^2
    adjusted for the number of coefficients. It needs no further throws, and it is valid for
    correlated parameters, whose shares overlap.
    """
    finite = np.isfinite(result)
    values, result = values[finite], result[finite]
    if result.size < 3 or float(np.ptp(result)) < ROUNDING:
        return [0.0] * values.shape[1]
    return [_share(column, result) for column in values.T]


def _share(column: Array, result: Array) -> float:
    """Adjusted R^2 of a polynomial in `column` (N,) fitted to `result` (N,)."""
    low, high = float(column.min()), float(column.max())
    # The degree is below the number of different values.
    different = np.unique(column).size
    degree = min(SETTINGS.degree, different - 1, (result.size - 1) // SETTINGS.samples_per_term)
    if degree < 1 or high <= low:
        return 0.0
    basis = np.polynomial.legendre.legvander(2 * (column - low) / (high - low) - 1, degree)
    q, _ = np.linalg.qr(basis)
    deviation = result - result.mean()
    explained = float(((q.T @ deviation) ** 2).sum() / (deviation @ deviation))
    adjusted = 1 - (1 - explained) * (result.size - 1) / (result.size - 1 - degree)
    return min(max(adjusted, 0.0), 1.0)


def derivatives(batch: ThrowBatch, sampler: Sampler) -> dict[str, tuple[float, float]]:
    """d x / d p [m per unit] and d theta / d p [rad per unit] at the plan's own values.

    By central differences, for each uncertain parameter p.
    """
    nominal = batch.nominal()[0]
    parameters = zip(batch.names, nominal, sampler.spreads, strict=True)
    steps = np.array([_step(*parameter) for parameter in parameters])
    changes = np.diag(steps)
    pose = batch.fly(nominal + np.concatenate([changes, -changes])).pose[:, :2]
    slopes = (pose[: len(steps)] - pose[len(steps) :]) / (2 * steps[:, None])
    return {name: (float(s[0]), float(s[1])) for name, s in zip(batch.names, slopes, strict=True)}


def _step(name: str, value: float, spread: Distribution) -> float:
    # A single measured value has no deviation.
    step = SETTINGS.step * spread.deviation or 1e-4
    return min(step, SETTINGS.max_step * value) if Uncertainty.PARAMETERS[name].scaled else step


def tornado(batch: ThrowBatch, sampler: Sampler) -> Array:
    """Landings (P, 2, 3) with each parameter at its 5 and 95 % quantile, the others as planned."""
    values = np.repeat(batch.nominal(), 2 * len(batch.names), axis=0)
    for i, name in enumerate(batch.names):
        values[2 * i : 2 * i + 2, i] = sampler.quantiles(name, np.array(OUTER))
    return batch.fly(values).pose.reshape(-1, 2, 3)


def delay_band(
    batch: ThrowBatch, sampler: Sampler, limits: tuple[float, float]
) -> tuple[Array, Array]:
    """Delays (K,) [s] beyond the mean; landings (K, M, 3) of M draws of the other parameters."""
    quick = release_model(batch.scene, batch.model).quick
    count, draws = SETTINGS.band if quick else SETTINGS.slow_band
    delays = np.linspace(*limits, count)
    values = np.tile(sampler.draw(0, draws), (count, 1))
    late, samples = with_delays(batch, np.repeat(delays, draws), values)
    return delays, late.fly(samples).pose.reshape(count, draws, 3)
