"""The pose of a pick."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from job_lists import ONE
from throwplan.cycles.job_files import load_jobs
from throwplan.cycles.planning import with_joints
from throwplan.planner.throw import make_manipulator


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
