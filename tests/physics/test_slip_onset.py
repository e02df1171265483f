"""Fails if a held bar begins to slip at another instant than its wrench meets the limit surface."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from release_cases import VALUES, reference_case
from throwplan.models import Trajectory
from throwplan.models.release import ImplicitRelease, KarnoppRelease, SteppedRelease

GRAVITY = 9.81


def test_a_level_bar_slips_where_its_weight_reaches_the_ellipsoid() -> None:
    case = reference_case("drop_h020_faces2")
    arm = case.body.com_offset / case.contact.torsion_arm
    force = case.body.mass * GRAVITY * np.sqrt(1 + arm**2) / (2 * case.contact.friction)
    when = case.grip.opening * (1 - force / case.grip.full)
    for model in (SteppedRelease(), ImplicitRelease(), KarnoppRelease()):
        release = model.release(case)
        assert release.pivot == release.slide == pytest.approx(when, abs=1e-9)


@pytest.mark.parametrize("name", sorted(VALUES))
def test_the_held_wrench_is_on_the_surface_at_the_onset(name: str) -> None:
    case = reference_case(name)
    when, _ = case.slip_onset()
    (wrench,) = case.held_wrench(np.array([when])).T
    use = case.contact.utilisation_squared(*wrench, float(case.grip.force(when)))
    if when == 0:
        assert use >= 1
    else:
        assert use == pytest.approx(1, rel=1e-9)


def test_a_hand_that_falls_freely_never_lets_a_body_slip() -> None:
    hand = Trajectory.accelerating((0, 0, 0.3), (1.0, 2.0, 0.0), (0.0, -GRAVITY, 0.0))
    case = dataclasses.replace(reference_case("drop_h100_faces2"), hand=hand)
    assert case.slip_onset() == (None, None)


def test_a_motion_that_no_wrench_asks_for_does_not_begin() -> None:
    case = reference_case("drop_h100_faces2")
    held_at_com = dataclasses.replace(case, body=dataclasses.replace(case.body, com_offset=0.0))
    pivot, slide = held_at_com.slip_onset()
    weight = case.body.mass * GRAVITY / (2 * case.contact.friction)
    assert pivot is None
    assert slide == pytest.approx(case.grip.opening * (1 - weight / case.grip.full), abs=1e-9)
    spun = Trajectory.accelerating((0, 0, 0), acceleration=(0, 0, 300.0))
    pivot, slide = dataclasses.replace(held_at_com, hand=spun, gravity=0.0).slip_onset()
    assert slide is None and 0 < pivot < case.grip.opening


def test_a_jerk_of_the_hand_is_found_to_the_instant() -> None:
    pulls = [(0.0, 0.0, 0.0), (0.0, 60.0, 0.0)]
    hand = Trajectory.stepping((0, 0, 0), (0, 0, 0), (0.0, 0.0123), pulls)
    case = dataclasses.replace(reference_case("drop_h100_faces2"), hand=hand)
    assert case.slip_onset()[0] == pytest.approx(0.0123, abs=1e-9)
