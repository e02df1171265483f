"""Measured throws: data sets as files, `make-throws`, `identify` and `validate`."""

from __future__ import annotations

import csv
import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp

TRUE = 0.8 * 0.0031


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """One synthetic throw of each condition of the paper's design; not to be changed."""
    from throwplan.planner.cli import main

    folder = tmp_path_factory.mktemp("throws") / "made"
    assert main(["make-throws", "--out", str(folder), "--repeats", "1"]) == 0
    return folder


SMALL = """landing_height = -0.8
description = "a bar of plastic"
angle_noise_deg = 1.0
[objects.bar]
mass = 0.24
inertia = 0.000535
length = 0.26
com = 0.10
[truth]
friction = 0.8
"""


@pytest.fixture
def small(tmp_path) -> Path:
    """Two throws of a free hand: one with a landing, one with a track only."""
    folder = tmp_path / "small"
    for name in ("motion", "grip", "track"):
        (folder / name).mkdir(parents=True)
    (folder / "dataset.toml").write_text(SMALL)
    rows = ["throw,object,command,x,z,theta,motion,grip,track,odd one"]
    rows.append('"throw, no. 1",bar,0.1001,1.0,-0.8,7.5,motion/1.csv,grip/1.csv,,"""0"""')
    rows.append("second,bar,0.1,,,,motion/1.csv,grip/1.csv,track/1.csv,x")
    (folder / "throws.csv").write_text("\n".join(rows) + "\n")
    t = np.arange(0.0, 0.4, 0.002)
    motion = np.column_stack([t, t, t**2, -t])
    lines = [",".join(f"{value:.9g}" for value in row) for row in motion]
    (folder / "motion" / "1.csv").write_text("\n".join(["t,x,z,theta", *lines]) + "\n")
    (folder / "grip" / "1.csv").write_text("t,f_N\n0,100\n0.05,100\n0.08,40\n0.115,0\n")
    t = np.arange(0.2, 0.9, 0.004)
    track = np.column_stack([t, 1.5 * t, 0.9 * t - 9.81 * t**2 / 2, 5 * t])
    lines = [",".join(f"{value:.9g}" for value in row) for row in track]
    (folder / "track" / "1.csv").write_text("\n".join(["t,x,z,theta", *lines]) + "\n")
    return folder


# Files of a data set.


def test_a_small_data_set_is_read(small) -> None:
    data = tp.load_throws(small)
    one, two = data.throws
    assert (one.name, one.object.mass, one.command) == ("throw, no. 1", 0.24, 0.1001)
    assert one.landing == (1.0, -0.8, 7.5) and one.track is None
    assert one.factors["odd one"] == '"0"'
    assert two.landing is None and two.track.shape[1] == 4
    assert one.grip.dwell == pytest.approx(0.05) and one.grip.opening == pytest.approx(0.065)
    assert one.motion.shape == (200, 3)
    assert data.shared.landing_height == -0.8 and data.truth == {"friction": 0.8}
    assert data.shared.angle_noise == pytest.approx(math.radians(1.0))
    assert not data.shared.synthetic


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("dataset.toml", "mass = 0.24", "mass = 240", "at most 50 (is it in grams?)"),
        ("dataset.toml", "mass = 0.24", "mas = 0.24", "unknown key 'mas', did you mean 'mass'?"),
        ("dataset.toml", "mass = 0.24", "mass = nan", "mass = nan: must be a finite number"),
        ("dataset.toml", "landing_height = -0.8", "", "key 'landing_height' is missing"),
        ("dataset.toml", "inertia = 0.000535", "inertia = 535", "inertia = 535: must be at most"),
        (
            "dataset.toml",
            "[objects",
            'arm = "pandas"\n[objects',
            "arm = 'pandas': unknown robot, did",
        ),
        ("dataset.toml", "friction = 0.8", 'friction = "?"', "must be a section [truth] of numb"),
        ("throws.csv", ",bar,", ",stick,", "line 2: object: unknown key 'stick'"),
        ("throws.csv", "command", "order", "the first line must name the column command"),
        ("throws.csv", "grip/1.csv", "grip/9.csv", "line 2: grip = "),
        ("throws.csv", "0.1001", "soon", "line 2: command = 'soon': must be a finite number"),
        ("throws.csv", "0.1001", "0.5", "line 2: motion = motion/1.csv: too short"),
        ("throws.csv", "0.1001", "0.265", "must cover 0.03 s more at either end"),
        ("throws.csv", "1.0,-0.8,7.5", "1000,-0.8,7.5", "x = 1000: must be in m, at most 50 (is"),
        ("throws.csv", "1.0,-0.8,7.5", "1.0,-0.8,430", "theta = 430: must be in rad, at most 62.8"),
        ("throws.csv", "1.0,-0.8,7.5", ",,", "line 2: no landing: give x, z and theta, or a"),
        ("throws.csv", "track/1.csv", "a,b", "throws.csv: line 3 has 11 cells, not 10"),
        ("motion/1.csv", "\n0.002,", "\n\n0.000,", "t = 0: must rise from row to row"),
        ("motion/1.csv", "\n0.002,", "\n0,002,", "motion/1.csv: line 3 has 5 cells, not 4"),
        (
            "throws.csv",
            "1.0,-0.8,7.5",
            "1e155,-0.8,7.5",
            "line 2: x = 1e+155: must be within -1000",
        ),
        ("grip/1.csv", "0.115,0", "0.115,50", "f_N must end at 0, but the last row has 50 N"),
        ("grip/1.csv", "t,f_N\n", "t,f_N\n-1,1e7\n", "line 2: f_N = 1e+07: must be within -1e+06"),
        ("motion/1.csv", "theta", "angle", "must name the columns t, x, z and theta"),
    ],
)
def test_wrong_data_is_refused_in_one_line(file, old, new, message, small) -> None:
    text = (small / file).read_text()
    assert old in text
    (small / file).write_text(text.replace(old, new, 1))
    with pytest.raises(tp.InputError) as caught:
        tp.load_throws(small)
    told = str(caught.value)
    assert message in told and "\n" not in told
    assert file in told or "throws.csv" in told


