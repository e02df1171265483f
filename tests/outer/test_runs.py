"""`throwplan run` and `correct`: what is refused before a robot moves, and what a lag teaches."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import socket
import threading
import types
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter
from simulated_robot import BINDING
from throwplan.planner.result import SentMotion
from throwplan.planner.verdict import verdict_on
from throwplan.problems import InputError, Obstacle
from throwplan.problems.arm_files import load_arm
from throwplan.robots import (
    Franka,
    GripperState,
    Recording,
    approach,
    corrected,
    joint_motion,
    read_recording,
)

TICK = 0.001
#: The usual pose of an FR3.
HOME = np.array([0.0, 0.0, 0.0, -1.57, 0.0, 1.57, 0.785])


@pytest.fixture(scope="module")
def plan(saved) -> Path:
    """The folder of a plan of an FR3."""
    return saved("fr3")


def lagging(motion: SentMotion, still: float = 0.5, spring: float = 4500.0) -> Recording:
    """What an arm records whose joints are pulled to what is sent by springs, damped by far.

    As franky-sim's are: ddq = 4500 (sent - q) - 450 dq, a lag of 0.1 s.
    """
    after = round(still / TICK)
    sent = np.vstack([motion.q, np.repeat(motion.q[-1:], after, axis=0)])
    numerator, denominator, _ = cont2discrete(([spring], [1.0, 450.0, spring]), TICK)
    q = sent[0] + lfilter(numerator.ravel(), denominator, sent - sent[0], axis=0)
    return Recording(TICK * np.arange(len(sent)), q, sent, (motion.throw.command_time,))


def errors(recording: Recording, motion: SentMotion) -> np.ndarray:
    """Landing off the target: [m], [rad]."""
    error = recording.to_dict(motion)["error"]
    return np.array([error["position"], error["angle"]])


def test_a_motion_that_is_followed_lands_as_planned(plan) -> None:
    motion = joint_motion(plan)
    recording = Recording(motion.times, motion.q, motion.q, (motion.throw.command_time,))
    assert (errors(recording, motion) < [1e-4, math.radians(0.05)]).all()


@pytest.mark.parametrize("rest", [0, 500])
def test_a_measured_throw_may_use_up_the_clearances_of_its_plan(plan, rest) -> None:
    """Also when the recording ends with the motion, before the bar has landed."""
    throw = (motion := joint_motion(plan)).throw
    workspace = throw.scene.workspace.changed(palm_clearance=0.2)
    roomy = throw.in_scene(throw.scene.changed(workspace=workspace))
    assert verdict_on(roomy).broken and not verdict_on(throw).broken
    times = TICK * np.arange(len(motion.q) + rest)
    q = np.pad(motion.q, ((0, rest), (0, 0)), "edge")
    recording = Recording(times, q, q, (throw.command_time,))
    seen = recording.to_dict(SentMotion.of(roomy))
    assert seen["succeeds"] and not seen["findings"]


@pytest.mark.slow
def test_a_lag_is_learnt_in_three_runs_inside_all_limits(plan) -> None:
    motion = joint_motion(plan)
    sent, found = motion, []
    limits = motion.arm.limits
    for _ in range(3):
        recording = lagging(sent)
        found.append(errors(recording, motion))
        sent, expected = corrected(motion, recording)
        assert abs(expected.miss()[0]) < 1e-3 and abs(expected.miss()[1]) < math.radians(0.5)
        most = limits.velocity, limits.acceleration, limits.jerk
        for values, bound in zip(sent.samples.rows, most, strict=True):
            rates = np.abs(np.diff(values, axis=0)).max(axis=0) / TICK
            assert (rates <= np.array(bound) * (1 + 1e-6)).all()
        assert (sent.q >= limits.position_min).all() and (sent.q <= limits.position_max).all()
        assert not sent.samples.dq[[0, -1]].any()
    assert found[0][0] > 0.05
    assert (found[2] < found[0] / 10).all()


def test_noise_of_the_encoders_moves_the_landing_little(plan) -> None:
    motion = joint_motion(plan)
    recording = lagging(motion)
    noise = 1e-5 * np.random.default_rng(0).standard_normal(recording.q.shape)
    noisy = dataclasses.replace(recording, q=recording.q + noise)
    off = np.abs(errors(noisy, motion) - errors(recording, motion))
    assert (off < [1e-3, math.radians(1.0)]).all()


def test_correct_writes_what_to_send_next(plan, tmp_path, run, table) -> None:
    motion = joint_motion(plan)
    recording = lagging(motion)
    recording.save(tmp_path / "run.csv")
    said = run("correct --json", plan, tmp_path / "run.csv", "--out", tmp_path / "next").json
    position, angle = errors(recording, motion)
    assert said["recorded"]["error"] == pytest.approx({"position": position, "angle": angle}, 1e-4)
    assert position > 0.05
    assert said["expected"]["position"] < 0.002
    sent = table(tmp_path / "next" / "joints.csv")
    assert sent["q2"][0] == pytest.approx(said["motion"]["start"][1], abs=1e-9)
    shown = run("run --dry --json", plan, "--after", tmp_path / "run.csv").json
    assert {key: shown[key] for key in said["motion"]} == said["motion"]


def plain(recording: Recording, path: Path, every: int, clock: float = 0.0) -> Path:
    """A CSV of joints sent and measured only, every so many milliseconds."""
    rows = np.column_stack([recording.times + clock, recording.q, recording.sent])[::every]
    count = recording.q.shape[1]
    names = ["t", *(f"{name}{j + 1}" for name in ("q", "sent") for j in range(count))]
    np.savetxt(path, rows, "%.6f", ",", header=",".join(names), comments="")
    return path


@pytest.mark.parametrize("scene", ["fr3", pytest.param("ur5e", marks=pytest.mark.slow)])
def test_a_plain_recording_of_any_arm_corrects_its_plan(scene, saved, tmp_path, run, table) -> None:
    """A row every 4 ms, without the times of commands; joints lag by some tenths of a radian."""
    motion = joint_motion(folder := saved(scene))
    recording = lagging(motion)
    path = plain(recording, tmp_path / "joints.csv", every=4)
    said = run("correct --json", folder, path, "--out", tmp_path / "next").json
    assert said["recorded"]["error"]["position"] > 0.02 and said["recorded"]["lag"] > 0.03
    next_motion = table(tmp_path / "next" / "joints.csv")
    q = np.column_stack([next_motion[f"q{j}"] for j in range(1, motion.arm.joints + 1)])
    sent, _ = corrected(motion, read_recording(path, motion))
    np.testing.assert_allclose(q, sent.q, atol=1e-6)
    assert (errors(lagging(sent), motion) < errors(recording, motion) / 10).all()


def test_the_way_to_the_start_pose_keeps_the_limits(plan) -> None:
    motion, arm = joint_motion(plan), load_arm("fr3")
    way = approach(motion, HOME)
    assert way[0] == pytest.approx(HOME) and way[-1] == pytest.approx(motion.q[0], abs=1e-6)
    assert np.abs(np.diff(way, axis=0)).max() / TICK < 0.25 * max(arm.limits.velocity)
    low, high = arm.limits.position_min, arm.limits.position_max
    assert (way >= low).all() and (way <= high).all()


def test_the_way_to_the_start_pose_is_clear_of_obstacles_or_refused(plan) -> None:
    motion = joint_motion(plan)
    way = approach(motion, HOME)

    def among(*obstacles: Obstacle) -> SentMotion:
        scene = motion.throw.scene.replace(obstacle=obstacles)
        return SentMotion.of(dataclasses.replace(motion.throw, scene=scene))

    # On the way of the flange.
    q = ca.SX.sym("q", 7)
    flange = ca.Function("flange", [q], [motion.arm.frames(q)[-2][:3, 3]])
    x, y, z = np.array(flange(way[len(way) // 2])).ravel()
    ball = Obstacle("ball", "sphere", (0.03,), (x, y, z))
    with pytest.raises(InputError, match=r"not clear: obstacle ball: .* guide the arm nearer"):
        approach(among(ball), HOME)


# Wrong input: one line, nothing moved.


@pytest.mark.parametrize(
    ("says", "words"),
    [
        (False, "gripper: "),
        pytest.param(True, "is open and does not answer", marks=pytest.mark.slow),
    ],
)
def test_what_is_no_franka_is_given_up(plan, refused, says, words) -> None:
    """It takes the connection, and closes it or goes on in silence."""
    pytest.importorskip("pylibfranka")
    host, kept = f"127.0.19.{5 + says}", list[socket.socket]()

    def serve(port: socket.socket) -> None:
        # Until the port is closed.
        with contextlib.suppress(OSError):
            while True:
                taken = port.accept()[0]
                if says:
                    kept.append(taken)
                else:
                    taken.close()

    for number in (1337, 1338):
        port = socket.create_server((host, number))
        kept.append(port)
        threading.Thread(target=serve, args=(port,), daemon=True).start()
    said = refused("run --yes", plan, "--robot", host)
    for one in kept:
        one.close()
    assert host in said and words in said


def test_a_robot_that_does_not_answer(plan, refused, tmp_path) -> None:
    pytest.importorskip("pylibfranka")
    out = tmp_path / "out"
    said = refused("run --yes", plan, "--robot", "127.255.255.1", "--out", out)
    assert "127.255.255.1: does not answer on port 1337" in said and "cable" in said
    assert not out.exists()


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        (lambda rows: rows[:120], "the recording ends at 0.118 s, before the pads are open"),
        (lambda rows: rows[:-620], "record until the arm rests, or until the landing"),
        (lambda rows: rows[:1] + rows[150:], "does not begin at rest"),
        (lambda rows: rows[:1], "t must rise over at least two rows"),
        (lambda rows: [rows[0].replace("sent3", "sent9"), *rows[1:]], "sent3 is missing"),
        (lambda rows: rows[:1] + rows[:0:-1], "t must rise"),
        (lambda rows: rows[:1] + rows[1::20], "t rises by 0.02 s a row"),
        (lambda rows: [*rows[:5], rows[5].replace(",", ",x", 1), *rows[6:]], "line 6"),
    ],
)
def test_recordings_that_do_not_fit_are_refused(plan, tmp_path, refused, spoilt, words) -> None:
    path = tmp_path / "run.csv"
    lagging(joint_motion(plan)).save(path)
    path.write_text("\n".join(spoilt(path.read_text().splitlines())) + "\n")
    for command in ("correct", "run --dry --after"):
        order = (plan, path) if command == "correct" else (path, plan)
        said = refused(command, *order)
        assert words in said and "run.csv" in said


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("ur5e", "the plan's arm is ur5e, the robot of `throwplan run` is an fr3"),
        ("pose", "an fr3, whose limit of joint 1 acceleration is 10; the plan's arm panda has 15"),
    ],
)
def test_other_arms_plans_are_refused_before_a_robot_is_asked(scene, words, saved, refused) -> None:
    folder = saved(scene)
    for options in (["--dry"], ["--yes", "--robot", "127.255.255.1"]):
        said = refused("run", folder, *options)
        assert said.startswith(f"throwplan: {folder}: ") and words in said
        assert 'plan it with arm = "fr3"' in said


class Standing:
    """A robot, as the binding shows it, that stands in that pose."""

    def __init__(self, mode: str = "Idle", errors: str = "", rate: float = 0.0) -> None:
        self.state = types.SimpleNamespace(
            robot_mode=types.SimpleNamespace(name=mode),
            current_errors=errors,
            q=HOME.tolist(),
            q_d=HOME.tolist(),
            dq=[0.0, rate, 0.0, 0.0, 0.0, 0.0, 0.0],
            # As franky-sim says of that pose.
            O_T_EE=[1, 4e-4, 0, 0, 4e-4, -1, 0, 0, 0, 0, -1, 0, 0.55443418, 0, 0.52140576, 1],
            F_T_EE=[0.7071, -0.7071, 0, 0, 0.7071, 0.7071, 0, 0, 0, 0, 1, 0, 0, 0, 0.1034, 1],
        )

    def read_once(self) -> types.SimpleNamespace:
        return self.state


class Hand:
    """A gripper's link without a gripper: homed, or not."""

    def __init__(self, most: float = 0.08) -> None:
        self.most = most

    def state(self) -> GripperState:
        return GripperState(0.04, self.most, holds=False)


def test_a_robot_is_ready_only_where_all_is_well() -> None:
    arm = load_arm("fr3")
    q, gripper = Franka("host", Standing(), Hand(), BINDING).check(arm)
    assert q[3] == -1.57 and gripper.width == 0.04
    elsewhere = Standing()
    elsewhere.state.O_T_EE[12] += 0.05
    for robot, hand, words in (
        (Standing(mode="UserStopped"), Hand(), "host: its mode is UserStopped, must be Idle: rel"),
        (Standing(mode="Reflex", errors="joint_reflex"), Hand(), "is in error, joint_reflex: "),
        (Standing(rate=0.3), Hand(), "moves (0.30 rad/s), must be at rest"),
        (Standing(), Hand(most=0.0), "gripper is not homed"),
        (elsewhere, Hand(), "flange is 50 mm from where"),
    ):
        with pytest.raises(InputError) as raised:
            Franka("host", robot, hand, BINDING).check(arm)
        assert words in str(raised.value) and "\n" not in str(raised.value)
