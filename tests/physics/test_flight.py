"""Fails if a flight is not the integral of its equations, or falls through a height at another
time than the last."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from throwplan.models import FlightLaw, FlightState

relaxed = settings(deadline=None, max_examples=50)
position, speed, rate = st.floats(-5, 5), st.floats(-10, 10), st.floats(-60, 60)
states = st.builds(FlightState, position, position, position, speed, speed, rate)
times = st.floats(0, 3)
gravities = st.floats(0.1, 25)


def values(state):
    return np.array([state.x, state.z, state.theta, state.v_x, state.v_z, state.omega])


def at_height(z, v_z):
    return FlightState(0.0, z, 0.0, 1.0, v_z, 0.0)


def test_flight_solves_the_equations_of_motion():
    gravity = 9.81
    state = FlightState(0.2, 0.9, 0.4, 1.7, 2.1, -7.0)
    times = np.linspace(0.1, 0.8, 5)
    solved = solve_ivp(
        lambda _, y: [*y[3:], 0.0, -gravity, 0.0],
        (0.0, 0.8),
        values(state),
        rtol=1e-11,
        atol=1e-12,
        t_eval=times,
    )
    for time, expected in zip(times, solved.y.T, strict=True):
        np.testing.assert_allclose(
            values(FlightLaw(gravity).after(state, time)), expected, atol=1e-10
        )


@relaxed
@given(state=states, height=position, gravity=gravities)
def test_time_to_height_is_the_last_crossing_and_downwards(state, height, gravity):
    time = FlightLaw(gravity).fall_time(state, height)
    assume(math.isfinite(time))
    end = FlightLaw(gravity).after(state, time)
    assert time >= 0
    assert end.z == pytest.approx(height, abs=1e-8)
    assert end.v_z <= 1e-7


@relaxed
@given(state=states, height=position, gravity=gravities)
def test_a_height_is_reached_only_below_the_apex(state, height, gravity):
    apex = state.z + max(state.v_z, 0.0) ** 2 / (2 * gravity)
    assume(abs(height - apex) > 1e-6)
    assert math.isfinite(FlightLaw(gravity).fall_time(state, height)) == (height < apex)


def test_a_fast_fall_keeps_its_digits():
    # v t = 1e-9 m with g t^2 / 2 far below: the textbook root would cancel.
    time = FlightLaw(9.81).fall_time(at_height(1e-9, -100.0), 0.0)
    assert time == pytest.approx(1e-11, rel=1e-9)


def test_without_gravity_the_flight_is_straight():
    assert FlightLaw(0.0).fall_time(at_height(2.0, -4.0), 1.0) == pytest.approx(0.25)
    end = FlightLaw(0.0).after(FlightState(0.0, 2.0, 0.1, 3.0, -4.0, 5.0), 0.25)
    np.testing.assert_allclose(values(end), [0.75, 1.0, 1.35, 3.0, -4.0, 5.0])
