"""Scenes, plans, planners and sessions pickle and copy; arrays that are handed out are shared."""

from __future__ import annotations

import copy
import dataclasses
import pickle

import numpy as np
import pytest
import throwplan as tp
from throwplan import robots
from throwplan.problems.scene_files import scene_from_table

COPIES = [
    pytest.param(lambda value: pickle.loads(pickle.dumps(value)), id="pickle"),
    pytest.param(copy.deepcopy, id="deepcopy"),
    pytest.param(copy.copy, id="copy"),
]


@pytest.fixture(scope="module")
def solved(pose_planner) -> tp.Plan:
    """A plan that a solver has found, with all that it keeps once it is asked."""
    plan = tp.Planner(pose_planner.scene, library=False).plan()
    assert plan.solver == "fatrop" and plan.to_dict() and plan.path() and plan.verdict.ok
    return plan


@pytest.mark.parametrize("copied", COPIES)
def test_a_copied_plan_works_with_its_planner(copied, solved, pose_planner) -> None:
    plan, near = copied(solved), dataclasses.replace(solved.target, x=solved.target.x + 0.003)
    assert plan.to_dict() == solved.to_dict() and plan.scene == solved.scene
    moved, expected = (pose_planner.plan(near, warm=one) for one in (plan, solved))
    assert moved.starts == expected.starts == 1 and moved.iterations < solved.iterations
    assert moved.throw.deciding.landing.pose == expected.throw.deciding.landing.pose
    assert (
        robots.follow(pose_planner, plan).throw.landing.pose == solved.throw.deciding.landing.pose
    )
    assert (tp.sweep(plan, samples=8).success == tp.sweep(solved, samples=8).success).all()


@pytest.mark.parametrize("copied", COPIES)
def test_a_copied_planner_takes_plans_of_its_scene(copied, solved, pose_planner) -> None:
    planner = copied(pose_planner)
    assert planner.scene == pose_planner.scene
    near = dataclasses.replace(solved.target, x=solved.target.x - 0.003)
    assert planner.plan(near, warm=solved).iterations < solved.iterations
    assert robots.follow(planner, solved).throw.landing.pose == solved.throw.deciding.landing.pose


def test_plans_of_other_scenes_are_no_warm_plans(solved, pose_planner) -> None:
    """Another grip: the throw would be another; the same target elsewhere: it is not."""
    contact = dataclasses.replace(solved.scene.contact, friction=0.9)
    slippery = tp.Planner(solved.scene.replace(contact=contact), library=False)
    cold, warm = slippery.plan(), slippery.plan(warm=solved)
    assert warm.iterations == cold.iterations and warm.throw.effort == cold.throw.effort
    with pytest.raises(tp.InputError, match="follow: needs a solved plan of this planner's scene"):
        robots.follow(slippery, solved)
    moved = solved.scene.replace(target=dataclasses.replace(solved.target, x=0.95))
    again = tp.Planner(moved, library=False).plan(solved.target, warm=solved)
    assert again.iterations < solved.iterations


def test_a_plan_is_of_its_scene_by_whatever_name_and_file(solved, tmp_path) -> None:
    """A warm plan, and one to follow, also as a file of the scene by another name has it."""
    (tmp_path / "mine.toml").write_text(tp.scene_text("pose"))
    renamed = tp.load_scene(tmp_path / "mine.toml").replace(name="mine", description="")
    planner = tp.Planner(renamed, library=False)
    assert planner.plan(warm=solved).iterations < solved.iterations
    assert robots.follow(planner, solved).throw.landing_time == solved.throw.landing_time


@pytest.mark.parametrize("name", ["near-cup", "gen3"])
def test_a_scene_is_that_of_its_saved_plan(name) -> None:
    """The arm and the gripper are in the plan's file, whose names and places are not needed."""
    scene = tp.load_scene(name)
    assert scene.fits(scene_from_table(scene.table()))


# Arrays.


def test_arrays_that_are_handed_in_stay_as_they_are() -> None:
    poses = np.zeros((1, 5, 3))
    hand, delays = {"times": np.linspace(0.0, 0.2, 5), "poses": poses}, np.zeros(2)
    tp.simulate_batch(tp.load_scene("drop"), hand=hand, delays=delays)
    rate = np.ones(3)
    response = robots.Response(rate, np.zeros(3))
    assert not response.rate.flags.writeable
    assert all(array.flags.writeable for array in (*hand.values(), delays, rate))
