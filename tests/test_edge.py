"""Targets at the edge of what is possible, and where the table has too little."""

from __future__ import annotations

import math

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.check.geometry import column_of, column_room, lowest_of_bar
from throwplan.planner.check.violations import flight_poses
from throwplan.planner.search import starts, table_search
from throwplan.planner.search.closer import closer
from throwplan.planner.search.releases import distances


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
    assert len(np.unique(more.detach, axis=0)) == len(np.unique(table.detach, axis=0)) + (
        len(more.q) - len(table.q)
    )
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


def test_a_bar_that_touches_the_column_between_two_instants_gets_more_room() -> None:
    """It passes a corner there; the same rows with the same room would lead there for ever."""
    planner = tp.Planner(tp.load_scene("flip"))
    plan = planner.plan(aimed(planner, -0.36681081, 5.1195110))
    assert plan.solved and plan.throw.room.passing > 0.0, plan.message
    assert plan.attempts < 10


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
    names = ["t_rim", *(f"t_cup{i}" for i in range(nlp.structure.cup))]
    times = [float(nlp.block(x, name, nlp.structure.detach)[0]) for name in names]
    assert times == sorted(times)
    poses = flight_poses(scene, plan.throw.final, np.array(times))
    depths = scene.cup.rim - lowest_of_bar(scene.object, poses)
    # Aslant the corner enters 2.6 mm before the middle of the end.
    below = scene.object.width / 2 * np.abs(np.cos(poses[2]))
    assert (below > 2.2e-3).all()
    middles = np.linspace(0.0, scene.cup.insertion, nlp.structure.cup)
    assert np.allclose(depths - [0.0, *below[1:]], [0.0, *middles], rtol=0, atol=1e-3)


def counted(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, float]]:
    """The starts that a search takes, none of which leads anywhere: solver, goal's angle."""
    taken: list[tuple[str, float]] = []

    def nowhere(bench, name, index, goal, releases, search, light):
        taken.append((name, goal.theta))

    monkeypatch.setattr(table_search, "from_release", nowhere)
    monkeypatch.setattr(table_search, "from_elastic", lambda *arguments: None)
    return taken


@pytest.mark.parametrize("turns", ["exact", "any"])
def test_so_many_starts_and_no_more(
    pose: tp.Planner, monkeypatch: pytest.MonkeyPatch, turns: str
) -> None:
    taken = counted(monkeypatch)
    plan = pose.plan(turns=turns)
    assert not plan.solved
    # Four and six from the table, four and IPOPT's four from releases that were looked for.
    assert [name for name, _ in taken] == ["fatrop"] * 14 + ["ipopt"] * 4


def test_with_nothing_that_passes_the_column_the_starts_come_to_an_end(
    pose: tp.Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    taken, clear = counted(monkeypatch), "flies_past_column"
    monkeypatch.setattr(starts, clear, lambda scene, detach, time: np.zeros(len(detach), bool))
    monkeypatch.setattr(
        table_search, "in_column", lambda scene, target: bool(taken.append(("asked", 0.0)))
    )
    asked = pose._search._throws

    def passing(candidates, aim, rounds, search):
        search.guards |= {"passing"}
        return asked(candidates, aim, rounds, search)

    monkeypatch.setattr(pose._search, "_throws", passing)
    pose.plan()
    assert len(taken) == 1 + 18


@pytest.mark.parametrize(("x", "degrees"), [(-1.342, 274.6), (-0.735, 258.4)])
def test_an_elastic_solve_that_ends_farther_off_than_a_release_settles_nothing(
    cup: tp.Planner, x: float, degrees: float
) -> None:
    """No release near these goes into the cup, so that it starts, and ends, elsewhere."""
    plan = cup.plan(aimed(cup, x, degrees))
    assert plan.solved, plan.message


def test_a_throw_at_the_edge_is_kept_where_others_are_looked_for(
    pose: tp.Planner, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(table_search, "from_release", lambda *arguments: None)
    plan = pose.plan(aimed(pose, 1.303, -163.5), alternatives=1)
    assert plan.solved and plan.alternatives == ()
