"""Fails if a data set is read wrongly, a wrong one is read, or a contact is not identified."""

from __future__ import annotations

import csv
import json
import math
import tomllib
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import MADE_PRODUCT, MADE_THROWS
from throwplan import lab

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
    rows = ["throw,object,command,x,z,theta,motion,grip,track,odd one,grasp_angle_deg"]
    rows.append('"throw, no. 1",bar,0.1001,1.0,-0.8,7.5,motion/1.csv,grip/1.csv,,"""0""",15')
    rows.append("second,bar,0.1,,,,motion/1.csv,grip/1.csv,track/1.csv,x,")
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
    data = lab.load_throws(small)
    one, two = data.throws
    assert (one.name, one.object.mass, one.command) == ("throw, no. 1", 0.24, 0.1001)
    assert one.landing == (1.0, -0.8, 7.5) and one.track is None
    assert one.factors["odd one"] == '"0"'
    assert (one.grasp.angle, two.grasp.angle) == pytest.approx((math.radians(15), 0.0))
    assert two.landing is None and two.track.shape[1] == 4
    assert one.grip.dwell == pytest.approx(0.05) and one.grip.opening == pytest.approx(0.065)
    assert one.motion.shape == (200, 3)
    assert data.shared.landing_height == -0.8 and data.truth == {"friction": 0.8}
    assert data.shared.angle_noise == pytest.approx(math.radians(1.0))
    assert not data.shared.synthetic


#: A file, what is replaced in it, by what, and what the message says.
WRONG = """
dataset.toml | mass = 0.24 | mass = 240 | at most 50 kg (is it in grams?)
dataset.toml | mass = 0.24 | mas = 0.24 | unknown key 'mas', did you mean 'mass'?
dataset.toml | mass = 0.24 | mass = nan | mass = nan: must be a finite number
dataset.toml | landing_height = -0.8 | | key 'landing_height' is missing
dataset.toml | inertia = 0.000535 | inertia = 535 | inertia = 535: must be at most
dataset.toml | [objects | arm = "pandas"~[objects | arm = 'pandas': unknown robot, did
dataset.toml | friction = 0.8 | friction = "?" | must be a section [truth] of numb
throws.csv | ,bar, | ,stick, | line 2: object: unknown key 'stick'
throws.csv | command | order | the first line must name the column command
throws.csv | grip/1.csv | grip/9.csv | line 2: grip =
throws.csv | 0.1001 | soon | line 2: command = 'soon': must be a finite number
throws.csv | 0.1001 | 0.5 | line 2: motion = motion/1.csv: too short
throws.csv | 0.1001 | 0.265 | must cover 0.03 s more at either end
throws.csv | 1.0,-0.8,7.5 | 1000,-0.8,7.5 | x = 1000: must be in m, at most 50 (is
throws.csv | 1.0,-0.8,7.5 | 1.0,-0.8,430 | theta = 430: must be in rad, at most 62.8
throws.csv | 1.0,-0.8,7.5 | ,, | line 2: no landing: give x, z and theta, or a
throws.csv | track/1.csv | a,b | throws.csv: line 3 has 12 cells, not 11
motion/1.csv | ~0.002, | ~~0.000, | t = 0: must rise from row to row
motion/1.csv | ~0.002, | ~0,002, | motion/1.csv: line 3 has 5 cells, not 4
motion/1.csv | theta | angle | must name the columns t, x, z and theta
grip/1.csv | 0.115,0 | 0.115,50 | f_N must end at 0, but the last row has 50 N
grip/1.csv | t,f_N~ | t,f_N~-1,1e7~ | line 2: f_N = 1e+07: must be within -1e+06
"""


