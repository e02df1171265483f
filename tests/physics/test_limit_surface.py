"""Limit surfaces: gauges, sliding wrenches, normality; 1-D friction laws."""

from __future__ import annotations

import math

import numpy as np
import pytest
from throwplan.models import (
    Contact,
    Ellipsoid,
    ellipsoid,
    rotated_ellipsoid,
    slip_size,
    smoothed_sliding_wrench,
)

CONTACT = Contact(0.7, 0.006, 0.6, 2)
SURFACES = {
    "ellipsoid": ellipsoid(CONTACT),
    "rotated": rotated_ellipsoid(CONTACT),
}
SCALE = np.array([0.7, 0.7, 0.7 * 0.6 * 0.006])


def twists(count: int = 40) -> np.ndarray:
    """Random contact twists whose rotation counts as much as their translation."""
    return np.random.default_rng(3).standard_normal((count, 3)) / SCALE * 0.01


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
def test_gauge_is_homogeneous_and_symmetric(surface) -> None:
    for wrench in np.random.default_rng(1).standard_normal((20, 3)) * SCALE:
        assert surface.gauge(2.5 * wrench) == pytest.approx(2.5 * surface.gauge(wrench))
        assert surface.gauge(-wrench) == pytest.approx(surface.gauge(wrench))


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
def test_sliding_wrench_lies_on_the_surface_and_takes_most_power(surface) -> None:
    rng = np.random.default_rng(2)
    for twist in twists():
        wrench = surface.sliding_wrench(twist)
        assert surface.gauge(wrench) == pytest.approx(1.0, rel=1e-9)
        assert wrench @ twist < 0
        for direction in rng.standard_normal((20, 3)) * SCALE:
            other = direction / surface.gauge(direction)
            assert wrench @ twist <= other @ twist + 1e-9 * abs(wrench @ twist)


@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)
def test_sliding_wrench_ignores_speed(surface) -> None:
    for twist in twists(10):
        assert surface.sliding_wrench(1e-6 * twist) == pytest.approx(surface.sliding_wrench(twist))


def test_pure_slides_give_the_limits() -> None:
    surface = SURFACES["ellipsoid"]
    assert surface.sliding_wrench(np.array([1.0, 0, 0])) == pytest.approx([-0.7, 0, 0])
    turning = surface.sliding_wrench(np.array([0, 0, -2.0]))
    assert turning == pytest.approx([0, 0, 0.7 * 0.6 * 0.006])


def test_rotated_ellipsoid_couples_force_and_torque() -> None:
    surface = SURFACES["rotated"]
    assert isinstance(surface, Ellipsoid)
    assert np.linalg.eigvalsh(surface.matrix).min() > 0
    assert abs(surface.matrix[1, 2]) > 0
    assert abs(surface.sliding_wrench(np.array([0, 1.0, 0]))[2]) > 0


def test_smoothing_is_linear_inside_the_band_and_nothing_outside() -> None:
    surface = SURFACES["ellipsoid"]
    twist = np.array([0.003, -0.004, 0.0])
    full = surface.sliding_wrench(twist)
    assert smoothed_sliding_wrench(surface, twist, 0.005, 0.01) == pytest.approx(0.5 * full)
    assert smoothed_sliding_wrench(surface, 9 * twist, 0.045, 0.01) == pytest.approx(full)
    assert smoothed_sliding_wrench(surface, 0 * twist, 0.0, 0.01) == pytest.approx(np.zeros(3))


def test_norms_of_a_twist() -> None:
    twist = np.array([0.03, 0.04, 2.0])
    assert slip_size(twist, CONTACT, "paper") == pytest.approx(math.sqrt(0.05**2 + 4.0))
    assert slip_size(twist, CONTACT, "consistent") == pytest.approx(
        math.hypot(0.05, 2.0 * 0.6 * 0.006)
    )
