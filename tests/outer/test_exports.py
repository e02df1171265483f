"""Fails if what is exported is not the plan, number by number, or an edited plan is exported."""

from __future__ import annotations

import csv
import json
import math
import runpy
import shutil
import sys
import types
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

import numpy as np
import pytest
from builders import edit_plan

JOINTS = range(1, 8)


@pytest.fixture
def copied(turned, tmp_path) -> Path:
    """A copy of the plan's folder, to be spoilt."""
    return Path(shutil.copytree(turned[1], tmp_path / "cup"))


def test_franka_files_are_the_motion(turned, tmp_path, run, table) -> None:
    plan, folder = turned
    out = tmp_path / "franka"
    answer = run("export --json", folder / "plan.json", "--franka", out).json
    assert {path.name for path in out.iterdir()} == {
        *("joints.csv", "gripper.csv", "stops.csv", "franka.json", "franka.txt"),
        *("throw.cpp", "CMakeLists.txt"),
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
    (opening,) = answer["commands"]
    assert opening["command"] == "open" and opening["time"] == pytest.approx(command, abs=1e-12)
    assert answer["duration"] == pytest.approx(sent["t"][-1])
    (row,) = csv.DictReader((out / "gripper.csv").read_text().splitlines())
    assert row["command"] == "open"
    assert float(row["t"]) == pytest.approx(command, abs=1e-11)
    cycle, fraction = int(row["cycle"]), float(row["fraction"])
    assert 0.0 <= fraction < 1.0
    assert (cycle + fraction) * 0.001 == pytest.approx(command, abs=1e-9)
    start = json.loads((out / "franka.json").read_text())["start"]
    assert start == pytest.approx([motion[f"q{j}"][0] for j in JOINTS], abs=1e-10)
    assert start[0] == pytest.approx(math.radians(20.0))
    # Differences of positions as a controller sees them: 12 digits are good to 0.01 rad/s^3.
    limits = plan.scene.arm.limits
    for j in (2, 4, 6):
        third = np.diff(np.concatenate([[sent[f"q{j}"][0]] * 3, sent[f"q{j}"]]), 3)
        assert np.abs(third).max() / 1e-9 <= limits.jerk[j - 1] + 0.01
        assert np.abs(sent[f"dq{j}"]).max() <= limits.velocity[j - 1]


def read_bag(folder: Path) -> dict[str, list[tuple[int, str, object]]]:
    """All messages by topic, with the definitions that the bag itself holds."""
    from rosbags.highlevel import AnyReader

    found: dict[str, list[tuple[int, str, object]]] = {}
    with AnyReader([folder]) as reader:
        for connection, time, data in reader.messages():
            message = reader.deserialize(data, connection.msgtype)
            found.setdefault(connection.topic, []).append((time, connection.msgtype, message))
    return found


def test_ros_bag_reads_back(turned, tmp_path, run, table) -> None:
    plan, folder = turned
    out = tmp_path / "bag"
    assert run("export", folder, "--ros", out).status == 0
    assert {path.name for path in out.iterdir()} == {"metadata.yaml", "throw.mcap", "throw_node.py"}
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


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("", "--franka DIR, --ros DIR"),
        ("--ros OUT --joint-names a b", "--joint-names a b: must be 7 different names"),
        ("--ros OUT --open-width 80", "--open-width = 80: must be at most 0.5 m"),
    ],
)
def test_options_that_do_not_fit(options, words, turned, tmp_path, refused, untouched) -> None:
    untouched()
    options = options.replace("OUT", str(tmp_path / "o")).split()
    assert words in refused("export", turned[1], *options)


