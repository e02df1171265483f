"""The check behind `solved` sees what is broken."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from throwplan.models import PlanarHand, hand_motion
from throwplan.planner.check.check import broken_limits, throw
from throwplan.planner.check.geometry import (
    bar_outline,
    column_room,
    cup_entry,
    distance_to_bar,
    lowest_of_bar,
    palm_distance,
    reach_of_bar,
)
from throwplan.planner.check.motion import PlannedMotion, SampledMotion
from throwplan.planner.check.mover import Mover, make_mover
from throwplan.planner.check.rollout import slip_while_carrying
from throwplan.planner.check.smooth import send
from throwplan.planner.check.violations import scene_violations


@pytest.fixture(scope="module")
def cup_plan() -> tp.Plan:
    return tp.plan("cup")


def straight_drop(x: float, theta: float = -math.pi / 2) -> np.ndarray:
    """CoM poses of a bar that falls straight down through a cup's rim at z = 0.1."""
    z = np.linspace(0.5, 0.0, 800)
    return np.array([np.full_like(z, x), z, np.full_like(z, theta)])


def test_cup_clearance_of_a_bar_that_falls_straight_in() -> None:
    scene = tp.load_scene("cup")
    chord = math.sqrt(0.06**2 - 0.01**2)
    entry = cup_entry(scene, scene.cup, straight_drop(0.90))
    assert entry.entered == pytest.approx(0.08)
    assert entry.clearance == pytest.approx(chord - 0.01, abs=1e-6)
    beside = cup_entry(scene, scene.cup, straight_drop(0.92))
    assert beside.clearance == pytest.approx(chord - 0.03, abs=1e-6)
    assert cup_entry(scene, scene.cup, straight_drop(0.96)).clearance < 0


def test_a_tilted_bar_has_less_room_in_the_cup() -> None:
    scene = tp.load_scene("cup")
    upright = cup_entry(scene, scene.cup, straight_drop(0.90)).clearance
    tilted = cup_entry(scene, scene.cup, straight_drop(0.90, -math.pi / 2 + 0.2)).clearance
    assert tilted < upright - 0.01


def test_a_bar_that_never_reaches_the_depth_is_not_in_the_cup() -> None:
    scene = tp.load_scene("cup")
    short = straight_drop(0.90)[:, :500]
    assert cup_entry(scene, scene.cup, short).entered < 0.08


def test_distances_of_bar_palm_and_column() -> None:
    scene = tp.load_scene("cup")
    bar, tool = scene.object, scene.arm.tool
    level = np.array([[1.0], [0.5], [0.0]])
    corners = bar_outline(bar, level)[:, 0]
    assert corners[0].min() == pytest.approx(0.9) and corners[0].max() == pytest.approx(1.16)
    assert corners[1].max() - corners[1].min() == pytest.approx(bar.width)
    point = np.array([[[1.0]], [[0.56]]])
    assert distance_to_bar(bar, level, point)[0, 0] == pytest.approx(0.05)
    # Held along the approach axis the bar's end is palm_front in front of the palm.
    hand = np.array([[0.9], [0.5], [0.0]])
    assert palm_distance(bar, tool, level, hand)[0] == pytest.approx(tool.palm_front)
    folded = np.array([[0.8], [0.5], [math.pi]])
    assert palm_distance(bar, tool, folded, hand)[0] == 0.0
    # Beside, inside, above, and out of reach.
    places = np.array([[0.25, 0.1, 0.0, 1.0], [0.2, 0.2, 0.5, 0.5], [0.0, 0.0, 0.0, 0.0]])
    room = column_room(bar, places, 0.12, 0.45)
    assert room[[0, 2]] == pytest.approx([0.03, 0.05 - bar.width / 2])
    assert room[1] < 0.0 and room[3] == np.inf


