"""Exit statuses 0 and 3, and the one JSON object on stdout that interface.md fixes."""

from __future__ import annotations

import dataclasses
import json
import math
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from throwplan import Planner, Pose, load_scene

#: interface.md's JSON of `plan`: keys, and the keys below them.
KEYS: dict[str, set[str]] = {
    "scene": set(),
    "status": set(),
    "message": set(),
    "target": {"x", "y", "z", "theta"},
    "landing": {"planned", "exact", "sent", "limit_surface"},
    "error": {"planned", "exact", "sent"},
    "release": {"command_time", "opening_time", "detach_time", "landing_time"},
    "nearest": set(),
    "binding": set(),
    "solver": {"name", "iterations", "attempts"},
    "nlp": {"variables", "constraints"},
    "time": {"build", "guess", "solve", "smooth", "check", "total", "draw"},
}


def run(folder: Path, line: str) -> subprocess.CompletedProcess[str]:
    """The command in a process of its own, so that what libraries print counts too."""
    return subprocess.run(
        [sys.executable, "-m", "throwplan", *line.split()],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )


def no_constant(name: str) -> float:
    raise AssertionError(f"{name} in JSON")


def one_object(text: str) -> dict[str, Any]:
    """`text` as exactly one JSON object; NaN and infinities, which JSON has not, are errors."""
    answer = json.loads(text, parse_constant=no_constant)
    assert isinstance(answer, dict)
    return answer


def assert_has_the_interface_s_keys(answer: dict[str, Any]) -> None:
    assert set(answer) >= set(KEYS)
    for key, below in KEYS.items():
        if below:
            assert set(answer[key]) >= below, key
    assert isinstance(answer["binding"], list)
    for key in ("iterations", "attempts"):
        assert type(answer["solver"][key]) is int
    for key in ("variables", "constraints"):
        assert answer["nlp"][key] > 0
    times = dict(answer["time"])
    assert times.pop("draw") is None
    assert all(seconds >= 0 for seconds in times.values())
    assert times["total"] >= max(times.values())


@pytest.fixture(scope="module")
def too_far(tmp_path_factory):
    """The cup 3 m away: 10 to 15 s, so once."""
    folder = tmp_path_factory.mktemp("too_far")
    result = run(folder, "plan cup --target 3 0.22 -90 --json")
    assert list(folder.iterdir()) == []
    return result


def test_out_of_reach_exits_3_with_its_reason(too_far):
    answer = one_object(too_far.stdout)
    assert too_far.returncode == 3
    assert answer["status"] == "out_of_reach"
    assert answer["binding"]
    assert all(isinstance(name, str) and name for name in answer["binding"])
    assert len(set(answer["binding"])) == len(answer["binding"])
    # One line on stderr says it too.
    assert len(too_far.stderr.splitlines()) == 1
    assert answer["message"] in too_far.stderr
    assert answer["binding"][0] in answer["message"]


def test_out_of_reach_names_the_nearest_pose(too_far):
    nearest = one_object(too_far.stdout)["nearest"]
    assert set(nearest) == {"x", "y", "z", "theta"}
    assert nearest["y"] == 0.0
    assert nearest["z"] == pytest.approx(0.22)
    assert nearest["theta"] == pytest.approx(-math.pi / 2, abs=0.2)
    # More than an arm's length, less than was asked for.
    assert 0.9 < nearest["x"] < 2.9


def test_out_of_reach_has_every_key(too_far):
    answer = one_object(too_far.stdout)
    assert_has_the_interface_s_keys(answer)
    assert answer["scene"] == "cup"
    assert answer["target"] == {"x": 3.0, "y": 0.0, "z": 0.22, "theta": pytest.approx(-math.pi / 2)}
    for key in ("landing", "error", "release"):
        assert set(answer[key].values()) == {None}, key


def test_solved_exits_0_with_every_key(tmp_path):
    result = run(tmp_path, "plan hand-box --json")
    answer = one_object(result.stdout)
    assert result.returncode == 0
    assert result.stderr == ""
    assert list(tmp_path.iterdir()) == []  # nothing is written without --out
    assert_has_the_interface_s_keys(answer)
    assert answer["status"] == "solved"
    assert answer["nearest"] is None
    # A hand has no motion to be smoothed and sent.
    assert answer["landing"]["sent"] is None
    assert answer["error"]["sent"] is None
    target = answer["target"]
    for name in ("planned", "exact", "limit_surface"):
        landing = answer["landing"][name]
        assert set(landing) == {"x", "z", "theta"}
        assert landing["z"] == pytest.approx(target["z"], abs=1e-9)
    for name in ("planned", "exact"):
        error = answer["error"][name]
        assert set(error) == {"position", "angle"}
        miss = abs(answer["landing"][name]["x"] - target["x"])
        assert error["position"] == pytest.approx(miss, abs=1e-12)
        assert error["angle"] == 0.0  # open
    assert answer["error"]["exact"]["position"] <= 1e-4  # the corrections' aim
    release = answer["release"]
    assert release["command_time"] >= 0.0
    assert release["opening_time"] - release["command_time"] == pytest.approx(0.05)  # dwell
    assert release["detach_time"] - release["opening_time"] == pytest.approx(0.05)  # opening
    assert release["landing_time"] > release["detach_time"]


