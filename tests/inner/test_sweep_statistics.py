"""Fails if a sweep's quantiles or shares of variance are not those of models with known answers."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from scipy.stats import norm, qmc
from throwplan.planner.sweep import quantiles, variance_shares


def test_quantiles_are_errors_that_were_met() -> None:
    found = quantiles(np.random.default_rng(0).permutation(np.arange(1.0, 101.0)))
    assert found == {"50": 50.0, "90": 90.0, "95": 95.0, "99": 99.0}


def test_a_throw_without_a_landing_is_infinitely_far_off() -> None:
    errors = np.array([1.0] * 92 + [math.nan] * 8)
    assert quantiles(errors) == {"50": 1.0, "90": 1.0, "95": math.inf, "99": math.inf}


def test_the_pose_error_is_equation_39() -> None:
    dx, dtheta = np.array([0.003, -0.001]), np.array([-0.02, 0.01])
    expected = [0.003 + 0.02 * 0.13, 0.001 + 0.01 * 0.13]
    bar = dataclasses.replace(tp.load_scene("pose").object, length=0.26)
    assert bar.pose_error(dx, dtheta) == pytest.approx(expected)
    assert bar.pose_error(dx, 0.0) == pytest.approx([0.003, 0.001])


def unit_samples(count: int, columns: int) -> np.ndarray:
    return qmc.Sobol(columns, rng=1).random(count) + 2.0**-31


@pytest.mark.parametrize("count", [256, 4096])
def test_shares_of_a_linear_model(count: int) -> None:
    """y = sum a_i x_i of independent x: a_i^2 Var(x_i) / Var(y)."""
    u = unit_samples(count, 4)
    x = np.column_stack([2 * u[:, 0] - 1, norm.ppf(u[:, 1]), u[:, 2] > 0.5, u[:, 3]])
    slopes, variances = np.array([3.0, 1.0, 2.0, 0.0]), np.array([1 / 3, 1.0, 1 / 4, 1 / 12])
    parts = slopes**2 * variances
    shares = variance_shares(x, x @ slopes + 5.0)
    assert shares == pytest.approx(parts / parts.sum(), abs=0.03 if count < 1000 else 0.01)


def test_shares_of_what_does_not_vary_are_zero() -> None:
    x = unit_samples(256, 2)
    assert variance_shares(x, np.full(256, 0.9)) == [0.0, 0.0]
    # Rounding is no variance: below 10 um, or 10 urad.
    assert variance_shares(x, 0.9 + 1e-6 * x[:, 0]) == [0.0, 0.0]


def test_shares_do_without_the_throws_that_land_nowhere() -> None:
    x = unit_samples(1024, 2)
    y = np.where(x[:, 1] > 0.9, np.nan, x[:, 0])
    assert variance_shares(x, y) == pytest.approx([1.0, 0.0], abs=0.01)
