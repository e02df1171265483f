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
import throwplan as tp

TURN = math.radians(20.0)
JOINTS = range(1, 8)


@pytest.fixture(scope="module")
def cup(tmp_path_factory) -> tuple[tp.Plan, Path]:
    """A plan of the cup in a plane turned by 20 degrees, and its folder."""
    folder = tmp_path_factory.mktemp("plans") / "cup"
    target = tp.Pose(x=0.92 * math.cos(TURN), y=0.92 * math.sin(TURN), z=0.22, theta=-math.pi / 2)
    plan = tp.plan("cup", target)
    assert plan.status == "solved", plan.message
    plan.save(folder, draw=False)
    return plan, folder


@pytest.fixture
def copied(cup, tmp_path) -> Path:
    """A copy of the plan's folder, to be spoilt."""
    return Path(shutil.copytree(cup[1], tmp_path / "cup"))


def edit(folder: Path, **changes) -> dict:
    """Sections or values of plan.json changed."""
    plan = json.loads((folder / "plan.json").read_text())
    for name, value in changes.items():
        plan[name] = plan[name] | value if isinstance(value, dict) else value
    (folder / "plan.json").write_text(json.dumps(plan))
    return plan


def test_franka_files_are_the_motion(cup, tmp_path, run, table) -> None:
    plan, folder = cup
    out = tmp_path / "franka"
    answer = run("export --json", folder / "plan.json", "--franka", out).json
    assert {path.name for path in out.iterdir()} == {
        *("joints.csv", "gripper.csv", "franka.json", "franka.txt")
    }
    sent, motion = table(out / "joints.csv"), table(folder / "motion.csv")
    names = ["t", *(f"q{j}" for j in JOINTS), *(f"dq{j}" for j in JOINTS)]
    assert list(sent.dtype.names) == names
    for name in names:
        np.testing.assert_allclose(sent[name], motion[name], rtol=0, atol=1e-10)
    assert np.allclose(np.diff(sent["t"]), 0.001, atol=1e-9)
    for j in JOINTS:
        assert sent[f"dq{j}"][0] == 0.0 and abs(sent[f"dq{j}"][-1]) < 1e-9
    # Not the last row twice.
    assert any(abs(sent[f"dq{j}"][-3]) > 0 for j in (2, 4, 6))
    command = plan.to_dict()["release"]["command_time"]
    assert answer["command_time"] == pytest.approx(command, abs=1e-12)
    assert answer["duration"] == pytest.approx(sent["t"][-1])
    (row,) = csv.DictReader((out / "gripper.csv").read_text().splitlines())
    assert row["command"] == "open"
    assert float(row["t"]) == pytest.approx(command, abs=1e-11)
    cycle, fraction = int(row["cycle"]), float(row["fraction"])
    assert 0.0 <= fraction < 1.0
    assert (cycle + fraction) * 0.001 == pytest.approx(command, abs=1e-9)


def test_franka_json_says_where_to_start_and_what_is_used(cup, tmp_path, run, table) -> None:
    run("export", cup[1], "--franka", tmp_path)
    facts, motion = (
        json.loads((tmp_path / "franka.json").read_text()),
        table(cup[1] / "motion.csv"),
    )
    start = [motion[f"q{j}"][0] for j in JOINTS]
    assert facts["start"] == pytest.approx(start, abs=1e-10)
    assert facts["start"][0] == pytest.approx(TURN)
    limits, sent = tp.load_scene("cup").arm.limits, table(tmp_path / "joints.csv")
    for j in (2, 4, 6):
        # Differences of positions as a controller sees them.
        position = np.concatenate([[sent[f"q{j}"][0]] * 3, sent[f"q{j}"]])
        third = position[3:] - 3 * position[2:-1] + 3 * position[1:-2] - position[:-3]
        # The file has 12 digits: a third difference of them is good to 0.01 rad/s^3.
        assert np.abs(third).max() / 1e-9 <= limits.jerk[j - 1] + 0.01
        assert np.abs(sent[f"dq{j}"]).max() <= limits.velocity[j - 1]
    text = (tmp_path / "franka.txt").read_text()
    assert f"{facts['start'][1]:.6f}" in text and f"row {facts['gripper']['cycle']}" in text


