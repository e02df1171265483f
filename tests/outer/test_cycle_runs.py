"""`throwplan run` with a cycle: commands in time, and what goes wrong at a pick or on the way."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from simulated_robot import TICK, simulated
from throwplan.planner.result import SentMotion
from throwplan.planner.throw import Samples
from throwplan.problems import InputError
from throwplan.robots import (
    Franka,
    Recording,
    approach,
    check_motion,
    find_stops,
    joint_motion,
    throws,
)

from oracle import gap_to_waiting

#: Losses that are tried: the number of the object, and the time [s] after the command to grasp.
LOSSES = (1, 0.55), (2, 0.75)


@pytest.fixture(scope="module")
def motion(cycled) -> SentMotion:
    """The motion of an FR3's cycle with two parts."""
    return joint_motion(cycled)


def opened(**hand: object) -> Franka:
    """A robot whose hand is open and empty."""
    return simulated(lambda tick: 0.08, holds=False, **hand)


def one_run(franka: Franka, motion: SentMotion) -> tuple[Recording, np.ndarray, list[str]]:
    """The recording of a run, what the arm was sent in it, and what was asked; it ends at rest
    within all limits."""
    asked, limits = list[str](), motion.arm.limits
    recording = next(throws(franka, motion, motion, asked.append))
    values = sent = np.array(franka.robot.sent)
    for most in (limits.velocity, limits.acceleration, limits.jerk):
        values = np.diff(values, axis=0) / TICK
        assert (np.abs(values) <= np.array(most) * (1 + 1e-6)).all()
    assert np.abs(np.diff(sent[-2:], axis=0)).max() < 1e-6 and franka.robot.finished
    assert "\n" not in recording.trouble
    return recording, sent, asked


def test_the_gripper_closes_at_each_pick_and_opens_for_each_throw(motion, cycled) -> None:
    franka = opened()
    recording, sent, asked = one_run(franka, motion)
    assert recording.trouble == "" and sent[-1] == pytest.approx(motion.q[-1])
    steps = json.loads((cycled / "cycle.json").read_text())["steps"]
    (width,) = {command for name, command in franka.gripper.orders if name == "grasp"}
    assert width == steps[0]["definition"]["object"]["width"]
    assert [name for name, _ in franka.gripper.orders] == ["grasp", "move"] * 2
    # The commands as the cycle has them, an opening earlier by the gripper's delay.
    begin = franka.gripper.times[0] - steps[0]["reach_time"]
    times = np.array(franka.gripper.times) - begin
    planned = [step[key] for step in steps for key in ("reach_time", "command_time")]
    np.testing.assert_allclose(times, planned, rtol=0, atol=1e-9)
    opens = [step["command_time"] for step in steps]
    np.testing.assert_allclose(recording.command_times, opens, rtol=0, atol=1e-9)
    for words in ("2 picks and throws in", "sweep x ", "load to set: 0.24 kg", "thresholds"):
        assert words in asked[0]


@pytest.mark.parametrize("grasps", [0, pytest.param(1, marks=pytest.mark.slow)])
def test_an_empty_grasp_stops_the_arm_at_its_pick(motion, grasps) -> None:
    franka = opened(grasps=grasps)
    recording, sent, _ = one_run(franka, motion)
    carry = motion.carries[grasps]
    assert recording.trouble.startswith(f"{carry.pick} was not grasped: ")
    assert "holds nothing between 15 and 25 mm" in recording.trouble
    assert sent[-1] == pytest.approx(motion.q[carry.reach])
    assert len(recording.command_times) == grasps


@pytest.mark.parametrize(
    ("number", "after"),
    [(2, 0.95), *(pytest.param(*each, marks=pytest.mark.slow) for each in LOSSES)],
)
def test_an_object_lost_on_the_way_stops_the_arm_by_a_brake(motion, number, after) -> None:
    """Soon after the grasp, and in the swing."""
    franka, carry = opened(drops=(number, after)), motion.carries[number - 1]
    recording, *_ = one_run(franka, motion)
    assert recording.trouble.startswith(f"{carry.pick} was lost ")
    assert "went from 20 to 0 mm; the arm braked without an opening" in recording.trouble
    assert [name for name, _ in franka.gripper.orders][-1] == "grasp"
    assert len(recording.command_times) == number - 1
    # It leaves the motion within 10 ms and the notice, and stands soon after.
    lost = carry.reach + after / TICK
    assert len(recording.times) < lost + 600
    away = np.abs(recording.sent - motion.q[: len(recording.sent)]).max(axis=1)
    left = np.flatnonzero(away > 1e-9)[0]
    assert lost <= left <= lost + 15


