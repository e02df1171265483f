"""What is sent is what Ruckig gives when it follows every tick."""

from __future__ import annotations

import dataclasses
from functools import cache

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.check import smooth
from throwplan.planner.check.check import broken_limits
from throwplan.planner.check.motion import TICK, PlannedMotion, SampledMotion
from throwplan.planner.check.mover import Mover, make_mover
from throwplan.planner.check.smooth import send


@cache
def plan_of(name: str) -> tp.Plan:
    return tp.plan(name)


@cache
def panda() -> Mover:
    return make_mover(tp.load_scene("pose"))


def followed_all_the_way(mover: Mover, planned: PlannedMotion, monkeypatch) -> SampledMotion:
    with monkeypatch.context() as patch:
        patch.setattr(
            smooth,
            "_kept_ticks",
            lambda limits, planned, until: np.zeros(round(until / TICK), dtype=bool),
        )
        return send(mover, planned)


def kept(mover: Mover, planned: PlannedMotion) -> np.ndarray:
    hard = mover.hard
    assert hard.jerk is not None
    limits = smooth._Limits(*(smooth.SHARE * most for most in (hard.dq, hard.ddq, hard.jerk)))
    return smooth._kept_ticks(limits, planned, TICK * np.ceil(planned.times[-1] / TICK))


def same(one: SampledMotion, other: SampledMotion) -> None:
    """Equal as far as Ruckig's own results are: it takes 1e-8 for a position or rate met."""
    assert one.q.shape == other.q.shape
    assert np.median(np.abs(one.q - other.q).max(axis=1)) < 1e-12
    assert np.abs(one.q - other.q).max() < 1e-8
    assert np.abs(one.dq - other.dq).max() < 2e-8
    # The brake switches its jerk at another nanosecond: 1e-9 s of 10,000 rad/s^3.
    assert np.abs(one.ddq - other.ddq).max() < 2e-5


def pieces(seed: int, share: float, jerk: float) -> PlannedMotion:
    """Random pieces of 20 to 60 ms: accelerations within `share` of their limits, steps
    between them, and jerks within `jerk` of theirs."""
    hard, rng = panda().hard, np.random.default_rng(seed)
    assert hard.jerk is not None
    dt = rng.uniform(0.02, 0.06, 12)
    ddq = rng.uniform(-1, 1, (12, 3)) * share * hard.ddq
    jerks = rng.uniform(-1, 1, (12, 3)) * jerk * hard.jerk
    q, dq = np.zeros((12, 3)), np.zeros((12, 3))
    q[0] = (hard.q_min + hard.q_max) / 2
    for k, h in enumerate(dt[:-1]):
        q[k + 1] = q[k] + h * (dq[k] + h * (ddq[k] / 2 + h * jerks[k] / 6))
        dq[k + 1] = dq[k] + h * (ddq[k] + h * jerks[k] / 2)
    return PlannedMotion(np.concatenate([[0.0], np.cumsum(dt)]), q, dq, ddq, jerks)


def even(jerk: float) -> PlannedMotion:
    """From rest with continuous acceleration: jerk up, down, down, up at `jerk` of the limit."""
    hard = panda().hard
    assert hard.jerk is not None
    signs, h = np.array([1.0, -1.0, -1.0, 1.0]), 0.0015
    q, dq, ddq = (np.zeros((4, 3)) for _ in range(3))
    q[0] = (hard.q_min + hard.q_max) / 2
    jerks = signs[:, None] * jerk * hard.jerk
    for k in range(3):
        q[k + 1] = q[k] + h * (dq[k] + h * (ddq[k] / 2 + h * jerks[k] / 6))
        dq[k + 1] = dq[k] + h * (ddq[k] + h * jerks[k] / 2)
        ddq[k + 1] = ddq[k] + h * jerks[k]
    return PlannedMotion(h * np.arange(5.0), q, dq, ddq, jerks)


@pytest.mark.parametrize("name", ["pose", "cup", "box", "flip"])
def test_a_plan_is_sent_as_ruckig_follows_it(name: str, monkeypatch) -> None:
    plan = plan_of(name)
    assert plan.throw is not None
    sent = send(plan.mover, plan.throw.planned)
    same(sent, followed_all_the_way(plan.mover, plan.throw.planned, monkeypatch))
    assert broken_limits(plan.mover.hard, plan.mover.joints, sent) == []


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("share", "jerk"), [(0.2, 0.0), (0.6, 0.0), (0.5, 0.02)])
def test_steps_of_the_acceleration_are_followed_the_same(
    seed: int, share: float, jerk: float, monkeypatch
) -> None:
    planned = pieces(seed, share, jerk)
    assert not kept(panda(), planned).all()
    sent = send(panda(), planned)
    same(sent, followed_all_the_way(panda(), planned, monkeypatch))
    assert broken_limits(panda().hard, panda().joints, sent) == []


@pytest.mark.parametrize("jerk", [0.5, 0.95, 0.998])
def test_a_motion_within_the_limits_needs_no_ruckig(jerk: float, monkeypatch) -> None:
    planned = even(jerk)
    assert kept(panda(), planned).all()
    sent = send(panda(), planned)
    same(sent, followed_all_the_way(panda(), planned, monkeypatch))
    assert sent.q[:7] == pytest.approx(planned.at(TICK * np.arange(7))[0].T, abs=0)
    assert broken_limits(panda().hard, panda().joints, sent) == []


def test_what_breaks_a_limit_is_left_to_ruckig() -> None:
    planned = even(0.9)
    # Jerk beyond the limit in the third piece, 3 to 4.5 ms.
    jerks = planned.jerk.copy()
    jerks[2, 1] *= 1.2
    broken = dataclasses.replace(planned, jerk=jerks)
    assert kept(panda(), broken)[3:5].tolist() == [False, False]
    assert kept(panda(), broken)[0]
    # A gap in the position where two pieces meet, at 1.5 ms: 60 of it / TICK^3 is its jerk.
    for gap, fine in ((1e-12, True), (1e-5, False)):
        q = planned.q + gap * np.array([0.0, 1, 1, 1])[:, None]
        ticks = kept(panda(), dataclasses.replace(planned, q=q))
        assert ticks.tolist() == [True, fine, True, True, True, True]


@pytest.mark.parametrize("size", [1e-10, 1e-8, 1e-7])
def test_gaps_that_a_solver_leaves_change_nothing(size: float, monkeypatch) -> None:
    plan = plan_of("cup")
    assert plan.throw is not None
    planned, rng = plan.throw.planned, np.random.default_rng(0)
    moved = dataclasses.replace(
        planned,
        q=planned.q + size * rng.uniform(-1, 1, planned.q.shape) * (planned.times[:-1, None] > 0),
        dq=planned.dq + size * rng.uniform(-1, 1, planned.q.shape) * (planned.times[:-1, None] > 0),
    )
    same(send(plan.mover, moved), followed_all_the_way(plan.mover, moved, monkeypatch))


def test_the_first_sample_is_at_rest_even_where_the_plan_starts_with_a_step() -> None:
    sent = send(panda(), pieces(3, 0.5, 0.0))
    assert not sent.dq[0].any() and not sent.ddq[0].any()
    assert np.abs([sent.dq[-1], sent.ddq[-1]]).max() < 1e-12
