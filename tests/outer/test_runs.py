"""Fails if a run sends an arm beyond its limits, throws what was lost, or learns no lag."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
import types
from collections.abc import Callable
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter
from simulated_robot import BINDING, HOME, TICK, SimulatedRobot, simulated
from throwplan.planner.result import SentMotion
from throwplan.planner.throw import Samples
from throwplan.planner.verdict import verdict_on
from throwplan.problems import InputError, Obstacle
from throwplan.problems.arm_files import load_arm
from throwplan.robots import (
    Franka,
    GripperState,
    Recording,
    approach,
    corrected,
    find_stops,
    joint_motion,
    read_recording,
    rehearse,
    throws,
)

from oracle import gap_to_waiting


@pytest.fixture(scope="module")
def plan(saved) -> Path:
    """The folder of a plan of an FR3."""
    return saved("fr3")


@pytest.fixture(scope="module")
def motion(plan) -> SentMotion:
    """Its motion."""
    return joint_motion(plan)


@pytest.fixture(scope="module")
def cycle(cycled) -> SentMotion:
    """The motion of an FR3's cycle with two parts."""
    return joint_motion(cycled)


def sent_whole(franka: Franka, motion: SentMotion) -> np.ndarray:
    """The joints (N, 7) sent each millisecond, within the arm's limits, from rest to rest."""
    limits = motion.arm.limits
    values = sent = np.array(franka.robot.sent)
    for most in (limits.velocity, limits.acceleration, limits.jerk):
        values = np.diff(values, axis=0) / TICK
        assert (np.abs(values) <= np.array(most) * (1 + 1e-6)).all()
    assert np.abs([np.diff(sent[:2], axis=0), np.diff(sent[-2:], axis=0)]).max() < 1e-6
    assert franka.robot.finished
    return sent


def one_run(franka: Franka, motion: SentMotion) -> tuple[Recording, np.ndarray, list[str]]:
    """The recording of a run, what the arm was sent, and what a person was told."""
    asked = list[str]()
    recording = next(throws(franka, motion, motion, asked.append))
    assert "\n" not in recording.trouble
    return recording, sent_whole(franka, motion), asked


# A throw.


def test_a_throw_in_order_opens_in_time_and_says_what_it_needs(motion, plan, run) -> None:
    """The space swept, the load in the flange's frame, and collision thresholds."""
    recording, _, asked = one_run(simulated(), motion)
    assert recording.trouble == "" and recording.width[0] == 0.02
    assert recording.command_time == pytest.approx(motion.throw.command_time, abs=1e-9)
    for words in ("sweep x ", "behind the base's axis", "load to set: 0.24 kg", "thresholds"):
        assert words in asked[0]
    facts, scene = run("run --dry --json", plan).json["expects"], motion.throw.scene
    # The bar is in line with the hand: pads' centre behind the flange, CoM ahead of it.
    ahead = scene.arm.tool.tcp + scene.com_offset
    assert facts["load"] == [{"mass": 0.24, "com": pytest.approx([0.0, 0.0, ahead], abs=1e-6)}]
    # The object starts in the swept space and lands at the target.
    landing, start = motion.throw.landing, motion.throw.release.detach.pose
    for axis, place, begin in (("x", landing.x, start[0]), ("z", landing.z, start[1])):
        assert facts["flown"][axis][0] < place < facts["flown"][axis][1]
        assert facts["swept"][axis][0] < begin < facts["swept"][axis][1]
    # A held bar's weight alone is its mass times gravity at its distance.
    lever = max(facts["thresholds"]["torque"].values()) / facts["thresholds"]["force"]
    assert 0.3 < lever < 1.3 and facts["thresholds"]["force"] > 0.24 * 9.81


def test_a_gripper_that_does_not_open_ends_the_throws_at_rest(motion) -> None:
    franka = simulated(opens=False)
    recording, sent, _ = one_run(franka, motion)
    assert "did not open" in recording.trouble
    assert [command for command, _ in franka.gripper.orders] == ["move"]
    assert sent[-1] == pytest.approx(motion.q[-1])


