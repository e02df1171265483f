"""Fails if inverse kinematics puts the pads elsewhere than asked, breaks a limit, misses a pose in
reach, or takes a pick in another posture than that of throws."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from adam.numpy import KinDynComputations
from job_lists import ONE
from throwplan.cycles import HandPose, inverse_kinematics
from throwplan.cycles.job_files import load_jobs
from throwplan.cycles.planning import with_joints
from throwplan.planner.throw import Samples, make_manipulator
from throwplan.planner.verdict import SpatialScene, motion_verdict

MARGIN = 0.05


def space_of(name: str) -> SpatialScene:
    scene = tp.load_scene(name)
    return SpatialScene(scene, make_manipulator(scene))


def is_clear(space: SpatialScene, q: np.ndarray) -> bool:
    """Whether the arm breaks no limit at rest."""
    still = Samples(*(np.array([rows, rows]) for rows in (q, 0 * q, 0 * q)))
    return motion_verdict(space, still, held=False).ok


def reachable(name: str, count: int) -> Iterator[tuple[np.ndarray, float, np.ndarray]]:
    """Random joints of a hand that points down, with place and turn of its pads by the frames.

    The throwing joints lie in any vertical plane, the last joint turns the hand in any way.
    """
    space = space_of(name)
    arm, kinematics, random = space.kinematics.arm, space.kinematics, np.random.default_rng(4)
    low = np.maximum(np.array(arm.limits.position_min) + MARGIN, -math.pi)
    high = np.minimum(np.array(arm.limits.position_max) - MARGIN, math.pi)
    throwing = [joint - 1 for joint in kinematics.throwing_joints]
    side = np.sign(arm.placed(arm.posture)[-1][1, 1])
    while count:
        uniform, q = random.uniform(low, high), np.array(arm.posture)
        moved = [*throwing, arm.joints - 1, arm.azimuth_joint - 1]
        q[moved] = uniform[moved]
        angle = kinematics.theta + kinematics.link_angles(list(q[throwing]))[-1]
        bend = q[throwing[-1]] + kinematics.signs[-1] * (-math.pi / 2 - angle)
        q[throwing[-1]] = (bend + math.pi) % (2 * math.pi) - math.pi
        if (q < low).any() or (q > high).any() or not is_clear(space, q):
            continue
        pads = arm.placed(q)[-1]
        closing = side * pads[:3, 1]
        yield pads[:3, 3], math.atan2(-closing[0], closing[1]), q
        count -= 1


def check_pose(space: SpatialScene, q: np.ndarray, place: np.ndarray, turn: float) -> None:
    arm = space.kinematics.arm
    pads, side = arm.placed(q)[-1], np.sign(arm.placed(arm.posture)[-1][1, 1])
    assert np.abs(pads[:3, 3] - place).max() < 1e-6
    assert np.abs(pads[:3, 2] - [0.0, 0.0, -1.0]).max() < 1e-6
    assert np.abs(side * pads[:3, 1] - [-math.sin(turn), math.cos(turn), 0.0]).max() < 1e-6
    assert (q >= np.array(arm.limits.position_min) + MARGIN - 1e-12).all()
    assert (q <= np.array(arm.limits.position_max) - MARGIN + 1e-12).all()
    assert is_clear(space, q)


@pytest.mark.parametrize("name", ["pose", "ur5e"])
def test_reachable_poses_are_found(name: str) -> None:
    """All from one seed."""
    space, seed = space_of(name), None
    for place, turn, q in reachable(name, 8):
        seed = q if seed is None else seed
        joints = inverse_kinematics(space, HandPose(place.tolist(), turn), seed.tolist())
        check_pose(space, joints, place, turn)


@pytest.mark.parametrize("name", ["ur5e", "gen3"])
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


def test_another_library_has_the_pads_there() -> None:
    urdf = Path(__file__).parent.parent / "data" / "panda.urdf"
    adam = KinDynComputations(str(urdf), [f"panda_joint{i}" for i in range(1, 8)])
    space, seed = space_of("pose"), [0.0, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785]
    for place, turn in (([0.5, 0.2, 0.2], 0.3), ([0.4, -0.3, 0.4], None)):
        pose = HandPose(place, turn)
        q = inverse_kinematics(space, pose, seed)
        pads = np.asarray(adam.forward_kinematics("panda_hand_tcp", np.eye(4), q))
        assert np.abs(pads[:3, 3] - place).max() < 1e-6
        assert np.abs(pads[:3, 2] - [0.0, 0.0, -1.0]).max() < 1e-6
        assert np.abs(q - seed).max() < 1.0
    for place in ([1.3, 0.0, 0.3], [0.5, 0.0, -0.05]):  # Out of reach; below the floor.
        with pytest.raises(tp.InputError):
            inverse_kinematics(space, HandPose(place, 0.0), seed)