def read_bag(folder: Path) -> dict[str, list[tuple[int, str, object]]]:
    """All messages by topic, with the definitions that the bag itself holds."""
    from rosbags.highlevel import AnyReader

    found: dict[str, list[tuple[int, str, object]]] = {}
    with AnyReader([folder]) as reader:
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((time, connection.msgtype, message))
    return found


def test_an_arm_of_six_joints(copied, tmp_path, run) -> None:
    """The Panda with its last joint welded in its posture: the same throw, a joint less."""
    plan = json.loads((copied / "plan.json").read_text())
    arm = plan["definition"]["arm"]
    last = arm["dh"].pop()
    arm["posture"].pop()
    for joined in ("links", "capsules"):
        arm.pop(joined, None)
    for values in arm["limits"].values():
        if isinstance(values, list):
            values.pop()
    arm["tool"] |= {"xyz": [last["a"], 0.0, 0.0], "rpy": [last["alpha"], 0.0, 0.0]}
    arm["tool"]["rotation"] += math.pi / 4
    arm["name"] = "six"
    (copied / "plan.json").write_text(json.dumps(plan))
    assert run("export", copied, "--franka", tmp_path / "f", "--ros", tmp_path / "r").status == 0
    header = (tmp_path / "f" / "joints.csv").read_text().splitlines()[0].split(",")
    assert header == ["t", *(f"q{j}" for j in range(1, 7)), *(f"dq{j}" for j in range(1, 7))]
    assert len(json.loads((tmp_path / "f" / "franka.json").read_text())["start"]) == 6
    trajectory = read_bag(tmp_path / "r")["/joint_trajectory"][0][2]
    assert trajectory.joint_names == [f"six_joint{j}" for j in range(1, 7)]


def test_ros_bag_reads_back(cup, tmp_path, run, table) -> None:
    plan, folder = cup
    out = tmp_path / "bag"
    assert run("export", folder, "--ros", out).status == 0
    assert {path.name for path in out.iterdir()} == {"metadata.yaml", "throw.mcap"}
    bag = read_bag(out)
    assert set(bag) == {"/joint_trajectory", "/gripper_command"}
    ((time, kind, trajectory),) = bag["/joint_trajectory"]
    assert (time, kind) == (0, "trajectory_msgs/msg/JointTrajectory")
    assert trajectory.joint_names == [f"panda_joint{j}" for j in JOINTS]
    motion = table(folder / "motion.csv")
    assert len(trajectory.points) == len(motion)
    for name, prefix in (("positions", "q"), ("velocities", "dq"), ("accelerations", "ddq")):
        values = np.array([getattr(point, name) for point in trajectory.points])
        wanted = np.column_stack([motion[f"{prefix}{j}"] for j in JOINTS])
        np.testing.assert_allclose(values, wanted, rtol=0, atol=1e-9)
    stamps = [p.time_from_start.sec * 10**9 + p.time_from_start.nanosec for p in trajectory.points]
    assert stamps == [i * 10**6 for i in range(len(stamps))]
    ((time, kind, command),) = bag["/gripper_command"]
    assert kind == "control_msgs/msg/GripperCommand"
    assert time == pytest.approx(plan.to_dict()["release"]["command_time"] * 1e9, abs=1)
    assert (command.position, command.max_effort) == (0.08, 0.0)