@pytest.mark.slow
def test_what_waits_at_its_pick_is_in_the_way_of_the_arm(motion, cycled) -> None:
    """Of stops that the run may take, and of the way to the start pose."""
    first, second = motion.carries
    opens = 1e3 * first.command_time
    stops = [stop for stop in find_stops(motion) if stop.sample <= opens]
    assert stops and gap_to_waiting(cycled, 0, np.concatenate([s.q for s in stops])) >= 0.01
    # The hand has passed the object on another way; a stop on it would meet it.
    q = motion.q[second.reach]
    assert gap_to_waiting(cycled, 0, q[None]) < 0.0
    at_pick = np.repeat(q[None], len(motion.q), axis=0)
    # What waits is where the motion's grasps are.
    at_pick[second.held] = q
    still = dataclasses.replace(motion, samples=Samples(at_pick, 0 * at_pick, 0 * at_pick))
    assert min(stop.sample for stop in find_stops(still)) > opens
    # From there the hand rises before it comes to the start pose.
    way = approach(motion, q)
    assert way[-1] == pytest.approx(motion.q[0], abs=1e-6)
    assert gap_to_waiting(cycled, 0, way[len(way) // 2 :]) >= 0.01


@pytest.mark.parametrize("opens", [0, 1])
@pytest.mark.slow
def test_a_gripper_that_stays_closed_keeps_the_arm_from_the_next_pick(motion, opens) -> None:
    franka = opened(opens=opens)
    recording, sent, _ = one_run(franka, motion)
    name = motion.carries[opens].pick
    assert recording.trouble.startswith(f"{name} was not thrown: the gripper did not open")
    assert franka.gripper.orders[-1][0] == "move"
    assert np.abs(sent[-1] - motion.q[-1]).max() > 0.05
    assert len(recording.command_times) == opens + 1


def test_the_hand_is_empty_before_a_cycle_and_opened(motion) -> None:
    with pytest.raises(InputError, match="the gripper holds an object: take it out"):
        one_run(simulated(), motion)
    stuck = simulated(lambda tick: 0.01, holds=False, opens=0)
    with pytest.raises(InputError, match="does not answer"):
        one_run(stuck, motion)
    assert not stuck.robot.sent


def test_a_dry_run_says_what_would_be_sent(cycled, run) -> None:
    said = run("run --dry --json", cycled)
    assert said.status == 0
    facts, steps = said.json, json.loads((cycled / "cycle.json").read_text())["steps"]
    for one, step in zip(facts["gripper"], steps, strict=True):
        assert step["pick"] == one["pick"]
        assert one["close_time"] == step["reach_time"]
        assert one["command_time"] == pytest.approx(step["command_time"], abs=1e-9)
        assert one["detach_time"] == pytest.approx(step["detach_time"], abs=1e-9)
    assert [load["mass"] for load in facts["expects"]["load"]] == [0.24, 0.24]
    # Each object lands where the hand's space and the flight's say.
    for step in steps:
        for axis in "xyz":
            low, high = facts["expects"]["flown"][axis]
            assert low < step["landing"][axis] < high
    text = run("run --dry", cycled).out
    assert all(f"{step['pick']}: the gripper's command" in text for step in steps)


def edited(cycled: Path, folder: Path, change: Callable[[dict[str, Any]], None]) -> Path:
    """A copy of the cycle with another cycle.json."""
    table = json.loads((cycled / "cycle.json").read_text())
    change(table)
    (folder / "cycle.json").write_text(json.dumps(table))
    (folder / "motion.csv").write_text((cycled / "motion.csv").read_text())
    return folder


def shorten(table: dict[str, Any]) -> None:
    """Let the arm wait 0.3 s at its second pick."""
    samples = table["steps"][1]["samples"]
    samples[0] = samples[1] - 300


def quicken(table: dict[str, Any]) -> None:
    """As of an arm that may be faster."""
    table["arm"]["limits"]["velocity"][0] = 3.0


def widen(table: dict[str, Any]) -> None:
    """As of a hand that opens wider."""
    table["arm"]["tool"]["open_width"] = 0.085


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (widen, "opens by 0.085 m, a Franka Hand by 0.08 m at most"),
        (shorten, "needs 0.34 s until it holds the object; the arm waits 0.30 s: plan it with"),
        (quicken, "the robot of `throwplan run` is an fr3, whose limit of joint 1 velocity is "),
    ],
)
def test_what_an_fr3_and_its_hand_cannot_do_is_refused(
    cycled, tmp_path, refused, change, words
) -> None:
    said = refused("run --dry", edited(cycled, tmp_path, change))
    assert words in said and "\n" not in said.strip()
    assert change is not shorten or "other part: " in said


def test_a_grip_that_the_hand_does_not_have_is_refused(motion) -> None:
    carry = motion.carries[1]
    gripper = dataclasses.replace(carry.throw.scene.gripper, force=200.0, peak=None)
    scene = carry.throw.scene.changed(gripper=gripper)
    strong = dataclasses.replace(carry, throw=dataclasses.replace(carry.throw, scene=scene))
    check_motion("cycle", motion)
    with pytest.raises(InputError, match=r"other part: the grip force is 200 N, .* 140 N at most"):
        check_motion("cycle", dataclasses.replace(motion, carries=(motion.carries[0], strong)))
    throw = dataclasses.replace(strong, pick="")
    with pytest.raises(InputError, match=r"plan: the object: the grip force is 200 N"):
        check_motion("plan", dataclasses.replace(motion, carries=(throw,)))
