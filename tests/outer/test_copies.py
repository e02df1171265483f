"""Fails if a copy of a plan or planner works otherwise, or another scene's plan is taken."""

from __future__ import annotations

import copy
import dataclasses
import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import throwplan as tp
from throwplan import robots
from throwplan.problems.scene_files import scene_from_table

COPIES = [
    pytest.param(lambda value: pickle.loads(pickle.dumps(value)), id="pickle"),
    pytest.param(copy.deepcopy, id="deepcopy"),
]


@pytest.fixture(scope="module")
def solved(pose_planner) -> tp.Plan:
    """A plan that a solver has found, with all that it keeps once it is asked."""
    plan = tp.Planner(pose_planner.scene, library=False).plan()
    assert plan.solver == "fatrop" and plan.to_dict() and plan.path() and plan.verdict.ok
    return plan


@pytest.mark.parametrize("copied", COPIES)
def test_copies_work_with_each_other(copied, solved, pose_planner) -> None:
    plan, planner = copied(solved), copied(pose_planner)
    near = solved.target.changed(x=solved.target.x + 0.003)
    assert plan.to_dict() == solved.to_dict() and plan.scene == solved.scene == planner.scene
    moved, expected = planner.plan(near, warm=plan), pose_planner.plan(near, warm=solved)
    assert moved.starts == expected.starts == 1 and moved.iterations < solved.iterations
    assert moved.throw.deciding.landing.pose == expected.throw.deciding.landing.pose
    assert robots.follow(planner, plan).throw.landing.pose == solved.throw.deciding.landing.pose
    assert (tp.sweep(plan, samples=8).success == tp.sweep(solved, samples=8).success).all()


def test_plans_of_other_scenes_are_no_warm_plans(plan_of, planner_of, tmp_path) -> None:
    """Another grip: the throw would be another; the same scene elsewhere or by another name."""
    planner, plan = planner_of("hand-flip"), plan_of("hand-flip")
    contact = dataclasses.replace(plan.scene.contact, friction=0.9)
    slippery = tp.Planner(plan.scene.replace(contact=contact), library=False)
    cold, warm = slippery.plan(), slippery.plan(warm=plan)
    assert warm.iterations == cold.iterations and warm.throw.effort == cold.throw.effort
    (tmp_path / "mine.toml").write_text(tp.scene_text("hand-flip"))
    renamed = tp.load_scene(tmp_path / "mine.toml").replace(name="mine", description="")
    for scene in (renamed, planner.scene.replace(target=plan.target.changed(x=1.15))):
        again = tp.Planner(scene, library=False).plan(plan.target, warm=plan)
        assert again.solved and again.iterations < cold.iterations


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


@pytest.mark.slow
def test_threads_plan_as_one_does(planner_of, plan_of) -> None:
    """Of a plan from nothing the status, of one from a plan nearby the landing's last digit."""
    planner, first = planner_of("hand-flip"), plan_of("hand-flip")
    targets = [
        first.target.changed(x=first.target.x + shift) for shift in np.linspace(-0.1, 0.1, 8)
    ]

    def found(target: tp.Pose) -> tuple[object, ...]:
        cold, moved = planner.plan(target), planner.plan(target, warm=first)
        return cold.status, moved.solver, moved.throw.deciding.landing.pose

    expected = [found(target) for target in targets]
    for _ in range(2):
        with ThreadPoolExecutor(4) as pool:
            assert list(pool.map(found, targets)) == expected
