"""Validation of release models on small synthetic sets of throws."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from throwplan.models import FlightLaw
from throwplan.models.release import TableGrip
from throwplan.planner.identify import Predictor, parameter_sets
from throwplan.planner.validation import (
    VALIDATION_FILES,
    as_dict,
    as_text,
    bootstrap,
    fold_of,
    save_validation,
    validate,
)
from throwplan.problems import Grasp, ThrownObject
from throwplan.problems.throws import MeasuredThrow, Shared, ThrowData

COMS = {"0.10": (0.10, 535e-6), "0.16": (0.16, 802e-6)}
PITCHES = {"p1": (-0.6, 1.9), "p2": (-0.95, 1.2), "p3": (-1.3, 0.5)}
RELEASES = ("1.0", "0.0", "-1.0")
#: mu, r_p [m] by surface.
TRUTH = {"plastic": (0.8, 3.5e-3), "paper": (0.45, 5e-3)}


def bare_throw(name: str, rng: np.random.Generator, **factors: str) -> MeasuredThrow:
    """A hand that throws forwards and upwards, speeding up or slowing down."""
    com, inertia = COMS[factors["com"]]
    angle, rising = PITCHES[factors["pitch"]]
    share = float(factors["release"])
    times = np.arange(0.0, 0.3, 0.004)
    u = (times - 0.1)[:, None]
    twist = np.array([2.0, rising, 4.0]) + rng.normal(0, 0.03, 3)
    pose = np.array([0.5, 0.9, angle]) + u * twist + u**2 / 2 * share * np.array([8.0, 5.0, 25.0])
    bar = ThrownObject(mass=0.24, inertia=inertia, length=0.26, width=0.02, com=com)
    grip = TableGrip([0.0, 0.05, 0.08, 0.11], [100.0, 100.0, 45.0, 0.0])
    return MeasuredThrow(name, bar, Grasp(), times, pose, 0.05, grip, None, None, factors)


def landed(throw: MeasuredThrow, state: np.ndarray, rng: np.random.Generator) -> MeasuredThrow:
    """The throw as it is measured: 250 Hz track and landing, both with noise."""
    x, theta, time = FlightLaw(9.81).land(state[None], 0.1)[0]
    t = np.arange(0.0, time + 0.02, 0.004)
    end = throw.opening + throw.grip.opening
    track = [end + t, state[0] + state[3] * t, state[1] + state[4] * t - 4.905 * t**2]
    track.append(state[2] + state[5] * t)
    noisy = np.column_stack(track) + rng.normal(0, 1e-4, (len(t), 4)) * [0, 1, 1, 1]
    pose = (x + rng.normal(0, 0.005), 0.1, theta + rng.normal(0, 0.03))
    return dataclasses.replace(throw, track=noisy, landing=pose)


def make_data(
    coms: tuple[str, ...] = tuple(COMS),
    pitches: tuple[str, ...] = ("p1", "p3"),
    releases: tuple[str, ...] = RELEASES,
    repeats: int = 2,
    paper: int = 3,
) -> ThrowData:
    """A batch, and `paper` throws with another surface; the truth is a model's."""
    rng = np.random.default_rng(3)
    rows = [
        {"com": c, "pitch": p, "release": r, "surface": "plastic", "set": "batch", "repeat": str(k)}
        for c, p, r, k in itertools.product(coms, pitches, releases, range(repeats))
    ]
    apart = {"com": coms[0], "pitch": pitches[0], "release": releases[0], "surface": "paper"}
    rows += [apart | {"set": "factors", "repeat": str(k)} for k in range(paper)]
    throws = [bare_throw(f"t{i:03d}", rng, **row) for i, row in enumerate(rows)]
    shared = Shared(landing_height=0.1, synthetic="ls-step, for a test")
    data, done = ThrowData("toy", shared, tuple(throws)), []
    for i, throw in enumerate(throws):
        sets = parameter_sets(*TRUTH[throw.factors["surface"]])
        state = Predictor.of(data.picked([i])).detached("ls-step", sets)[0, 0]
        done.append(landed(throw, state, rng))
    return dataclasses.replace(data, throws=tuple(done))


@pytest.fixture(scope="module")
def data():
    return make_data()


@pytest.fixture(scope="module")
def found(data):
    return validate(data, ("ls-step", "sp"))


# Numbers.


