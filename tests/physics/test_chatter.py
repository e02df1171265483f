"""Explicit steps of a limit surface chatter; implicit and time-stepping ones do not (Fig. 6)."""

from __future__ import annotations

import numpy as np
import pytest
import throwplan as tp
from throwplan.models.release import (
    ImplicitRelease,
    KarnoppRelease,
    Release,
    ReleaseCase,
    SlidingPivotRelease,
    SteppedRelease,
)
from throwplan.planner.throw import case_of, given_hand


@pytest.fixture(scope="module")
def case() -> ReleaseCase:
    drop = tp.load_scene("drop")
    return case_of(drop, given_hand(drop))


def onset(case: ReleaseCase) -> float:
    pivot, _ = case.slip_onset()
    assert pivot is not None
    return pivot


def sign_changes(release: Release, start: float) -> int:
    """Changes of the sign of f_z from one instant to the next, from `start` [s] on."""
    f_z = release.wrench[1, release.times > start]
    return int((np.sign(f_z[1:]) * np.sign(f_z[:-1]) < 0).sum())


def test_explicit_steps_chatter_from_the_onset_on(case: ReleaseCase) -> None:
    start = onset(case)
    run = KarnoppRelease().release(case)
    # Nearly every step of those that are left turns the friction round, none before.
    assert sign_changes(run, start) > 0.7 * (run.times > start).sum()
    assert sign_changes(run, 0.0) == sign_changes(run, start)
    # And with the whole limit: friction is not between, but at plus and minus mu f_N.
    late = (run.times > start + 0.001) & (run.times < start + 0.004)
    limit = 2 * 0.8 * case.grip.force(run.times[late])
    assert np.abs(run.wrench[1, late]).min() > 0.8 * limit.min()


@pytest.mark.parametrize("half_band", [0.0, 0.01])
def test_finer_explicit_steps_chatter_too(case: ReleaseCase, half_band: float) -> None:
    # The paper: the oscillations persist with smaller steps.
    start = onset(case)
    counts = [
        sign_changes(KarnoppRelease(steps, half_band=half_band).release(case), start)
        for steps in (500, 1000, 2000)
    ]
    assert 150 < counts[0] < counts[1] < counts[2]


def test_stepped_and_implicit_friction_keeps_its_sign(case: ReleaseCase) -> None:
    start = onset(case)
    for model in (SteppedRelease(500), ImplicitRelease(), ImplicitRelease(method="BDF")):
        run = model.release(case)
        assert sign_changes(run, start) == 0
        # Upwards, and never more than the weight that it no longer holds.
        f_z = run.wrench[1, (run.times > start) & (run.times < 0.98 * case.grip.opening)]
        assert f_z.min() > 0.0
        assert f_z.max() < case.body.mass * case.gravity * (1 + 1e-6)


def test_explicit_steps_detach_elsewhere_than_all_others(case: ReleaseCase) -> None:
    # Fig. 6: not the mean of the oscillations but another motion.
    explicit = [KarnoppRelease(half_band=d).release(case).detach.omega for d in (0.0, 0.01)]
    others = [
        model.release(case).detach.omega
        for model in (ImplicitRelease(), SteppedRelease(), SlidingPivotRelease())
    ]
    assert max(explicit) < 1.5 * min(others)
    assert max(others) - min(others) < 0.05
