"""Fails if a map holds what is out of reach, or throws that are prepared are not kept or used."""

from __future__ import annotations

import math
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan import load_scene

KEYS = {"scene", "z", "found", "x", "theta", "file"}


@pytest.fixture(scope="module")
def pose() -> tp.ReachMap:
    return tp.reach_map("pose", samples=15_000)


@pytest.fixture(scope="module")
def box() -> tp.ReachMap:
    return tp.reach_map("hand-box", samples=6000)


def test_every_landing_is_contained(pose, box) -> None:
    for found in (pose, box):
        assert found.x.size > 1000
        assert found.landings.sum() == found.x.size
        for x, theta in zip(found.x[:2000], found.theta[:2000], strict=True):
            assert found.contains(x, theta)
        assert found.distance(found.x[7], found.theta[7]) == 0.0


def test_margin_of_letting_go_at_rest() -> None:
    """Nothing moves: the margin is what the weight leaves of the grip."""
    hand = {"x": (-0.001, 0.001), "z": (0.699, 0.701), "start": (0.0, 0.7)}
    found = tp.reach_map(varied(tp.load_scene("hand-box"), hand=hand), samples=1)
    # Held at its CoM: weight over the force limit of two faces.
    use = 0.2 * 9.81 / (2 * 0.8 * 50.0)
    assert np.abs(found.x).min() < 1e-12
    assert np.nanmax(found.margin) == pytest.approx(1 - use)


@pytest.mark.slow
def test_the_middle_of_full_bins_is_solved(pose) -> None:
    planner = tp.Planner(pose.scene)
    fullest = np.argsort(pose.landings, axis=None)[::-1]
    for place in fullest[[0, 15, 30]]:
        i, j = np.unravel_index(place, pose.landings.shape)
        x, theta = pose.x_edges[i : i + 2].mean(), pose.theta_edges[j : j + 2].mean()
        assert pose.contains(x, theta)
        plan = planner.plan(tp.Pose(x=float(x), z=pose.z, theta=float(theta)), patience=90.0)
        assert plan.status == "solved"


def test_the_search_goes_beyond_the_samples_of_the_map(pose, pose_planner) -> None:
    """It reports the nearest of its throws to a target out of reach."""
    target = pose_planner.scene.target.in_plane(1.9, 3.0)
    plan = pose_planner.plan(target)
    assert plan.status == "not_found"
    away = target.distance(plan.nearest.target, pose_planner.scene.object.half_length)
    assert away < 0.9 * pose.distance(target.x, target.theta)


def test_far_outside(pose, box) -> None:
    for x, theta in ((9.0, 0.0), (-9.0, 0.0), (0.5, 40.0)):
        assert not pose.contains(x, theta)
    for x, theta in ((math.nan, 0.0), (0.5, math.inf)):
        with pytest.raises(tp.InputError, match="must be a finite number"):
            pose.contains(x, theta)
    # At least as far as from the nearest x, and half a length for each radian.
    assert pose.distance(9.0, 0.0) >= 9.0 - pose.x.max() > 0
    assert pose.distance(0.5, 40.0) >= (40.0 - pose.theta.max()) * 0.26 / 2
    assert not box.contains(9.0)
    assert box.distance(9.0) == pytest.approx(9.0 - box.x.max())


def test_hand_box_ends_where_mechanics_says(box) -> None:
    """The object leaves from x 0.25 m, z 0.95 m at 3 m/s each way at the very best."""
    farthest = 0.25 + 3.0 * (3.0 + math.sqrt(9.0 + 2 * 9.81 * 0.95)) / 9.81
    assert np.abs(box.x).max() < farthest
    assert box.theta_edges is None
    # A start in the middle and an alike hand on both sides.
    assert box.x.max() == pytest.approx(-box.x.min(), rel=0.15)
    assert (tp.reach_map("hand-box", samples=6000).x == box.x).all()


def test_bounds_of_landing_are_kept(tmp_path) -> None:
    text, files = tp.scene_text("hand-flip"), {}
    for key in ("rate_max = 1.0", "speed_min = 90.0"):
        files[key] = tmp_path / f"{len(files)}.toml"
        files[key].write_text(f"{text}\n[landing]\n{key}\n")
    everything = tp.reach_map("hand-flip", samples=8000)
    slow = tp.reach_map(files["rate_max = 1.0"], samples=8000)
    assert 0 < slow.x.size < everything.x.size and set(slow.x) < set(everything.x)
    # The hand turns by 120 degrees, and no flight of 1.5 s adds more than 1.5 rad.
    assert np.abs(slow.theta).max() < math.radians(120.0) + 1.5 < np.abs(everything.theta).max()
    impossible = tp.reach_map(files["speed_min = 90.0"], samples=2000)
    assert impossible.found == 0 and "[landing]" in impossible.message