def test_missing_folders_and_files_are_refused(small, tmp_path, refused) -> None:
    for command in ("identify", "validate"):
        assert "no such folder" in refused(command, tmp_path / "nothing")
    (small / "throws.csv").unlink()
    with pytest.raises(tp.InputError, match=r"throws\.csv: no such file"):
        tp.load_throws(small)


# make-throws.


def test_the_design_is_the_paper_s(made) -> None:
    data = tp.load_throws(made)
    conditions = {tuple(t.factors[key] for key in ("com", "pitch", "release")) for t in data.throws}
    assert len(data.throws) == len(conditions) == 2 * 3 * 6
    assert {throw.object.com for throw in data.throws} == {0.10, 0.16}
    assert data.shared.landing_height < 0
    assert data.truth["friction"] * data.truth["patch_radius"] == pytest.approx(TRUE)
    landing = np.array([throw.landing for throw in data.throws])
    assert np.ptp(landing[:, 0]) > 0.5 and np.ptp(landing[:, 2]) > math.radians(90)


def test_the_command_says_what_it_wrote_over_other_synthetic_throws(made, tmp_path, run) -> None:
    """LuGre bristles: always labelled synthetic."""
    out = Path(shutil.copytree(made, tmp_path / "made"))
    line = "make-throws --repeats 1 --truth lugre --stiffness 1e5 --seed 7 --json --out"
    found, data = run(line, out).json, tp.load_throws(out)
    assert found["throws"] == len(data.throws) == 36
    assert found["synthetic"] == data.shared.synthetic and found["truth"] == data.truth
    assert found["landing_height"] == data.shared.landing_height
    assert "LuGre" in found["synthetic"] and "seed 7" in found["synthetic"]


def test_nothing_but_synthetic_throws_is_overwritten(small, tmp_path, refused) -> None:
    before = (small / "throws.csv").read_bytes()
    line = "make-throws --repeats 1 --out"
    assert "not labelled synthetic, not overwritten" in refused(line, small)
    assert (small / "throws.csv").read_bytes() == before
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.txt").write_text("mine")
    assert "holds thesis.txt, not overwritten" in refused(line, tmp_path / "other")


# identify.


def test_identify_takes_filters_and_writes_what_it_finds(made, tmp_path, run, refused) -> None:
    options = ("--model", "sp", "--throws", 6, "--json", "--out", tmp_path)
    (told,) = json.loads(run("identify", made, "--only", "com=com2", *options).out)
    assert told["throws"] == 6
    assert told["fit"]["product"]["value"] == pytest.approx(TRUE, rel=0.1)
    names = {"identify.json", "contact-sp.png", "contact.toml"}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert "com must be one of com1, com2" in refused("identify", made, "--only", "com=3")


# validate.


@pytest.mark.slow
def test_validate_writes_beside_the_data_and_leaves_the_data(made, tmp_path, run) -> None:
    """Twelve throws."""
    copy = Path(shutil.copytree(made, tmp_path / "copy"))
    lines = (copy / "throws.csv").read_text().splitlines(keepends=True)
    few = "".join([lines[0], *lines[1:36:3]])
    (copy / "throws.csv").write_text(few)
    printed = run("validate", copy, "--models", "sp", "--json", "--out", copy).json
    assert printed["synthetic"]
    assert printed["models"]["sp"]["errors"]["theta"]["mae"] < 0.05
    tables = {"cross_validation", "errors", "errors_by_throw", "parameters"}
    pictures = {"boxes", "errors"}
    names = {f"{n}.csv" for n in tables} | {f"{n}.png" for n in pictures} | {"validation.md"}
    kept = {"dataset.toml", "throws.csv", "motion", "grip", "track"}
    assert {path.name for path in copy.iterdir()} == names | kept
    rows = list(csv.DictReader((copy / "errors_by_throw.csv").read_text().splitlines()))
    assert len(rows) == 12
    mean = np.mean([abs(float(row["dx"])) for row in rows])
    (line,) = csv.DictReader((copy / "errors.csv").read_text().splitlines())
    assert float(line["x [m]"]) == pytest.approx(mean, rel=1e-6)
    page = (copy / "validation.md").read_text()
    for part in ("Table III", "Table IV", "folds", "SYNTHETIC"):
        assert part in page
    assert (copy / "throws.csv").read_text() == few
    assert len(tp.load_throws(copy).throws) == 12


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("--models spp", "--models: model = 'spp': must be one of .* did you mean 'sp'"),
        ("--models ,", "--models ',': names no model"),
        ("--models ils", "--models: model = 'ils': throws one at a time, too slow here: take sp"),
    ],
)
def test_validate_refuses(words, message, made, refused) -> None:
    assert re.search(message, refused(f"validate {made} {words}"))
