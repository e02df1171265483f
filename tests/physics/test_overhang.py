"""The overhanging beam of section V-A: statics, thresholds, and a two-point patch beside it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from throwplan.models import (
    Body,
    Contact,
    LinearRelease,
    OverhangingBeam,
    Patch,
    PatchRelease,
    Path,
    ReleaseCase,
)

BAR, PADS = Body(0.2, 5e-4, 0.1), Contact(0.8, 0.0075)
BEAM = OverhangingBeam(BAR, PADS)
WEIGHT = BAR.mass * 9.81

beams = st.builds(
    lambda m, k, h, r, mu: OverhangingBeam(Body(m, m * k * k, h), Contact(mu, r)),
    st.floats(0.05, 1),
    st.floats(0.01, 0.2),
    st.floats(0.02, 0.3),
    st.floats(0.001, 0.015),
    st.floats(0.1, 1.2),
)


@given(beams)
def test_sticking_forces_balance_weight_and_its_torque(beam: OverhangingBeam) -> None:
    f_1, f_2 = beam.sticking_forces()
    weight, r = beam.body.mass * beam.gravity, beam.half_span
    np.testing.assert_allclose(f_1 + f_2, [0.0, weight], atol=1e-9)
    assert (f_2[1] - f_1[1]) * r == pytest.approx(weight * beam.body.com_offset)
    # Least norm: any horizontal pair would add to it. And C2 carries more.
    assert f_1[0] == f_2[0] == 0.0
    assert np.hypot(*f_1) < np.hypot(*f_2)


@given(beams)
def test_c2_reaches_its_limit_at_the_hinge_threshold(beam: OverhangingBeam) -> None:
    threshold = beam.hinge_threshold()
    weight, ratio = beam.body.mass * beam.gravity, beam.body.com_offset / beam.half_span
    # The paper's m g (1 + h/r) / 2 = f_max^C, with two faces in place of its one.
    assert 2 * beam.contact.friction * threshold / 2 == pytest.approx(weight * (1 + ratio) / 2)
    # Long before f_N falls to what the weight alone needs, mg / mu.
    assert threshold > weight / (2 * beam.contact.friction)
    assert beam.pivot_acceleration(threshold) == pytest.approx(0.0, abs=1e-9)
    assert beam.pivot_acceleration(0.99 * threshold) < 0


@given(beams, st.floats(0.0, 1.0))
def test_the_hinge_holds_between_its_thresholds(beam: OverhangingBeam, share: float) -> None:
    low, high = beam.sliding_threshold(), beam.hinge_threshold()
    assert low < high
    assert beam.hinge_holds(low + (0.001 + 0.998 * share) * (high - low))
    assert not beam.hinge_holds(low * share * 0.999)
    assert not beam.hinge_holds(high * (1.001 + share))


def test_a_falling_bar_loads_its_hinge_to_the_end() -> None:
    # A rod hinged at one end and let go: m g I / J_1.
    reach = BAR.com_offset + PADS.patch_radius
    expected = WEIGHT * BAR.inertia / (BAR.inertia + BAR.mass * reach**2)
    np.testing.assert_allclose(BEAM.hinge_force(0.0), [0.0, expected])
    assert not BEAM.hinge_holds(0.0)


def test_a_turning_bar_slides_sooner() -> None:
    grips = np.linspace(0.1, 1.2, 200) * BEAM.hinge_threshold()
    still, turning = BEAM.hinge_holds(grips), BEAM.hinge_holds(grips, omega=15.0)
    assert turning.sum() < still.sum()
    assert (still | ~turning).all()
    # Inward: m omega^2 (h + r).
    inward = BEAM.hinge_force(grips, 15.0)[0]
    np.testing.assert_allclose(inward, -BAR.mass * 225 * 0.1075)


@settings(deadline=None, max_examples=8)
@given(st.floats(0.04, 0.2), st.floats(0.003, 0.01))
def test_a_patch_of_two_points_does_the_same(h: float, r: float) -> None:
    # The time-stepped patch knows nothing of hinges.
    beam = OverhangingBeam(Body(0.2, 5e-4, h), Contact(0.8, r))
    grip = LinearRelease(2 * beam.hinge_threshold(), 0.0, 0.04)
    still = Path.accelerating((0.0, 0.0, 0.0))
    two = Patch([-r, r], [0.0, 0.0], [0.5, 0.5])
    steps = 400
    case = ReleaseCase(beam.body, beam.contact, grip, still)
    release = PatchRelease(pressure=two, steps=steps).release(case)
    omega = release.com_twist[2]
    # At rest until the threshold, at half of the opening, then pivoting.
    start = steps // 2
    assert np.abs(omega[: start - 1]).max() < 1e-4
    later = slice(start + 15, start + 100)
    force = grip.force((release.times[later] + release.times[start + 14 : start + 99]) / 2)
    rate = np.diff(omega)[start + 14 : start + 99] * steps / grip.opening
    np.testing.assert_allclose(rate, beam.pivot_acceleration(force), rtol=0.01)
    # The hinge: C1 does not move.
    x, z, theta = release.com[:, start + 100]
    assert np.hypot(x - (h + r) * np.cos(theta) + r, z - (h + r) * np.sin(theta)) < 2e-6


def test_impossible_beams_are_refused() -> None:
    with pytest.raises(ValueError, match="arm: must be above 0"):
        OverhangingBeam(BAR, PADS, arm=0.0)
    with pytest.raises(ValueError, match="com_offset: must not be negative"):
        OverhangingBeam(Body(0.2, 5e-4, -0.1), PADS)
