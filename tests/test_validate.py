"""Validation of release models on small synthetic sets of throws."""

from __future__ import annotations

import csv
import dataclasses
import itertools
import json
import math
import re

import matplotlib.image
import numpy as np
import pytest
from throwplan.models import TableRelease, land
from throwplan.planner.check.simulate import MODELS
from throwplan.planner.identify import validation_files
from throwplan.planner.identify.best_cell import cells_around, spread_rows
from throwplan.planner.identify.factors import comparisons, factor_rows, mann_whitney
from throwplan.planner.identify.measured import measured
from throwplan.planner.identify.predict import Parameters, Predictor
from throwplan.planner.identify.validation import validate
from throwplan.planner.identify.validation_folds import bootstrap, fold_of
from throwplan.planner.identify.validation_predict import predicted, quick_predictor
from throwplan.problems import (
    Grasp,
    MeasuredThrow,
    Shared,
    ThrowData,
    ThrownObject,
    load_arm,
)

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
    grip = TableRelease([0.0, 0.05, 0.08, 0.11], [100.0, 100.0, 45.0, 0.0])
    return MeasuredThrow(name, bar, Grasp(), times, pose, 0.05, grip, None, None, factors)


def landed(throw: MeasuredThrow, state: np.ndarray, rng: np.random.Generator) -> MeasuredThrow:
    """The throw as it is measured: 250 Hz track and landing, both with noise."""
    x, theta, time = land(state[None], 0.1, 9.81)[0]
    t = np.arange(0.0, time + 0.02, 0.004)
    end = throw.opening + throw.grip.opening
    track = [end + t, state[0] + state[3] * t, state[1] + state[4] * t - 4.905 * t**2]
    track.append(state[2] + state[5] * t)
    track = np.column_stack(track) + rng.normal(0, 1e-4, (len(t), 4)) * [0, 1, 1, 1]
    pose = (x + rng.normal(0, 0.005), 0.1, theta + rng.normal(0, 0.03))
    return dataclasses.replace(throw, track=track, landing=pose)


