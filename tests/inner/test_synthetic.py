"""Synthetic throws: the design is possible, noise is as stated, recordings agree with the truth."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest
from throwplan.models.release import TableGrip
from throwplan.planner.identify import measured, thrown
from throwplan.planner.throw import Throw, excesses
from throwplan.planner.validation import (
    Flown,
    Noise,
    SynthesisConfig,
    conditions,
    design,
    grip_use,
    make_throws,
    panda,
    scene_with,
)
from throwplan.planner.verdict import Code, verdict
from throwplan.problems import Pose
from throwplan.problems.throws import ThrowData, load_throws, write_throws

Made = tuple[ThrowData, list[Flown]]


@pytest.fixture(scope="module")
def batch() -> Made:
    return make_throws(SynthesisConfig(steps=50, seed=3, factors=True))


@pytest.fixture(scope="module")
def exact() -> Made:
    return make_throws(SynthesisConfig(noise=Noise.none(), repeats=1))


@pytest.mark.parametrize("pitch", ["p1", "p2", "p3"])
def test_the_design_keeps_limits_grip_and_workspace(pitch: str) -> None:
    manipulator, height = panda(), -0.65
    held = dict.fromkeys((c.bar, c.labels["surface"]) for c in conditions(True) if c.pitch == pitch)
    for motion in design()[pitch]:
        samples, at = motion.samples, motion.opening_time
        assert not excesses(manipulator, samples)
        assert np.abs(samples.q[0] - samples.q[1]).max() < 2e-4
        for bar, surface in held:
            scene = scene_with(bar, surface)
            assert grip_use(motion, scene) <= 0.8
            aimed = scene.aimed_at(Pose(x=0.0, z=height))
            throw = Throw(aimed, manipulator, samples.path, at).sliding_pivot
            assert verdict(throw).without(Code.LANDING).ok


def test_releases_are_constant_accelerations_from_one_state_per_pitch(exact: Made) -> None:
    for pitch in ("p1", "p2", "p3"):
        states = []
        for one in exact[0].throws:
            if one.factors["pitch"] != pitch:
                continue
            joints, at = one.motion[:, [1, 3, 5]], round(one.opening / 0.002)
            bends = np.diff(joints[at : at + 31], n=2, axis=0) / 0.002**2
            np.testing.assert_allclose(bends, np.tile(bends.mean(axis=0), (29, 1)), atol=1e-3)
            states.append(joints[at])
        np.testing.assert_allclose(states, np.tile(states[0], (12, 1)), rtol=0, atol=1e-5)


def test_without_noise_the_patch_predicts_the_landing(exact: Made) -> None:
    # What is left is the 35 Hz low-pass of the joints: at most 0.11 mm and 0.056 deg of all 36.
    some = list(range(0, 36, 5))
    found = thrown(exact[0].picked(some), "patch", {"friction": 0.8, "patch_radius": 0.0031})
    off = np.abs(found - np.array([exact[1][k].landing[:2] for k in some]))
    assert off[:, 0].max() < 0.0003
    assert off[:, 1].max() < math.radians(0.15)


def test_the_mean_flight_time_is_the_paper_s(exact: Made) -> None:
    flight = np.array([throw.landing[2] for throw in exact[1]])
    assert flight.mean() == pytest.approx(0.6, abs=0.05)


def test_more_throws_vary_one_factor_each(batch: Made) -> None:
    more = [throw for throw in batch[0].throws if throw.factors["set"] == "factors"]
    for factor, labels in (
        ("surface", {"plastic", "papertape"}),
        ("payload", {"metal", "plastic"}),
        ("moi", {"small", "large"}),
    ):
        varied = [throw for throw in more if throw.factors[factor] != "base"]
        assert {throw.factors[factor] for throw in varied} == labels
        assert len(varied) == 30
        assert len({throw.object.com for throw in varied}) == 1


def test_noise_is_as_stated(batch: Made) -> None:
    data, flown = batch
    noise = Noise()
    landed = np.array([throw.landing for throw in data.throws], float)
    true = np.array([throw.landing for throw in flown])
    off = np.column_stack([landed[:, 0] - true[:, 0], landed[:, 2] - true[:, 1]])
    np.testing.assert_allclose(off.std(axis=0), [noise.landing, noise.landing_angle], rtol=0.15)
    still = np.concatenate([throw.motion[:, 4] for throw in data.throws])
    assert still.std() == pytest.approx(noise.joints, rel=0.02)
    pairs = zip(data.throws, flown, strict=True)
    tracked = [t.track[:, 1:] - f.poses(t.track[:, 0]) for t, f in pairs if t.track is not None]
    stated = [noise.position, noise.position, noise.angle]
    np.testing.assert_allclose(np.concatenate(tracked).std(axis=0), stated, rtol=0.03)
    events = [throw.event for throw in flown]
    dwell = np.array([event.grip.dwell for event in events])
    assert dwell.std() == pytest.approx(noise.opening, rel=0.15)
    assert np.std([e.grip.full for e in events]) == pytest.approx(220 * noise.force, rel=0.15)
    rough = [event.friction for event in events if event.patch_radius == 0.0031]
    assert np.std(rough) == pytest.approx(0.8 * noise.friction, rel=0.15)
    assert data.truth["noise_opening"] == noise.opening


def test_the_recorded_force_is_the_true_one_but_for_its_clock_and_sensor(batch: Made) -> None:
    late = []
    for seen, flown in zip(batch[0].throws, batch[1], strict=True):
        t, true, grip = np.linspace(0.0, 0.14, 14001), flown.event.grip, seen.grip
        half = [t[one.force(t - one.dwell) < 110.0][0] for one in (grip, true)]
        late.append(half[0] - half[1])
        assert grip.full == pytest.approx(true.full, abs=1.5)
    # The clocks differ by 0.5 ms; the sensor's noise adds a little.
    assert np.std(late) == pytest.approx(0.0005, rel=0.2)
    assert abs(np.mean(late)) < 0.0001


def test_the_track_lands_where_the_throw_does(batch: Made) -> None:
    blind = [dataclasses.replace(throw, landing=None) for throw in batch[0].throws]
    found = measured(dataclasses.replace(batch[0], throws=tuple(blind))).landing
    off = np.abs(found - np.array([throw.landing[:2] for throw in batch[1]]))
    assert off[:, 0].max() < 0.001
    assert off[:, 1].max() < math.radians(0.3)


def test_a_batch_written_and_read_is_the_same(batch: Made, tmp_path: Path) -> None:
    data = batch[0].picked(list(range(0, 270, 50)))
    write_throws(data, tmp_path / "made")
    back = load_throws(tmp_path / "made")
    assert (data.shared, data.truth, data.arm) == (back.shared, back.truth, back.arm)
    for a, b in zip(data.throws, back.throws, strict=True):
        assert (a.name, a.object, a.factors, a.grasp) == (b.name, b.object, b.factors, b.grasp)
        assert a.landing is not None and a.track is not None
        for one, other in ((a.times, b.times), (a.motion, b.motion), (a.landing, b.landing)):
            np.testing.assert_allclose(one, other, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(a.track, b.track, rtol=1e-8, atol=1e-12)
        # Between the samples the written table is another cubic.
        t = np.linspace(0.0, a.grip.opening, 300)
        np.testing.assert_allclose(a.grip.force(t), b.grip.force(t), atol=2e-3 * a.grip.full)


@pytest.mark.parametrize("noise", [0.2, 0.8, 2.0])
def test_the_full_grip_of_a_noisy_recording_is_no_single_sample(noise: float) -> None:
    t = np.arange(0.0, 0.2, 0.001)
    u = np.clip((t - 0.04) / 0.05, 0.0, 1.0)
    true = 90.0 * (1 - 3 * u**2 + 2 * u**3)
    found = []
    for seed in range(20):
        raw = true + 1.5 + noise * np.random.default_rng(seed).normal(size=t.size)
        found.append(TableGrip.from_recording(t, raw).full)
        if noise > 1.0:  # that hides the slope of a few samples
            continue
        # Cut off while there is force on the pads: what is left is no offset.
        with pytest.raises(ValueError, match="must go on, level"):
            TableGrip.from_recording(t[t < 0.075], raw[t < 0.075])
    assert np.abs(np.array(found) - 90.0).max() < 0.5 + noise
    assert np.std(found) < noise / 3


@pytest.mark.parametrize(
    ("forces", "message"),
    [
        (np.zeros(100), "must start at the full grip and fall"),
        (np.full(100, 80.0), "must start at the full grip and fall"),
        (np.full(100, np.nan), "not a finite number"),
        (np.ones(5), "needs at least 20 rows"),
    ],
)
def test_a_raw_force_without_a_fall_is_refused(forces: np.ndarray, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        TableGrip.from_recording(0.001 * np.arange(len(forces)), forces)
