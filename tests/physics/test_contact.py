"""Fails if a contact's kinematics, wrenches or limit surface break Newton, Euler or Coulomb."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from release_cases import BAR
from throwplan.models import HandMotion, PinchContact, pivot_wrench
from throwplan.models.body import com_wrench, contact_twist

relaxed = settings(deadline=None, max_examples=50)
number = st.floats(-10, 10)
triple = st.tuples(number, number, number)
lever = st.tuples(st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
positive = st.floats(0.01, 10)

STEP = 1e-3


def rate(function, t):
    """First derivative by fourth-order central differences."""
    f = [function(t + k * STEP) for k in (-2, -1, 1, 2)]
    return (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * STEP)


def second_rate(function, t):
    """Second derivative by fourth-order central differences."""
    f = [function(t + k * STEP) for k in (-2, -1, 0, 1, 2)]
    return (-f[0] + 16 * f[1] - 30 * f[2] + 16 * f[3] - f[4]) / (12 * STEP**2)


@relaxed
@given(twist=triple, wrench=triple, r=lever)
def test_power_is_the_same_at_the_contact_and_at_the_com(twist, wrench, r):
    at_com = np.dot(com_wrench(*wrench, *r), twist)
    at_contact = np.dot(wrench, contact_twist(*twist, *r))
    assert at_com == pytest.approx(at_contact, rel=1e-12, abs=1e-10)


def pushed(t, turn):
    """A hand, and the CoM of a body that keeps its grasped point there.

    The body turns against the hand at the constant rate `turn`: with 0 it rides
    along, otherwise it has the hand's angular acceleration but not its rate.
    """
    hand = np.array([0.4 * math.sin(2 * t), 0.2 + 1.5 * t * t, 0.5 * t - 1.2 * math.sin(3 * t)])
    angle = hand[2] + 0.7 + turn * t
    h = BAR.com_offset
    com = np.array([hand[0] + h * math.cos(angle), hand[1] + h * math.sin(angle), angle])
    return hand, com


@pytest.mark.parametrize("t", [0.0, 0.7])
def test_contact_twist_is_the_rate_of_the_grasped_point(t):
    """The body turns against the hand, which holds one of its points."""
    hand, com = pushed(t, 4.0)
    twist = contact_twist(*rate(lambda time: pushed(time, 4.0)[1], t), *(com - hand)[:2])
    expected = np.add(rate(lambda time: pushed(time, 4.0)[0], t), [0.0, 0.0, 4.0])
    np.testing.assert_allclose(twist, expected, atol=1e-8)


@pytest.mark.parametrize("gravity", [9.81, 0.0])
@pytest.mark.parametrize("turn", [0.0, 4.0])
@pytest.mark.parametrize("t", [0.3, 0.9])
def test_pivot_wrench_is_newton_and_euler_of_a_carried_body(t, turn, gravity):
    hand, com = pushed(t, turn)
    x_r, z_r = com[:2] - hand[:2]
    a_x, a_z, alpha = second_rate(lambda time: pushed(time, turn)[0], t)
    motion = HandMotion(hand[2], rate(lambda time: pushed(time, turn)[0], t)[2], a_x, a_z, alpha)
    omega = rate(lambda time: pushed(time, turn)[1], t)[2]
    wrench = pivot_wrench(BAR, gravity, motion, omega, x_r, z_r)

    com_x, com_z, com_alpha = second_rate(lambda time: pushed(time, turn)[1], t)
    force = BAR.mass * np.array([com_x, com_z + gravity])
    # Euler about the CoM: the contact sits at -r from it, and turns from x to z count.
    moment = -x_r * force[1] + z_r * force[0]
    torque = BAR.inertia * com_alpha - moment
    np.testing.assert_allclose(wrench, [*force, torque], rtol=1e-6, atol=1e-7)


def test_a_level_bar_at_rest_needs_its_weight_and_its_moment():
    still = HandMotion(0.0, 0.0, 0.0, 0.0, 0.0)
    f_x, f_z, torque = pivot_wrench(BAR, 9.81, still, 0.0, BAR.com_offset, 0.0)
    assert (f_x, f_z) == (0.0, pytest.approx(0.24 * 9.81))
    assert torque == pytest.approx(0.235, abs=5e-4)


@relaxed
@given(mu=positive, radius=st.floats(1e-4, 0.05), force=positive, angle=st.floats(0, 7))
def test_utilisation_is_one_on_the_limits(mu, radius, force, angle):
    contact = PinchContact(mu, radius, torsion=0.6, faces=2)
    f_max = 2 * mu * force
    tau_max = 0.6 * radius * f_max
    pull = f_max * math.cos(angle), f_max * math.sin(angle)
    assert contact.utilisation_squared(*pull, 0.0, force) == pytest.approx(1.0)
    assert contact.utilisation_squared(0.0, 0.0, -tau_max, force) == pytest.approx(1.0)
    both = contact.utilisation_squared(0.6 * pull[0], 0.6 * pull[1], 0.8 * tau_max, force)
    assert both == pytest.approx(1.0)


# The ellipsoid: its gauge, its sliding wrench, normality.

CONTACT = PinchContact(0.7, 0.006, 0.6, 2)
SCALE = np.array([0.7, 0.7, 0.7 * 0.6 * 0.006])


def gauge(wrench: np.ndarray) -> float:
    return float(2 * np.sqrt(CONTACT.utilisation_squared(*wrench, 1.0)))


def test_sliding_wrench_lies_on_the_surface_and_takes_most_power() -> None:
    """Of random contact twists whose rotation counts as much as their translation."""
    rng = np.random.default_rng(2)
    for twist in rng.standard_normal((40, 3)) / SCALE * 0.01:
        wrench = CONTACT.sliding_wrench(twist)
        assert gauge(wrench) == pytest.approx(1.0, rel=1e-9)
        assert wrench @ twist < 0
        for direction in rng.standard_normal((20, 3)) * SCALE:
            other = direction / gauge(direction)
            assert wrench @ twist <= other @ twist + 1e-9 * abs(wrench @ twist)


def test_pure_slides_give_the_limits() -> None:
    assert CONTACT.sliding_wrench(np.array([1.0, 0, 0])) == pytest.approx([-0.7, 0, 0])
    turning = CONTACT.sliding_wrench(np.array([0, 0, -2.0]))
    assert turning == pytest.approx([0, 0, 0.7 * 0.6 * 0.006])
