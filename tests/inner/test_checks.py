"""The check behind `solved` sees what is broken."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from throwplan.models import Path, PlanarHand, hand_motion
from throwplan.planner.check import Mover, Samples, Throw, make_mover, send


@pytest.fixture(scope="module")
def cup_plan() -> tp.Plan:
    return tp.plan("cup")


def lifting_hand(scene: tp.Scene, acceleration: float) -> tuple[Mover, Path]:
    """A level hand at rest that then accelerates upwards for 0.2 s."""
    mover = dataclasses.replace(make_mover(scene), motion=hand_motion(PlanarHand(True)), start=None)
    zero = np.zeros((1, 3))
    lift = np.array([[0.0, acceleration, 0.0]])
    return mover, Path.cubics(np.array([0.0, 0.2]), zero, zero, lift, zero)


def test_grip_use_of_a_lifted_level_bar_by_hand() -> None:
    """Level bar, hand accelerating up with a: torque m h (g + a) over c r_p n mu f_N."""
    scene = tp.load_scene("hand-flip")
    mover, motion = lifting_hand(scene, 2.0)
    weight = 0.24 * (scene.gravity + 2.0)
    torque = weight * 0.1 / (0.6 * 0.0025 * 2 * 120.0)
    force = weight / (2 * 120.0)
    used = Throw(scene, mover, motion, 0.1).grip_use
    assert used == pytest.approx(math.hypot(torque, force), rel=1e-9)


def test_a_peak_of_the_grip_use_where_two_pieces_meet_is_seen() -> None:
    """Acceleration that rises to where a piece ends and is gone after: no even grid sees it."""
    scene = tp.load_scene("hand-flip")
    mover, _ = lifting_hand(scene, 0.0)
    times, zero = np.array([0.0, 0.08765, 0.2]), np.zeros((2, 3))
    jerk = np.array([[0.0, 50.0, 0.0], [0.0, 0.0, 0.0]])
    motion = Path.cubics(times, zero, zero, zero, jerk)
    _, steady = lifting_hand(scene, 50.0 * 0.08765)
    expected = Throw(scene, mover, steady, 0.1).grip_use
    assert Throw(scene, mover, motion, 0.1).grip_use == pytest.approx(expected, rel=1e-9)


def test_a_swing_of_the_acceleration_between_two_samples_is_seen() -> None:
    scene = tp.load_scene("hand-flip")
    mover, _ = lifting_hand(scene, 0.0)
    rest = np.zeros((200, 3))
    moved = rest.copy()
    # A micrometre in one millisecond, at rest at both ends: up to 5.8 m/s^2 in between.
    moved[61:, 1] = 1e-6
    sent = Samples(moved, rest, rest).path
    _, steady = lifting_hand(scene, 5.77)
    expected = Throw(scene, mover, steady, 0.1).grip_use
    assert Throw(scene, mover, sent, 0.1).grip_use == pytest.approx(expected, rel=0.02)
    still = Samples(rest, rest, rest).path
    assert Throw(scene, mover, still, 0.1).grip_use < 0.7 * expected


def test_ruckig_follows_a_jerk_controlled_plan_exactly(cup_plan: tp.Plan) -> None:
    assert cup_plan.throw is not None
    planned = cup_plan.throw.planned
    sent = send(cup_plan.mover, planned)
    n = int(planned.end / 1e-3)
    q, dq, ddq = planned.at(sent.times[:n])
    assert np.abs(q.T - sent.q[:n]).max() < 1e-6
    assert np.abs(dq.T - sent.dq[:n]).max() < 1e-5
    assert np.abs(ddq.T - sent.ddq[:n]).max() < 1e-2
