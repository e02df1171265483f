"""Onset of slip on a limit surface: known answers, and what the steps do around it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from release_cases import VALUES, reference_case, sliding_wrench
from throwplan.models import (
    Contact,
    ImplicitRelease,
    KarnoppRelease,
    Patch,
    Path,
    ReleaseCase,
    SteppedRelease,
    contact_twist,
    disc,
    ellipsoid_gauge,
    held_wrench,
    patch_gauge,
    slip_onset,
)

GRAVITY = 9.81


def onset(case: ReleaseCase) -> tuple[float | None, float | None]:
    return slip_onset(case, ellipsoid_gauge(case.contact))


@pytest.mark.parametrize("name", ["drop_h100_faces2", "drop_h020_faces2"])
def test_a_level_bar_slips_where_its_weight_reaches_the_ellipsoid(name: str) -> None:
    case = reference_case(name)
    arm = case.body.com_offset / case.contact.torsion_arm
    force = case.body.mass * GRAVITY * np.sqrt(1 + arm**2) / (2 * case.contact.friction)
    when = case.grip.opening * (1 - force / case.grip.full)
    for model in (SteppedRelease(), ImplicitRelease(), KarnoppRelease()):
        release = model.release(case)
        assert release.pivot == release.slide == pytest.approx(when, abs=1e-9)


@pytest.mark.parametrize("name", sorted(VALUES))
def test_the_held_wrench_is_on_the_surface_at_the_onset(name: str) -> None:
    case = reference_case(name)
    when, _ = onset(case)
    (needed,) = ellipsoid_gauge(case.contact)(*held_wrench(case, np.array([when])))
    grip = case.contact.faces * float(case.grip.force(when))
    if when == 0:
        assert needed >= grip
    else:
        assert needed == pytest.approx(grip, rel=1e-9)


def test_steps_stick_before_the_onset_and_slip_after_it() -> None:
    case = reference_case("throw_decelerating")
    release = SteppedRelease(2000).release(case)
    hand = case.hand.at(release.times)
    lever = release.com[:2] - hand.pose[:2]
    slip = np.array(contact_twist(*release.com_twist, *lever)) - hand.twist
    spin, step = np.abs(slip[2]), release.times[1]
    assert spin[release.times < release.pivot - step].max() < 1e-9
    assert spin[release.times > release.pivot + 2 * step].min() > 1e-6


def test_a_hand_that_falls_freely_never_lets_a_body_slip() -> None:
    hand = Path.accelerating((0, 0, 0.3), (1.0, 2.0, 0.0), (0.0, -GRAVITY, 0.0))
    case = dataclasses.replace(reference_case("drop_h100_faces2"), hand=hand)
    assert onset(case) == (None, None)


def test_a_motion_that_no_wrench_asks_for_does_not_begin() -> None:
    case = reference_case("drop_h100_faces2")
    held_at_com = dataclasses.replace(case, body=dataclasses.replace(case.body, com_offset=0.0))
    pivot, slide = onset(held_at_com)
    weight = case.body.mass * GRAVITY / (2 * case.contact.friction)
    assert pivot is None
    assert slide == pytest.approx(case.grip.opening * (1 - weight / case.grip.full), abs=1e-9)
    spun = Path.accelerating((0, 0, 0), acceleration=(0, 0, 300.0))
    pivot, slide = onset(dataclasses.replace(held_at_com, hand=spun, gravity=0.0))
    assert slide is None and 0 < pivot < case.grip.opening


def test_a_jerk_of_the_hand_is_found_to_the_instant() -> None:
    pulls = [(0.0, 0.0, 0.0), (0.0, 60.0, 0.0)]
    hand = Path.stepping((0, 0, 0), (0, 0, 0), (0.0, 0.0123), pulls)
    case = dataclasses.replace(reference_case("drop_h100_faces2"), hand=hand)
    assert onset(case)[0] == pytest.approx(0.0123, abs=1e-9)


# The meshed patch.


def test_a_sliding_patch_is_at_its_own_limit() -> None:
    rng = np.random.default_rng(0)
    places = rng.normal(size=(2, 9))
    places /= np.hypot(*places).mean()
    uneven = Patch(*places, np.full(9, 1 / 9))
    for patch in (disc(), disc("hertz", 100), uneven):
        gauge = patch_gauge(Contact(0.7, 1.0, 1.0), patch)
        twists = rng.normal(size=(3, 40))
        wrench = 0.7 * np.array([sliding_wrench(patch, twist) for twist in twists.T]).T
        np.testing.assert_allclose(gauge(wrench, np.zeros(40)), 1.0, rtol=1e-9)
        np.testing.assert_allclose(gauge(5 * wrench, np.zeros(40)), 5.0, rtol=1e-9)


def test_a_disc_slips_a_little_before_the_ellipsoid_and_turns_with_the_hand() -> None:
    contact = Contact(0.8, 0.0075)
    rng = np.random.default_rng(1)
    wrench = rng.normal(size=(3, 200)) * np.array([[1], [1], [contact.torsion_arm]])
    gauge, angle = patch_gauge(contact, disc()), rng.uniform(-3, 3, 200)
    ratio = gauge(wrench, angle) / ellipsoid_gauge(contact)(wrench, angle)
    assert ratio.min() > 1 - 1e-9 and ratio.max() < 1.08
    ends = Patch(np.array([-1.0, 1.0]), np.zeros(2), np.full(2, 0.5))
    bar = patch_gauge(Contact(0.8, 0.01, 1.0), ends)
    torque = np.array([[0.0], [0.0], [1.0]])
    assert bar(torque, np.zeros(1)) == pytest.approx(1 / (0.8 * 0.01))
    along, across = np.array([[1.0], [0], [0.005]]), np.array([[0], [1.0], [0.005]])
    turned = np.full(1, np.pi / 2)
    assert bar(along, np.zeros(1)) == pytest.approx(bar(across, turned))
    assert bar(along, np.zeros(1)) < 0.9 * bar(along, turned)