@pytest.mark.parametrize("row", WRONG.strip().splitlines())
def test_wrong_data_is_refused_in_one_line(row, small) -> None:
    file, old, new, message = (part.strip().replace("~", "\n") for part in row.split(" |"))
    text = (small / file).read_text()
    assert old in text
    (small / file).write_text(text.replace(old, new, 1))
    with pytest.raises(tp.InputError) as caught:
        lab.load_throws(small)
    told = str(caught.value)
    assert message in told and "\n" not in told
    assert file in told or "throws.csv" in told


def test_missing_folders_and_files_are_refused(small, tmp_path, refused) -> None:
    assert "no such folder" in refused("identify", tmp_path / "nothing")
    (small / "throws.csv").unlink()
    with pytest.raises(tp.InputError, match=r"throws\.csv"):
        lab.load_throws(small)


def test_the_shipped_throws_are_those_of_their_page() -> None:
    data = lab.load_throws(MADE_THROWS)
    conditions = {(t.factors["pitch"], t.factors["release"]) for t in data.throws}
    assert (len(data.throws), len(conditions)) == (90, 3 * 6)
    assert data.truth["friction"] * data.truth["patch_radius"] == pytest.approx(MADE_PRODUCT)
    assert data.shared.synthetic
    landing = np.array([throw.landing for throw in data.throws])
    assert np.ptp(landing[:, 0]) > 0.4 and np.ptp(landing[:, 2]) > math.radians(90)


def test_identify_takes_filters_and_writes_what_it_finds(tmp_path, run, refused) -> None:
    options = (
        "--model",
        "sp",
        "--throws",
        6,
        "--delay",
        "--grip-scale",
        "--json",
        "--out",
        tmp_path,
    )
    (told,) = json.loads(run("identify", MADE_THROWS, "--only", "repeat=2", *options).out)
    assert told["throws"] == 6
    low, high = 0.9 * MADE_PRODUCT, 1.1 * MADE_PRODUCT
    assert low < told["fit"]["product"]["value"] < high
    for name, truth in (("delay", 0.0), ("grip_scale", 1.0)):
        found = told["fit"][name]
        assert abs(found["value"] - truth) < 4 * found["deviation"] < 0.5
    names = {"identify.json", "contact-sp.png", "contact.toml"}
    assert {path.name for path in tmp_path.iterdir()} == names
    words = ("identify", MADE_THROWS, "--only", "pitch=3")
    assert "pitch must be one of p1, p2, p3" in refused(*words)


def test_what_a_prior_knows_of_the_opening_stays_beside_the_fit(tmp_path, run) -> None:
    text = (MADE_THROWS / "scene.toml").read_text(encoding="utf-8")
    known = "[uncertainty]\ndelay = { normal = 0.003 }\nfriction = { normal = 0.1 }\n"
    (tmp_path / "scene.toml").write_text(f"{text}\n{known}", encoding="utf-8")
    words = ("--only", "repeat=2", "--prior", tmp_path / "scene.toml", "--out", tmp_path)
    assert run("identify", MADE_THROWS, *words).status == 0
    found = tomllib.loads((tmp_path / "contact.toml").read_text(encoding="utf-8"))["uncertainty"]
    assert found["delay"] == {"normal": 0.003}
    assert found["friction"] != {"normal": 0.1} and "opening" not in found


@pytest.mark.slow
def test_identify_compares_the_models(tmp_path, run) -> None:
    words = "--only repeat=1 --model all --json --out"
    found = json.loads(run("identify", MADE_THROWS, *words.split(), tmp_path).out)
    rows = list(csv.DictReader((tmp_path / "comparison.csv").read_text().splitlines()))
    assert [row["model"] for row in rows] == [one["model"] for one in found]
    for row, one in zip(rows, found, strict=True):
        low, high = one["left_out"]["interval"]
        assert low < one["left_out"]["mean"] < high
        assert float(row["left out [mm]"]) == pytest.approx(1e3 * one["left_out"]["mean"])
        assert float(row["pose error [mm]"]) == pytest.approx(1e3 * one["mean_error"])
        assert (tmp_path / f"contact-{one['model']}.png").is_file()
