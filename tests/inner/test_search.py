"""Fails if a plan depends on what was planned before, a release of the table cannot be thrown, or a
bound forbids what can be thrown."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.models import Trajectory
from throwplan.planner.search import Releases, ReleaseSampler
from throwplan.planner.throw import case_of, make_manipulator
from throwplan.planner.verdict import column_distance

from benchmarks.plain_pivot import PlainPivot


def drawn(scene: tp.Scene, count: int = 4000) -> Releases:
    return ReleaseSampler(scene, make_manipulator(scene)).draw(count, 0)


# The release table.


@pytest.mark.parametrize("name", ["pose"])
def test_sampled_releases_are_feasible_and_thrown_as_the_exact_model_throws(name: str) -> None:
    """Within what twelve even steps leave, which is good enough for a starting point."""
    scene = tp.load_scene(name)
    manipulator, table = make_manipulator(scene), drawn(scene)
    limits, sampler = manipulator.planning, ReleaseSampler(scene, manipulator)
    assert len(table.q) > 300
    for t in (0.0, scene.gripper.profile().opening):
        q, dq = table.q + t * (table.dq + t * table.ddq / 2), table.dq + t * table.ddq
        assert (q >= limits.q_min - 1e-9).all() and (q <= limits.q_max + 1e-9).all()
        assert (np.abs(dq) <= limits.dq + 1e-9).all()
    assert sampler.grip_use(table.q, table.dq, table.ddq).max() <= 1.0
    x, theta, time = table.landings(scene.target.z, scene.flight)
    ends = np.array([0.0, 1.0])
    for i in np.flatnonzero(np.isfinite(time))[::400]:
        path = Trajectory.cubics(
            ends, table.q[[i]], table.dq[[i]], table.ddq[[i]], 0 * table.q[[i]]
        )
        release = PlainPivot(steps=400).release(case_of(scene, manipulator.hand(path)))
        if not release.trouble:
            end = scene.flight.after(release.detach, time[i])
            assert x[i] == pytest.approx(end.x, abs=6e-3)
            assert theta[i] == pytest.approx(end.theta, abs=0.05)


# A plan is a function.


def answers(planner: tp.Planner, targets: list[tp.Pose]) -> dict[tp.Pose, tuple[object, ...]]:
    """By target: status, landing of the throw or the nearest one, effort, and what was counted."""
    found: dict[tp.Pose, tuple[object, ...]] = {}
    for target in targets:
        plan = planner.plan(target)
        thrown = plan.throw or (plan.nearest and plan.nearest.throw)
        lands = thrown and (thrown.deciding.landing.pose, thrown.effort)
        found[target] = plan.status, lands, plan.binding, plan.starts, plan.iterations
    return found


@pytest.mark.slow
def test_a_plan_does_not_depend_on_plans_before(monkeypatch: pytest.MonkeyPatch, tmp_path) -> None:
    """20 targets in two orders, one without machine code, which a process makes on the way."""
    scene, rng = tp.load_scene("hand-flip"), np.random.default_rng(3)
    places = zip(rng.uniform(0.3, 4.2, 20), rng.uniform(-1.0, 9.0, 20), strict=True)
    targets = [scene.target.in_plane(float(x), float(theta)) for x, theta in places]
    monkeypatch.setenv("THROWPLAN_CACHE", str(tmp_path))
    monkeypatch.delenv("THROWPLAN_COMPILE")
    one = answers(tp.Planner(scene, library=False), targets)
    monkeypatch.setenv("THROWPLAN_COMPILE", "0")
    other = answers(tp.Planner(scene, library=False), targets[::-1])
    assert one == other
    assert {status for status, *_ in one.values()} == {"solved", "not_found"}


# Where none is found.


def test_all_limits_that_bind_are_named_the_grip_among_them() -> None:
    """1.4 N hold the bar of `hand-box` hardly."""
    weak = varied(tp.load_scene("hand-box"), gripper={"force": 1.4})
    plan = tp.Planner(weak, library=False).plan(weak.target.shifted(0.7, 0.0))
    names = [one.limit for one in plan.binding]
    assert "grip while carrying" in names and len(set(names)) == len(names)


def test_bounds_hold_for_what_is_thrown_and_end_where_mechanics_says() -> None:
    """No sampled release lands beyond them. A hand in a box that throws at 3 m/s rises to
    v^2 / 2g above it at the very best; the bound adds what the opening can add."""
    planner = tp.Planner("hand-box", library=False)
    table, target = planner.releases(), planner.scene.target
    for z in (target.z, target.z + 0.3):
        x, _, time = table.landings(z, planner.scene.flight)
        lands = np.isfinite(time)
        for edge in (x[lands].min(), x[lands].max()):
            assert planner.plan(tp.Pose(x=float(edge), z=z), patience=1e-3).bound is None
    for x, z, limit in ((30.0, 0.0, "landing distance"), (0.0, 9.0, "landing height")):
        plan = planner.plan(tp.Pose(x=x, z=z))
        assert plan.status == "not_found" and plan.bound.limit == limit
        assert plan.bound.value < max(x, z)
    assert planner.plan(tp.Pose(x=0.0, z=1.4)).bound is None


@pytest.mark.slow
def test_nothing_is_thrown_into_the_base_column() -> None:
    """The bar touches nothing where the nearest throw lands."""
    plan = tp.plan("pose", tp.load_scene("pose").target.in_plane(0.2, math.radians(-20)))
    assert plan.bound.limit == "base column" and plan.to_dict()["bound"]["value"] > 0.0
    near = plan.nearest.target
    there = np.array([[near.plane_x], [near.z], [near.theta]])
    assert column_distance(plan.scene.object, there, 0.12, 0.45)[0] > -1e-4


def test_a_bar_that_is_turned_round_in_the_hand_is_thrown_alike() -> None:
    """One held at its middle, whose end behind the pads must clear the floor, too."""
    scene = tp.load_scene("hand-box")
    scene = scene.replace(
        hand=dataclasses.replace(scene.hand, start=None),
        grasp=dataclasses.replace(scene.grasp, angle=math.radians(90.0)),
        workspace=tp.Workspace(floor=0.45),
        target=scene.target.changed(z=0.7),
    )
    planner = tp.Planner(scene, library=False)
    for x, z in ((-1.6, 1.2), (1.6, 1.2), (1.9, 1.0)):
        plan = planner.plan(scene.target.changed(x=x, z=z))
        assert plan.solved, (x, z, plan.message)
