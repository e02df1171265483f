"""Synthetic throws and the files of a data set: what is written is read, and is as stated."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from throwplan.models import TableRelease
from throwplan.planner.cli import main
from throwplan.planner.identify.make_throws import Making, Noise, make_throws
from throwplan.planner.identify.make_throws_scene import HEIGHT
from throwplan.planner.identify.make_throws_truth import Flown, Law
from throwplan.planner.identify.measured import measured
from throwplan.planner.identify.predict import Parameters, Predictor
from throwplan.problems import (
    Grasp,
    InputError,
    MeasuredThrow,
    Shared,
    ThrowData,
    ThrownObject,
    load_throws,
    write_throws,
)
from throwplan.problems.grip_recording import grip_samples, monotone_grip

#: Franka's data sheet of the Panda, joints 2, 4 and 6: position from, to [rad], then rate,
#: acceleration and jerk.
JOINTS = [2, 4, 6]
LOW, HIGH = [-1.7628, -3.0718, -0.0175], [1.7628, -0.0698, 3.7525]
RATE, ACCELERATION, JERK = [2.175, 2.175, 2.61], [7.5, 12.5, 20.0], [3750.0, 6250.0, 10000.0]

Made = tuple[ThrowData, list[Flown]]


@pytest.fixture(scope="module")
def batch() -> Made:
    return make_throws(Making(seed=3, factors=True))


@pytest.fixture(scope="module")
def exact() -> Made:
    return make_throws(Making(noise=Noise.none(), repeats=1))


def pairs(made: Made) -> list[tuple[MeasuredThrow, Flown]]:
    return list(zip(made[0].throws, made[1], strict=True))


def assert_same(one: ThrowData, other: ThrowData) -> None:
    assert (one.shared, one.truth, one.arm) == (other.shared, other.truth, other.arm)
    assert len(one.throws) == len(other.throws)
    for a, b in zip(one.throws, other.throws, strict=True):
        assert (a.name, a.object, a.factors) == (b.name, b.object, b.factors)
        np.testing.assert_allclose([a.grasp.offset, a.command], [b.grasp.offset, b.command])
        np.testing.assert_allclose(a.grasp.angle, b.grasp.angle, rtol=1e-8)
        np.testing.assert_allclose(a.times, b.times, rtol=1e-8)
        np.testing.assert_allclose(a.motion, b.motion, rtol=1e-8, atol=1e-12)
        assert (a.landing is None, a.track is None) == (b.landing is None, b.track is None)
        if a.landing is not None and b.landing is not None:
            np.testing.assert_allclose(a.landing, b.landing, rtol=1e-8)
        if a.track is not None and b.track is not None:
            np.testing.assert_allclose(a.track, b.track, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose([a.grip.dwell, a.grip.opening], [b.grip.dwell, b.grip.opening])
        # Between the samples the written table is another cubic.
        t = np.linspace(0.0, a.grip.opening, 300)
        np.testing.assert_allclose(a.grip.force(t), b.grip.force(t), atol=2e-3 * a.grip.full)


def test_a_batch_read_again_is_the_same(batch: Made, tmp_path: Path) -> None:
    data = batch[0].picked(list(range(0, 270, 30)))
    write_throws(data, tmp_path / "made")
    assert_same(data, load_throws(tmp_path / "made"))


def small() -> ThrowData:
    """Three throws of a hand, odd in every way."""
    bar = ThrownObject(mass=0.24, inertia=535e-6, length=0.26, com=0.10)
    other = dataclasses.replace(bar, mass=0.5)
    rng, times = np.random.default_rng(0), np.arange(0.0, 0.4, 0.002)
    throws = []
    for k in range(3):
        grip = TableRelease([0.0, 0.0473, 0.06, 0.08, 0.115], [100.0, 100.0, 98.0, 40.0, 0.0])
        landing = None if k == 0 else (1.0, -0.8, 7.5)
        track = None if k == 1 else np.column_stack([times, rng.normal(size=(times.size, 3))])
        motion, grasp = rng.normal(size=(times.size, 3)), Grasp(0.01 * k, 0.1 * k)
        named = f"throw, no. {k}", (bar, other)[k % 2], grasp, times, motion
        throws.append(
            MeasuredThrow(*named, 0.1 + 1e-4 * k, grip, landing, track, {"odd one": f'"{k}"'})
        )
    shared = Shared(landing_height=-0.8, description='a "bar"\nof plastic', angle_noise=0.02)
    return ThrowData("small", shared, tuple(throws), None, {"friction": 0.8})


def test_odd_names_motions_of_a_hand_and_what_is_absent_are_kept(tmp_path: Path) -> None:
    data = small()
    write_throws(data, tmp_path, {data.throws[0].object: "a bar"})
    assert_same(data, load_throws(tmp_path))


def test_the_design_is_the_paper_s(batch: Made) -> None:
    rows = [throw for throw in batch[0].throws if throw.factors["set"] == "batch"]
    assert len(rows) == 180
    conditions = {tuple(r.factors[key] for key in ("com", "pitch", "release")) for r in rows}
    assert len(conditions) == 2 * 3 * 6
    assert {row.object.com for row in rows} == {0.10, 0.16}
    assert batch[0].shared.landing_height < 0


def test_the_mean_flight_time_is_the_paper_s_and_landings_are_far_apart(batch: Made) -> None:
    landing = np.array([throw.landing for throw in batch[1][:180]])
    assert landing[:, 2].mean() == pytest.approx(0.6, abs=0.05)
    assert np.ptp(landing[:, 0]) > 0.5
    assert np.ptp(landing[:, 1]) > math.radians(90)


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


def test_every_motion_keeps_the_panda_s_limits(exact: Made) -> None:
    for throw in exact[0].throws:
        joints = throw.motion[:, [j - 1 for j in JOINTS]]
        assert (joints >= LOW).all() and (joints <= HIGH).all()
        for order, limit in ((1, RATE), (2, ACCELERATION), (3, JERK)):
            # A mean of the derivative over a few samples: no more than its largest.
            steps = np.diff(joints, n=order, axis=0) / 0.002**order
            assert (np.abs(steps) <= np.array(limit) * (1 + 1e-6)).all(), (throw.name, order)


def test_motions_start_at_rest_and_release_at_constant_acceleration(exact: Made) -> None:
    states: dict[str, list[Any]] = {}
    for throw in exact[0].throws:
        joints = throw.motion[:, [j - 1 for j in JOINTS]]
        assert np.abs(np.diff(joints[:2], axis=0)).max() < 2e-4
        at = round(throw.opening / 0.002)
        bends = np.diff(joints[at : at + 31], n=2, axis=0) / 0.002**2
        np.testing.assert_allclose(bends, np.tile(bends.mean(axis=0), (29, 1)), atol=1e-3)
        states.setdefault(throw.factors["pitch"], []).append(joints[at])
    for found in states.values():
        np.testing.assert_allclose(found, np.tile(found[0], (12, 1)), rtol=0, atol=1e-5)


def test_without_noise_the_patch_predicts_the_landing(exact: Made, tmp_path: Path) -> None:
    # What is left is the 35 Hz low-pass of the joints: at most 0.11 mm and 0.056 deg of all 36.
    some = list(range(0, 36, 3))
    write_throws(exact[0].picked(some), tmp_path)
    parameters = Parameters(np.array([0.8]), np.array([0.0031]))
    found = Predictor(load_throws(tmp_path)).predict("patch", parameters).landing[:, 0]
    off = np.abs(found - np.array([exact[1][k].landing for k in some]))
    assert off[:, 0].max() < 0.0003
    assert off[:, 1].max() < math.radians(0.15)


def test_noise_is_as_stated(batch: Made) -> None:
    data, flown = batch
    noise, truth = Noise(), data.truth
    landed = np.array([throw.landing for throw in data.throws], float)
    true = np.array([throw.landing for throw in flown])
    off = np.column_stack([landed[:, 0] - true[:, 0], landed[:, 2] - true[:, 1]])
    np.testing.assert_allclose(off.std(axis=0), [noise.landing, noise.landing_angle], rtol=0.15)
    still = np.concatenate([throw.motion[:, 4] for throw in data.throws])
    assert still.std() == pytest.approx(noise.joints, rel=0.02)
    tracked = np.concatenate(
        [t.track[:, 1:] - f.poses(t.track[:, 0]) for t, f in pairs(batch) if t.track is not None]
    )
    stated = [noise.position, noise.position, noise.angle]
    np.testing.assert_allclose(tracked.std(axis=0), stated, rtol=0.03)
    events = [throw.event for throw in flown]
    dwell = np.array([event.grip.dwell for event in events])
    assert dwell.std() == pytest.approx(noise.opening, rel=0.15)
    assert np.std([e.grip.full for e in events]) == pytest.approx(220 * noise.force, rel=0.15)
    rough = [event.friction for event in events if event.patch_radius == 0.0031]
    assert np.std(rough) == pytest.approx(0.8 * noise.friction, rel=0.15)
    assert truth["noise_opening"] == noise.opening


def test_the_recorded_force_is_the_true_one_but_for_its_clock_and_sensor(batch: Made) -> None:
    halves = []
    for throw, flown in pairs(batch):
        t = np.linspace(0.0, 0.14, 14001)
        true, seen = flown.event.grip, throw.grip
        halves.append(
            t[seen.force(t - seen.dwell) < 110.0][0] - t[true.force(t - true.dwell) < 110.0][0]
        )
        assert seen.full == pytest.approx(true.full, abs=1.5)
    # The clocks differ by 0.5 ms; the sensor's noise adds a little.
    assert np.std(halves) == pytest.approx(0.0005, rel=0.2)
    assert abs(np.mean(halves)) < 0.0001


def test_the_track_lands_where_the_throw_does(batch: Made) -> None:
    data, flown = batch
    blind = [dataclasses.replace(throw, landing=None) for throw in data.throws]
    found = measured(dataclasses.replace(data, throws=tuple(blind))).landing
    off = found - np.array([throw.landing[:2] for throw in flown])
    assert np.abs(off[:, 0]).max() < 0.001
    assert np.abs(off[:, 1]).max() < math.radians(0.3)


@pytest.mark.parametrize("law", [Law(), Law("lugre", 1e5)])
@pytest.mark.parametrize("noise", [Noise(), Noise.none()])
def test_it_is_always_labelled_synthetic(law: Law, noise: Noise, tmp_path: Path) -> None:
    making = Making(law=dataclasses.replace(law, steps=20), noise=noise, repeats=1, seed=7)
    data, _ = make_throws(making)
    write_throws(data.picked([0]), tmp_path)
    synthetic = load_throws(tmp_path).shared.synthetic
    assert "meshed patch" in synthetic and "seed 7" in synthetic
    assert ("LuGre" in synthetic) == (law.kind == "lugre")
    assert ("no noise" in synthetic) == (noise == Noise.none())


def test_the_seed_alone_decides() -> None:
    makings = [Making(law=Law(steps=20), repeats=1, seed=seed) for seed in (1, 1, 2)]
    one, other, third = (make_throws(making)[0].throws[5].landing for making in makings)
    assert one == other != third


def test_the_command_writes_and_says_what(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    line = ["make-throws", "--out", str(tmp_path / "made"), "--repeats", "1", "--json"]
    assert main(line) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["throws"], found["landing_height"]) == (36, HEIGHT)
    data = load_throws(tmp_path / "made")
    assert (len(data.throws), data.shared.synthetic) == (36, found["synthetic"])
    assert data.truth == found["truth"]
    # Once more in the same place, with less.
    assert main([*line, "--no-noise"]) == 0
    assert "no noise" in load_throws(tmp_path / "made").shared.synthetic


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("", "--out: needs a folder's name"),
        ("--friction 0.3", "the grip does not hold the bar on its way"),
        ("--friction 0", "--friction 0: must be from 0.01 to 10"),
        ("--friction much", "--friction much: must be a finite number"),
        ("--patch-radius 3.1", "--patch-radius 3.1: must be from 0.0001 to 0.05"),
        ("--stiffness 1e6", "--stiffness: only with --truth lugre"),
        ("--repeats 0", "--repeats 0: must be a whole number, 1 to 100"),
        ("--seed one", "--seed one: must be a whole number"),
        ("--truth glue", "invalid choice: 'glue'"),
    ],
)
def test_wrong_options_are_refused_in_one_line(
    words: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["--out", str(tmp_path / "made")] if words else []
    assert main(["make-throws", *out, *words.split()]) == 2
    told = capsys.readouterr().err
    assert message in told and told.count("\n") == 1


def test_nothing_but_synthetic_throws_is_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_throws(small(), tmp_path / "real")
    assert main(["make-throws", "--out", str(tmp_path / "real")]) == 2
    assert "not labelled synthetic, not overwritten" in capsys.readouterr().err
    assert_same(small(), load_throws(tmp_path / "real"))
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("mine")
    assert main(["make-throws", "--out", str(tmp_path / "other")]) == 2
    assert "holds thesis.txt, not overwritten" in capsys.readouterr().err


def replaced(path: Path, old: str, new: str) -> None:
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("dataset.toml", "mass = 0.24", "mass = 240", "at most 50 (is it in grams?)"),
        ("dataset.toml", "mass = 0.24", "mas = 0.24", "unknown key 'mas', did you mean 'mass'?"),
        ("dataset.toml", "mass = 0.24", "mass = nan", "mass = nan: must be a finite number"),
        ("dataset.toml", "landing_height = -0.8", "", "key 'landing_height' is missing"),
        ("dataset.toml", "inertia = 0.000535", "inertia = 535", "inertia = 535: must be at most"),
        ("dataset.toml", "friction = 0.8", 'friction = "?"', "must be a section [truth] of numb"),
        ("throws.csv", "object1", "stick", "line 2: object: unknown key 'stick'"),
        ("throws.csv", "command", "order", "the first line must name the column command"),
        ("throws.csv", "grip/0001.csv", "grip/9.csv", "line 2: grip = "),
        ("throws.csv", "0.1001", "soon", "line 3: command = 'soon': must be a finite number"),
        ("throws.csv", "0.1001", "0.5", "line 3: motion = motion/0002.csv: too short"),
        ("throws.csv", "0.1001", "0.265", "must cover 0.03 s more at either end"),
        ("throws.csv", "track/0001.csv", "", "line 2: no landing: give x, z and theta, or a"),
        ("throws.csv", "track/0001.csv", "a,b", "throws.csv: line 2 has 13 cells, not 12"),
        ("motion/0001.csv", "\n0.002,", "\n0.000,", "line 3: t must rise from row to row"),
        ("motion/0001.csv", "\n0.002,", "\nnan,", "line 3 has a value that is not finite"),
        ("motion/0001.csv", "theta", "angle", "must name the columns t, x, z and theta"),
        ("grip/0001.csv", "t,f_N\n", "t,f_N\n0,-1\n", "t must rise from row to row"),
        ("grip/0001.csv", "0.115,0", "0.115,50", "f_N must end at 0, but the last row has 50 N"),
    ],
)
def test_wrong_data_is_refused_in_one_line(
    file: str, old: str, new: str, message: str, tmp_path: Path
) -> None:
    write_throws(small(), tmp_path)
    replaced(tmp_path / file, old, new)
    with pytest.raises(InputError) as caught:
        load_throws(tmp_path)
    told = str(caught.value)
    assert message in told and "\n" not in told
    assert file in told or "throws.csv" in told


def test_a_folder_that_is_not_there_and_a_file_that_is_missing_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such folder"):
        load_throws(tmp_path / "nothing")
    write_throws(small(), tmp_path)
    (tmp_path / "throws.csv").unlink()
    with pytest.raises(InputError, match=r"throws\.csv: no such file"):
        load_throws(tmp_path)


def test_a_raw_force_recording_becomes_a_profile_that_falls() -> None:
    rng, t = np.random.default_rng(0), np.arange(0.0, 0.16, 0.001)
    true = 150.0 * np.clip(1 - (t - 0.05) / 0.06, 0.0, 1.0)
    found = monotone_grip(t, true - 4.0 + 0.5 * rng.standard_normal(t.size))
    rows = grip_samples(found)
    assert (np.diff(rows[:, 1]) <= 0).all() and rows[-1, 1] == 0.0
    assert found.full == pytest.approx(150.0, abs=0.5)
    assert found.dwell == pytest.approx(0.05, abs=0.0011)
    assert np.abs(np.interp(t, *rows.T) - true).max() < 3.5


@pytest.mark.parametrize("noise", [0.2, 0.8, 2.0])
def test_the_full_grip_of_a_noisy_recording_is_no_single_sample(noise: float) -> None:
    t = np.arange(0.0, 0.2, 0.001)
    u = np.clip((t - 0.04) / 0.05, 0.0, 1.0)
    true = 90.0 * (1 - 3 * u**2 + 2 * u**3)
    found = []
    for seed in range(40):
        raw = true + 1.5 + noise * np.random.default_rng(seed).normal(size=t.size)
        found.append(monotone_grip(t, raw).full)
        if noise > 1.0:  # that hides the slope of a few samples
            continue
        # Cut off while there is force on the pads: what is left is no offset.
        with pytest.raises(ValueError, match="must go on, level"):
            monotone_grip(t[t < 0.075], raw[t < 0.075])
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
def test_a_raw_force_without_a_fall_is_refused(forces: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        monotone_grip(0.001 * np.arange(len(forces)), forces)
