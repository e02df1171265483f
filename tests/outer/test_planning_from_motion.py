"""Fails if a plan from a state of motion does not join it, breaks a limit, or misses."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.throw import TICK, Samples, excesses


@pytest.fixture(scope="module")
def swing(plan_of) -> tp.Plan:
    return plan_of("pose")


def state_at(plan: tp.Plan, tick: int) -> tp.State:
    samples = plan.throw.samples
    return tp.State(samples.q[tick], samples.dq[tick], samples.ddq[tick])


@pytest.mark.parametrize(("tick", "dx"), [(60, 0.1), (150, -0.04)])
def test_a_swing_goes_on_to_another_target(pose_planner, swing, tick, dx) -> None:
    state, target = state_at(swing, tick), swing.target.changed(x=swing.target.x + dx)
    plan = pose_planner.plan(target, start=state, warm=swing)
    assert plan.solved, plan.message
    sent, before = plan.throw.samples, swing.throw.samples
    for name in ("q", "dq", "ddq"):
        assert getattr(sent, name)[0] == pytest.approx(getattr(state, name), abs=1e-9)
    # What was sent until then and what is sent now are one motion within the limits.
    both = ([getattr(before, k)[:tick], getattr(sent, k)] for k in ("q", "dq", "ddq"))
    whole = Samples(*map(np.vstack, both))
    assert not excesses(pose_planner.manipulator, whole)
    # It lands there, thrown as one motion too; the gripper is told after the state, not before.
    one = {"path": whole.path, "samples": whole, "manipulator": pose_planner.manipulator}
    opening = plan.throw.opening_time + TICK * tick
    throw = dataclasses.replace(plan.throw.deciding, opening_time=opening, **one)
    (dx, dtheta), own = throw.miss(target), plan.throw.deciding.miss(target)
    assert abs(dx - own[0]) < 1e-4 and abs(dtheta - own[1]) < 1e-3
    assert plan.throw.deciding.command_time >= 0


def test_any_state_within_the_limits_is_a_start(pose_planner, swing) -> None:
    """Without a plan to go on from: states drawn at random, at up to a third of the rates."""
    limits, random, solved = pose_planner.manipulator.planning, np.random.default_rng(3), 0
    middle, half = (limits.q_max + limits.q_min) / 2, (limits.q_max - limits.q_min) / 2
    home = swing.throw.samples.q[0]
    home = home + 0.2 * (middle - home)
    for _ in range(4):
        q = home + random.uniform(-0.1, 0.1, 3) * half
        state = tp.State(q, random.uniform(-0.3, 0.3, 3) * limits.dq, np.zeros(3))
        plan = pose_planner.plan(start=state)
        if plan.solved:
            solved += 1
            assert plan.throw.samples.q[0] == pytest.approx(q, abs=1e-9)
            assert plan.throw.samples.dq[0] == pytest.approx(state.dq, abs=1e-9)
    assert solved >= 3


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("q", np.full(3, 9.0), "State q: joint 2 at 9: must be -1.7628 to 1.7628"),
        ("dq", np.full(3, -9.0), "State dq: joint 2 at -9: must be -2.175 to 2.175"),
        ("ddq", np.full(3, np.nan), "State ddq: must be 3 finite numbers"),
        ("ddq", "still", "State ddq: must be numbers"),
        ("dq", np.zeros(7), "State dq: must be 3 finite numbers"),
    ],
)
def test_states_beyond_the_limits_are_refused(pose_planner, swing, name, value, words) -> None:
    state = dataclasses.replace(state_at(swing, 50), **{name: value})
    with pytest.raises(tp.InputError, match=words):
        pose_planner.plan(start=state)
    with pytest.raises(tp.InputError, match="start: a robust plan begins at rest"):
        pose_planner.plan(start=state_at(swing, 50), robust=True)
