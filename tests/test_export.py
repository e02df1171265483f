"""`throwplan export`: what is written for libfranka and ROS 2 is the plan, number by number."""

from __future__ import annotations

import csv
import json
import math
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest
from throwplan import Planner, Pose, load_scene
from throwplan.planner.cli import main
from throwplan.planner.robot.export_ros import GRIPPER_TYPE, TRAJECTORY_TYPE

TURN = math.radians(20.0)


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    """A plan of the cup in a plane turned by 20 degrees, and its folder."""
    folder = tmp_path_factory.mktemp("plans") / "cup"
    target = Pose(
        x=0.92 * math.cos(TURN), y=0.92 * math.sin(TURN), z=0.22, theta=math.radians(-90.0)
    )
    plan = Planner(load_scene("cup")).plan(target)
    assert plan.solved, plan.message
    plan.save(folder, draw=False)
    return plan, folder


@pytest.fixture
def copied(saved, tmp_path):
    """A copy of the plan's folder, to be spoilt."""
    return Path(shutil.copytree(saved[1], tmp_path / "cup"))


def motion_columns(folder: Path) -> dict[str, np.ndarray]:
    table = np.genfromtxt(folder / "motion.csv", delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names}


def change(folder: Path, column: str, row: int, value: float) -> None:
    """One cell of motion.csv."""
    lines = list(csv.reader((folder / "motion.csv").read_text().splitlines()))
    lines[row][lines[0].index(column)] = repr(value)
    (folder / "motion.csv").write_text("\n".join(map(",".join, lines)) + "\n")