@pytest.mark.parametrize("after", [20, 120])
def test_an_object_lost_on_the_way_stops_the_arm_by_a_brake(motion, after) -> None:
    """It stops sooner and elsewhere than planned, within the limits."""
    end = len(approach(motion, simulated().robot.q)) + 100 + after
    franka = simulated(lambda tick: 0.02 if tick < end else 0.0)
    recording, sent, _ = one_run(franka, motion)
    assert recording.trouble.startswith("the object was lost 0.")
    assert not franka.gripper.orders and math.isnan(recording.command_time)
    assert np.abs(sent[-1] - motion.q[-1]).max() > 0.01
    assert len(recording.times) < len(motion.times)


def test_an_object_lost_before_the_start_pose_is_not_thrown(motion) -> None:
    franka = simulated(lambda tick: 0.02 if tick < 500 else 0.0)
    with pytest.raises(InputError, match=r"lost on the way to the start pose: .* nothing was"):
        one_run(franka, motion)
    assert np.array(franka.robot.sent)[-1] == pytest.approx(motion.q[0])
    assert franka.robot.finished and not franka.gripper.orders


@pytest.mark.parametrize(("after", "brakes"), [(-400, False), (60, True), (None, False)])
def test_a_gripper_that_fails_leaves_no_arm_in_motion(motion, after, brakes) -> None:
    """On the way to the start pose, before the opening command, and after it."""
    way = approach(motion, simulated().robot.q)
    after = round(1e3 * motion.carries[0].throw.command_time) if after is None else after
    franka = simulated(ends=len(way) + 100 + after)
    if after < 0:
        with pytest.raises(InputError, match="the connection ended"):
            one_run(franka, motion)
        sent_whole(franka, motion)
    else:
        recording, *_ = one_run(franka, motion)
        assert "the connection ended" in recording.trouble
        assert math.isnan(recording.command_time) == brakes == (not franka.gripper.orders)


