"""Fails if a shipped arm is not what its maker publishes: frames, URDFs, limits, meshes."""

import dataclasses

import numpy as np
import pytest
import throwplan as tp
from throwplan.cli import main
from throwplan.problems.arm_files import load_arm
from throwplan.robots.urdf import kinematics_difference, limits_of, link_inertias

from oracle.meshes import MESHES, PACKAGES, ROBOTS, URDFS, chain_for, has_meshes, link_points
from oracle.shapes import to_segment


def skip_without_meshes(name):
    if not has_meshes(name):
        pytest.skip(f"needs {MESHES[name][0]} (extra sim)")


def with_pads(chain, arm):
    """The arm's own hand turned as its tool is."""
    turn = np.eye(4)
    cos, sin = np.cos(arm.tool.rotation), np.sin(arm.tool.rotation)
    turn[:2, :2] = [[cos, -sin], [sin, cos]]
    return dataclasses.replace(chain, hand_turn=chain.hand_turn @ turn)


def test_iiwa_is_the_arm_of_its_denavit_hartenberg_parameters():
    """Craig's convention, constDhDataOf14R820.m of KST-Kuka-Sunrise-Toolbox."""
    lengths, turns = [0.36, 0.0, 0.42, 0.0, 0.4, 0.0, 0.126], [0, -1, 1, 1, -1, -1, 1]
    for state in np.random.default_rng(3).uniform(-2, 2, (5, 7)):
        frames, expected = load_arm("iiwa14").placed(state), np.eye(4)
        for frame, angle, length, turn in zip(frames[:7], state, lengths, turns, strict=True):
            cos, sin = np.cos(angle), np.sin(angle)
            step = np.eye(4)
            step[:3, :3] = [[1, 0, 0], [0, 1 - abs(turn), -turn], [0, turn, 1 - abs(turn)]] @ (
                np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
            )
            step[:3, 3] = step[:3, 2] * length
            expected = expected @ step
            np.testing.assert_allclose(frame[:3, 2], expected[:3, 2], atol=1e-9)
        np.testing.assert_allclose(frames[7], expected, atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", URDFS)
def test_an_arm_is_that_of_its_urdf(name):
    skip_without_meshes(name)
    arm, chain = load_arm(name), chain_for(name)
    assert kinematics_difference(arm, with_pads(chain, arm)) < 1e-9
    own, turns = vars(arm.limits), [joint.type == "continuous" for joint in chain.joints]
    given = {key: np.where(turns, own[key], None) for key in ("position_min", "position_max")}
    found = limits_of(chain, given | {key: own[key] for key in ("acceleration", "jerk")})
    for key in ("position_min", "position_max", "torque"):
        np.testing.assert_allclose(own[key], vars(found)[key], rtol=1e-4)
    # Those of gen3 are its controller's, which are lower.
    assert (np.array(own["velocity"]) <= found.velocity).all()
    masses = link_inertias(chain)
    for own, maker in zip(arm.links[: arm.joints - 1], masses[: arm.joints - 1], strict=True):
        assert own.mass == pytest.approx(maker.mass)
        np.testing.assert_allclose(own.com, maker.com, atol=1e-6)
        np.testing.assert_allclose(own.inertia, maker.inertia, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("name", MESHES)
def test_capsules_contain_the_published_meshes(name):
    """Of all links, and of the hand that the package has: Franka's, for gen3 the 2F-85."""
    pytest.importorskip("trimesh")
    skip_without_meshes(name)
    arm = load_arm(name)
    for link, points in link_points(name).items():
        capsules = [c for c in arm.capsules if c.link == link]
        away = [to_segment(points, *map(np.array, (c.begin, c.end))) - c.radius for c in capsules]
        assert np.min(away, axis=0).max() < 1e-6, f"link {link}"


#: Real robots' files, options that they need, joints that throw, a target x, z [m] and theta [rad].
ENDLESS = "--position-min-deg -360 - - -360 - -360 --position-max-deg 360 - - 360 - 360"
REAL = {
    "ur5e": (URDFS["ur5e"][0], "--tool tool0", (2, 3, 4), 1.1, 0.1),
    "panda": (f"{ROBOTS}/panda_description/urdf/panda.urdf", "--tool panda_hand",
              (2, 4, 6), 1.2, 0.1),
    "ur5": (f"{ROBOTS}/ur_description/urdf/ur5_robot.urdf", "--tool ee_link --approach=x",
            (2, 3, 4), 1.1, 0.1),
    "xarm7": (URDFS["xarm7"][0], "--tool link_eef", (2, 4, 6), 0.9, 0.1),
    "kinova": (f"{ROBOTS}/kinova_description/robots/kinova.urdf",
               f"--tool j2s6s200_end_effector --approach=x {ENDLESS}", (2, 3, 5),
               -0.305, 0.1, -0.9),
    "so101": (f"{ROBOTS}/so_arm_description/urdf/so101.urdf",
              "--tool gripper_link --approach=-z --closing x", (2, 3, 4), 0.35, 0.1),
    "tiago": (f"{ROBOTS}/tiago_description/robots/tiago.urdf",
              "--tool wrist_ft_tool_link --approach=x", (2, 4, 6), 0.9, 0.4),
    "z1": (f"{ROBOTS}/z1_description/urdf/z1.urdf",
           "--tool gripperStator --approach=x --closing z", (2, 3, 4), 0.7, 0.1),
}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", REAL)
def test_a_real_robot_s_urdf_throws(name, tmp_path):
    file, options, throwing, x, z, *turned = REAL[name]
    if not (PACKAGES / file).is_file():
        pytest.skip(f"needs {file} (extra sim)")
    words = ["import-robot", str(PACKAGES / file), *options.split(), "--tcp", "0.1"]
    words += ["--acceleration", "10", "--jerk", "500", "--out", str(tmp_path / "arm.toml")]
    assert main(words) == 0
    arm = load_arm("arm.toml", tmp_path)
    assert arm.throwing_joints == throwing
    scene = tp.load_scene("xarm7").replace(arm=arm, workspace=None)
    bar = dataclasses.replace(scene.object, mass=0.05, inertia=1e-4)
    target = tp.Pose(x, z, *(turned or [0.0]))
    plan = tp.Planner(scene.replace(object=bar)).plan(target, patience=60.0)
    assert plan.solved, plan.message
