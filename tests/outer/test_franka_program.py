"""Fails if the files of `export --franka` are not the motion, or its C++ program sends another.

The program is built against a stand-in for libfranka (tests/data/franka) that writes down what arm
and gripper are sent; its hand is described by environment variables.
"""

from __future__ import annotations

import csv
import json
import os
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from throwplan.robots import commands_of, export, joint_motion

JOINTS = range(1, 8)


def rows_of(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file."""
    return list(csv.DictReader(path.read_text().splitlines()))


def test_a_cycles_franka_files_have_its_commands_and_its_stops(
    cycled, tmp_path, run, table
) -> None:
    assert run("export", cycled, "--franka", tmp_path).status == 0
    steps = json.loads((cycled / "cycle.json").read_text())["steps"]
    rows = rows_of(tmp_path / "gripper.csv")
    assert [row["command"] for row in rows] == ["grasp", "open"] * 2
    times = [step[key] for step in steps for key in ("reach_time", "command_time")]
    assert [float(row["t"]) for row in rows] == pytest.approx(times, abs=1e-9)
    for row, step in zip(rows[::2], steps, strict=True):
        scene = step["definition"]
        assert step["pick"] in row["object"]
        assert float(row["width"]) == scene["object"]["width"]
        assert float(row["force"]) == scene["gripper"]["force"]
        # While the arm still waits.
        assert step["reach_time"] < 0.001 * int(row["check"]) < step["held_time"]
    sent, stops = table(tmp_path / "joints.csv"), table(tmp_path / "stops.csv")
    begins, first, count = np.unique(stops["cycle"].astype(int), True, return_counts=True)
    last = first + count - 1
    # From the first grasp until the last object has left the hand.
    assert begins[0] == 0 and 0.001 * begins[-1] > steps[-1]["detach_time"]
    for j in JOINTS:
        q = stops[f"q{j}"]
        np.testing.assert_array_equal(q[first], sent[f"q{j}"][begins])
        assert np.abs(q[last] - q[last - 1]).max() < 1e-6


@pytest.fixture(scope="module")
def program_of(turned, cycled, tmp_path_factory) -> Callable[[str], Path]:
    """A function that exports a plan or a cycle and builds its program; the folder."""
    if shutil.which("g++") is None:
        pytest.skip("needs a C++ compiler")
    known = dict[str, Path]()

    def built(name: str) -> Path:
        if name not in known:
            folder = known[name] = tmp_path_factory.mktemp(name)
            export({"plan": turned[1], "cycle": cycled}[name], franka=folder)
            stand_in = Path(__file__).parent.parent / "data" / "franka"
            flags = ["-std=c++17", "-Wall", "-Wextra", "-Werror", "-pthread", "-I", str(stand_in)]
            command = ["g++", *flags, str(folder / "throw.cpp"), "-o", str(folder / "throw")]
            subprocess.run(command, check=True)
        return known[name]

    return built


@pytest.fixture
def thrown(tmp_path, program_of) -> Callable[..., tuple[Any, Any, Any]]:
    """A function that runs a program: what it said, the rows (N, 7) of each of its motions, to the
    start pose and the one that throws, and its orders to the gripper."""

    def running(name: str, **hand: object) -> tuple[Any, Any, Any]:
        folder = program_of(name)
        for file in ("sent.csv", "orders.csv"):
            (tmp_path / file).unlink(missing_ok=True)
        said = subprocess.run(
            [folder / "throw", "host", folder],
            cwd=tmp_path,
            env=os.environ | {name: str(value) for name, value in hand.items()},
            input="\n\n",
            capture_output=True,
            text=True,
            check=False,
        )
        sent, ordered = tmp_path / "sent.csv", tmp_path / "orders.csv"
        motions = sent.read_text().split("motion,")[1:] if sent.exists() else []
        # It throws without limiter, with the filter open.
        assert all(motion.startswith("0,1000\n") for motion in motions[1:])
        rows = [
            np.array([[float(v) for v in row.split(",")[:7]] for row in motion.splitlines()[1:]])
            for motion in motions
        ]
        orders = list(csv.reader(ordered.read_text().splitlines())) if ordered.exists() else []
        return said, rows, orders

    return running


@pytest.mark.slow
def test_a_plan_is_sent_and_the_gripper_opens_in_its_cycle(program_of, thrown) -> None:
    said, (way, sent), ((kind, width, *_, cycles),) = thrown("plan")
    assert said.returncode == 0 and said.stderr == ""
    rows = np.loadtxt(program_of("plan") / "joints.csv", delimiter=",", skiprows=1)[:, 1:8]
    np.testing.assert_allclose(sent, rows, atol=1e-9)
    # Slowly to the start pose, from where the arm is.
    np.testing.assert_allclose(way[[0, -1]], [np.zeros(7), rows[0]], atol=1e-12)
    assert np.abs(np.diff(way, axis=0)).max() <= 0.2 * 1e-3 * (1 + 1e-6)
    (row,) = rows_of(program_of("plan") / "gripper.csv")
    assert (kind, float(width)) == ("move", 0.08) and int(cycles) >= int(row["cycle"])
    # A gripper that stays closed; after the opening the plan is the brake.
    said, (_, sent), _ = thrown("plan", OPENS=0)
    assert said.returncode == 1 and "did not open, is 20 mm wide" in said.stderr
    assert len(sent) == len(rows) and np.abs(sent[-1] - sent[-2]).max() < 1e-6


@pytest.mark.slow
def test_parts_are_picked_and_thrown(cycled, thrown) -> None:
    said, (_, sent), ((first, *_), *orders) = thrown("cycle", HOLDS=0)
    assert said.returncode == 0 and said.stderr == ""
    motion = joint_motion(cycled)
    np.testing.assert_allclose(sent, motion.q, atol=1e-9)
    # The hand opens on the way; each command goes out in its cycle, not before.
    assert first == "move" and [kind for kind, *_ in orders] == ["grasp", "move"] * 2
    commands = commands_of(motion)
    ends = [*(command.cycle for command in commands[1:]), len(sent)]
    for command, (_, *shape, cycles), end in zip(commands, orders, ends, strict=True):
        values = (command.width, command.tolerance, 0.2, command.force)
        assert [float(value) for value in shape] == pytest.approx(values)
        assert command.cycle <= int(cycles) < end
    for hand, words in (({"HOLDS": 1}, "holds an object"), ({"HOLDS": 0, "OPENS": 0}, "not open")):
        said, *_ = thrown("cycle", **hand)
        assert said.returncode == 1 and words in said.stderr


@pytest.mark.slow
@pytest.mark.parametrize(
    ("hand", "number", "words", "kind"),
    [
        ({"GRASPS": 1}, 2, "was not grasped: the gripper is 0 mm wide and holds nothing", "grasp"),
        ({"DROPS": 2, "AFTER": 700}, 2, "was lost: the gripper is 0 mm wide", "grasp"),
        # The first order to open comes before the motion.
        ({"OPENS": 2}, 2, "was not thrown: the gripper did not open, is 20 mm wide", "move"),
        ({"FAILS": 1000}, 1, "the gripper's connection failed", "grasp"),
    ],
)
def test_what_goes_wrong_with_an_object_stops_the_arm(
    cycled, program_of, thrown, hand, number, words, kind
) -> None:
    said, (_, sent), (_, *orders) = thrown("cycle", HOLDS=0, **hand)
    assert said.returncode == 1 and words in said.stderr and said.stderr.count("\n") == 1
    motion = joint_motion(cycled)
    carry = motion.carries[number - 1]
    assert said.stderr.startswith(carry.pick) or "FAILS" in hand
    # The gripper gets no further command.
    assert len(orders) == 2 * number - (kind == "grasp") and orders[-1][0] == kind
    # The rows of the motion, then those of a stop, to rest within all limits.
    stops = np.loadtxt(program_of("cycle") / "stops.csv", delimiter=",", skiprows=1)
    brakes = {int(begin): stops[stops[:, 0] == begin, 1:] for begin in np.unique(stops[:, 0])}
    (begin,) = (
        begin
        for begin, brake in brakes.items()
        if begin + len(brake) == len(sent) and np.abs(sent[begin:] - brake).max() < 1e-9
    )
    np.testing.assert_allclose(sent[:begin], motion.q[:begin], atol=1e-9)
    last = carry.detach_time + 0.4 if kind == "move" else carry.command_time
    assert carry.reach < begin < 1e3 * last
    values, limits = sent, motion.arm.limits
    for most in (limits.velocity, limits.acceleration, limits.jerk):
        values = np.diff(values, axis=0) / 1e-3
        # The stand-in writes 12 digits.
        assert (np.abs(values) <= np.array(most) * (1 + 1e-6) + 0.01).all()
    assert np.abs(sent[-1] - sent[-2]).max() < 1e-6
