"""Shipped arms against what their makers publish: frames by Denavit-Hartenberg, URDFs, limits."""

import dataclasses
import re

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from throwplan.cli import main
from throwplan.problems.arm_files import load_arm
from throwplan.robots.urdf import kinematics_difference, limits_of, link_inertias

from oracle.meshes import MESHES, PACKAGES, ROBOTS, URDFS, chain_for, has_meshes, link_points
from oracle.shapes import to_segment
from oracle.studies import SCENES, corner_contacts

STATES = 20


def skip_without_meshes(name):
    if not has_meshes(name):
        pytest.skip(f"needs {MESHES[name][0]} (extra sim)")


def with_pads(chain, arm):
    """The arm's own hand turned as its tool is."""
    turn = np.eye(4)
    cos, sin = np.cos(arm.tool.rotation), np.sin(arm.tool.rotation)
    turn[:2, :2] = [[cos, -sin], [sin, cos]]
    return dataclasses.replace(chain, hand_turn=chain.hand_turn @ turn)


def random_frames(arm):
    """Joint states inside the limits with the frames of the arm at each."""
    q = ca.SX.sym("q", arm.joints)
    frames = ca.Function("frames", [q], arm.frames(q))
    limits = arm.limits
    shape = (STATES, arm.joints)
    for state in np.random.default_rng(3).uniform(limits.position_min, limits.position_max, shape):
        yield state, [np.array(pose) for pose in frames(state)]


def test_iiwa_is_the_arm_of_its_denavit_hartenberg_parameters():
    """Craig's convention, constDhDataOf14R820.m of KST-Kuka-Sunrise-Toolbox."""
    lengths = [0.36, 0.0, 0.42, 0.0, 0.4, 0.0, 0.126]
    turns = [0, -1, 1, 1, -1, -1, 1]
    for state, frames in random_frames(load_arm("iiwa14")):
        expected = np.eye(4)
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


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_no_published_mesh_is_in_an_obstacle_at_a_corner(name):
    """Small obstacles where a corner of a link or of the hand would pass."""
    pytest.importorskip("trimesh")
    skip_without_meshes(name)
    found = list(corner_contacts(name, 8))
    assert sum(said == "solved" for said, _ in found) >= 4
    assert not any(depth for _, depth in found)


def test_any_arm_carries_a_gripper_that_the_scene_names(tmp_path):
    (tmp_path / "mine.toml").write_text(
        tp.scene_text("pose").replace("franka-hand", "robotiq-2f-85")
    )
    scene, panda, other = tp.load_scene(tmp_path / "mine.toml"), load_arm("panda"), load_arm("ur5e")
    assert scene.arm.tool == dataclasses.replace(
        other.tool, flange=panda.tool.flange, rotation=panda.tool.rotation
    )
    assert scene.arm.links == (*panda.links[:7], other.links[-1])
    kept = tuple(capsule for capsule in panda.capsules if capsule.link < 8)
    hand = [dataclasses.replace(c, link=8) for c in other.capsules if c.link == other.joints + 1]
    assert scene.arm.capsules == (*kept, *hand)
    # What the scene says of the grip goes before the file.
    assert scene.gripper.force == tp.load_scene("pose").gripper.force
    named = tmp_path / "mine.toml"
    named.write_text(named.read_text().replace("2f-85", "2f-58"))
    with pytest.raises(tp.InputError, match=r"gripper.*did you mean 'robotiq-2f-85'"):
        tp.load_scene(named)


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
    assert arm.throwing_joints == throwing and set(arm.joint_names) <= names_in(PACKAGES / file)
    scene = tp.load_scene("xarm7").replace(arm=arm, workspace=None)
    bar = dataclasses.replace(scene.object, mass=0.05, inertia=1e-4)
    target = tp.Pose(x, z, *(turned or [0.0]))
    plan = tp.Planner(scene.replace(object=bar)).plan(target, patience=60.0)
    assert plan.solved, plan.message


def names_in(file):
    return set(re.findall(r'joint[^<>]*? name="(.*?)"', file.read_text()))