@pytest.mark.parametrize(
    ("column", "row", "change", "words"),
    [
        ("dq4", 1, 0.01, "does not begin at rest: joint 4"),
        ("ddq2", -1, 0.1, "does not end at rest: joint 2"),
        ("q2", 500, 1.9, "joint 2 position: 1.9 rad at 499 ms, limit 1.763 rad"),
        ("dq6", 500, 3.0, "joint 6 velocity: 3 rad/s at 499 ms, limit 2.61 rad/s"),
        ("ddq4", 500, 13.0, "joint 4 acceleration: 13 rad/s^2 at 499 ms, limit 12.5 rad/s^2"),
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
    edit_plan(copied, release={"opening_time": plan["release"]["opening_time"] - 0.04})
    assert "mm from the target, tolerance 2 mm" in refused("export", copied, *to)
    edit_plan(copied, release={"opening_time": 0.02})
    assert "the opening command would come 30.0 ms too early" in refused("export", copied, *to)
    beyond = {"x": -0.92 * math.cos(0.1), "y": 0.92 * math.sin(0.1)}
    edit_plan(copied, release=plan["release"], definition={"target": beyond})
    assert "joint 1 position: outside its limits" in refused("export", copied, *to)


# The programs beside the files.


@pytest.fixture
def node_of(tmp_path, monkeypatch):
    """A function that runs the node of the bag in `tmp_path`; returns the goals that it sent."""

    def running() -> list[tuple[str, Any, float]]:
        sent: list[tuple[str, Any, float]] = []
        for name, module in ros_modules(tmp_path, sent).items():
            monkeypatch.setitem(sys.modules, name, module)
        monkeypatch.setattr("builtins.input", lambda words: "")
        monkeypatch.setattr("time.sleep", lambda seconds: None)
        runpy.run_path(str(tmp_path / "throw_node.py"), run_name="__main__")
        return sent

    return running


def ros_modules(bag: Path, sent: list[tuple[str, Any, float]]) -> dict[str, Any]:
    """Stand-ins for what throw_node.py imports of ROS 2; goals go to `sent`, with their times."""
    names = ["control_msgs.action", "control_msgs.msg", "trajectory_msgs.msg", "rosbag2_py"]
    names += ["rclpy", *(f"rclpy.{part}" for part in ("action", "duration", "node"))]
    found = {name: MagicMock() for name in (*names, "rclpy.serialization")}
    found |= {name.split(".")[0]: MagicMock() for name in names if name.endswith("msg")}
    rows = [(topic, one[2], one[0]) for topic, all_ in read_bag(bag).items() for one in all_]
    ticks: list[float] = []

    class Time(float):
        def __new__(cls, seconds):
            return super().__new__(cls, seconds)

        def __add__(self, other):
            return Time(float(self) + other)

        def to_msg(self):
            return float(self)

    class Node:
        def __init__(self, name):
            self.known = {}

        def declare_parameter(self, name, value):
            self.known[name] = message(value=value)

        def get_parameter(self, name):
            return self.known[name]

        def get_clock(self):
            return message(now=lambda: ticks.append(0.0) or Time(1e-3 * len(ticks)))

    def client(node, kind, name):
        done = MagicMock()
        done.result().get_result_async().result().result.error_code = 0
        send = lambda goal: sent.append((name, goal, 1e-3 * len(ticks))) or done  # noqa: E731
        return message(wait_for_server=lambda timeout_sec: True, send_goal_async=send)

    message = types.SimpleNamespace
    for action in ("FollowJointTrajectory", "GripperCommand"):
        kind = message(Goal=message, Result=message(SUCCESSFUL=0))
        setattr(found["control_msgs.action"], action, kind)
    for name in ("JointTrajectory", "JointTrajectoryPoint"):
        setattr(found["trajectory_msgs.msg"], name, message)
    found["rclpy.action"].ActionClient, found["rclpy.node"].Node = client, Node
    found["rclpy.duration"].Duration = Time
    found["rclpy.serialization"].deserialize_message = lambda data, kind: data
    found["rosbag2_py"].SequentialReader = lambda: MagicMock(
        has_next=lambda: bool(rows), read_next=lambda: rows.pop(0)
    )
    return found


def test_a_cycles_bag_closes_at_each_pick_and_opens_for_each_throw(
    cycled, tmp_path, run, table, node_of
) -> None:
    """The bag is motion.csv, number by number; the node sends its commands on the same clock."""
    done = run("export", cycled, "--ros", tmp_path, "--open-width", "0.06", "--json")
    assert done.status == 0
    motion, steps = table(cycled / "motion.csv"), json.loads((cycled / "cycle.json").read_text())
    bag = read_bag(tmp_path)
    ((_, _, trajectory),) = bag["/joint_trajectory"]
    values = np.array([point.positions for point in trajectory.points])
    wanted = np.column_stack([motion[f"q{j}"] for j in JOINTS])
    np.testing.assert_allclose(values, wanted, rtol=0, atol=1e-9)
    # The gripper as motion.csv has it, a sample each.
    times = 1e-9 * np.array([time for time, _, _ in bag["/gripper_command"]])
    closing = [command.position == 0.0 for _, _, command in bag["/gripper_command"]]
    assert closing == [True, False] * 2
    last = np.searchsorted(times, motion["t"] + 1e-9) - 1
    np.testing.assert_array_equal(np.array([*closing, False])[last], motion["gripper"] == 1.0)
    for (_, _, close), (_, _, opened), step in zip(
        bag["/gripper_command"][::2], bag["/gripper_command"][1::2], steps["steps"], strict=True
    ):
        force = step["definition"]["gripper"]["force"]
        assert (close.max_effort, opened.position) == (force, 0.06)
    planned = [step[key] for step in steps["steps"] for key in ("reach_time", "command_time")]
    assert [one["time"] for one in done.json["commands"]] == planned
    (_, _, _), (_, throw, _), *commands = node_of()
    sent = np.array([when - throw.trajectory.header.stamp for _, _, when in commands])
    np.testing.assert_allclose(sent, times, atol=2.1e-3)
