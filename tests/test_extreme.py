"""Stiff and extreme releases: finite, or a status that says why not; no energy from friction."""

from __future__ import annotations

import time

import numpy as np
import pytest
from throwplan.models import (
    Body,
    Contact,
    ImplicitRelease,
    KarnoppRelease,
    LinearRelease,
    Path,
    ReleaseBatch,
    ReleaseCase,
    SlidingPivotRelease,
    SteppedRelease,
    contact_twist,
    sliding_pivot_batch,
    stepped_batch,
)


def extremes(count: int, seed: int) -> dict[str, np.ndarray]:
    """mu 0.02-3, r_p 0.05-50 mm, h 0-1 m, m 1 g-50 kg, opening 0.5 ms-2 s, f_N 0.1-2000 N,
    g 0-25, hand accelerations to 500 m/s^2; a fifth with h = 0, a fifth with g = 0."""
    rng = np.random.default_rng(seed)

    def wide(low: float, high: float) -> np.ndarray:
        return np.exp(rng.uniform(np.log(low), np.log(high), count))

    mass, a, direction = wide(1e-3, 50), wide(1, 500), rng.uniform(-np.pi, np.pi, count)
    return {
        "mass": mass,
        "inertia": mass * wide(5e-3, 0.3) ** 2,
        "h": np.where(rng.random(count) < 0.2, 0.0, wide(1e-3, 1)),
        "mu": wide(0.02, 3),
        "r_p": wide(5e-5, 0.05),
        "opening": wide(5e-4, 2),
        "force": wide(0.1, 2000),
        "g": np.where(rng.random(count) < 0.2, 0.0, rng.uniform(0, 25, count)),
        "pose": np.column_stack([np.zeros((count, 2)), rng.uniform(-3, 3, count)]),
        "twist": np.column_stack([rng.uniform(-3, 3, (count, 2)), rng.uniform(-10, 10, count)]),
        "acceleration": np.column_stack(
            [a * np.cos(direction), a * np.sin(direction), rng.uniform(-500, 500, count)]
        ),
    }


def batch_of(v: dict[str, np.ndarray]) -> ReleaseBatch:
    return ReleaseBatch(
        len(v["mass"]),
        Body(v["mass"], v["inertia"], v["h"]),
        Contact(v["mu"], v["r_p"], 0.6, 2),
        LinearRelease(1.0, 0.0, 1.0),
        Path.accelerating(v["pose"], v["twist"], v["acceleration"]),
        v["opening"],
        v["force"],
        v["g"],
    )


def case_of(v: dict[str, np.ndarray], i: int) -> ReleaseCase:
    return ReleaseCase(
        Body(*(float(v[k][i]) for k in ("mass", "inertia", "h"))),
        Contact(float(v["mu"][i]), float(v["r_p"][i]), 0.6, 2),
        LinearRelease(float(v["force"][i]), 0.0, float(v["opening"][i])),
        Path.accelerating(v["pose"][i], v["twist"][i], v["acceleration"][i]),
        float(v["g"][i]),
    )


@pytest.mark.parametrize(("run", "steps"), [(sliding_pivot_batch, 48), (stepped_batch, 30)])
def test_no_nan_in_ten_thousand_extreme_throws(run, steps) -> None:
    start = time.process_time()
    detach = run(batch_of(extremes(10_000, 1)), steps)
    assert np.isfinite(detach).all()
    assert time.process_time() - start < 60


@pytest.mark.parametrize(
    "model",
    [SlidingPivotRelease(), SlidingPivotRelease("paper"), SteppedRelease(), KarnoppRelease()],
    ids=["sp", "sp-paper", "ls-step", "ls"],
)
def test_single_models_are_finite_or_say_why(model) -> None:
    values = extremes(120, 2)
    for i in range(120):
        release = model.release(case_of(values, i))
        assert np.isfinite(release.com_twist).all() or release.trouble


def test_implicit_model_is_finite_or_says_why() -> None:
    values = extremes(25, 3)
    troubled = 0
    for i in range(25):
        release = ImplicitRelease(rtol=1e-5, atol=1e-7).release(case_of(values, i))
        assert np.isfinite(release.com_twist).all() or release.trouble
        troubled += bool(release.trouble)
    assert troubled < 13


def test_lsoda_with_a_tiny_band_either_agrees_or_says_so() -> None:
    values = extremes(6, 4)
    for i in range(6):
        case = case_of(values, i)
        release = ImplicitRelease(1e-7).release(case)
        stepped = SteppedRelease(8000).release(case)
        if not release.trouble:
            speed = 1 + np.abs(stepped.com_twist[:, -1]).max()
            assert np.abs(release.com_twist[:, -1] - stepped.com_twist[:, -1]).max() < 0.1 * speed


def test_stepped_friction_takes_power_and_never_gives_it() -> None:
    """Contact impulse times slip of the same step is never above zero."""
    values = extremes(60, 5)
    for i in range(60):
        case = case_of(values, i)
        release = SteppedRelease(400).release(case)
        hand = case.hand.at(release.times)
        lever = (release.com[:2, :-1] + release.times[1] / 2 * release.com_twist[:2, :-1]) - (
            hand.pose[:2, :-1] + hand.pose[:2, 1:]
        ) / 2
        slip = np.array(contact_twist(*release.com_twist[:, 1:], *lever))
        slip = slip - hand.twist[:, 1:]
        dt = release.times[1]
        change = np.diff(release.com_twist, axis=1) / dt
        f_x, f_z = case.body.mass * change[0], case.body.mass * (change[1] + case.gravity)
        torque = case.body.inertia * change[2] - f_x * lever[1] + f_z * lever[0]
        parts = np.array([f_x * slip[0], f_z * slip[1], torque * slip[2]])
        assert (parts.sum(axis=0) <= 1e-6 * (1e-12 + np.abs(parts).sum(axis=0).max())).all()


def test_a_body_that_slides_out_of_the_pads_is_reported() -> None:
    case = ReleaseCase(
        Body(5.0, 0.01, 0.05),
        Contact(0.05, 0.001, 0.6, 2),
        LinearRelease(1.0, 0.0, 1.0),
        Path.accelerating((0.0, 0.0, 0.0)),
    )
    release = SlidingPivotRelease().release(case)
    assert "slid out" in release.trouble
    # From then on it falls freely.
    late = release.times > 0.5
    fall = np.gradient(release.com_twist[1, late], release.times[late])
    assert fall == pytest.approx(np.full(fall.size, -9.81), rel=1e-3)