def test_errors_agree_with_releases_one_by_one(data, found):
    """Landings of some of the batch at the best cell, by single releases and by hand."""
    assert found.batch.tolist() == list(range(24))
    predictor = Predictor.of(data)
    # The single time stepping is of first order, the batch's is extrapolated.
    for model, close in (("sp", 3e-4), ("ls-step", 4e-3)):
        check = found.checks[model]
        for i in (0, 7, 15):
            end = predictor.released(model, i, parameter_sets(*check.parameters[""])[0]).detach
            time = (end.v_z + math.sqrt(end.v_z**2 + 2 * 9.81 * (end.z - 0.1))) / 9.81
            place = np.array([end.x + end.v_x * time, end.theta + end.omega * time])
            assert np.abs(place - found.predictor.truth.landing[i] - check.landing[i]).max() < close
        off = np.abs(check.landing[:24])
        mean = (off[:, 0] + off[:, 1] * 0.13).mean()
        assert check.grid.error.min() == pytest.approx(mean)
        assert found.scaled(model)[:24].mean() == pytest.approx(mean)


def test_the_true_model_finds_the_truth(data, found):
    check = found.checks["ls-step"]
    assert np.prod(check.parameters[""]) == pytest.approx(0.8 * 3.5e-3, rel=0.05)
    assert np.prod(check.parameters["paper"]) == pytest.approx(0.45 * 5e-3, rel=0.1)
    # Nothing but the noise is left: 5 mm and 0.03 rad times half the bar's length.
    left = math.sqrt(2 / math.pi) * (0.005 + 0.03 * 0.13)
    assert check.grid.error.min() == pytest.approx(left, rel=0.35)
    assert found.surface == [""] * 24 + ["paper"] * 3


def test_cross_validation_by_hand(found):
    for check in found.checks.values():
        crossed = check.crossed
        assert (len(crossed.parameters), len(found.batch)) == (6, 24)
        assert crossed.outside[0] >= crossed.inside[0] == pytest.approx(check.grid.error.min())
        assert crossed.inside[1] < crossed.inside[0] < crossed.inside[2]
    check = found.checks["sp"]
    errors, outside = check.grid.errors.reshape(24, 400), []
    fold = fold_of([found.conditions[i] for i in found.batch])
    for k in range(6):
        best = min(range(400), key=lambda cell: errors[fold != k][:, cell].mean())
        outside += errors[fold == k][:, best].tolist()
    assert check.crossed.outside[0] == pytest.approx(np.mean(outside))


def test_folds_keep_conditions_together():
    names = [name for name in "abcdefg" for _ in range(3)]
    fold = fold_of(names)
    for name in "abcdefg":
        assert len({f for f, n in zip(fold, names, strict=True) if n == name}) == 1
    assert set(fold) == set(range(6))


def test_the_interval_is_that_of_a_mean():
    values = np.random.default_rng(0).normal(3.0, 1.0, (100, 1))
    drawn = bootstrap(values, list(range(100)))
    assert drawn.std() == pytest.approx(values.std() / 10, rel=0.1)
    # Repeats that all err alike are worth one throw.
    repeated = bootstrap(np.repeat(values, 5, axis=0), [i // 5 for i in range(500)])
    assert repeated.std() == pytest.approx(drawn.std(), rel=0.1)


def test_another_surface_is_fitted_apart_without_a_column_that_says_so(data, found):
    plain = [
        dataclasses.replace(t, factors={k: v for k, v in t.factors.items() if k != "set"})
        for t in data.throws
    ]
    again = validate(dataclasses.replace(data, throws=tuple(plain)), ("sp",))
    assert set(again.checks["sp"].parameters) == {"", "paper"}
    assert len(again.batch) == len(found.batch)


# What is written.


def test_landings_without_tracks_and_too_few_throws(data, tmp_path: Path):
    throws = [dataclasses.replace(t, track=None, factors={}) for t in data.throws[:4]]
    found = validate(dataclasses.replace(data, throws=tuple(throws)), ("sp",))
    text = as_text(found)
    assert "v_x" not in text.split("no tracks")[0]
    assert "no tracks: v_x and omega are left out" in text
    assert "cross-validation: left out" in text
    save_validation(found, tmp_path)
    assert {path.stem for path in tmp_path.glob("*.png")} == {"errors", "boxes"}


@pytest.mark.slow
def test_a_model_that_never_lands(found, tmp_path: Path):
    """No number is made up, nothing is chosen as the lowest, and it is said."""
    check = found.checks["sp"]
    lost = dataclasses.replace(check, landing=np.nan * check.landing, twist=np.nan * check.twist)
    mine = dataclasses.replace(found, checks=found.checks | {"sp": lost})
    save_validation(mine, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(VALIDATION_FILES)
    page = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert "sp: no landing for 27 throws" in page
    assert re.search(r"\| sp +\| +– \| +– \| +– \| +– \|", page)
    json.dumps(as_dict(mine), allow_nan=False)