def make_data(
    coms=tuple(COMS), pitches=("p1", "p3"), releases=RELEASES, repeats=2, paper=3, model="ls-step"
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
    shared = Shared(landing_height=0.1, synthetic=f"{model}, for a test")
    data = ThrowData("toy", shared, tuple(throws))
    states = np.empty((len(throws), 6))
    for surface, (mu, radius) in TRUTH.items():
        mine = [i for i, t in enumerate(throws) if t.factors["surface"] == surface]
        if mine:
            parameters = Parameters(np.array([mu]), np.array([radius]))
            states[mine] = Predictor(data.picked(mine)).predict(model, parameters).detach[:, 0]
    done = (landed(t, s, rng) for t, s in zip(throws, states, strict=True))
    return dataclasses.replace(data, throws=tuple(done))


def without(data: ThrowData, **values: object) -> ThrowData:
    throws = tuple(dataclasses.replace(throw, **values) for throw in data.throws)
    return dataclasses.replace(data, throws=throws)


@pytest.fixture(scope="module")
def data() -> ThrowData:
    return make_data()


@pytest.fixture(scope="module")
def found(data):
    return validate(data, ("ls-step", "sp"))


# Numbers.


def test_tables_agree_with_releases_one_by_one(data, found):
    """Landings of the batch at the best cell, by the single models and NumPy by hand."""
    predictor, truth = Predictor(data), measured(data)
    batch = [i for i, throw in enumerate(data.throws) if throw.factors["set"] == "batch"]
    assert found.batch.tolist() == batch
    for model, check in found.checks.items():
        errors = []
        for i in batch:
            case = predictor.case(
                data.throws[i], predictor.hands[i], (check.friction, check.patch_radius, 0.0, 1.0)
            )
            end = MODELS[model].release(case).detach
            time = (end.v_z + math.sqrt(end.v_z**2 + 2 * 9.81 * (end.z - 0.1))) / 9.81
            errors.append((end.x + end.v_x * time, end.theta + end.omega * time))
        off = np.array(errors) - truth.landing[batch]
        # The single time stepping is of first order, the batch's is extrapolated.
        close = {"sp": 3e-4, "ls-step": 4e-3}[model]
        assert np.abs(off - check.landing[batch]).max() < close
        mean = (np.abs(off[:, 0]) + np.abs(off[:, 1]) * 0.13).mean()
        assert check.cells.mean().min() == pytest.approx(mean, abs=4e-4)
        assert found.scaled(model)[batch].mean() == pytest.approx(mean, abs=4e-4)


def test_the_true_model_finds_the_truth(data, found):
    check = found.checks["ls-step"]
    assert check.friction * check.patch_radius == pytest.approx(0.8 * 3.5e-3, rel=0.05)
    paper = check.parameters["paper"]
    assert paper[0] * paper[1] == pytest.approx(0.45 * 5e-3, rel=0.1)
    # Nothing but the noise is left: 5 mm and 0.03 rad times half the bar's length.
    left = math.sqrt(2 / math.pi) * (0.005 + 0.03 * 0.13)
    assert check.cells.mean().min() == pytest.approx(left, rel=0.35)
    apart = [i for i, throw in enumerate(data.throws) if throw.factors["surface"] == "paper"]
    assert [check.surface[i] for i in apart] == ["paper"] * len(apart)


def test_cross_validation_is_not_kinder_than_the_fit(found):
    for check in found.checks.values():
        crossed = check.crossed
        assert crossed.folds == 6
        assert crossed.throws == 24
        assert crossed.outside >= crossed.inside
        low, high = crossed.inside_interval
        assert low < crossed.inside < high
        assert crossed.inside == pytest.approx(check.cells.mean().min())


def test_cross_validation_by_hand(found):
    cells = found.checks["sp"].cells
    known = [found.conditions[i] for i in cells.rows]
    fold = fold_of(known)
    outside = []
    for k in range(6):
        inside = np.array([row for row, f in zip(cells.error, fold, strict=True) if f != k])
        best = min(range(400), key=lambda cell: inside[:, cell].mean())
        outside += [row[best] for row, f in zip(cells.error, fold, strict=True) if f == k]
    assert found.checks["sp"].crossed.outside == pytest.approx(np.mean(outside))


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


def test_mann_whitney_against_permutations():
    """The p-value, against the share of all 252 ways to part the ten numbers."""
    rng = np.random.default_rng(5)
    for shift in (0.0, 0.8, 2.0):
        numbers = np.concatenate([rng.normal(0, 1, 5), rng.normal(shift, 1, 5)])
        rank = numbers.argsort().argsort()

        def away(chosen, rank=rank):
            return abs(sum(rank[list(chosen)]) - 22.5)

        real = away(range(5))
        ways = [away(chosen) for chosen in itertools.combinations(range(10), 5)]
        share = np.mean([way >= real - 1e-9 for way in ways])
        assert mann_whitney(numbers[:5], numbers[5:]) == pytest.approx(share, abs=1e-9)
    assert math.isnan(mann_whitney(np.array([math.nan]), np.ones(3)))


def test_factors_compare_like_with_like(data, found):
    groups = {group[0].comparison.factor: group for group in found.factors}
    assert list(groups) == ["com", "pitch", "release", "surface"]
    labels = {name: group[0].comparison.labels for name, group in groups.items()}
    assert labels["com"] == ("0.10", "0.16")
    assert labels["release"] == ("1.0", "-1.0")
    assert labels["pitch"] == ("p1", "p3")
    surface = groups["surface"][0].comparison
    assert (len(surface.first), len(surface.second)) == (2, 3)
    for i in surface.first:
        factors = data.throws[i].factors
        assert (factors["com"], factors["pitch"], factors["release"]) == ("0.10", "p1", "1.0")
    row = next(row for row in groups["com"] if row.model == "ls-step")
    assert np.abs(row.measured - row.predicted).max() < 0.02
    away = np.abs(found.checks["ls-step"].landing[row.comparison.first])
    assert row.mean[0] == pytest.approx(away.mean(axis=0))


def test_mixed_labels_and_factors_of_ones_own(data):
    throws = tuple(
        dataclasses.replace(t, factors=t.factors | {"day": "mo" if i % 2 else "tu"})
        for i, t in enumerate(data.throws)
    )
    mine = dataclasses.replace(data, throws=throws)
    compared, left_out = comparisons(mine, ["day"])
    assert [c.factor for c in compared] == ["com", "pitch", "release", "surface", "day"]
    assert compared[-1].labels == ("tu", "mo")
    assert left_out == ["payload: left out, no such column", "moi: left out, no such column"]


def test_a_slow_model_is_searched_around_a_fast_one():
    data = make_data(coms=("0.10",), pitches=("p1",), paper=0)
    found = validate(data, ("ils",))
    check = found.checks["ils"]
    assert not check.whole
    assert check.cells.friction.size == cells_around(0.8, 3.5e-3).count == 9
    assert np.isfinite(check.landing).all()
    text = validation_files.as_text(found)
    assert "ils: too slow for the whole grid" in text
    assert check.friction * check.patch_radius == pytest.approx(0.8 * 3.5e-3, rel=0.4)


def test_few_rows_are_spread_evenly():
    rows = np.arange(100, 200)
    assert spread_rows(rows, 5).tolist() == [100, 125, 150, 174, 199]
    assert spread_rows(rows[:3], 5).tolist() == [100, 101, 102]


# The command, its files and what it refuses.


def test_files_and_pictures(found, tmp_path):
    validation_files.save_validation(found, tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == set(validation_files.FILES)
    for name in validation_files.PICTURES:
        image = matplotlib.image.imread(tmp_path / f"{name}.png")[..., :3]
        assert image.shape[0] > 300
        assert 0.01 < (image.min(axis=2) < 0.9).mean() < 0.6
    with (tmp_path / "errors_by_throw.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 27 * 2
    mine = [r for r in rows if r["model"] == "sp" and r["in_batch"] == "1"]
    mean = np.mean([abs(float(r["dx"])) for r in mine])
    with (tmp_path / "errors.csv").open(encoding="utf-8") as file:
        line = next(r for r in csv.DictReader(file) if r["model"] == "sp")
    assert float(line["x [m]"]) == pytest.approx(mean, rel=1e-6)
    page = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert "SYNTHETIC" in page
    assert page.count("**") % 2 == 0


def test_a_failing_picture_leaves_nothing(found, tmp_path, monkeypatch):
    def broken(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(validation_files, "errors_by_throw", broken)
    with pytest.raises(ValueError, match="No space left"):
        validation_files.save_validation(found, tmp_path)
    assert not list(tmp_path.iterdir())


def test_another_surface_is_fitted_apart_without_a_column_that_says_so(data, found):
    plain = [
        dataclasses.replace(t, factors={k: v for k, v in t.factors.items() if k != "set"})
        for t in data.throws
    ]
    again = validate(dataclasses.replace(data, throws=tuple(plain)), ("sp",))
    assert set(again.checks["sp"].parameters) == {"", "paper"}
    assert len(again.batch) == len(found.batch)


def test_landings_without_tracks_and_too_few_throws(tmp_path):
    data = make_data(coms=("0.10",), pitches=("p1",), releases=("1.0",), repeats=4, paper=0)
    found = validate(without(data, track=None, factors={}), ("sp",))
    text = validation_files.as_text(found)
    assert "v_x" not in text.split("no tracks")[0]
    assert "no tracks: v_x, omega and the case study are left out" in text
    assert "cross-validation: left out" in text
    assert "com: left out, no such column" in text
    validation_files.save_validation(found, tmp_path)
    assert not (tmp_path / "case.png").exists()
    assert not (tmp_path / "factors.png").exists()
    assert (tmp_path / "boxes.png").exists()


def test_a_model_that_never_lands(found, tmp_path):
    """No number is made up, nothing is chosen as the lowest, and it is said."""
    check = found.checks["sp"]
    lost = dataclasses.replace(check, landing=np.nan * check.landing, twist=np.nan * check.twist)
    rows = [
        factor_rows(g[0].comparison, found.truth.landing, {"sp": lost.landing})
        for g in found.factors
    ]
    mine = dataclasses.replace(found, checks=found.checks | {"sp": lost}, factors=rows)
    validation_files.save_validation(mine, tmp_path)
    page = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert "sp: no landing for 27 throws" in page
    assert re.search(r"\| sp \| – \| – \| – \| – \|", page)
    json.dumps(validation_files.as_dict(mine), allow_nan=False)


def test_one_throw_and_a_slow_batch(data, tmp_path):
    found = validate(data.picked([0]), ("patch",))
    assert found.checks["patch"].cells.friction.size == 9
    assert found.checks["patch"].batched > 0
    assert "cross-validation: left out" in validation_files.as_text(found)
    validation_files.save_validation(found, tmp_path)
    assert (tmp_path / "violins.png").exists()


def test_splined_hands_are_the_hands_of_the_joints():
    """An arm's recorded joints, by splines and by the recording itself."""
    rng = np.random.default_rng(0)
    times = np.arange(0.0, 0.6, 0.002)
    posture = np.array(load_arm("panda").posture)
    joints = np.repeat(posture[None], len(times), axis=0)
    joints[:, [1, 3, 5]] += 0.3 * np.sin(4 * times)[:, None] * rng.uniform(0.5, 1, 3)
    throw = bare_throw("a", rng, com="0.10", pitch="p1", release="1.0")
    throw = dataclasses.replace(throw, times=times, motion=joints, command=0.2)
    data = ThrowData("arm", Shared(landing_height=0.0, arm="panda"), (throw,), load_arm("panda"))
    exact, quick = Predictor(data).hands[0], quick_predictor(data).hands[0]
    t = np.linspace(-0.05, 0.06, 333)
    a, b = exact.at(t), quick.at(t)
    assert np.abs(a.pose - b.pose).max() < 1e-8
    assert np.abs(a.twist - b.twist).max() < 1e-5
    assert np.abs(a.acceleration - b.acceleration).max() < 2e-2
    mine = Parameters(np.array([0.8, 0.5]), np.array([3e-3, 5e-3]))
    for model in ("ls", "sp-paper", "ils"):
        slow = Predictor(data).predict(model, mine)
        fast = predicted(quick_predictor(data), model, mine, None)
        close = 2e-3 if model == "sp-paper" else 2e-5
        assert np.abs(slow.detach - fast.detach).max() < close