def test_out_of_reach_in_words_and_files(tmp_path):
    """Without --json: why and the nearest on stderr. With --out: the same object in plan.json."""
    said = run(tmp_path, "plan hand-box --target 5 0 free --out out")
    assert said.returncode == 3
    assert len(said.stderr.splitlines()) == 1
    answer = one_object((tmp_path / "out" / "plan.json").read_text())
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["plan.json"]
    assert_has_the_interface_s_keys(answer)
    assert answer["status"] == "out_of_reach"
    assert answer["binding"][0] in said.stderr
    assert f"{answer['nearest']['x']:.3f}" in said.stderr
    assert answer["nearest"]["theta"] is None


def test_height_out_of_reach_exits_3(tmp_path):
    """The hand rises to 1.1 m at most and throws 3 m/s up: 1.56 m is the highest of all."""
    result = run(tmp_path, "plan hand-box --target 0.3 1.7 free --json")
    answer = one_object(result.stdout)
    assert result.returncode == 3
    assert_has_the_interface_s_keys(answer)
    assert answer["status"] == "out_of_reach"
    assert "1.7" in answer["message"]


def test_nearest_is_possible_and_no_more_is():
    planner = Planner(load_scene("hand-box"))
    far = planner.plan(Pose(x=5.0, z=0.0))
    assert far.status == "out_of_reach"
    nearest = far.nearest
    # Braking from 3 m/s with 30 m/s^2 takes 0.15 m of the hand's room, so the object leaves
    # from x 0.25 m, z 0.95 m at 3 m/s each way at the very best.
    flight = (3.0 + math.sqrt(9.0 + 2 * 9.81 * 0.95)) / 9.81
    assert nearest.x < 0.25 + 3.0 * flight
    assert planner.plan(nearest.in_plane(nearest.x - 0.005, None)).status == "solved"
    assert planner.plan(nearest.in_plane(nearest.x + 0.01, None)).status == "out_of_reach"


@pytest.mark.parametrize(
    ("name", "hand", "opening", "target"),
    [
        # Held at its CoM at (0, 0.7) m; let go without moving it comes down through (0, 0).
        ("hand-box", {}, 2.0, Pose(x=0.0, z=0.0)),
        # Hanging at -90 degrees from a hand at (0, 0.7) m, its CoM 0.1 m below.
        (
            "hand-flip",
            {"x": (-0.001, 0.001), "z": (0.699, 0.701)},
            0.05,
            Pose(x=0.0, z=0.3, theta=-math.pi / 2),
        ),
    ],
)
def test_letting_go_at_rest_is_never_out_of_reach(name, hand, opening, target):
    """A slow gripper, a hand that can hardly move: still the start pose is a release."""
    scene = load_scene(name)
    scene = scene.replace(
        hand=dataclasses.replace(scene.hand, **hand),
        gripper=dataclasses.replace(scene.gripper, opening=opening),
        target=target,
    )
    assert Planner(scene).plan().status != "out_of_reach"


def test_no_motion_of_another_plan_stays_beside_plan_json(tmp_path):
    """A second plan into the same folder that finds no throw: motion.csv is not its own."""
    planner = Planner(load_scene("hand-box"))
    planner.plan().save(tmp_path, draw=False)
    assert (tmp_path / "motion.csv").exists()
    planner.plan(Pose(x=0.3, z=1.7)).save(tmp_path, draw=False)
    assert one_object((tmp_path / "plan.json").read_text())["status"] != "solved"
    assert not (tmp_path / "motion.csv").exists()


def test_simulate_writes_what_it_prints(tmp_path):
    result = run(tmp_path, "simulate drop --model sp --json --out out")
    assert result.returncode == 0
    assert one_object(result.stdout) == one_object((tmp_path / "out/simulation.json").read_text())


@pytest.mark.parametrize("model", ["sp", "all"])
def test_simulate_prints_one_object(model, tmp_path):
    result = run(tmp_path, f"simulate drop --model {model} --json")
    answer = one_object(result.stdout)
    assert result.returncode == 0
    assert result.stderr == ""
    assert list(tmp_path.iterdir()) == []
    assert set(answer) >= {"scene", "models"}
    assert answer["scene"] == "drop"
    assert list(answer["models"]) == ["sp"] or model == "all"
    assert len(answer["models"]) > 1 or model == "sp"
    for simulation in answer["models"].values():
        assert set(simulation["detach"]) == {"x", "z", "theta", "vx", "vz", "omega"}
        assert simulation["landing"] is None  # the scene gives no height
        assert set(simulation["events"]) == {"pivot", "slide"}
        assert simulation["time"] > 0.0
