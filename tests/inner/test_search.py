"""Search: the release table, starts and retries, alternatives, targets at the edge of reach."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from scipy.interpolate import BPoly
from throwplan.models import Trajectory
from throwplan.planner.clearance import column_distance
from throwplan.planner.samples import Releases, ReleaseSampler
from throwplan.planner.throw import case_of, make_manipulator

from benchmarks.plain_pivot import PlainPivot


def aimed(planner: tp.Planner, x: float, degrees: float) -> tp.Pose:
    return planner.scene.target.in_plane(x, math.radians(degrees))


def drawn(scene: tp.Scene, count: int = 4000) -> Releases:
    return ReleaseSampler(scene, make_manipulator(scene)).draw(count, 0)


# The release table.


@pytest.mark.parametrize("name", ["pose", "hand-flip"])
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


def test_run_ups_through_the_base_column_are_marked() -> None:
    """SciPy's polynomials, and the bar's axis point by point."""
    scene = tp.load_scene("near-cup")
    manipulator, table, workspace = make_manipulator(scene), drawn(scene, 2000), scene.workspace
    bar = np.linspace(-scene.object.com, scene.object.length - scene.object.com, 53)
    deepest = np.full(len(table.q), -np.inf)
    for i, duration in enumerate(table.run_up):
        ends = [[manipulator.start, 0 * manipulator.start, 0 * manipulator.start]]
        ends.append([table.q[i], table.dq[i], table.ddq[i]])
        path = BPoly.from_derivatives([0.0, duration], ends)(np.linspace(0.0, duration, 120))
        x, z, theta = np.array(manipulator.motion(path.T, 0 * path.T, 0 * path.T)[0])[:, :, None]
        theta = theta + scene.grasp.angle
        x = x + (scene.com_offset + bar) * np.cos(theta)
        z = z + (scene.com_offset + bar) * np.sin(theta)
        deepest[i] = np.minimum(
            workspace.column_radius - np.abs(x), workspace.column_height - z
        ).max()
    through = deepest > 0.02
    assert through.sum() > 20 and through.mean() < 0.5
    assert not table.clear[through].any() and table.clear[~through].any()


# What the next NLP is asked.


@pytest.mark.parametrize(
    ("name", "x", "degrees"),
    [("hand-flip", 50.0, 270.0), pytest.param("flip", -2.0, 90.0, marks=pytest.mark.slow)],
)
def test_a_target_far_off_is_out_of_reach(name: str, x: float, degrees: float) -> None:
    """Of releases drawn towards it those that land much farther off than others are no evidence."""
    planner = tp.Planner(name, library=False)
    plan = planner.plan(aimed(planner, x, degrees), patience=60.0)
    assert plan.status == "out_of_reach" and plan.binding, plan.message
    assert planner.plan(plan.nearest, patience=60.0).solved


def test_a_bar_without_width_enters_a_cup() -> None:
    scene = varied(tp.load_scene("cup"), object={"width": 0.0})
    assert tp.Planner(scene, library=False).plan().solved


# Several throws, warm plans, models.


def test_warm_plans_follow_a_moving_target(pose_planner) -> None:
    plan = pose_planner.plan()
    iterations = plan.iterations
    for k in range(1, 5):
        target = plan.target.in_plane(plan.target.plane_x - 0.003, plan.target.theta + 0.006)
        plan = pose_planner.plan(target, warm=plan)
        assert plan.solved and plan.attempts <= 3, k
        assert plan.iterations < iterations
    other = tp.Planner(tp.load_scene("pose")).plan(target, warm=plan)
    assert other.solved, "a plan of another planner is no warm start, but no error either"


# The edge of reach.


def test_a_target_inside_the_column_is_out_of_reach(pose_planner) -> None:
    plan = pose_planner.plan(aimed(pose_planner, 0.2, -20), patience=90.0)
    assert plan.status == "out_of_reach"
    assert plan.binding == ("base column",)
    near = plan.nearest
    # The bar touches nothing there, and it is thrown there.
    there = np.array([[near.plane_x], [near.z], [near.theta]])
    assert column_distance(pose_planner.scene.object, there, 0.12, 0.45)[0] > -1e-4
    out = pose_planner.plan(near)
    assert out.solved, out.message


@pytest.mark.slow
def test_a_landing_once_named_is_named_again_for_targets_beyond() -> None:
    planner = tp.Planner("cup", library=False)
    target = planner.scene.target
    planner.plan(target.in_plane(1.34, target.theta))
    first, second = (
        planner.plan(target.in_plane(x, target.theta), patience=60.0) for x in (1.36, 1.38)
    )
    assert first.status == second.status == "out_of_reach"
    assert second.nearest.x == pytest.approx(first.nearest.x, abs=0.005)
    assert planner.plan(second.nearest).solved


@pytest.mark.slow
@pytest.mark.parametrize("turn", [0.0, 0.3])
def test_targets_beside_one_out_of_reach_are_answered_from_it(turn: float) -> None:
    """No throw lands nearer than 0.13 m to the first, so none lands within half of that; the
    nearest landing is the one that a planner of its own finds, in any plane."""
    planner, scene = tp.Planner("pose", library=False), tp.load_scene("pose")
    lever, own = scene.object.half_length, scene.target.plane_x

    def aimed(x: float) -> tp.Pose:
        return dataclasses.replace(scene.target, x=x * math.cos(turn), y=x * math.sin(turn))

    first = aimed(own + 0.35)
    away = first.distance(planner.plan(first, patience=60.0).nearest, lever)
    for share, beside in ((-0.4, True), (0.4, True), (-0.9, False)):
        target, alone = aimed(own + 0.35 + share * away), tp.Planner("pose", library=False)
        plan, other = planner.plan(target, patience=60.0), alone.plan(target, patience=60.0)
        assert plan.status == other.status == "out_of_reach"
        if beside:
            assert plan.iterations < other.iterations / 4
        lands, alike = (target.distance(one.nearest, lever) for one in (plan, other))
        assert lands < 1.02 * alike + 1e-3
        assert planner.plan(plan.nearest).solved


def test_what_is_out_of_reach_says_nothing_of_targets_of_another_kind() -> None:
    """The cup or bin of a region stands elsewhere, an angle asks for more, and a named solver
    starts from nothing that was found before."""
    planner, own = tp.Planner("hand-box", library=False), tp.load_scene("hand-box").target
    first = own.in_plane(3.0, None)
    assert planner.plan(first, patience=60.0).status == "out_of_reach"
    again = planner.plan(first.shifted(0.02, 0.0), patience=60.0)
    assert again.status == "out_of_reach" and again.attempts < 6
    region = tp.Region(x=(2.98, 3.04), z=own.z)
    angle = dataclasses.replace(first, theta=0.3)
    for target, solver in ((region, "auto"), (angle, "auto"), (first, "ipopt")):
        plan = planner.plan(target, solver=solver, patience=60.0)
        assert not plan.solved and plan.attempts > 12


@pytest.mark.parametrize("degrees", [-90.0, 90.0])
def test_a_bar_that_is_turned_round_in_the_hand_is_thrown_alike(degrees: float) -> None:
    """One held at its middle, whose end behind the pads must clear the floor, too."""
    scene = tp.load_scene("hand-box")
    scene = scene.replace(
        hand=dataclasses.replace(scene.hand, start=None),
        grasp=dataclasses.replace(scene.grasp, angle=math.radians(degrees)),
        workspace=tp.Workspace(floor=0.45),
        target=scene.target.changed(z=0.7),
    )
    planner = tp.Planner(scene, library=False)
    for x, z in ((-1.6, 1.2), (1.6, 1.2), (2.0, 1.0)):
        plan = planner.plan(scene.target.changed(x=x, z=z))
        assert plan.solved, (x, z, plan.message)
