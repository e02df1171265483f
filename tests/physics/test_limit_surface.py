"""The ellipsoid: its gauge, its sliding wrench, normality."""

from __future__ import annotations

import numpy as np
import pytest
from throwplan.models import Contact

CONTACT = Contact(0.7, 0.006, 0.6, 2)
SCALE = np.array([0.7, 0.7, 0.7 * 0.6 * 0.006])


def gauge(wrench: np.ndarray) -> float:
    return float(2 * np.sqrt(CONTACT.utilisation_squared(*wrench, 1.0)))


def twists(count: int = 40) -> np.ndarray:
    """Random contact twists whose rotation counts as much as their translation."""
    return np.random.default_rng(3).standard_normal((count, 3)) / SCALE * 0.01


def test_gauge_is_homogeneous_and_symmetric() -> None:
    for wrench in np.random.default_rng(1).standard_normal((20, 3)) * SCALE:
        assert gauge(2.5 * wrench) == pytest.approx(2.5 * gauge(wrench))
        assert gauge(-wrench) == pytest.approx(gauge(wrench))


def test_sliding_wrench_lies_on_the_surface_and_takes_most_power() -> None:
    rng = np.random.default_rng(2)
    for twist in twists():
        wrench = CONTACT.sliding_wrench(twist)
        assert gauge(wrench) == pytest.approx(1.0, rel=1e-9)
        assert wrench @ twist < 0
        for direction in rng.standard_normal((20, 3)) * SCALE:
            other = direction / gauge(direction)
            assert wrench @ twist <= other @ twist + 1e-9 * abs(wrench @ twist)


def test_sliding_wrench_ignores_speed() -> None:
    for twist in twists(10):
        assert CONTACT.sliding_wrench(1e-6 * twist) == pytest.approx(CONTACT.sliding_wrench(twist))


def test_pure_slides_give_the_limits() -> None:
    assert CONTACT.sliding_wrench(np.array([1.0, 0, 0])) == pytest.approx([-0.7, 0, 0])
    turning = CONTACT.sliding_wrench(np.array([0, 0, -2.0]))
    assert turning == pytest.approx([0, 0, 0.7 * 0.6 * 0.006])
