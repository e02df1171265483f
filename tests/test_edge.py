"""Targets at the edge of what is possible, and where the table has too little."""

from __future__ import annotations

import math

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.closer import closer
from throwplan.planner.geometry import column_of, column_room, lowest_of_bar
from throwplan.planner.releases import distances
from throwplan.planner.violations import flight_poses


@pytest.fixture(scope="module")
def pose() -> tp.Planner:
    return tp.Planner(tp.load_scene("pose"))


@pytest.fixture(scope="module")
def cup() -> tp.Planner:
    return tp.Planner(tp.load_scene("cup"))


def aimed(planner: tp.Planner, x: float, degrees: float) -> tp.Pose:
    target = planner.scene.target
    assert target is not None
    return target.in_plane(x, math.radians(degrees))


def test_releases_are_looked_for_ever_nearer(cup: tp.Planner) -> None:
    target, table = aimed(cup, -2.18, 265), cup.releases()
    where = cup.scene, target.plane_x, target.z, target.theta
    more, again = (closer(cup._sampler, table, target) for _ in range(2))
    assert np.array_equal(more.detach[: len(table.q)], table.detach)
    assert np.array_equal(more.q, again.q)
    before, after = (distances(some, *where).min() for some in (table, more))
    assert after < 0.2 * before
    # What was added is feasible, and lands where it says.
    new = more.picked(np.arange(len(table.q), len(more.q)))
    sampler = cup._sampler
    assert sampler.held(new.q, new.dq, new.ddq).all()
    assert sampler.within_limits(new.q, new.dq, new.ddq, new.run_up).all()
    assert np.allclose(sampler.throw(new.q, new.dq, new.ddq), new.detach, rtol=0, atol=1e-12)


def test_a_target_that_the_table_misses_by_far_is_thrown_to(cup: tp.Planner) -> None:
    target = aimed(cup, -2.18, 265)
    assert cup.starts(target)[0][2] > 0.25
    plan = cup.plan(target)
    assert plan.solved, plan.message


@pytest.mark.parametrize(("x", "degrees"), [(0.17546259, -106.1607374), (0.19689628, -46.79630062)])
def test_beside_the_base_column(pose: tp.Planner, x: float, degrees: float) -> None:
    """The bar lands a little more than a millimetre beside it."""
    plan = pose.plan(aimed(pose, x, degrees))
    assert plan.solved, plan.message
    assert max(plan.error_sent()) < 1e-3
    thrown = plan.throw.final
    times = np.linspace(0.0, thrown.landing.flight_time, 3000)
    room = column_room(pose.scene.object, flight_poses(pose.scene, thrown, times), 0.12, 0.45)
    assert column_of(pose.scene) == (0.12, 0.45)
    assert -1e-5 < room.min() < 2e-3


def test_where_only_the_tolerance_lets_it_land(pose: tp.Planner) -> None:
    """There the bar would lie 0.8 mm beside the column, and no throw was found to do so."""
    plan, tolerance = pose.plan(aimed(pose, 0.22, -15)), pose.scene.tolerance
    assert plan.solved, plan.message
    position, angle = plan.error_sent()
    assert 1e-4 < position < tolerance.position and angle < tolerance.angle


@pytest.mark.parametrize(("x", "degrees"), [(0.2, -20), (0.0, 0)])
def test_inside_the_column_is_out_of_reach(pose: tp.Planner, x: float, degrees: float) -> None:
    plan = pose.plan(aimed(pose, x, degrees))
    assert plan.status == "out_of_reach" and plan.attempts == 0
    assert plan.binding == ("base column",)
    near = plan.nearest
    assert near is not None
    # The bar at the pose that is named touches nothing, and a little farther out it is thrown.
    there = np.array([[near.plane_x], [near.z], [near.theta]])
    assert column_room(pose.scene.object, there, 0.12, 0.45)[0] > -1e-4
    out = pose.plan(near.in_plane(near.plane_x + 0.01, near.theta))
    assert out.solved, out.message


def test_with_any_angle_a_bar_may_stand_beside_the_column() -> None:
    planner = tp.Planner(tp.load_scene("box"))
    target = planner.scene.target
    assert target is not None
    inside = planner.plan(target.in_plane(0.1, None))
    assert inside.status == "out_of_reach" and inside.attempts == 0
    beside = planner.plan(target.in_plane(0.16, None))
    assert beside.solved, beside.message


def test_the_way_into_the_cup_begins_with_the_lowest_corner(cup: tp.Planner) -> None:
    plan, scene = cup.plan(aimed(cup, 0.9, -75)), cup.scene
    nlp, x = plan.throw.nlp, plan.throw.solution.x
    times = [float(nlp.block(x, f"t_cup{i}", nlp.structure.detach)[0]) for i in range(4)]
    poses = flight_poses(scene, plan.throw.final, np.array(times))
    # Aslant the corner enters 2.6 mm before the middle of the end.
    assert (scene.object.width / 2 * np.abs(np.cos(poses[2])) > 2.2e-3).all()
    depths = scene.cup.rim - lowest_of_bar(scene.object, poses)
    assert np.allclose(depths, np.linspace(0.0, scene.cup.insertion, 4), rtol=0, atol=1e-3)