def refused(capsys, *words: object) -> str:
    """The one line on stderr of a command that is refused."""
    assert main([str(word) for word in words]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert len(err.splitlines()) == 1
    return err


def test_franka_files_are_the_motion(saved, tmp_path, capsys):
    plan, folder = saved
    out = tmp_path / "franka"
    assert main(["export", str(folder / "plan.json"), "--franka", str(out), "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert {path.name for path in out.iterdir()} == {
        "joints.csv",
        "gripper.csv",
        "franka.json",
        "franka.txt",
    }
    header = (out / "joints.csv").read_text().splitlines()[0].split(",")
    assert header == [
        "t",
        *(f"q{j}" for j in range(1, 8)),
        *(f"dq{j}" for j in range(1, 8)),
    ]
    motion = motion_columns(folder)
    sent = np.genfromtxt(out / "joints.csv", delimiter=",", names=True)
    for name in header:
        np.testing.assert_allclose(sent[name], motion[name], rtol=0, atol=1e-10)
    assert np.allclose(np.diff(sent["t"]), 0.001, atol=1e-9)
    for j in range(1, 8):
        assert sent[f"dq{j}"][0] == 0.0
        assert abs(sent[f"dq{j}"][-1]) < 1e-9
    # Not the last row twice.
    moves = [f"dq{j}" for j in (2, 4, 6)]
    assert any(abs(sent[name][-3]) > 0 for name in moves)
    release = plan.to_dict()["release"]
    assert answer["command_time"] == pytest.approx(release["command_time"], abs=1e-12)
    assert answer["duration"] == pytest.approx(sent["t"][-1])


def test_franka_s_gripper_command_has_its_cycle(saved, tmp_path):
    plan, folder = saved
    main(["export", str(folder), "--franka", str(tmp_path)])
    rows = list(csv.DictReader((tmp_path / "gripper.csv").read_text().splitlines()))
    assert len(rows) == 1
    command = plan.to_dict()["release"]["command_time"]
    assert rows[0]["command"] == "open"
    assert float(rows[0]["t"]) == pytest.approx(command, abs=1e-11)
    cycle, fraction = int(rows[0]["cycle"]), float(rows[0]["fraction"])
    assert 0.0 <= fraction < 1.0
    assert (cycle + fraction) * 0.001 == pytest.approx(command, abs=1e-9)


def test_franka_json_says_where_to_start_and_what_is_used(saved, tmp_path):
    _, folder = saved
    main(["export", str(folder), "--franka", str(tmp_path)])
    facts = json.loads((tmp_path / "franka.json").read_text())
    motion = motion_columns(folder)
    start = [motion[f"q{j}"][0] for j in range(1, 8)]
    assert facts["start"] == pytest.approx(start, abs=1e-10)
    assert facts["start"][0] == pytest.approx(TURN)
    limits = load_scene("cup").arm.limits
    for j in (2, 4, 6):
        # Differences of positions as a controller sees them, by another way than the code's.
        position = np.concatenate([[motion[f"q{j}"][0]] * 3, motion[f"q{j}"]])
        third = position[3:] - 3 * position[2:-1] + 3 * position[1:-2] - position[:-3]
        share = np.abs(third).max() / 1e-9 / limits.jerk[j - 1]
        # motion.csv has 12 digits: a third difference of them is good to 0.01 rad/s^3.
        assert facts["limits_used"]["jerk"][j - 1] >= share - 1e-4
        fastest = np.abs(motion[f"dq{j}"]).max() / limits.velocity[j - 1]
        assert facts["limits_used"]["velocity"][j - 1] == pytest.approx(fastest, rel=1e-3)
    for name, shares in facts["limits_used"].items():
        assert max(shares) <= 1.0, name
        assert shares[2] == 0.0  # a joint that keeps its posture, in the middle of its range
    text = (tmp_path / "franka.txt").read_text()
    assert f"{facts['start'][1]:.6f}" in text
    assert f"row {facts['gripper']['cycle']}" in text


def test_arm_of_six_joints(copied, tmp_path):
    """The Panda with its last joint welded in its posture: the same throw, a joint less."""
    plan = json.loads((copied / "plan.json").read_text())
    arm = plan["definition"]["arm"]
    last = arm["dh"].pop()
    arm["posture"].pop()
    arm.pop("links", None)
    for values in arm["limits"].values():
        values.pop()
    arm["tool"] |= {"xyz": [last["a"], 0.0, 0.0], "rpy": [last["alpha"], 0.0, 0.0]}
    arm["tool"]["rotation"] += math.pi / 4
    arm["name"] = "six"
    (copied / "plan.json").write_text(json.dumps(plan))
    words = ["--franka", str(tmp_path / "f"), "--ros", str(tmp_path / "r")]
    assert main(["export", str(copied), *words]) == 0
    header = (tmp_path / "f" / "joints.csv").read_text().splitlines()[0].split(",")
    assert header == ["t", *(f"q{j}" for j in range(1, 7)), *(f"dq{j}" for j in range(1, 7))]
    assert len(json.loads((tmp_path / "f" / "franka.json").read_text())["start"]) == 6
    trajectory = read_bag(tmp_path / "r")["/joint_trajectory"][0][2]
    assert trajectory.joint_names == [f"six_joint{j}" for j in range(1, 7)]


def read_bag(folder: Path) -> dict[str, list[tuple[int, str, object]]]:
    """All messages by topic, with the definitions that the bag itself holds."""
    from rosbags.highlevel import AnyReader

    found: dict[str, list[tuple[int, str, object]]] = {}
    with AnyReader([folder]) as reader:
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((time, connection.msgtype, message))
    return found


def test_ros_bag_reads_back(saved, tmp_path):
    plan, folder = saved
    out = tmp_path / "bag"
    assert main(["export", str(folder), "--ros", str(out)]) == 0
    assert {path.name for path in out.iterdir()} == {"metadata.yaml", "throw.mcap"}
    bag = read_bag(out)
    assert set(bag) == {"/joint_trajectory", "/gripper_command"}
    ((time, kind, trajectory),) = bag["/joint_trajectory"]
    assert (time, kind) == (0, TRAJECTORY_TYPE)
    assert trajectory.joint_names == [f"panda_joint{j}" for j in range(1, 8)]
    motion = motion_columns(folder)
    assert len(trajectory.points) == len(motion["t"])
    for name, prefix in (("positions", "q"), ("velocities", "dq"), ("accelerations", "ddq")):
        values = np.array([getattr(point, name) for point in trajectory.points])
        wanted = np.column_stack([motion[f"{prefix}{j}"] for j in range(1, 8)])
        np.testing.assert_allclose(values, wanted, rtol=0, atol=1e-9)
    stamps = [
        point.time_from_start.sec * 10**9 + point.time_from_start.nanosec
        for point in trajectory.points
    ]
    assert stamps == [i * 10**6 for i in range(len(stamps))]
    ((time, kind, command),) = bag["/gripper_command"]
    assert kind == GRIPPER_TYPE
    assert time == pytest.approx(plan.to_dict()["release"]["command_time"] * 1e9, abs=1)
    assert (command.position, command.max_effort) == (0.08, 0.0)


def test_ros_names_and_width_can_be_given(saved, tmp_path):
    names = [f"arm_{j}" for j in range(7)]
    words = ["--joint-names", *names, "--open-width", "0.05"]
    assert main(["export", str(saved[1]), "--ros", str(tmp_path / "bag"), *words]) == 0
    bag = read_bag(tmp_path / "bag")
    assert bag["/joint_trajectory"][0][2].joint_names == names
    assert bag["/gripper_command"][0][2].position == 0.05


def test_both_into_one_folder_and_again(saved, tmp_path):
    for _ in range(2):
        words = ["--franka", str(tmp_path), "--ros", str(tmp_path)]
        assert main(["export", str(saved[1]), *words]) == 0
    assert len(list(tmp_path.iterdir())) == 6
    assert set(read_bag(tmp_path)) == {"/joint_trajectory", "/gripper_command"}


def test_options_that_do_not_fit(saved, tmp_path, capsys):
    folder = saved[1]
    assert "--franka DIR, --ros DIR" in refused(capsys, "export", folder)
    err = refused(capsys, "export", folder, "--franka", tmp_path / "f", "--joint-names", "a")
    assert "--joint-names: only with --ros" in err
    err = refused(capsys, "export", folder, "--ros", tmp_path / "r", "--joint-names", "a", "b")
    assert "--joint-names a b: must be 7 different names" in err
    err = refused(capsys, "export", folder, "--ros", tmp_path / "r", "--joint-names", *"aabcdef")
    assert "must be 7 different names" in err
    err = refused(capsys, "export", folder, "--ros", tmp_path / "r", "--open-width", "-1")
    assert "--open-width -1: must be at least 0" in err
    assert list(tmp_path.iterdir()) == []


def test_missing_extra(saved, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    err = refused(capsys, "export", saved[1], "--ros", tmp_path / "r")
    assert "pip install 'throwplan[ros]'" in err
    assert list(tmp_path.iterdir()) == []


def test_folder_that_cannot_be_written(saved, tmp_path, capsys):
    (tmp_path / "file").write_text("here")
    for option in ("--franka", "--ros"):
        err = refused(capsys, "export", saved[1], option, tmp_path / "file")
        assert err.startswith(f"throwplan: {option} ")
    (tmp_path / "r" / "throw.mcap").mkdir(parents=True)
    err = refused(capsys, "export", saved[1], "--franka", tmp_path / "f", "--ros", tmp_path / "r")
    assert "throw.mcap is a folder there" in err
    assert list((tmp_path / "f").iterdir()) == []


def test_hand_s_plan_has_no_joints(tmp_path, capsys):
    plan = Planner(load_scene("hand-box")).plan()
    plan.save(tmp_path / "hand", draw=False)
    err = refused(capsys, "export", tmp_path / "hand", "--franka", tmp_path / "f")
    assert "no [robot]" in err
    assert not (tmp_path / "f").exists()


def test_no_plan(saved, tmp_path, capsys):
    assert "no such file" in refused(capsys, "export", tmp_path, "--franka", tmp_path / "f")
    plan = json.loads((saved[1] / "plan.json").read_text())
    (tmp_path / "plan.json").write_text(json.dumps(plan | {"status": "out_of_reach"}))
    assert "holds no throw" in refused(capsys, "export", tmp_path, "--franka", tmp_path / "f")
    (tmp_path / "plan.json").write_text("{")
    assert "is not JSON" in refused(capsys, "export", tmp_path, "--franka", tmp_path / "f")


@pytest.mark.parametrize(
    ("column", "row", "value", "words"),
    [
        ("dq4", 1, 0.01, "does not begin at rest: joint 4"),
        ("dq4", -1, 0.01, "does not end at rest: joint 4"),
        ("ddq2", -1, 0.1, "does not end at rest: joint 2"),
        ("q2", 500, 1.9, "limit of joint 2 position broken"),
        ("dq6", 500, 3.0, "limit of joint 6 velocity broken"),
        ("ddq4", 500, 13.0, "limit of joint 4 acceleration broken"),
    ],
)
def test_edited_motion_is_not_sent(copied, tmp_path, capsys, column, row, value, words):
    change(copied, column, row, value)
    err = refused(capsys, "export", copied, "--franka", tmp_path / "f")
    assert f"not sent, {words}" in err or f"not sent, the motion {words}" in err
    assert not (tmp_path / "f").exists()


def test_edited_rates_must_be_those_of_the_positions(copied, tmp_path, capsys):
    at = motion_columns(copied)["q4"][299]
    change(copied, "q4", 300, float(at) + 1e-5)
    err = refused(capsys, "export", copied, "--franka", tmp_path / "f")
    assert "joint 4's rates do not fit the samples" in err


def test_edited_times_of_the_opening_throw_elsewhere(copied, tmp_path, capsys):
    plan = json.loads((copied / "plan.json").read_text())
    plan["release"]["opening_time"] -= 0.01
    (copied / "plan.json").write_text(json.dumps(plan))
    err = refused(capsys, "export", copied, "--franka", tmp_path / "f")
    assert "the motion lands" in err
    plan["release"]["opening_time"] = 0.02
    (copied / "plan.json").write_text(json.dumps(plan))
    err = refused(capsys, "export", copied, "--franka", tmp_path / "f")
    assert "the opening command would come 30.0 ms too early" in err


def test_edited_azimuth_outside_the_joint(copied, tmp_path, capsys):
    plan = json.loads((copied / "plan.json").read_text())
    target = plan["definition"]["target"]
    target["x"], target["y"] = -0.92 * math.cos(0.1), 0.92 * math.sin(0.1)
    (copied / "plan.json").write_text(json.dumps(plan))
    err = refused(capsys, "export", copied, "--franka", tmp_path / "f")
    assert "limit of joint 1 position broken" in err