def test_with_a_cup_only_poses_that_go_into_one_are_in_reach() -> None:
    """The cup comes along with the landing; a bar that lies flat enters none."""
    scene = tp.load_scene("near-cup")
    found = tp.reach_map(scene, samples=8000)
    without = tp.reach_map(scene.replace(cup=None), samples=8000)
    assert 0 < found.x.size < 0.3 * without.x.size
    assert np.abs(np.cos(found.theta)).max() < 0.85
    assert np.abs(np.cos(without.theta)).max() > 0.99


def test_the_command(run, tmp_path) -> None:
    out = tmp_path / "out"
    answer = run("map pose --samples 3000 --json --out", out).json
    assert set(answer) == KEYS
    assert (answer["scene"], answer["z"]) == ("pose", 0.1) and answer["found"] > 10
    assert answer["x"][0] < answer["x"][1] and answer["theta"][0] < answer["theta"][1]
    assert answer["file"] == str(out / "map.npz")
    said = run("map hand-box --samples 3000 --z 0.2")
    assert (said.status, len(said.out.splitlines()), said.err) == (0, 3, "")
    assert "target x 1.2 m" in said.out
    answer = run("map hand-box --samples 3000 --z -1 --json").json
    assert set(answer) == KEYS
    assert (answer["z"], answer["theta"], answer["file"]) == (-1.0, None, None)


def test_a_robust_map_needs_a_library(refused) -> None:
    assert "first throwplan prepare ur5e" in refused("map ur5e --robust")


def test_a_height_out_of_reach(run) -> None:
    """The hand rises to 1.1 m at most and throws 3 m/s up: 1.56 m is the highest of all."""
    said = run("map hand-box --samples 3000 --z 1.9 --json")
    answer = said.json
    assert (said.status, len(said.err.splitlines())) == (3, 1)
    assert (answer["found"], answer["x"], answer["theta"]) == (0, None, None)
    assert answer["message"] in said.err
    highest = float(answer["message"].split("at most about ")[1].split(" m")[0])
    assert 1.2 < highest < 1.57
    empty = tp.reach_map("hand-box", z=1.9, samples=3000)
    assert not empty.contains(0.0) and empty.distance(0.0) == math.inf
    with pytest.raises(tp.InputError, match="nothing to save"):
        empty.save("never")


# Throws that are prepared.

PREPARED = {"scene", "throws", "added", "edge", "bytes", "folder", "time"}


def test_it_says_what_there_is_and_plans_use_it(run, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    said = run("prepare hand-box --throws 40 --json")
    assert said.status == 0 and said.json.keys() == PREPARED
    found = said.json
    assert found["throws"] == found["added"] >= 40 and Path(found["folder"]).is_dir()
    # Again: they are there already.
    again = run("prepare hand-box --throws 40 --json").json
    assert again["throws"] == found["throws"] and again["added"] == 0
    answer = run("plan hand-box --json").json
    assert answer["status"] == "solved" and answer["solver"]["name"] == "corrector"
    said = run("prepare hand-box --throws 40")
    assert said.status == 0 and "solved throws, none of them new" in said.out


@pytest.mark.slow
def test_it_says_why_there_are_fewer_than_asked_for(run, tmp_path, monkeypatch) -> None:
    """A hand so slow that its reach has no room for as many."""
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    text = tp.scene_text("hand-box")
    assert "\nspeed = 3.0" in text
    slow = tmp_path / "slow.toml"
    slow.write_text(text.replace("\nspeed = 3.0", "\nspeed = 0.3"))
    said = run("prepare --throws 300", slow)
    assert said.status == 0 and "fewer than the 300 requested: no places are left" in said.out


@pytest.mark.slow
def test_an_end_loses_nothing_that_was_solved(tmp_path: Path, interruptible: None) -> None:
    """Of the command, with the processes that it starts."""
    environment = os.environ | {"THROWPLAN_CACHE": str(tmp_path)}
    command = [sys.executable, "-m", "throwplan", "prepare", "hand-flip", "--throws", "5000"]
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, text=True)
    until = time.monotonic() + 300
    while not list(tmp_path.glob("throws-*/*.npy")) and time.monotonic() < until:
        time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    _, words = process.communicate(timeout=60)
    assert process.returncode == 130
    kept = r"throwplan: interrupted: ([\d,]+) throws are kept; run the command again .*\n"
    said = re.fullmatch(kept, words)
    assert said, words
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("THROWPLAN_CACHE", str(tmp_path))
        kept = tp.Planner(load_scene("hand-flip")).prepared
    assert kept == int(said[1].replace(",", "")) > 0
    assert not [path for path in tmp_path.glob("throws-*/*") if path.suffix != ".npy"]
