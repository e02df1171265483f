"""The pose of a pick, and motions slowed as far as the verdict demands."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from job_lists import ONE
from throwplan.planner.clearance import SpatialScene
from throwplan.planner.cycle import UnsolvedError, slowed_transfer
from throwplan.planner.cycle.planning import with_joints
from throwplan.planner.throw import State, make_manipulator
from throwplan.planner.verdict import grip_use, motion_verdict
from throwplan.problems.job_files import load_jobs


@pytest.mark.parametrize("name", ["ur5e", "gen3", "pose"])
def test_a_pick_is_taken_in_the_posture_of_throws(name: str, tmp_path: Path) -> None:
    """Joints that do not throw as in throws towards it, and the hand at -90 degrees: a shoulder
    that turns more than once could also hold it a whole turn further."""
    file = tmp_path / "jobs.toml"
    file.write_text(ONE.replace('"pose"', f'"{name}"').replace("z = 0.35", "z = 0.4"))
    jobs = with_joints(load_jobs(file))
    arm, joints = jobs.arm, np.array(jobs.picks[0].joints)
    kinematics = make_manipulator(tp.load_scene(name)).kinematics
    throwing = np.array(kinematics.throwing_joints) - 1
    aside = np.delete(joints - arm.posture, [*throwing, arm.azimuth_joint - 1])
    assert np.abs(aside).max() < 0.2
    angle = kinematics.theta + kinematics.link_angles(list(joints[throwing]))[-1]
    assert angle == pytest.approx(-math.pi / 2, abs=0.2)


# Slowed.

START, GOAL = ([turn, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785] for turn in (-0.8, 0.8))


def resting(joints: list[float]) -> State:
    return State(np.array(joints), np.zeros(7), np.zeros(7))


def test_a_weak_grip_slows_the_way_as_far_as_it_must() -> None:
    times = []
    for force in (120.0, 30.0, 12.0):
        scene = varied(tp.load_scene("pose"), gripper={"force": force})
        space = SpatialScene(scene, make_manipulator(scene))
        found = slowed_transfer(space, resting(START), resting(GOAL), held=True)
        assert motion_verdict(space, found, held=True).ok
        times.append(len(found.q))
    assert times[0] < times[1] < times[2]
    # The last one is slow for its grip, which it uses.
    assert grip_use(space, found).use.max() > 0.8
    assert len(slowed_transfer(space, resting(START), resting(GOAL), held=False).q) <= times[0]


def test_a_grip_that_cannot_hold_at_rest_is_refused() -> None:
    scene = varied(tp.load_scene("pose"), gripper={"force": 1.0})
    space = SpatialScene(scene, make_manipulator(scene))
    with pytest.raises(UnsolvedError, match=r"grip on the way.* % of what the pads' force holds"):
        slowed_transfer(space, resting(START), resting(GOAL), held=True)