def test_a_rehearsal_opens_nothing_and_is_slow(motion) -> None:
    franka, asked = simulated(holds=False), list[str]()
    recording = rehearse(franka, motion, motion, asked.append)
    assert not franka.gripper.orders and (recording.width == 0.02).all()
    sent = sent_whole(franka, motion)
    # Along the same path, slower by one factor.
    slow = recording.sent[: -(len(recording.sent) // 20)]
    way = np.abs(motion.q[:, None, :] - slow[None, ::50, :]).max(axis=2).min(axis=0)
    assert way.max() < 0.01
    assert sent[-1] == pytest.approx(motion.q[-1], abs=1e-6)
    # All joints' frames, flange and pads, on the way to the start pose as well.
    joints = ca.SX.sym("q", motion.arm.joints)
    origins = ca.vertcat(*(frame[:3, 3] for frame in motion.arm.frames(joints)))
    placed = np.array(ca.Function("origins", [joints], [origins])(sent.T)).T
    speeds = np.diff(placed.reshape(len(sent), -1, 3), axis=0) / TICK
    assert 0.15 < np.linalg.norm(speeds, axis=2).max() < 0.25
    assert "times as slow" in asked[0]
    with pytest.raises(InputError, match="holds an object: take it out"):
        rehearse(simulated(), motion, motion, asked.append)


# A cycle.


def opened(**hand: object) -> Franka:
    """A robot whose hand is open and empty."""
    return simulated(lambda tick: 0.08, holds=False, **hand)


def test_the_gripper_closes_at_each_pick_and_opens_for_each_throw(cycle, cycled, run) -> None:
    franka = opened()
    recording, sent, _ = one_run(franka, cycle)
    assert recording.trouble == "" and sent[-1] == pytest.approx(cycle.q[-1])
    steps = json.loads((cycled / "cycle.json").read_text())["steps"]
    (width,) = {command for name, command in franka.gripper.orders if name == "grasp"}
    assert width == steps[0]["definition"]["object"]["width"]
    assert [name for name, _ in franka.gripper.orders] == ["grasp", "move"] * 2
    # The commands as the cycle has them, an opening earlier by the gripper's delay.
    times = np.array(franka.gripper.times) - franka.gripper.times[0] + steps[0]["reach_time"]
    planned = [step[key] for step in steps for key in ("reach_time", "command_time")]
    np.testing.assert_allclose(times, planned, rtol=0, atol=1e-9)
    np.testing.assert_allclose(recording.command_times, planned[1::2], rtol=0, atol=1e-9)
    # A dry run says so.
    facts = run("run --dry --json", cycled).json
    said = [one[key] for one in facts["gripper"] for key in ("close_time", "command_time")]
    assert said == pytest.approx(planned, abs=1e-9)
    for step in steps:
        for axis in "xyz":
            low, high = facts["expects"]["flown"][axis]
            assert low < step["landing"][axis] < high


@pytest.mark.parametrize("grasps", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_an_empty_grasp_stops_the_arm_at_its_pick(cycle, grasps) -> None:
    recording, sent, _ = one_run(opened(grasps=grasps), cycle)
    carry = cycle.carries[grasps]
    assert recording.trouble.startswith(f"{carry.pick} was not grasped: ")
    assert sent[-1] == pytest.approx(cycle.q[carry.reach])
    assert len(recording.command_times) == grasps


def test_a_part_lost_in_its_swing_stops_the_arm_by_a_brake(cycle) -> None:
    """It leaves the motion within 10 ms and the notice, and stands soon after."""
    franka, carry = opened(drops=(2, 0.95)), cycle.carries[1]
    recording, *_ = one_run(franka, cycle)
    assert recording.trouble.startswith(f"{carry.pick} was lost ")
    assert [name for name, _ in franka.gripper.orders][-1] == "grasp"
    assert len(recording.command_times) == 1
    lost = carry.reach + 0.95 / TICK
    assert len(recording.times) < lost + 600
    away = np.abs(recording.sent - cycle.q[: len(recording.sent)]).max(axis=1)
    assert lost <= np.flatnonzero(away > 1e-9)[0] <= lost + 15


@pytest.mark.slow
def test_what_waits_at_its_pick_is_in_the_way_of_the_arm(cycle, cycled) -> None:
    """Of stops that the run may take, and of the way to the start pose."""
    first, second = cycle.carries
    opens = 1e3 * first.command_time
    stops = [stop for stop in find_stops(cycle) if stop.sample <= opens]
    assert stops and gap_to_waiting(cycled, 0, np.concatenate([s.q for s in stops])) >= 0.01
    # The hand has passed the object on another way; a stop on it would meet it.
    q = cycle.q[second.reach]
    assert gap_to_waiting(cycled, 0, q[None]) < 0.0
    at_pick = np.repeat(q[None], len(cycle.q), axis=0)
    # What waits is where the motion's grasps are.
    at_pick[second.held] = q
    still = dataclasses.replace(cycle, samples=Samples(at_pick, 0 * at_pick, 0 * at_pick))
    assert min(stop.sample for stop in find_stops(still)) > opens
    # From there the hand rises before it comes to the start pose.
    way = approach(cycle, q)
    assert way[-1] == pytest.approx(cycle.q[0], abs=1e-6)
    assert gap_to_waiting(cycled, 0, way[len(way) // 2 :]) >= 0.01


def test_the_hand_is_empty_before_a_cycle_and_opened(cycle) -> None:
    with pytest.raises(InputError, match="the gripper holds an object: take it out"):
        one_run(simulated(), cycle)
    stuck = simulated(lambda tick: 0.01, holds=False, opens=0)
    with pytest.raises(InputError, match="does not answer"):
        one_run(stuck, cycle)
    assert not stuck.robot.sent


def sooner(table: dict[str, Any]) -> None:
    """Let the arm wait 0.3 s at its second pick."""
    samples = table["steps"][1]["samples"]
    samples[0] = samples[1] - 300


def faster(table: dict[str, Any]) -> None:
    table["arm"]["limits"]["velocity"][0] = 3.0


def wider(table: dict[str, Any]) -> None:
    table["arm"]["tool"]["open_width"] = 0.085


def stronger(table: dict[str, Any]) -> None:
    gripper = table["steps"][1]["definition"]["gripper"]
    gripper.pop("file", None)
    gripper |= {"force": 200.0, "peak": 300.0}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (wider, "opens by 0.085 m, a Franka Hand by 0.08 m at most"),
        (sooner, "other part: the hand"),
        (faster, "the robot of `throwplan run` is an fr3, whose limit of joint 1 velocity is "),
        (stronger, "200"),
    ],
)
def test_what_an_fr3_and_its_hand_cannot_do_is_refused(
    cycled, tmp_path, refused, change: Callable[[dict[str, Any]], None], words
) -> None:
    folder = Path(shutil.copytree(cycled, tmp_path / "edited"))
    table = json.loads((folder / "cycle.json").read_text())
    change(table)
    (folder / "cycle.json").write_text(json.dumps(table))
    assert words in refused("run --dry", folder)


# What a lag teaches.


def lagging(motion: SentMotion, still: float = 0.5) -> Recording:
    """What an arm records whose joints are pulled to what is sent by springs, damped by far.

    As franky-sim's are: ddq = 4500 (sent - q) - 450 dq, a lag of 0.1 s.
    """
    after = round(still / TICK)
    sent = np.vstack([motion.q, np.repeat(motion.q[-1:], after, axis=0)])
    numerator, denominator, _ = cont2discrete(([4500.0], [1.0, 450.0, 4500.0]), TICK)
    q = sent[0] + lfilter(numerator.ravel(), denominator, sent - sent[0], axis=0)
    return Recording(TICK * np.arange(len(sent)), q, sent, (motion.throw.command_time,))


def errors(recording: Recording, motion: SentMotion) -> np.ndarray:
    """Landing off the target: [m], [rad]."""
    error = recording.to_dict(motion)["error"]
    return np.array([error["position"], error["angle"]])


def test_a_motion_that_is_followed_lands_as_planned(motion) -> None:
    """A measured throw may use up the clearances of its plan."""
    recording = Recording(motion.times, motion.q, motion.q, (motion.throw.command_time,))
    assert (errors(recording, motion) < [1e-4, math.radians(0.05)]).all()
    workspace = motion.throw.scene.workspace.changed(palm_clearance=0.2)
    roomy = motion.throw.in_scene(motion.throw.scene.changed(workspace=workspace))
    assert verdict_on(roomy).broken and not verdict_on(motion.throw).broken
    assert recording.to_dict(SentMotion.of(roomy))["succeeds"]
    # Noise of the encoders moves the landing little.
    noise = 1e-5 * np.random.default_rng(0).standard_normal(recording.q.shape)
    noisy = dataclasses.replace(recording, q=recording.q + noise)
    off = np.abs(errors(noisy, motion) - errors(recording, motion))
    assert (off < [1e-3, math.radians(1.0)]).all()


def test_correct_writes_what_to_send_next(plan, motion, tmp_path, run, table) -> None:
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


def test_a_plain_recording_of_any_arm_corrects_its_plan(plan, motion, tmp_path, run, table) -> None:
    """A CSV with a row every 4 ms, without the times of commands."""
    recording, path = lagging(motion), tmp_path / "joints.csv"
    names = ["t", *(f"{name}{j}" for name in ("q", "sent") for j in range(1, 8))]
    rows = np.column_stack([recording.times, recording.q, recording.sent])[::4]
    np.savetxt(path, rows, "%.6f", ",", header=",".join(names), comments="")
    said = run("correct --json", plan, path, "--out", tmp_path / "next").json
    assert said["recorded"]["error"]["position"] > 0.02 and said["recorded"]["lag"] > 0.03
    sent, _ = corrected(motion, read_recording(path, motion))
    limits = motion.arm.limits
    most = limits.velocity, limits.acceleration, limits.jerk
    for values, bound in zip(sent.samples.rows, most, strict=True):
        assert (np.abs(np.diff(values, axis=0)) <= TICK * np.array(bound) * (1 + 1e-6)).all()
    assert (sent.q >= limits.position_min).all() and (sent.q <= limits.position_max).all()
    written = table(tmp_path / "next" / "joints.csv")
    q = np.column_stack([written[f"q{j}"] for j in range(1, 8)])
    np.testing.assert_allclose(q, sent.q, atol=1e-6)
    assert (errors(lagging(sent), motion) < errors(recording, motion) / 10).all()


# The way to the start pose.


def test_the_way_to_the_start_pose_keeps_the_limits_and_clear_of_obstacles(motion) -> None:
    arm, way = load_arm("fr3"), approach(motion, HOME)
    assert way[0] == pytest.approx(HOME) and way[-1] == pytest.approx(motion.q[0], abs=1e-6)
    assert np.abs(np.diff(way, axis=0)).max() / TICK < 0.25 * max(arm.limits.velocity)
    assert (way >= arm.limits.position_min).all() and (way <= arm.limits.position_max).all()
    # On the way of the flange.
    x, y, z = (float(value) for value in arm.placed(way[len(way) // 2])[-2][:3, 3])
    ball = Obstacle("ball", "sphere", (0.03,), (x, y, z))
    among = dataclasses.replace(motion.throw, scene=motion.throw.scene.replace(obstacle=(ball,)))
    with pytest.raises(InputError, match=r"not clear: obstacle ball: .* guide the arm nearer"):
        approach(SentMotion.of(among), HOME)


# Wrong input: one line, nothing moved.


def test_what_is_no_franka_is_given_up(plan, refused, tmp_path) -> None:
    """A host without the port, a name that is none, nobody to ask."""
    pytest.importorskip("pylibfranka")
    out = ("--out", tmp_path / "out")
    for host, more, words in (
        ("127.255.255.1", ["--yes"], "127.255.255.1: does not answer on port 1337"),
        ("a..b", ["--yes"], "the address of a machine"),
        ("127.0.0.1", [], "--yes"),
    ):
        assert words in refused("run", plan, "--robot", host, *more, *out)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("spoilt", "words"),
    [
        (lambda rows: rows[:120], "the recording ends at 0.118 s, before the pads are open"),
        (lambda rows: rows[:-620], "record until the arm rests, or until the landing"),
        (lambda rows: rows[:1] + rows[150:], "does not begin at rest"),
        (lambda rows: [rows[0].replace("sent3", "sent9"), *rows[1:]], "sent3 is missing"),
        (lambda rows: rows[:1] + rows[1::20], "t rises by 0.02 s a row"),
        (lambda rows: [*rows[:5], rows[5].replace(",", ",x", 1), *rows[6:]], "line 6"),
    ],
)
def test_recordings_that_do_not_fit_are_refused(plan, motion, tmp_path, refused, spoilt, words):
    path = tmp_path / "run.csv"
    lagging(motion).save(path)
    path.write_text("\n".join(spoilt(path.read_text().splitlines())) + "\n")
    said = refused("correct", plan, path)
    assert words in said and "run.csv" in said


@pytest.mark.parametrize(
    ("scene", "words"),
    [
        ("ur5e", "the plan's arm is ur5e, the robot of `throwplan run` is an fr3"),
        ("pose", "an fr3, whose limit of joint 1 acceleration is 10; the plan's arm panda has 15"),
    ],
)
def test_other_arms_plans_are_refused_before_a_robot_is_asked(scene, words, saved, refused) -> None:
    assert words in refused("run --yes --robot 127.255.255.1", saved(scene))


def test_a_robot_is_ready_only_where_all_is_well() -> None:
    def checked(most: float = 0.08, **changes: Any) -> Any:
        robot = SimulatedRobot()
        state = types.SimpleNamespace(**vars(robot.read_once()) | changes)
        robot.read_once = lambda: state  # type: ignore[method-assign]
        hand = types.SimpleNamespace(state=lambda: GripperState(0.04, most, holds=False))
        return Franka("host", robot, hand, BINDING).check(load_arm("fr3"))

    q, gripper = checked()
    assert q[3] == -1.57 and gripper.width == 0.04
    mode, at = types.SimpleNamespace(name="UserStopped"), SimulatedRobot().read_once().O_T_EE
    at[12] += 0.05
    for changes, words in (
        ({"robot_mode": mode}, "host: its mode is UserStopped, must be Idle: rel"),
        ({"current_errors": "joint_reflex"}, "is in error, joint_reflex: "),
        ({"dq": [0.3] * 7}, r"moves \(0.30 rad/s\), must be at rest"),
        ({"most": 0.0}, "gripper is not homed"),
        ({"O_T_EE": at}, "flange is 50 mm from where"),
    ):
        with pytest.raises(InputError, match=f"^[^\n]*{words}[^\n]*$"):
            checked(**changes)
