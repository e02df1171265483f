"""The gripper of a robot: its file, its width watched, rehearsals without it."""

from __future__ import annotations

import math

import casadi as ca
import numpy as np
import pytest
from simulated_robot import TICK, simulated
from throwplan.planner.result import SentMotion
from throwplan.problems import InputError
from throwplan.robots import approach, joint_motion, rehearse, throws


@pytest.fixture(scope="module")
def motion(saved) -> SentMotion:
    """The motion of a plan of an FR3."""
    return joint_motion(saved("fr3"))


# Its file.


# Watched.


def sent_whole(franka, motion: SentMotion) -> np.ndarray:
    """The joints (N, 7) sent each millisecond, within the arm's limits, from rest to rest."""
    limits = motion.arm.limits
    values = sent = np.array(franka.robot.sent)
    for most in (limits.velocity, limits.acceleration, limits.jerk):
        values = np.diff(values, axis=0) / TICK
        assert (np.abs(values) <= np.array(most) * (1 + 1e-6)).all()
    assert np.abs([np.diff(sent[:2], axis=0), np.diff(sent[-2:], axis=0)]).max() < 1e-6
    assert franka.robot.finished
    return sent


def one_throw(franka, motion):
    """The recordings of at most two throws, and what was asked."""
    asked: list[str] = []
    found = []
    for recording in throws(franka, motion, motion, asked.append):
        found.append(recording)
        if len(found) == 2:
            break
    return found, asked


def test_a_gripper_that_does_not_open_ends_the_throws_at_rest(motion) -> None:
    franka = simulated(opens=False)
    (recording,), _ = one_throw(franka, motion)
    assert "did not open" in recording.trouble and "\n" not in recording.trouble
    assert [command for command, _ in franka.gripper.orders] == ["move"]
    sent = sent_whole(franka, motion)
    assert sent[-1] == pytest.approx(motion.q[-1])


def test_an_object_lost_on_the_way_stops_the_arm_by_a_brake(motion) -> None:
    """At several instants: it stops sooner and elsewhere than planned, within the limits."""
    way = len(approach(motion, simulated().robot.q)) + 100
    for after in (20, 60, 120):
        franka = simulated(lambda tick, end=way + after: 0.02 if tick < end else 0.0)
        (recording,), _ = one_throw(franka, motion)
        assert recording.trouble.startswith("the object was lost 0.")
        assert "\n" not in recording.trouble
        assert not franka.gripper.orders and math.isnan(recording.command_time)
        sent = sent_whole(franka, motion)
        assert np.abs(sent[-1] - motion.q[-1]).max() > 0.01
        assert len(recording.times) < len(motion.times)


def test_an_object_lost_before_the_start_pose_is_not_thrown(motion) -> None:
    franka = simulated(lambda tick: 0.02 if tick < 500 else 0.0)
    with pytest.raises(
        InputError, match=r"lost on the way to the start pose: .* nothing was thrown"
    ):
        one_throw(franka, motion)
    sent = np.array(franka.robot.sent)
    assert sent[-1] == pytest.approx(motion.q[0]) and franka.robot.finished
    assert not franka.gripper.orders


@pytest.mark.parametrize(("after", "brakes"), [(-400, False), (60, True), (None, False)])
def test_a_gripper_that_fails_leaves_no_arm_in_motion(motion, after, brakes) -> None:
    """On the way to the start pose, before the opening command, and after it."""
    way = approach(motion, simulated().robot.q)
    after = round(1e3 * motion.carries[0].throw.command_time) if after is None else after
    franka = simulated(ends=len(way) + 100 + after)
    if after < 0:
        with pytest.raises(InputError, match="the connection ended"):
            one_throw(franka, motion)
    else:
        (recording,), _ = one_throw(franka, motion)
        assert "the connection ended" in recording.trouble and "\n" not in recording.trouble
        assert math.isnan(recording.command_time) == brakes == (not franka.gripper.orders)
    sent_whole(franka, motion)


def test_a_throw_in_order_has_no_trouble(motion) -> None:
    franka = simulated()
    recordings = throws(franka, motion, motion, lambda words: None)
    recording = next(recordings)
    assert recording.trouble == "" and recording.width[0] == 0.02
    assert recording.command_time == pytest.approx(motion.throw.command_time, abs=1e-9)


# Rehearsed.


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
    places = motion.arm.frames
    joints = ca.SX.sym("q", motion.arm.joints)
    origins = ca.Function("origins", [joints], [ca.vertcat(*(f[:3, 3] for f in places(joints)))])
    speeds = np.diff(np.array(origins(sent.T)).T.reshape(len(sent), -1, 3), axis=0) / TICK
    assert 0.15 < np.linalg.norm(speeds, axis=2).max() < 0.25
    assert "times as slow" in asked[0] and "sweep" in asked[0] and "flies" not in asked[0]


def test_a_rehearsal_is_for_an_empty_hand(motion) -> None:
    with pytest.raises(InputError, match="holds an object: take it out"):
        rehearse(simulated(), motion, motion, lambda words: None)


# What a motion needs.


def test_what_a_throw_needs_is_said_before_it(motion, saved, run) -> None:
    """The space swept, the load in the flange's frame, and collision thresholds."""
    _, asked = one_throw(simulated(opens=False), motion)
    facts = run("run --dry --json", saved("fr3")).json["expects"]
    for words in ("sweep x ", "behind the base's axis", "load to set: 0.24 kg", "thresholds"):
        assert words in asked[0]
    scene = motion.throw.scene
    # The bar is in line with the hand: pads' centre behind the flange, CoM ahead of it.
    ahead = scene.arm.tool.tcp + scene.com_offset
    assert facts["load"] == [{"mass": 0.24, "com": pytest.approx([0.0, 0.0, ahead], abs=1e-6)}]
    # The object starts in the swept space and lands at the target.
    swept, flown = facts["swept"], facts["flown"]
    landing = motion.throw.landing
    for place, axis in ((landing.x, "x"), (landing.z, "z")):
        assert flown[axis][0] < place < flown[axis][1]
    start = motion.throw.release.detach.pose
    assert swept["x"][0] < start[0] < swept["x"][1] and swept["z"][0] < start[1] < swept["z"][1]
    # A held bar's weight alone is its mass times gravity at its distance.
    lever = max(facts["thresholds"]["torque"].values()) / facts["thresholds"]["force"]
    assert 0.3 < lever < 1.3 and facts["thresholds"]["force"] > 0.24 * 9.81
