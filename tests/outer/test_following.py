"""Fails if a swing that is corrected or planned anew leaves its motion or limits, or misses."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable

import numpy as np
import pytest
import throwplan as tp
from throwplan import robots
from throwplan.planner.throw import TICK, Samples, excesses
from throwplan.robots.following import Response, Session, Update

HORIZON = 0.02


@pytest.fixture(scope="module")
def plan(plan_of) -> tp.Plan:
    return plan_of("pose")


@pytest.fixture(scope="module")
def loud(loud_planner_of) -> tp.Planner:
    """Its throws leave more room to be changed."""
    return loud_planner_of("pose")


def played(
    session: Session, target: Callable[[float], tp.Pose], every: int = 5, response=None
) -> tuple[list[Update], Samples, np.ndarray]:
    """The updates of a swing, what was sent in the end, and the joints as an arm followed it."""
    updates: list[Update] = []
    limits = session.throw.manipulator
    follow = response or (lambda q: q)
    tick = 0
    while not updates or updates[-1].status not in ("committed", "stopped"):
        before = session.throw.samples
        q = follow(before.q[: tick + 1])[-1]
        found = session.update(TICK * tick, q, before.dq[tick], target(TICK * tick))
        after = session.throw.samples
        # What is on its way stays; what follows is joined to it within the limits.
        committed = round((TICK * tick + HORIZON) / TICK)
        assert found.first >= committed
        assert (after.q[: committed + 1] == before.q[: committed + 1]).all()
        assert not excesses(limits, after)
        assert np.abs([after.dq[-1], after.ddq[-1]]).max() < 1e-9
        # Of all joints, at 1 kHz, to rest.
        throwing = [j - 1 for j in session.throw.scene.arm.throwing_joints]
        assert (found.q[:, throwing] == after.q[found.first :]).all()
        updates.append(found)
        tick += every
    return updates, session.throw.samples, follow(session.throw.samples.q)


def check_hit(session: Session, goal: tp.Pose) -> None:
    """What was sent lands on a pose, thrown as any plan."""
    throw = dataclasses.replace(session.throw, scene=session.throw.scene.aimed_at(goal))
    assert throw.release.trouble == ""
    (dx, dtheta), tolerance = throw.miss(goal), throw.scene.tolerance
    assert abs(dx) < tolerance.position / 2 and abs(dtheta) < tolerance.angle / 2


@pytest.mark.parametrize(("jump", "turn"), [(0.06, 0.0), (-0.05, 0.2)])
def test_a_target_that_jumps_is_hit(pose_planner, plan, jump, turn) -> None:
    session, target = robots.follow(pose_planner, plan, HORIZON), plan.target
    there = target.changed(x=target.x + jump, theta=target.theta + turn)
    updates, *_ = played(session, lambda t: target if t < 0.04 else there)
    check_hit(session, there)
    assert "followed" in {update.status for update in updates}
    assert updates[-1].command_time == plan.throw.deciding.command_time


def test_a_target_that_speeds_up_is_hit_where_it_then_is(pose_planner) -> None:
    """Planned for 0.1 m/s; from 60 ms on it moves faster, and is seen to."""
    # At the recommended torque rate the rest of the swing has no room for that, nor a quiet one.
    scene = pose_planner.scene.replace(torque=tp.Torque(rate=1e5), cost=tp.Cost(quiet=0.0))
    planner = tp.Planner(scene, library=False)
    plan = planner.plan(scene.target.changed(velocity=(0.1,)))
    session, start = robots.follow(planner, plan, HORIZON), plan.target.x

    def where(t: float) -> float:
        return start + 0.1 * t + 0.12 * max(t - 0.06, 0.0)

    def seen(t: float) -> tp.Pose:
        return plan.target.changed(x=where(t), velocity=(0.22 if t >= 0.06 else 0.1,))

    played(session, seen)
    there = plan.target.changed(x=where(session.throw.landing_time), velocity=None)
    check_hit(session, there)


def test_a_target_that_leaves_the_reach_stops_the_swing(pose_planner, plan) -> None:
    session, target = robots.follow(pose_planner, plan, HORIZON), plan.target
    updates, sent, _ = played(session, lambda t: target.changed(x=target.x + 40 * t**2), 10)
    last = updates[-1]
    assert last.status == "stopped" and last.command_time is None
    assert TICK * len(sent.q) < TICK * len(plan.throw.samples.q) + 0.2
    # Stopped it stays, whatever the target does then.
    again = session.update(0.5, sent.q[-1], sent.dq[-1], target)
    assert again.status == "stopped" and (again.q == last.q[-1]).all()


def test_joints_that_lag_are_learnt_on_the_way(loud) -> None:
    """By joints that follow 6 ms late the measured motion lands nearer by over three times."""
    law = Response(np.full(3, 120.0), np.full(3, 0.3))
    noise, plan = np.random.default_rng(0), loud.plan()
    session, target = robots.follow(loud, plan, HORIZON), plan.target

    def measured(q: np.ndarray) -> np.ndarray:
        return law.all(q) + noise.normal(scale=2e-4, size=q.shape)

    def landing(samples: Samples) -> float:
        joints = law.all(np.array([samples.q, samples.dq, samples.ddq]))
        path = Samples(*joints).path
        dx, dtheta = dataclasses.replace(plan.throw.deciding, path=path).miss(target)
        return abs(dx) + abs(dtheta) * plan.scene.object.length / 2

    open_loop = landing(plan.throw.samples)
    _, sent, _ = played(session, lambda t: target, 2, measured)
    assert landing(sent) < open_loop / 3


#: What an update is given instead, and words of the message.
WRONG_UPDATES = [
    ({"t": math.nan}, "t = nan: must be a finite number"),
    ({"t": 0.05}, "t = 0.05: must be above 0.05, the last update's"),
    ({"t": 0.01}, "t = 0.01: must be above 0.05"),
    ({"q": [math.nan] * 3}, "q: must be 7 or 3 finite numbers"),
    ({"q": [0.0] * 5}, "q: must be 7 or 3 finite numbers"),
    ({"t": 99.0}, "t = 99: must be at most"),
    (
        {"q": [0.0, -2.0, 30.0]},
        r"q: joint 6 is .* rad off what is sent, must be at most 1 .*degrees",
    ),
    ({"dq": [0.0, 1e300, 0.0]}, r"dq: joint 4 is 1e\+300 rad per s, must be at most 20 "),
    ({"target": tp.Pose(0.9, 0.1, 0.4, y=0.5)}, "target: is 29.1 deg off the throw's plane"),
    ({"target": tp.Pose(0.9, 0.1)}, "target: must fix theta if the plan's target does"),
]


def test_wrong_updates_leave_the_motion_as_it_is(pose_planner, plan) -> None:
    session = robots.follow(pose_planner, plan, HORIZON)
    q, dq = plan.throw.samples.q, plan.throw.samples.dq
    moved = plan.target.changed(x=plan.target.x + 0.02)
    session.update(0.05, q[50], dq[50], moved)
    before, given = session.throw, {"t": 0.06, "q": q[60], "dq": dq[60], "target": moved}
    for changes, words in WRONG_UPDATES:
        with pytest.raises(tp.InputError, match=words):
            session.update(**given | changes)
        assert session.throw is before
    assert session.update(**given).status in ("followed", "kept")


def test_what_can_be_followed(pose_planner, plan, planner_of, plan_of) -> None:
    with pytest.raises(tp.InputError, match=r"horizon = 0\.5: must be above 0 s and below 0\.2"):
        robots.follow(pose_planner, plan, 0.5)
    with pytest.raises(tp.InputError, match="follow: needs a solved plan of this planner's scene"):
        robots.follow(planner_of("near-cup"), plan)
    with pytest.raises(tp.InputError, match=r"follow: only for a scene with \[robot\]"):
        robots.follow(planner_of("hand-box"), plan_of("hand-box"))


@pytest.mark.parametrize(("rate", "share"), [(5.0, -0.5), (450.0, 0.6)])
def test_a_lag_is_found_from_exact_joints(plan, rate, share) -> None:
    """Also where a millisecond is a good part of the lag."""
    sent = plan.throw.samples.q
    law = Response(np.full(3, rate), np.full(3, share))
    found = Response.fitted(sent, law.all(sent))
    assert found.rate == pytest.approx(law.rate, rel=1e-6)
    assert found.share == pytest.approx(law.share, abs=1e-6)


def test_before_the_motion_all_of_it_is_to_come(pose_planner, plan) -> None:
    """A controller that begins with the session gets the samples from the first on."""
    samples = plan.throw.samples
    first = robots.follow(pose_planner, plan).update(-1.0, samples.q[0], samples.dq[0])
    joints = [j - 1 for j in plan.scene.arm.throwing_joints]
    np.testing.assert_allclose(first.q[:, joints], samples.q, rtol=0, atol=1e-12)


# Plans that go on from a state of motion.


def state_at(plan: tp.Plan, tick: int) -> tp.State:
    samples = plan.throw.samples
    return tp.State(samples.q[tick], samples.dq[tick], samples.ddq[tick])


@pytest.mark.parametrize(("tick", "dx"), [(60, 0.1), (150, -0.04)])
def test_a_swing_goes_on_to_another_target(pose_planner, plan, tick, dx) -> None:
    state, target = state_at(plan, tick), plan.target.changed(x=plan.target.x + dx)
    found = pose_planner.plan(target, start=state, warm=plan)
    assert found.solved, found.message
    sent, before = found.throw.samples, plan.throw.samples
    for name in ("q", "dq", "ddq"):
        assert getattr(sent, name)[0] == pytest.approx(getattr(state, name), abs=1e-9)
    # What was sent until then and what is sent now are one motion within the limits.
    both = ([getattr(before, k)[:tick], getattr(sent, k)] for k in ("q", "dq", "ddq"))
    whole = Samples(*map(np.vstack, both))
    assert not excesses(pose_planner.manipulator, whole)
    # It lands there, thrown as one motion too; the gripper is told after the state, not before.
    one = {"path": whole.path, "samples": whole, "manipulator": pose_planner.manipulator}
    opening = found.throw.opening_time + TICK * tick
    throw = dataclasses.replace(found.throw.deciding, opening_time=opening, **one)
    (dx, dtheta), own = throw.miss(target), found.throw.deciding.miss(target)
    assert abs(dx - own[0]) < 1e-4 and abs(dtheta - own[1]) < 1e-3
    assert found.throw.deciding.command_time >= 0


def test_any_state_within_the_limits_is_a_start(pose_planner, plan) -> None:
    """Without a plan to go on from: states drawn at random, at up to a third of the rates."""
    limits, random, solved = pose_planner.manipulator.planning, np.random.default_rng(3), 0
    middle, half = (limits.q_max + limits.q_min) / 2, (limits.q_max - limits.q_min) / 2
    home = plan.throw.samples.q[0]
    home = home + 0.2 * (middle - home)
    for _ in range(4):
        q = home + random.uniform(-0.1, 0.1, 3) * half
        state = tp.State(q, random.uniform(-0.3, 0.3, 3) * limits.dq, np.zeros(3))
        found = pose_planner.plan(start=state)
        if found.solved:
            solved += 1
            assert found.throw.samples.q[0] == pytest.approx(q, abs=1e-9)
            assert found.throw.samples.dq[0] == pytest.approx(state.dq, abs=1e-9)
    assert solved >= 3


@pytest.mark.parametrize(
    ("name", "value", "words"),
    [
        ("q", np.full(3, 9.0), "State q: joint 2 at 9: must be -1.7628 to 1.7628"),
        ("dq", np.full(3, -9.0), "State dq: joint 2 at -9: must be -2.175 to 2.175"),
        ("ddq", np.full(3, np.nan), "State ddq: must be 3 finite numbers"),
        ("dq", np.zeros(7), "State dq: must be 3 finite numbers"),
    ],
)
def test_states_beyond_the_limits_are_refused(pose_planner, plan, name, value, words) -> None:
    state = dataclasses.replace(state_at(plan, 50), **{name: value})
    with pytest.raises(tp.InputError, match=words):
        pose_planner.plan(start=state)
    with pytest.raises(tp.InputError, match="start: a robust plan begins at rest"):
        pose_planner.plan(start=state_at(plan, 50), robust=True)
