"""Fails if a region is missed, met at more than the least cost, or loses its bounds."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
import throwplan as tp
from throwplan import robots

#: A region about the target of `hand-flip`, by its bounds in x [m] and theta [rad].
X, THETA = (1.15, 1.25), (4.55, 4.85)
#: Errors at which a landing counts as corrected: 0.1 mm and 0.02 deg.
NEAR = 1.01e-4, math.radians(0.0202)


def region(**changes) -> tp.Region:
    return tp.Region(**{"x": X, "z": 0.2, "theta": THETA} | changes)


@pytest.fixture(scope="module")
def plan(loud_planner_of) -> tp.Plan:
    """Its throws make one cost small, in one solve."""
    return loud_planner_of("hand-flip").plan(region())


def assert_inside(landing: dict, x, theta=None) -> None:
    assert x[0] - NEAR[0] <= landing["x"] <= x[1] + NEAR[0]
    if theta is not None:
        assert theta[0] - NEAR[1] <= landing["theta"] <= theta[1] + NEAR[1]


# Planning.


def test_it_lands_between_the_bounds_at_no_higher_cost_than_at_any_of_its_poses(
    plan, loud_planner_of
) -> None:
    assert plan.solved, plan.message
    assert_inside(plan.to_dict()["landing"]["limit_surface"], X, THETA)
    planner = loud_planner_of("hand-flip")
    places = [(x, theta) for x in X for theta in THETA] + [(np.mean(X), np.mean(THETA))]
    costs = [
        found.throw.effort
        for x, theta in places
        if (found := planner.plan(tp.Pose(x=float(x), z=0.2, theta=float(theta)))).solved
    ]
    # Where a torque is at its limit, its margin in the NLP differs from throw to throw.
    assert costs and plan.throw.effort <= 1.005 * min(costs)


def test_a_landing_between_the_bounds_has_no_error(loud_planner_of) -> None:
    # A box, whose angle is free: the cheapest throw lands short of the middle.
    planner = loud_planner_of("hand-box")
    x = planner.scene.target.x
    found = planner.plan(tp.Region(x=(x - 0.3, x + 0.3), z=planner.scene.target.z))
    error, landing = (found.to_dict()[name] for name in ("error", "landing"))
    assert found.solved and landing["limit_surface"]["x"] < x
    assert error["planned"]["position"] == error["limit_surface"]["angle"] == 0.0
    assert error["limit_surface"]["position"] <= NEAR[0]


def test_a_cup_stays_where_it_is(planner_of) -> None:
    shift = -0.05
    planner = planner_of("near-cup")
    middle, cup = planner.scene.target, planner.scene.cup
    x, theta = middle.x + shift, middle.theta
    found = planner.plan(
        tp.Region(x=(x - 0.02, x + 0.02), z=middle.z, theta=(theta - 0.3, theta + 0.3))
    )
    assert found.solved, found.message
    # As far as the middle of the target moved, and no farther.
    assert found.scene.cup.x == pytest.approx(cup.x + shift, abs=1e-12)
    assert found.throw.deciding.scene.cup == found.scene.cup
    landing = found.to_dict()["landing"]["limit_surface"]
    assert_inside(landing, (x - 0.02, x + 0.02), (theta - 0.3, theta + 0.3))
    assert abs(landing["x"] - x) + abs(landing["theta"] - theta) > 0.01


@pytest.mark.slow
def test_a_swing_is_corrected_if_it_would_land_outside(loud_planner_of) -> None:
    planner = loud_planner_of("pose")
    own = {"z": 0.1, "theta": (-0.2, 0.2)}
    plan = planner.plan(region(**own))
    session, samples = robots.follow(planner, plan), plan.throw.samples
    inside = region(z=0.1, x=(1.1, 1.3), theta=(-0.3, 0.3))
    update = session.update(0.05, samples.q[50], samples.dq[50], inside)
    assert update.status == "kept" and session.throw is plan.throw.deciding
    update = session.update(0.1, samples.q[100], samples.dq[100], region(x=(1.18, 1.28), **own))
    assert update.status == "followed"
    x, _, theta = session.throw.landing.pose
    assert_inside({"x": x, "theta": theta}, (1.1795, 1.28), (-0.205, 0.2))


# Results.


def test_a_sweep_counts_landings_in_the_region(loud_planner_of) -> None:
    wide = loud_planner_of("hand-flip").plan(region(x=(1.0, 1.4), theta=(4.0, 5.4)))
    swept = tp.sweep(wide, samples=128)
    answer, (x, theta) = swept.to_dict(), swept.landings.pose[:, :2].T
    assert answer["bias"]["position"] == answer["bias"]["angle"] == 0.0
    tolerance = wide.scene.tolerance
    inside = np.abs(x - 1.2) <= 0.2 + tolerance.position
    inside &= np.abs(theta - 4.7) <= 0.7 + tolerance.angle
    assert (swept.landings.in_tolerance == inside).all()
    assert "in the region" in swept.summary()


def test_files_keep_the_bounds(plan, tmp_path) -> None:
    plan.save(tmp_path)
    saved = json.loads((tmp_path / "plan.json").read_text())
    assert saved["target"]["x"] == list(X)
    assert saved["target"]["theta"] == pytest.approx(THETA, abs=1e-15)
    again = tp.read_plan(tmp_path)
    assert isinstance(again.target, tp.Region) and again.target.table == saved["target"]
    assert all(abs(off) <= near for off, near in zip(again.miss(), NEAR, strict=True))


# Scene files and the command line.


def test_the_command_line_and_scene_files_take_ranges(run, tmp_path) -> None:
    answer = run("plan pose --target 1.0:1.1 0.1 -20:20 --azimuth 30 --json").json
    x, y = (answer["landing"]["limit_surface"][name] for name in "xy")
    assert answer["status"] == "solved"
    assert math.degrees(math.atan2(y, x)) == pytest.approx(30.0)
    # Ranges count along the throw's plane.
    assert_inside({"x": math.hypot(x, y)}, (1.0, 1.1))
    assert answer["target"]["theta"] == pytest.approx([math.radians(-20), math.radians(20)])
    text = tp.scene_text("pose").replace("x = 1.2 ", "x = [1.15, 1.25] ")
    text = text.replace("theta_deg = 0.0 ", "theta_deg = [-20, 20] ")
    (tmp_path / "bin.toml").write_text(text)
    target = tp.load_scene(tmp_path / "bin.toml").target
    assert target == tp.Region(x=X, z=0.1, theta=(math.radians(-20), math.radians(20)))


def test_a_pose_has_no_ranges_and_a_cup_needs_one_end_below(planner_of) -> None:
    scene = planner_of("near-cup").scene
    both = tp.Region(x=scene.target.x, z=scene.target.z, theta=(-math.pi / 2, 0.5))
    # Outside the cup at all of its poses; wider it holds some.
    beside = tp.Region(x=(0.5, 0.6), z=0.22, theta=(-1.8, -1.4))
    for wrong, words in (
        (lambda: tp.Pose(x=X, z=0.1), "a Region a range"),
        (lambda: scene.replace(target=both), r"\[cup\].*one end below"),
        (lambda: planner_of("near-cup").plan(both), r"\[cup\].*one end below"),
        (lambda: scene.replace(target=beside), "not in the cup"),
    ):
        with pytest.raises(tp.InputError, match=words):
            wrong()
    scene.replace(target=dataclasses.replace(beside, half_widths=(0.4, 0.2)))
