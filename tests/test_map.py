"""The map of landing poses in reach: what is in it, its files, the command."""

from __future__ import annotations

import dataclasses
import json
import math

import matplotlib.image
import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.cli import main
from throwplan.planner.reach.map_throws import CHUNK
from throwplan.problems.scene import Landing

KEYS = {"scene", "z", "reachable", "x", "theta", "file"}


@pytest.fixture(scope="module")
def pose() -> tp.ReachMap:
    """More than one chunk."""
    return tp.reach_map("pose", samples=CHUNK + 5000)


@pytest.fixture(scope="module")
def box() -> tp.ReachMap:
    return tp.reach_map("hand-box", samples=6000)


def answer_of(capsys) -> dict:
    return json.loads(capsys.readouterr().out)


def test_every_landing_is_contained(pose, box):
    for found in (pose, box):
        assert found.x.size > 1000
        assert found.landings.sum() == found.x.size
        for x, theta in zip(found.x, found.theta, strict=True):
            assert found.contains(x, theta)
        assert found.distance(found.x[7], found.theta[7]) == 0.0


def test_bins_agree_with_each_other(pose):
    hit = pose.landings > 0
    assert pose.reachable == hit.sum()
    assert ((pose.solutions > 0) == hit).all()
    assert (pose.solutions <= pose.landings).all()
    assert (np.isfinite(pose.margin) == hit).all()
    # The sampler keeps the limits and the grip, so no use is above 1.
    assert pose.margin[hit].min() >= 0.0
    assert pose.margin[hit].max() < 1.0
    assert (np.diff(pose.x_edges) > 0).all()
    assert (np.diff(pose.theta_edges) > 0).all()


def test_margin_of_letting_go_at_rest():
    """Nothing moves: the margin is what the weight leaves of the grip."""
    scene = tp.load_scene("hand-box")
    hand = dataclasses.replace(scene.hand, x=(-0.001, 0.001), z=(0.699, 0.701), start=(0.0, 0.7))
    found = tp.reach_map(scene.replace(hand=hand), samples=1)
    # Held at its CoM in the middle of its room: weight over the force limit of two faces.
    use = 0.2 * 9.81 / (2 * 0.8 * 50.0)
    assert np.abs(found.x).min() < 1e-12
    assert np.nanmax(found.margin) == pytest.approx(1 - use)


def test_the_middle_of_full_bins_is_solved(pose):
    planner = tp.Planner(pose.scene, compiling="no")
    fullest = np.argsort(pose.landings, axis=None)[::-1]
    for place in fullest[[0, 15, 30]]:
        i, j = np.unravel_index(place, pose.landings.shape)
        x, theta = pose.x_edges[i : i + 2].mean(), pose.theta_edges[j : j + 2].mean()
        assert pose.contains(x, theta)
        plan = planner.plan(tp.Pose(x=float(x), z=pose.z, theta=float(theta)))
        assert plan.status == "solved"


def test_far_outside(pose, box):
    for x, theta in ((9.0, 0.0), (-9.0, 0.0), (0.5, 40.0), (math.nan, 0.0), (0.5, math.inf)):
        assert not pose.contains(x, theta)
    # At least as far as from the nearest x, and half a length for each radian.
    assert pose.distance(9.0, 0.0) >= 9.0 - pose.x.max() > 0
    assert pose.distance(0.5, 40.0) >= (40.0 - pose.theta.max()) * 0.26 / 2
    assert not box.contains(9.0)
    assert box.distance(9.0) == pytest.approx(9.0 - box.x.max())


def test_hand_box_ends_where_mechanics_says(box):
    """As in test_exit_codes: from x 0.25 m, z 0.95 m at 3 m/s each way at the very best."""
    farthest = 0.25 + 3.0 * (3.0 + math.sqrt(9.0 + 2 * 9.81 * 0.95)) / 9.81
    assert np.abs(box.x).max() < farthest
    assert box.theta_edges is None
    # A start in the middle and an alike hand on both sides.
    assert box.x.max() == pytest.approx(-box.x.min(), rel=0.15)


def test_bounds_of_landing_are_kept():
    scene = tp.load_scene("hand-flip")
    everything = tp.reach_map(scene, samples=8000)
    slow = tp.reach_map(scene.replace(landing=Landing(rate_max=1.0)), samples=8000)
    assert 0 < slow.x.size < everything.x.size
    assert set(slow.x) < set(everything.x)
    # The hand turns by 120 degrees, and no flight of 1.5 s adds more than 1.5 rad.
    assert np.abs(slow.theta).max() < math.radians(120.0) + 1.5 < np.abs(everything.theta).max()
    impossible = tp.reach_map(scene.replace(landing=Landing(speed_min=90.0)), samples=2000)
    assert impossible.reachable == 0
    assert "[landing]" in impossible.message


def test_a_start_to_wind_up_from_takes_nothing_but_time(pose):
    """With a given start and a long carry the same throws as without; fewer in a short one."""
    scene = tp.load_scene("flip")
    long = scene.replace(mesh=dataclasses.replace(scene.mesh, carry_max=5.0))
    short = scene.replace(mesh=dataclasses.replace(scene.mesh, carry_max=0.4))
    # Run-ups are drawn up to the longest carry, so compare the same limit.
    free = long.replace(robot=dataclasses.replace(scene.robot, start=None))
    from_start, from_anywhere = (tp.reach_map(s, samples=2000).x.size for s in (long, free))
    # One more: letting go at the start.
    assert from_anywhere <= from_start <= from_anywhere + 1
    assert tp.reach_map(short, samples=2000).x.size < 0.7 * from_start


