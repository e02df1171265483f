"""Fails if a throw lands where a moving target is not, or at another time than it is due."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from builders import only
from throwplan.planner.verdict import verdict_on


def moving(planner: tp.Planner, speed: float | None = None, **changes) -> tp.Plan:
    velocity = None if speed is None else (speed,)
    # Some take nearly the usual patience; what is tested here is not the time.
    target = dataclasses.replace(planner.scene.target, velocity=velocity, **changes)
    return planner.plan(target, patience=20.0)


def assert_met(plan: tp.Plan) -> None:
    """The landing is where the target is at its time, from the JSON's own numbers."""
    assert plan.solved, plan.message
    answer = plan.to_dict()
    time, target = answer["release"]["landing_time"], answer["target"]
    (speed,) = target.get("velocity", [0.0])
    landing, tolerance = answer["landing"]["limit_surface"], plan.scene.tolerance
    assert abs(landing["x"] - (target["x"] + speed * time)) <= tolerance.position / 4
    if target["theta"] is not None:
        assert abs(landing["theta"] - target["theta"]) <= tolerance.angle / 4
    # A sample more or less: the arm waits in whole ones.
    arrival = target.get("arrival", [0.0, math.inf])
    earliest, latest = arrival if isinstance(arrival, list) else (arrival, arrival)
    assert earliest - 1e-3 <= time <= latest + 1e-3


@pytest.mark.parametrize(
    ("speed", "where"),
    [
        (0.1, {}),
        pytest.param(-0.4, {}, marks=pytest.mark.slow),
        # It leaves: a throw that takes its time would come too late.
        (0.35, {"x": 1.0}),
        # Where the landing's time changes by half a sample as the target moves on by a whole.
        (0.4, {"x": 1.2 - 0.4 * 1.0538, "theta": 0.0, "arrival": 1.0538}),
        (None, {"arrival": (0.8, 1.1)}),
    ],
)
def test_a_target_is_met_where_it_then_is(loud_planner_of, speed, where) -> None:
    assert_met(moving(loud_planner_of("pose"), speed, **where))


def test_a_throw_that_is_due_may_be_quiet(planner_of) -> None:
    plan = moving(planner_of("hand-flip"), arrival=(0.2, 0.95))
    assert_met(plan)
    assert plan.peak_load < 0.05


def test_a_motion_and_a_time_add_to_the_nlp_only_what_they_need(planner_of) -> None:
    """A throw to where a target is met has its NLP; a time of arrival has rows of its own."""
    planner = planner_of("hand-box")
    target = planner.scene.target.changed(velocity=(0.1,))
    met = planner.plan(target, solver="fatrop")
    still = planner.plan(met.goal.changed(velocity=None), solver="fatrop")
    timed = planner.plan(still.target.changed(arrival=2.0), solver="fatrop")
    assert met.solved and still.solved and met.variables == still.variables < timed.variables


def test_a_target_that_comes_is_waited_for(planner_of, tmp_path, table) -> None:
    plan = moving(planner_of("hand-flip"), -0.5, x=3.4)
    assert_met(plan)
    plan.save(tmp_path)
    rows = table(tmp_path / "motion.csv")
    still = int(np.argmax(np.abs(rows["vx"]) > 0.0))
    assert still > 100 and (rows["x"][:still] == rows["x"][0]).all()
    again = tp.read_plan(tmp_path)
    assert again.landing_time == pytest.approx(plan.throw.landing_time, abs=1e-6)
    assert again.miss()[0] == pytest.approx(plan.throw.deciding.miss()[0], abs=1e-6)


def test_what_cannot_be_met_says_what_binds(planner_of) -> None:
    """The hand may wait: whether the place is in reach does not depend on the time."""
    planner = planner_of("hand-box")
    for velocity, x, arrival in (((0.2,), 4.0, 1.5), (None, 1.2, 0.15)):
        target = planner.scene.target.changed(x=x, arrival=arrival, velocity=velocity)
        plan = planner.plan(target, patience=3.0)
        limits = [one.limit for one in plan.binding]
        assert plan.status == "not_found" and plan.to_dict()["target"]["arrival"] == arrival
        assert limits and ("arrival" in limits) == (velocity is None)


def test_a_cup_that_moves_is_entered_as_it_sees_the_bar(planner_of) -> None:
    """All corners of the bar below the rim are inside the cup that has moved along."""
    planner = planner_of("near-cup")
    plan = moving(planner, -0.2)
    assert_met(plan)
    throw, cup, bar = plan.throw.deciding, plan.throw.deciding.scene.cup, planner.scene.object
    flight = throw.landing.flight_time
    since = np.linspace(0.0, flight, 2000)
    x, z, theta = throw.flight(since)
    x = x - -0.2 * (since - flight)
    deepest = np.inf
    for along in (-bar.com, bar.length - bar.com):
        for across in (-bar.width / 2, bar.width / 2):
            at_x = x + along * np.cos(theta) - across * np.sin(theta)
            at_z = z + along * np.sin(theta) + across * np.cos(theta)
            below = at_z < cup.rim
            assert (np.abs(at_x - cup.x)[below] < cup.radius).all()
            deepest = min(deepest, at_z.min())
    assert deepest < cup.rim - cup.insertion / 2


@pytest.mark.slow
def test_a_sweep_counts_from_the_target_that_moves_on(pose_planner) -> None:
    plan = moving(pose_planner, -0.4)
    delay = only(delay=tp.Distribution(uniform=0.01))
    plan = dataclasses.replace(plan, scene=plan.scene.replace(uncertainty=delay))
    found = tp.sweep(plan, samples=20)
    column = found.sampler.names.index("delay")
    for values, landed in zip(found.values, found.landings.pose, strict=True):
        late = plan.throw.deciding.delayed(float(values[column]))
        x = late.landing.x - -0.4 * (late.landing_time - plan.throw.landing_time)
        assert landed[0] == pytest.approx(x, abs=2e-4)


def test_a_throw_may_come_neither_late_nor_early(planner_of, tmp_path) -> None:
    """Its delays end where it lands more than a sample from its time, by the delayed throw."""
    scene = planner_of("hand-box").scene
    loose = scene.changed(tolerance=tp.Tolerance(position=0.5, angle=3.0))
    plan = tp.Planner(loose, library=False).plan(loose.target.changed(arrival=2.0))
    assert_met(plan)
    throw, bears = plan.throw.deciding, plan.delay.scan
    for end in (bears.early, bears.late):
        assert end is not None
        last, first = (throw.delayed(share * end).landing_time for share in (0.99, 1.01))
        assert abs(last - 2.0) <= 1e-3 < abs(first - 2.0)
    plan.save(tmp_path)
    early = tp.read_plan(tmp_path).delayed(2 * bears.early)
    assert [one.code.value for one in verdict_on(early, plan.target).broken] == ["arrival"]


def test_what_a_delay_changes_is_relative_to_the_target(loud_plan_of) -> None:
    plan = loud_plan_of("conveyor")
    throw, said = plan.throw.deciding, plan.delay.to_dict()["landing"]
    late = throw.delayed(said["delay"])
    way = plan.target.speed * (late.landing_time - throw.landing_time)
    x = late.landing.x - throw.landing.x - way
    assert said["late"]["x"] == pytest.approx(x, abs=1e-5) and abs(way) > 1e-3