def test_lowest_corner_and_reach_of_a_bar() -> None:
    bar = tp.load_scene("cup").object
    com = np.random.default_rng(0).uniform(-3, 3, (3, 200))
    corners = bar_outline(bar, com)
    assert lowest_of_bar(bar, com) == pytest.approx(corners[1].min(axis=1), abs=1e-14)
    away = np.hypot(*(corners - com[:2, :, None])).max()
    assert reach_of_bar(bar) == pytest.approx(away, rel=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_cup_entry_is_that_of_a_finely_drawn_outline(seed: int) -> None:
    scene, rng = tp.load_scene("cup"), np.random.default_rng(seed)
    com = straight_drop(0.90 + rng.uniform(-0.03, 0.03), rng.uniform(-2.2, -1.0))
    com[2] += rng.uniform(-2, 2) * np.linspace(0, 0.1, com.shape[1])
    com[0] += rng.uniform(-0.02, 0.02) * np.linspace(0, 1, com.shape[1])
    entry = cup_entry(scene, scene.cup, com)
    outline = bar_outline(scene.object, com, 2000)
    depth = scene.cup.rim - outline[1].min(axis=1)
    inside = (depth >= 0) & (depth <= scene.cup.insertion)
    assert entry.entered == pytest.approx(min(depth.max(), scene.cup.insertion), abs=1e-12)
    chord = math.sqrt(scene.cup.radius**2 - (scene.object.width / 2) ** 2)
    x, z = outline[0, inside] - scene.cup.x, outline[1, inside] - scene.cup.rim
    wall = np.where(z <= 0, chord - np.abs(x), np.inf).min()
    rim = min(np.hypot(x - side * chord, z).min() for side in (-1, 1))
    assert entry.clearance == pytest.approx(min(wall, rim), abs=2e-4)


def test_broken_limits_are_named() -> None:
    mover = make_mover(tp.load_scene("pose"))
    q = np.tile([0.0, -1.5, 1.5], (50, 1))
    still = SampledMotion(q, 0 * q, 0 * q)
    assert broken_limits(mover.hard, mover.joints, still) == []
    jump = q.copy()
    jump[20:, 1] += 0.01
    assert "joint 4 velocity" in broken_limits(
        mover.hard, mover.joints, SampledMotion(jump, 0 * q, 0 * q)
    )
    jerk = 0 * q
    jerk[20, 2] = 15.0
    assert broken_limits(mover.hard, mover.joints, SampledMotion(q, 0 * q, jerk)) == [
        "joint 6 jerk"
    ]
    out = q.copy()
    out[:, 0] = 1.9
    assert broken_limits(mover.hard, mover.joints, SampledMotion(out, 0 * q, 0 * q)) == [
        "joint 2 position"
    ]


def lifting_hand(scene: tp.Scene, acceleration: float) -> tuple[Mover, PlannedMotion]:
    """A level hand at rest that then accelerates upwards for 0.2 s."""
    mover = dataclasses.replace(make_mover(scene), motion=hand_motion(PlanarHand(True)), start=None)
    zero = np.zeros((1, 3))
    lift = np.array([[0.0, acceleration, 0.0]])
    return mover, PlannedMotion(np.array([0.0, 0.2]), zero, zero, lift, zero)


def test_grip_use_of_a_lifted_level_bar_by_hand() -> None:
    """Level bar, hand accelerating up with a: torque m h (g + a) over c r_p n mu f_N."""
    scene = tp.load_scene("hand-flip")
    mover, motion = lifting_hand(scene, 2.0)
    weight = 0.24 * (scene.gravity + 2.0)
    torque = weight * 0.1 / (0.6 * 0.0025 * 2 * 120.0)
    force = weight / (2 * 120.0)
    assert slip_while_carrying(scene, mover, motion, 0.1) == pytest.approx(
        math.hypot(torque, force), rel=1e-9
    )


def test_slip_before_the_opening_is_a_failure() -> None:
    scene = tp.load_scene("hand-flip")
    mover, motion = lifting_hand(scene, 8.0)
    thrown = throw(scene, mover, motion, 0.1, -5.0)
    assert thrown.grip_use > 1
    assert any(
        "slip" in found.words for found in scene_violations(scene, mover, motion, 0.2, 0.1, thrown)
    )


def test_a_peak_of_the_grip_use_where_two_pieces_meet_is_seen() -> None:
    """Acceleration that rises to where a piece ends and is gone after: no even grid sees it."""
    scene = tp.load_scene("hand-flip")
    mover, _ = lifting_hand(scene, 0.0)
    times, zero = np.array([0.0, 0.08765, 0.2]), np.zeros((2, 3))
    jerk = np.array([[0.0, 50.0, 0.0], [0.0, 0.0, 0.0]])
    motion = PlannedMotion(times, zero, zero, zero, jerk)
    _, steady = lifting_hand(scene, 50.0 * 0.08765)
    expected = slip_while_carrying(scene, mover, steady, 0.1)
    assert slip_while_carrying(scene, mover, motion, 0.1) == pytest.approx(expected, rel=1e-9)


def test_a_swing_of_the_acceleration_between_two_samples_is_seen() -> None:
    scene = tp.load_scene("hand-flip")
    mover, _ = lifting_hand(scene, 0.0)
    rest = np.zeros((200, 3))
    moved = rest.copy()
    # A micrometre in one millisecond, at rest at both ends: up to 5.8 m/s^2 in between.
    moved[61:, 1] = 1e-6
    sent = SampledMotion(moved, rest, rest)
    _, steady = lifting_hand(scene, 5.77)
    expected = slip_while_carrying(scene, mover, steady, 0.1)
    assert slip_while_carrying(scene, mover, sent, 0.1) == pytest.approx(expected, rel=0.02)
    still = slip_while_carrying(scene, mover, SampledMotion(rest, rest, rest), 0.1)
    assert still < 0.7 * expected


def violations(scene: tp.Scene, plan: tp.Plan) -> str:
    assert plan.throw is not None and plan.throw.sent is not None
    found = scene_violations(
        scene,
        plan.mover,
        plan.throw.samples,
        plan.throw.samples.times[-1],
        plan.throw.opening_time,
        plan.throw.sent,
    )
    return "; ".join(violation.words for violation in found)


def test_a_solved_plan_breaks_nothing_and_harder_scenes_are_broken(cup_plan: tp.Plan) -> None:
    scene = cup_plan.scene
    assert cup_plan.solved and violations(scene, cup_plan) == ""
    cup, workspace = scene.cup, scene.workspace
    assert cup is not None and workspace is not None
    changes = {
        "cup clearance": {"cup": dataclasses.replace(cup, x=cup.x + 0.05)},
        "cup": {"cup": dataclasses.replace(cup, clearance=0.0481)},
        "floor": {"workspace": dataclasses.replace(workspace, floor=0.4)},
        "base column": {"workspace": dataclasses.replace(workspace, column_radius=0.5)},
        "palm": {"workspace": dataclasses.replace(workspace, palm_clearance=0.2)},
    }
    for word, change in changes.items():
        assert word in violations(scene.replace(**change), cup_plan)


def test_planner_takes_no_throw_that_breaks_the_workspace() -> None:
    """The NLP knows nothing of the palm: the check alone must keep such throws out."""
    scene = tp.load_scene("pose")
    near = scene.replace(workspace=dataclasses.replace(scene.workspace, palm_clearance=2.0))
    plan = tp.plan(near)
    assert plan.status == "not_converged" and "palm" in plan.message


def test_palm_enters_the_nlp_when_it_decides() -> None:
    """Thrown backwards over the base, the bar would hit the hand: solved all the same."""
    plan = tp.Planner(tp.load_scene("pose")).plan(tp.Pose(x=-0.9, z=0.1, theta=0.0))
    assert plan.solved
    assert plan.constraints > tp.plan("pose").constraints
    assert violations(plan.scene, plan) == ""


def test_a_plan_with_the_palm_is_a_warm_start_too() -> None:
    planner = tp.Planner(tp.load_scene("pose"))
    first = planner.plan(tp.Pose(x=-0.9, z=0.1, theta=0.0))
    again = planner.plan(tp.Pose(x=-0.905, z=0.1, theta=0.0), warm=first)
    assert again.solved and again.constraints == first.constraints


def test_ruckig_follows_a_jerk_controlled_plan_exactly(cup_plan: tp.Plan) -> None:
    assert cup_plan.throw is not None
    planned = cup_plan.throw.planned
    sent = send(cup_plan.mover, planned)
    n = int(planned.times[-1] / 1e-3)
    q, dq, ddq = planned.at(sent.times[:n])
    assert np.abs(q.T - sent.q[:n]).max() < 1e-6
    assert np.abs(dq.T - sent.dq[:n]).max() < 1e-5
    assert np.abs(ddq.T - sent.ddq[:n]).max() < 1e-2


def test_sampled_motion_interpolates_a_quintic_exactly() -> None:
    t = 1e-3 * np.arange(30)
    polynomial = np.polynomial.Polynomial([0.3, -1.0, 2.0, 30.0, -400.0, 5e3])
    samples = SampledMotion(
        *(polynomial.deriv(k)(t)[:, None] if k else polynomial(t)[:, None] for k in range(3))
    )
    between = np.linspace(0, 0.0285, 101)
    for k, value in enumerate(samples.at(between)):
        exact = polynomial.deriv(k)(between) if k else polynomial(between)
        assert value[0] == pytest.approx(exact, rel=1e-9, abs=1e-9)