def test_both_into_one_folder_and_again_with_other_names(cup, tmp_path, run) -> None:
    names = [f"arm_{j}" for j in range(7)]
    both = ["--franka", tmp_path, "--ros", tmp_path]
    for options in ([], ["--joint-names", *names, "--open-width", "0.05"]):
        assert run("export", cup[1], *both, *options).status == 0
    assert len(list(tmp_path.iterdir())) == 6
    bag = read_bag(tmp_path)
    assert bag["/joint_trajectory"][0][2].joint_names == names
    assert bag["/gripper_command"][0][2].position == 0.05


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("", "--franka DIR, --ros DIR"),
        ("--franka OUT --joint-names a", "--joint-names: only with --ros"),
        ("--ros OUT --joint-names a b", "--joint-names a b: must be 7 different names"),
        ("--ros OUT --joint-names a a b c d e f", "must be 7 different names"),
        ("--ros OUT --open-width -1", "--open-width -1: must be at least 0"),
    ],
)
def test_options_that_do_not_fit(options, words, cup, tmp_path, refused, untouched) -> None:
    untouched()
    assert words in refused("export", cup[1], *options.replace("OUT", str(tmp_path / "o")).split())


def test_without_the_extra_it_is_named(cup, tmp_path, refused, monkeypatch, untouched) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    untouched()
    assert "pip install rosbags" in refused("export", cup[1], "--ros", tmp_path / "r")


def test_a_folder_that_cannot_be_written(cup, tmp_path, refused) -> None:
    (tmp_path / "file").write_text("here")
    for option in ("--franka", "--ros"):
        err = refused("export", cup[1], option, tmp_path / "file")
        assert err.startswith(f"throwplan: {option} ")
    (tmp_path / "r" / "throw.mcap").mkdir(parents=True)
    err = refused("export", cup[1], "--franka", tmp_path / "f", "--ros", tmp_path / "r")
    assert "throw.mcap is a folder there" in err
    assert list((tmp_path / "f").iterdir()) == []


def test_what_holds_no_throw_for_a_robot(copied, saved, tmp_path, refused) -> None:
    to = ["--franka", tmp_path / "f"]
    assert "no [robot]" in refused("export", saved("hand-box"), *to)
    assert "no such file" in refused("export", tmp_path, *to)
    edit(copied, status="out_of_reach")
    assert "holds no throw" in refused("export", copied, *to)
    (copied / "plan.json").write_text("{")
    assert "is not JSON" in refused("export", copied, *to)
    assert not (tmp_path / "f").exists()


@pytest.mark.parametrize(
    ("column", "row", "change", "words"),
    [
        ("dq4", 1, 0.01, "does not begin at rest: joint 4"),
        ("dq4", -1, 0.01, "does not end at rest: joint 4"),
        ("ddq2", -1, 0.1, "does not end at rest: joint 2"),
        ("q2", 500, 1.9, "limit of joint 2 position broken"),
        ("dq6", 500, 3.0, "limit of joint 6 velocity broken"),
        ("ddq4", 500, 13.0, "limit of joint 4 acceleration broken"),
        ("q4", 300, "+1e-5", "joint 4's rates do not fit the samples"),
    ],
)
def test_edited_motion_is_not_sent(copied, tmp_path, refused, column, row, change, words) -> None:
    lines = list(csv.reader((copied / "motion.csv").read_text().splitlines()))
    at = lines[0].index(column)
    value = float(lines[row][at]) + float(change) if isinstance(change, str) else change
    lines[row][at] = repr(value)
    (copied / "motion.csv").write_text("\n".join(map(",".join, lines)) + "\n")
    assert words in refused("export", copied, "--franka", tmp_path / "f")
    assert not (tmp_path / "f").exists()


def test_edited_plans_throw_elsewhere(copied, tmp_path, refused) -> None:
    to = ["--franka", tmp_path / "f"]
    plan = json.loads((copied / "plan.json").read_text())
    edit(copied, release={"opening_time": plan["release"]["opening_time"] - 0.01})
    assert "the motion lands" in refused("export", copied, *to)
    edit(copied, release={"opening_time": 0.02})
    assert "the opening command would come 30.0 ms too early" in refused("export", copied, *to)
    plan["definition"]["target"] |= {"x": -0.92 * math.cos(0.1), "y": 0.92 * math.sin(0.1)}
    (copied / "plan.json").write_text(json.dumps(plan))
    assert "limit of joint 1 position broken" in refused("export", copied, *to)
