"""Fails if the check behind `solved` misses a peak of grip, torque, torque rate or joint rates, a
throw that grazes its target's height or flies into the palm, or release models that disagree."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from throwplan.models import Trajectory, held_wrench
from throwplan.models.robot import PlanarHand, hand_motion
from throwplan.planner.throw import TICK, Manipulator, Samples, Throw, excesses, make_manipulator
from throwplan.planner.throw.loads import load_torques, torque_uses
from throwplan.planner.throw.manipulator import HandError
from throwplan.planner.verdict import Code, measures_of, verdict_on


def lifting_hand(scene: tp.Scene, acceleration: float) -> tuple[Manipulator, Trajectory]:
    """A level hand at rest that then accelerates upwards for 0.2 s."""
    manipulator = dataclasses.replace(
        make_manipulator(scene), motion=hand_motion(PlanarHand(True)), start=None
    )
    zero = np.zeros((1, 3))
    lift = np.array([[0.0, acceleration, 0.0]])
    return manipulator, Trajectory.cubics(np.array([0.0, 0.2]), zero, zero, lift, zero)


def grip_of(throw: Throw) -> float:
    """Largest use of the full grip until the opening."""
    return float(measures_of(throw).value("grip")[0])


@pytest.mark.parametrize(("below", "grazes"), [(1e-5, True), (1e-4, False)])
def test_a_throw_whose_top_is_the_targets_height_is_not_taken(below, grazes, plan_of) -> None:
    """Where it lands depends on micrometres there: at 0.02 m/s down it is 20 um below the top."""
    plan = plan_of("hand-flip")
    throw, target = plan.throw.deciding, plan.target
    start = throw.release.detach
    top = float(start.z + start.v_z**2 / (2 * plan.scene.gravity))
    high = dataclasses.replace(throw, scene=plan.scene.aimed_at(target.changed(z=top - below)))
    assert high.lands
    assert (Code.GRAZING in verdict_on(high).codes) == grazes


def test_torques_are_those_of_the_motion_that_drives_the_joints(plan_of) -> None:
    """Where joints lag the motion that is sent may need more than the expected one."""
    throw = plan_of("pose").throw.deciding
    weak = dataclasses.replace(throw.scene, torque=tp.Torque(limits=(1.0, 1.0, 1.0)))
    driven = dataclasses.replace(throw, scene=weak)
    assert measures_of(driven).torque[0].max() > 1.0 >= measures_of(throw).torque[0].max()
    assert Code.TORQUE not in verdict_on(throw, sent=throw).codes
    assert Code.TORQUE in verdict_on(throw, sent=throw, driven=driven).codes
    assert Code.TORQUE not in verdict_on(throw, sent=driven).codes
    for late in (-0.2, 0.0):
        other = throw.delayed(late)
        uses = torque_uses(other.scene, other.manipulator, other.path, other.opening_time)
        assert measures_of(other).torque[0][0, :3] == pytest.approx(uses.max(axis=0), rel=1e-6)


def test_grip_use_of_a_lifted_level_bar_by_hand() -> None:
    """Level bar, hand accelerating up with a: torque m h (g + a) over c r_p n mu f_N."""
    scene = tp.load_scene("hand-flip")
    manipulator, motion = lifting_hand(scene, 2.0)
    weight = 0.24 * (scene.gravity + 2.0)
    torque = weight * 0.1 / (0.6 * 0.0025 * 2 * 120.0)
    force = weight / (2 * 120.0)
    used = grip_of(Throw(scene, manipulator, motion, 0.1))
    assert used == pytest.approx(math.hypot(torque, force), rel=1e-9)


def test_a_peak_of_the_grip_use_where_two_pieces_meet_is_seen() -> None:
    """Acceleration that rises to where a piece ends and is gone after: no even grid sees it."""
    scene = tp.load_scene("hand-flip")
    manipulator, _ = lifting_hand(scene, 0.0)
    times, zero = np.array([0.0, 0.08765, 0.2]), np.zeros((2, 3))
    jerk = np.array([[0.0, 50.0, 0.0], [0.0, 0.0, 0.0]])
    motion = Trajectory.cubics(times, zero, zero, zero, jerk)
    _, steady = lifting_hand(scene, 50.0 * 0.08765)
    expected = grip_of(Throw(scene, manipulator, steady, 0.1))
    assert grip_of(Throw(scene, manipulator, motion, 0.1)) == pytest.approx(expected, rel=1e-9)


def test_a_swing_of_the_acceleration_between_two_samples_is_seen() -> None:
    scene = tp.load_scene("hand-flip")
    manipulator, _ = lifting_hand(scene, 0.0)
    rest = np.zeros((200, 3))
    moved = rest.copy()
    # A micrometre in one millisecond, at rest at both ends: up to 5.8 m/s^2 in between.
    moved[61:, 1] = 1e-6
    sent = Samples(moved, rest, rest).path
    _, steady = lifting_hand(scene, 5.77)
    expected = grip_of(Throw(scene, manipulator, steady, 0.1))
    assert grip_of(Throw(scene, manipulator, sent, 0.1)) == pytest.approx(expected, rel=0.02)
    still = Samples(rest, rest, rest).path
    assert grip_of(Throw(scene, manipulator, still, 0.1)) < 0.7 * expected


@pytest.mark.parametrize("opening", [0.0005, 0.05])
def test_the_torque_rate_is_that_of_the_commands_from_tick_to_tick(opening, loud_plan_of) -> None:
    """The load falls linearly while the pads open, wherever that is between two ticks."""
    throw = loud_plan_of("pose").throw.deciding
    scene = throw.scene.changed(gripper=throw.scene.gripper.changed(opening=opening))
    times = np.arange(0.0, throw.path.end + TICK / 2, TICK)
    free, by_load = load_torques(scene, throw.manipulator, throw.path, times)
    hand = throw.hand(times).motion
    load = np.array(held_wrench(scene.body, scene.gravity, hand, scene.grasp.angle))
    for late in np.arange(9) * TICK + 3e-4:
        other = throw.in_scene(scene).delayed(float(late))
        left = np.clip((other.detach_time - times) / opening, 0.0, 1.0)
        torques = free + left * np.einsum("wjk,wk->jk", by_load, load)
        rate = np.abs(np.diff(torques, axis=1)).max() / TICK
        assert measures_of(other).value("rate")[0] == pytest.approx(rate, rel=1e-6)


def test_a_bar_that_flies_into_the_palm_breaks_a_clearance_of_zero(loud_planner_of) -> None:
    """A hand that turns faster than planned from the opening on runs into the bar."""
    plan = loud_planner_of("pose").plan(tp.Pose(x=0.6, z=0.1, theta=3.0))
    throw = plan.throw.deciding
    bare, hits = throw.in_scene(throw.scene.without_reserves()), []
    for turning in np.linspace(15.0, 25.0, 21):
        other = dataclasses.replace(bare, error=HandError(omega=turning))
        hits.append(measures_of(other).value("palm")[0] < 0.0)
        assert (Code.PALM in verdict_on(other).codes) == hits[-1]
    assert 0 < sum(hits) < len(hits)


def test_a_position_beyond_its_limit_is_named() -> None:
    panda = make_manipulator(tp.load_scene("pose"))
    out = np.tile([1.9, -1.5, 1.5], (50, 1))
    found = excesses(panda, Samples(out, 0 * out, 0 * out))
    assert [(one.joint, one.kind) for one in found] == [("joint 2", "position")]


@pytest.mark.parametrize("seed", range(2))
def test_what_is_beyond_a_limit_is_the_worst_of_samples_and_differences(seed: int) -> None:
    manipulator, rng = make_manipulator(tp.load_scene("fr3")), np.random.default_rng(seed)
    limits = manipulator.hard
    middle = (limits.q_min + limits.q_max) / 2
    walk = [np.cumsum(rng.normal(0, s, (60, manipulator.size)), axis=0) for s in (2e-3, 0.2, 0.5)]
    samples = Samples(middle + walk[0], *walk[1:])
    found = {(one.joint, one.kind): one for one in excesses(manipulator, samples)}
    both = [np.vstack([v, np.diff(w, axis=0) / TICK]) for v, w in zip(walk[1:], walk, strict=False)]
    beyond = {
        "velocity": np.abs(both[0]).max(axis=0) - limits.dq,
        "acceleration": np.abs(both[1]).max(axis=0) - limits.ddq,
        "jerk": np.abs(np.diff(walk[2], axis=0) / TICK).max(axis=0) - limits.jerk,
    }
    for kind, values in beyond.items():
        for joint, value in zip(manipulator.joints, values, strict=True):
            if value > 0.0:
                excess = found[joint, kind]
                assert abs(excess.value) - abs(excess.limit) == pytest.approx(value, rel=1e-9)
                assert 0.0 <= excess.time <= 59 * TICK
    assert found


def test_a_plan_warns_where_the_release_models_land_farther_apart_than_the_tolerance(loud_plan_of):
    plan = loud_plan_of("hand-flip")
    landed = plan.to_dict()["landing"]
    apart = abs(landed["sent"]["x"] - landed["limit_surface"]["x"])
    for share, warns in ((0.9, 1), (1.1, 0)):
        scene = plan.scene.changed(tolerance=tp.Tolerance(position=share * apart, angle=1.0))
        throw = dataclasses.replace(plan.throw, deciding=plan.throw.deciding.in_scene(scene))
        said = dataclasses.replace(plan, scene=scene, throw=throw).to_dict()
        assert [found["code"] for found in said["findings"]] == warns * ["models_differ"]
        assert said["status"] == "solved" and ("warning" in said) == warns
