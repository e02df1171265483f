"""The check behind `solved` sees what is broken."""

from __future__ import annotations

import dataclasses
import functools
import math
import pickle
from collections.abc import Callable
from typing import TypeVar

import numpy as np
import pytest
import throwplan as tp
from throwplan.models import Path, PlanarHand, hand_motion
from throwplan.planner.check import Mover, Samples, Throw, broken_limits, make_mover, send
from throwplan.planner.ocp import broken

T = TypeVar("T")


def lifting_hand(scene: tp.Scene, acceleration: float) -> tuple[Mover, Path]:
    """A level hand at rest that then accelerates upwards for 0.2 s."""
    mover = dataclasses.replace(make_mover(scene), motion=hand_motion(PlanarHand(True)), start=None)
    zero = np.zeros((1, 3))
    lift = np.array([[0.0, acceleration, 0.0]])
    return mover, Path.cubics(np.array([0.0, 0.2]), zero, zero, lift, zero)


@pytest.mark.parametrize(("below", "grazes"), [(1e-9, True), (1e-5, True), (1e-4, False)])
def test_a_throw_whose_top_is_the_targets_height_is_not_taken(below: float, grazes: bool) -> None:
    """Where it lands depends on micrometres there: at 0.02 m/s down it is 20 um below the top."""
    plan = tp.plan("hand-flip")
    throw, target = plan.throw.final, plan.target
    start = throw.release.detach
    top = float(start.z + start.v_z**2 / (2 * plan.scene.gravity))
    high = dataclasses.replace(throw, scene=plan.scene.aimed_at(target.changed(z=top - below)))
    assert high.lands
    assert any("grazes" in violation.words for violation in broken(high)) == grazes


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


# The compiled core and NumPy say the same.


@pytest.fixture
def by_numpy(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[], T]], T]:
    """Runs something without the compiled core."""

    def run(something: Callable[[], T]) -> T:
        with monkeypatch.context() as changed:
            changed.setenv("THROWPLAN_COMPILE", "0")
            return something()

    return run


def numbers(throw: Throw) -> dict[str, float]:
    """What is measured of a throw, by name."""
    return {name: getattr(throw.measured, name) for name, *_ in throw.measured._fields_}


@pytest.mark.parametrize("name", ["pose", "fr3", "hand-flip"])
def test_the_compiled_core_sends_and_checks_the_same(name: str, by_numpy) -> None:
    plan = tp.plan(name)
    assert plan.throw is not None
    mover, planned, opening = plan.mover, plan.throw.planned, plan.throw.opening_time

    def sent(late: float, model: str) -> tuple[Samples, Throw]:
        samples = send(mover, planned)
        throw = Throw.sent(plan.throw.scene, mover, planned, samples, opening + late)
        return samples, throw.by(model)

    # The limit surface by NumPy takes even steps, which settle to some micrometres.
    for late, model, near in (
        *((late, "sp", 1e-7) for late in (0.0, 0.02, -0.05)),
        (0.0, "ls-step", 1e-5),
    ):
        make = functools.partial(sent, late, model)
        (samples, throw), (others, other) = make(), by_numpy(make)
        for rows in ("q", "dq", "ddq"):
            assert getattr(samples, rows) == pytest.approx(getattr(others, rows), abs=1e-10)
        kinks = by_numpy(lambda other=other: other.path.kinks)
        assert throw.path.kinks == pytest.approx(kinks, abs=1e-12)
        use = by_numpy(lambda other=other: other.grip_use)
        assert throw.grip_use == pytest.approx(use, rel=1e-9)
        measured = by_numpy(lambda other=other: numbers(other))
        assert numbers(throw) == pytest.approx(measured, abs=near)
        assert broken(throw) == by_numpy(lambda other=other: broken(other))
        assert broken_limits(mover, samples) == by_numpy(
            functools.partial(broken_limits, mover, others)
        )


def test_both_measure_the_same_where_things_are_near(cup_plan: tp.Plan, by_numpy) -> None:
    """Early and late openings on the plan's motion, beside a wide column and a large palm."""
    assert cup_plan.throw is not None
    throw, near = cup_plan.throw.final.sliding_pivot, set()
    scene, arm = throw.scene, throw.scene.arm
    assert scene.workspace is not None and arm is not None
    tool = dataclasses.replace(arm.tool, palm_half_width=0.12, palm_back=0.3)
    crowded = scene.replace(
        arm=dataclasses.replace(arm, tool=tool),
        workspace=dataclasses.replace(
            scene.workspace, column_radius=0.7, column_height=0.6, palm_clearance=0.08
        ),
    )
    for late in np.linspace(-0.3, 0.1, 9):
        one = dataclasses.replace(throw, scene=crowded, opening_time=throw.opening_time + late)
        other = dataclasses.replace(one)
        found = by_numpy(lambda other=other: numbers(other))
        assert numbers(one) == pytest.approx(found, abs=1e-6)
        near |= {key for key, value in found.items() if math.isfinite(value)}
    assert near == set(numbers(throw))


def test_a_checked_throw_goes_to_another_process(cup_plan: tp.Plan) -> None:
    """What it has of this process's memory stays behind."""
    assert cup_plan.throw is not None
    throw = dataclasses.replace(cup_plan.throw.final)
    assert broken(throw) == []
    sent = dataclasses.replace(pickle.loads(pickle.dumps(throw)))
    assert numbers(sent) == numbers(throw)


@pytest.mark.parametrize("seed", range(4))
def test_both_name_the_same_broken_limits(seed: int, by_numpy) -> None:
    mover, rng = make_mover(tp.load_scene("fr3")), np.random.default_rng(seed)
    middle = (mover.hard.q_min + mover.hard.q_max) / 2
    walk = [np.cumsum(rng.normal(0, s, (60, mover.size)), axis=0) for s in (2e-3, 0.2, 0.5)]
    samples = Samples(middle + walk[0], *walk[1:])
    found = broken_limits(mover, samples)
    assert found and found == by_numpy(lambda: broken_limits(mover, samples))
