"""Fails if what is sent is not what Ruckig gives when it follows every tick, or breaks a limit."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest
import ruckig
import throwplan as tp
from throwplan.models import Trajectory
from throwplan.planner.throw import TICK, Manipulator, Samples, excesses, make_manipulator, send

SHARE = 0.999


@cache
def panda() -> Manipulator:
    return make_manipulator(tp.load_scene("pose"))


def follow(manipulator: Manipulator, planned: Trajectory) -> list[np.ndarray]:
    """q, dq, ddq, each (N, n), by Ruckig from tick to tick, all the way to detach."""
    hard = manipulator.hard
    otg, trajectory = ruckig.Ruckig(manipulator.size), ruckig.Trajectory(manipulator.size)
    order = ruckig.InputParameter(manipulator.size)
    order.max_velocity = (SHARE * hard.dq).tolist()
    order.max_acceleration = (SHARE * hard.ddq).tolist()
    order.max_jerk = (SHARE * hard.jerk).tolist()
    order.minimum_duration = TICK
    ticks = math.ceil(planned.end / TICK - 1e-9)
    q, dq, ddq = (rows.T for rows in planned.at(TICK * np.arange(ticks + 1)))
    dq, ddq = (np.clip(v, -SHARE * m, SHARE * m) for v, m in ((dq, hard.dq), (ddq, hard.ddq)))
    states = [(q[0].tolist(), [0.0] * manipulator.size, [0.0] * manipulator.size)]
    for goal in zip(q[1:].tolist(), dq[1:].tolist(), ddq[1:].tolist(), strict=True):
        order.current_position, order.current_velocity, order.current_acceleration = states[-1]
        order.target_position, order.target_velocity, order.target_acceleration = goal
        otg.calculate(order, trajectory)
        states.append(trajectory.at_time(TICK))
    return [np.array(rows) for rows in zip(*states, strict=True)]


def assert_followed(manipulator: Manipulator, planned: Trajectory) -> Samples:
    """As Ruckig follows, as far as its results go: it takes 1e-8 for a position met."""
    sent, (q, dq, ddq) = send(manipulator, planned), follow(manipulator, planned)
    n = len(q)
    assert np.median(np.abs(sent.q[:n] - q).max(axis=1)) < 1e-12
    assert np.abs(sent.q[:n] - q).max() < 1e-8
    assert np.abs(sent.dq[:n] - dq).max() < 2e-8
    assert np.abs(sent.ddq[:n] - ddq).max() < 2e-5
    assert np.abs([sent.dq[-1], sent.ddq[-1]]).max() < 1e-12
    assert excesses(manipulator, sent) == []
    return sent


def pieces(seed: int, share: float, jerk: float) -> Trajectory:
    """Random pieces of 20 to 60 ms: accelerations within `share` of their limits, steps
    between them, and jerks within `jerk` of theirs."""
    hard, rng = panda().hard, np.random.default_rng(seed)
    dt = rng.uniform(0.02, 0.06, 12)
    ddq = rng.uniform(-1, 1, (12, 3)) * share * hard.ddq
    return joined(np.append(0.0, np.cumsum(dt)), ddq, rng.uniform(-1, 1, (12, 3)) * jerk)


def even_pieces(lengths: np.ndarray, jerk: np.ndarray) -> Trajectory:
    """From rest with continuous acceleration within its limits: jerks as shares of theirs."""
    hard, ddq = panda().hard, [np.zeros(3)]
    for k, length in enumerate(lengths):
        end = np.clip(ddq[-1] + length * jerk[k] * hard.jerk, -0.9 * hard.ddq, 0.9 * hard.ddq)
        jerk[k] = (end - ddq[-1]) / length / hard.jerk
        ddq.append(end)
    return joined(np.append(0.0, np.cumsum(lengths)), np.array(ddq[:-1]), jerk)


def joined(times: np.ndarray, ddq: np.ndarray, jerk: np.ndarray) -> Trajectory:
    """Pieces of these accelerations at their begin and jerks, shares of the limit."""
    hard, jerk = panda().hard, jerk * panda().hard.jerk
    q, dq = np.zeros_like(ddq), np.zeros_like(ddq)
    q[0] = (hard.q_min + hard.q_max) / 2
    for k, h in enumerate(np.diff(times)[:-1]):
        q[k + 1] = q[k] + h * (dq[k] + h * (ddq[k] / 2 + h * jerk[k] / 6))
        dq[k + 1] = dq[k] + h * (ddq[k] + h * jerk[k] / 2)
    return Trajectory.cubics(times, q, dq, ddq, jerk)


@pytest.mark.parametrize("name", ["near-cup"])
def test_a_plan_is_sent_as_ruckig_follows_it(name: str, plan_of) -> None:
    plan = plan_of(name)
    planned = plan.throw.planned
    sent = assert_followed(plan.manipulator, planned)
    for found, wanted, most in zip(
        (sent.q, sent.dq, sent.ddq), planned.at(sent.times), (1e-6, 1e-5, 1e-2), strict=True
    ):
        assert np.abs(found - wanted.T)[: int(planned.end / TICK)].max() < most


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize(("share", "jerk"), [(0.6, 0.0), (0.5, 0.02)])
def test_steps_of_the_acceleration_are_followed_the_same(seed, share, jerk) -> None:
    sent = assert_followed(panda(), pieces(seed, share, jerk))
    # At rest at first even where the plan starts with a step.
    assert not sent.dq[0].any() and not sent.ddq[0].any()


def test_a_motion_is_braked_as_ruckig_brakes_it() -> None:
    """From where planned motions end."""
    hard, rng = panda().hard, np.random.default_rng(1)
    otg, trajectory = ruckig.Ruckig(3), ruckig.Trajectory(3)
    for _ in range(20):
        # From rest by 6 pieces, with rates and accelerations of either sign at the end.
        planned = even_pieces(rng.uniform(0.002, 0.02, 6), rng.uniform(-0.9, 0.9, (6, 3)))
        sent = send(panda(), planned)
        order = ruckig.InputParameter(3)
        order.control_interface = ruckig.ControlInterface.Velocity
        order.synchronization = ruckig.Synchronization.No
        order.max_acceleration = (SHARE * hard.ddq).tolist()
        order.max_jerk = (SHARE * hard.jerk).tolist()
        last = math.ceil(planned.end / TICK - 1e-9)
        order.current_position = sent.q[last].tolist()
        order.current_velocity = sent.dq[last].tolist()
        order.current_acceleration = sent.ddq[last].tolist()
        order.target_velocity = order.target_acceleration = [0.0] * 3
        otg.calculate(order, trajectory)
        for k in range(last, len(sent.q)):
            q, dq, ddq = trajectory.at_time(TICK * (k - last))
            assert sent.q[k] == pytest.approx(q, abs=1e-9)
            assert sent.dq[k] == pytest.approx(dq, abs=1e-8)
            assert sent.ddq[k] == pytest.approx(ddq, abs=1e-6)
        assert trajectory.duration <= TICK * (len(sent.q) - 1 - last)
