"""Fails if a landing is not where its track falls through the landing height."""

from __future__ import annotations

import numpy as np
import pytest
from throwplan.lab import measured
from throwplan.lab.throws import MeasuredThrow, Shared, ThrowData
from throwplan.models.release import TableGrip
from throwplan.problems import Grasp, InputError, Object

G, HEIGHT, OPENED = 9.81, -0.7, 0.6
#: CoM pose and twist at the opening's end.
START = np.array([0.5, 0.4, 0.3, 1.5, 1.0, 5.0])


def state(t: np.ndarray) -> np.ndarray:
    """x, z, theta (K, 3) so long after the opening's end, the floor not there."""
    x, z, theta, v_x, v_z, omega = START
    return np.column_stack([x + v_x * t, z + v_z * t - G * t**2 / 2, theta + omega * t])


def landing_time(height: float) -> float:
    _, z, _, _, v_z, _ = START
    return float((v_z + np.sqrt(v_z**2 + 2 * G * (z - height))) / G)


def data(rest_at: float, end: float = 2.0, landing: tuple | None = None) -> ThrowData:
    """One throw whose bar stops dead at a height and lies there until `end` [s]."""
    times = np.arange(-0.1, end, 0.004)
    flight = np.minimum(times, landing_time(rest_at))
    track = np.column_stack([times + OPENED, state(flight)])
    bar = Object(mass=0.24, inertia=535e-6, length=0.26, com=0.10)
    grip = TableGrip([0.0, 0.05, 0.10], [120.0, 120.0, 0.0])
    motion = np.column_stack([times, 0 * times, 0 * times])
    throw = MeasuredThrow(
        "one", bar, Grasp(), times, motion, OPENED - 0.10, grip, landing, track, {}
    )
    return ThrowData("made", Shared(landing_height=HEIGHT), (throw,))


@pytest.mark.parametrize("rest_at", [HEIGHT - 0.01, HEIGHT - 0.3])
def test_what_comes_after_the_landing_is_not_looked_at(rest_at: float) -> None:
    found = measured(data(rest_at))
    x, _, theta = state(np.array([landing_time(HEIGHT)]))[0]
    assert found[0] == pytest.approx([x, theta], abs=1e-6)


def test_a_bar_that_comes_to_rest_above_the_landing_height_has_not_landed() -> None:
    with pytest.raises(InputError):
        measured(data(HEIGHT + 0.01))
    # A landing of its own needs no flight.
    assert measured(data(HEIGHT + 0.01, landing=(1.3, HEIGHT, 2.0)))[0] == pytest.approx([1.3, 2.0])