def test_same_arguments_same_map(box):
    again = tp.reach_map("hand-box", samples=6000)
    assert (again.x == box.x).all()


def test_files_of_a_plane(pose, tmp_path):
    assert pose.save(tmp_path) == tmp_path / "map.npz"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["map.npz", "map.png"]
    with np.load(tmp_path / "map.npz") as arrays:
        for name in ("x_edges", "theta_edges", "landings", "solutions", "margin", "x", "theta"):
            np.testing.assert_array_equal(arrays[name], getattr(pose, name))
        assert arrays["z"] == pose.z
        assert arrays["samples"] == pose.samples
    assert_ink(tmp_path / "map.png")


def test_files_of_a_line(box, tmp_path):
    box.save(tmp_path)
    with np.load(tmp_path / "map.npz") as arrays:
        assert arrays["theta_edges"].size == 0
        assert arrays["margin"].shape == (len(arrays["x_edges"]) - 1, 1)
    assert_ink(tmp_path / "map.png")


def assert_ink(path) -> None:
    """Colour, not only black on white, in the middle of the picture."""
    picture = matplotlib.image.imread(path)[..., :3]
    high, wide = picture.shape[:2]
    middle = picture[high // 4 : 3 * high // 4, wide // 4 : 3 * wide // 4]
    assert (np.ptp(middle, axis=2) > 0.1).mean() > 0.03


def test_json_and_three_lines(capsys, tmp_path):
    out = tmp_path / "out"
    assert main(["map", "pose", "--samples", "3000", "--json", "--out", str(out)]) == 0
    answer = answer_of(capsys)
    assert set(answer) == KEYS
    assert (answer["scene"], answer["z"]) == ("pose", 0.1)
    assert answer["reachable"] > 10
    assert answer["x"][0] < answer["x"][1]
    assert answer["theta"][0] < answer["theta"][1]
    assert answer["file"] == str(out / "map.npz")
    assert main(["map", "hand-box", "--samples", "3000", "--z", "0.2"]) == 0
    said = capsys.readouterr()
    assert len(said.out.splitlines()) == 3
    assert said.err == ""  # no terminal
    assert "target x 1.2 m" in said.out


def test_json_without_theta_or_files(capsys):
    assert main(["map", "hand-box", "--samples", "3000", "--z", "-1", "--json"]) == 0
    answer = answer_of(capsys)
    assert set(answer) == KEYS
    assert (answer["z"], answer["theta"], answer["file"]) == (-1.0, None, None)


def test_a_height_out_of_reach(capsys):
    """The hand rises to 1.1 m at most and throws 3 m/s up: 1.56 m is the highest of all."""
    assert main(["map", "hand-box", "--samples", "3000", "--z", "1.9", "--json"]) == 3
    said = capsys.readouterr()
    answer = json.loads(said.out)
    assert (answer["reachable"], answer["x"], answer["theta"]) == (0, None, None)
    assert len(said.err.splitlines()) == 1
    assert answer["message"] in said.err
    highest = float(answer["message"].split("at most about ")[1].split(" m")[0])
    assert 1.2 < highest < 1.57
    empty = tp.reach_map("hand-box", z=1.9, samples=3000)
    assert not empty.contains(0.0)
    assert empty.distance(0.0) == math.inf
    with pytest.raises(tp.InputError, match="nothing to save"):
        empty.save("never")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("map drop", "no [hand] or [robot]"),
        ("map pose --z high", "--z high: must be a finite number"),
        ("map pose --z nan", "--z nan: must be a finite number"),
        ("map pose --z 1e9", "--z = 1000000000.0: must be"),
        ("map pose --samples 0", "--samples 0: must be a whole number, 1 to"),
        ("map pose --samples many", "--samples many: must be a whole number, 1 to"),
        ("map pose --samples 1e3", "--samples 1e3: must be a whole number"),
        ("map nothing-like-it", "nothing-like-it"),
    ],
)
def test_refused_on_the_command_line(line, words, capsys, tmp_path):
    out = tmp_path / "out"
    assert main([*line.split(), "--out", str(out)]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert words in said
    assert not out.exists()


@pytest.mark.parametrize(
    "wrong",
    [{"z": math.nan}, {"z": "0.1"}, {"z": True}, {"samples": 0}, {"samples": 2.5}],
)
def test_refused_in_python(wrong):
    (name,) = wrong
    with pytest.raises(tp.InputError, match=f"{name} = .*must be"):
        tp.reach_map("pose", **wrong)


def test_with_a_cup_only_poses_that_go_into_one_are_in_reach() -> None:
    """The cup comes along with the landing; a bar that lies flat enters none."""
    scene = tp.load_scene("cup")
    found = tp.reach_map(scene, samples=20_000)
    without = tp.reach_map(scene.replace(cup=None), samples=20_000)
    assert 0 < found.x.size < 0.3 * without.x.size
    assert np.abs(np.cos(found.theta)).max() < 0.85
    assert np.abs(np.cos(without.theta)).max() > 0.99
