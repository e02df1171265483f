"""Arms from URDF files, against other kinematics and dynamics."""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
import yourdfpy
from adam.numpy import KinDynComputations
from planar_urdf import JOINTS, ODD_OPTIONS, XACRO, hand_pose, imported, moved, planar_urdf
from throwplan.models import Arm, PlanarArm
from throwplan.planner.check.check import throw
from throwplan.planner.check.mover import make_mover
from throwplan.planner.cli import main
from throwplan.problems import load_arm, scene_text

PANDA_URDF = Path(__file__).parent / "data" / "panda.urdf"
PANDA_JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
PANDA_OPTIONS = [
    *["--tool", "panda_hand", "--tcp", "0.1034", "--palm", "0.1034", "0.045", "0.033"],
    *["--acceleration", "15", "7.5", "10", "12.5", "15", "20", "20"],
    *["--jerk", "7500", "3750", "5000", "6250", "7500", "10000", "10000", "--name", "my-panda"],
]


@pytest.fixture(scope="module")
def panda(tmp_path_factory):
    folder = tmp_path_factory.mktemp("panda")
    return imported(folder, PANDA_URDF, PANDA_JOINTS, *PANDA_OPTIONS)


@pytest.fixture(scope="module")
def odd(odd_file):
    return imported(odd_file.parent, odd_file, JOINTS, *ODD_OPTIONS)


def frames_of(arm: Arm) -> ca.Function:
    q = ca.SX.sym("q", arm.joints)
    return ca.Function("frames", [q], arm.frames(q))


def states(arm: Arm, count: int) -> np.ndarray:
    low, high = arm.limits.position_min, arm.limits.position_max
    return np.random.default_rng(11).uniform(low, high, (count, arm.joints))


# Kinematics.


def test_imported_panda_is_the_shipped_one(panda):
    shipped, mine = frames_of(load_arm("panda")), frames_of(panda)
    for q in states(panda, 20):
        poses = [np.array(pose) for pose in mine(q)]
        expected = [np.array(pose) for pose in shipped(q)]
        # Axes z along the joints, as in the Denavit-Hartenberg frames, and the pads' centre.
        for i in [*range(7), 8]:
            np.testing.assert_allclose(poses[i], expected[i], rtol=0, atol=1e-12)
    assert panda.limits == load_arm("panda").limits
    assert panda.throwing_joints == (2, 4, 6)
    assert panda.azimuth_joint == 1
    assert panda.posture[6] == pytest.approx(math.pi / 4)


def test_imported_panda_agrees_with_adam(panda):
    adam, mine = KinDynComputations(str(PANDA_URDF), PANDA_JOINTS), frames_of(panda)
    for q in states(panda, 20):
        expected = np.asarray(adam.forward_kinematics("panda_hand_tcp", np.eye(4), q))
        np.testing.assert_allclose(np.array(mine(q)[-1]), expected, rtol=0, atol=1e-12)


def test_odd_frames_and_axes_are_folded_into_the_chain(odd):
    mine = frames_of(odd)
    for q in states(odd, 20):
        pose = np.array(mine(q)[-1])
        np.testing.assert_allclose(pose, hand_pose(q, 0.08), rtol=0, atol=1e-12)


def test_odd_arm_throws_in_its_plane(odd):
    assert (odd.azimuth_joint, odd.throwing_joints) == (1, (2, 3, 4))
    planar = PlanarArm(odd)
    q = ca.SX.sym("q", 3)
    zero = ca.SX.zeros(3)
    pose = ca.Function("pose", [q], [ca.vertcat(*planar.motion(q, zero, zero)[0])])
    for value in states(odd, 5)[:, 1:]:
        x, z, theta = np.array(pose(value)).ravel()
        expected = hand_pose(np.array([0.0, *value]), 0.08)
        np.testing.assert_allclose([x, 0.0, z], expected[:3, 3], atol=1e-12)
        points = [math.cos(theta), 0.0, math.sin(theta)]
        np.testing.assert_allclose(points, expected[:3, 2], atol=1e-12)


def test_right_angles_that_are_rounded_are_named(tmp_path, capsys):
    """1.5708 for pi/2 tilts a joint by 4e-6: the hand leaves the plane."""
    rounded = tmp_path / "rounded.urdf"
    text = PANDA_URDF.read_text().replace("1.5707963267948966", "1.5708")
    rounded.write_text(text.replace("<robot", f"<robot {XACRO}"))
    words = ["import-robot", str(rounded), "--joints", *PANDA_JOINTS, *PANDA_OPTIONS]
    assert main([*words, "--out", str(tmp_path / "arm.toml")]) == 2
    assert "write the URDF's right angles in full" in capsys.readouterr().err


def test_a_link_may_be_the_base(tmp_path, odd_file, odd):
    words = "<robot name='odd'><link name='world'/><joint name='stand' type='fixed'>"
    words += "<parent link='world'/><child link='base'/><origin xyz='1 2 3' rpy='0 0 1'/></joint>"
    raised = tmp_path / "raised.urdf"
    raised.write_text(odd_file.read_text().replace('<robot name="odd">', words))
    arm = imported(tmp_path, raised, JOINTS, *ODD_OPTIONS, "--base", "base")
    for q in states(odd, 3):
        np.testing.assert_allclose(
            np.array(frames_of(arm)(q)[-1]), np.array(frames_of(odd)(q)[-1]), atol=1e-12
        )


# Masses.


def test_masses_are_merged_and_none_is_lost(odd):
    bodies = [body for body in planar_urdf()[1] if body.moved_by]
    assert sum(link.mass for link in odd.links) == pytest.approx(sum(b.mass for b in bodies))
    assert len(odd.links) == odd.joints + 1
    # The roll and the forearm move with joint 3, so does the cover; hand and pads are the hand.
    each = Counter()
    for body in bodies:
        each[body.moved_by] += body.mass
    merged = [link.mass for link in odd.links]
    assert merged[:3] == pytest.approx([each[1], each[2], each[3]])
    assert merged[3] + merged[4] == pytest.approx(each[4])


def body_poses(arm: Arm, q: np.ndarray) -> list[np.ndarray]:
    """Poses of the frames in which the arm's links are given."""
    poses = [np.array(pose) for pose in frames_of(arm)(q)]
    back = np.eye(4)
    back[2, 3] = -arm.tool.tcp
    return [*poses[: arm.joints], poses[-1] @ back]


def test_centre_of_mass_is_yourdfpys(odd, odd_file):
    robot = yourdfpy.URDF.load(str(odd_file), load_meshes=False)
    for q in states(odd, 4):
        robot.update_cfg(dict(zip(JOINTS, q, strict=True)))
        expected, mass = np.zeros(3), 0.0
        for link in robot.robot.links:
            if link.name != "base":
                pose = robot.get_transform(link.name) @ link.inertial.origin
                expected, mass = (
                    expected + link.inertial.mass * pose[:3, 3],
                    mass + link.inertial.mass,
                )
        found = np.zeros(3)
        for link, pose in zip(odd.links, body_poses(odd, q), strict=True):
            found += link.mass * (pose[:3, :3] @ link.com + pose[:3, 3])
        np.testing.assert_allclose(found / mass, expected / mass, atol=1e-12)


def kinetic_energy(arm: Arm, q: np.ndarray, dq: np.ndarray) -> float:
    """Of all links, their velocities by differences of their poses."""
    h = 1e-6
    before, now, after = (body_poses(arm, q + step * dq) for step in (-h, 0.0, h))
    energy = 0.0
    for link, a, pose, b in zip(arm.links, before, now, after, strict=True):
        com = np.array([*link.com, 1.0])
        velocity = ((b - a) @ com)[:3] / (2 * h)
        spin = pose[:3, :3].T @ (b - a)[:3, :3] / (2 * h)
        omega = np.array(
            [spin[2, 1] - spin[1, 2], spin[0, 2] - spin[2, 0], spin[1, 0] - spin[0, 1]]
        )
        xx, xy, xz, yy, yz, zz = link.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        energy += link.mass * velocity @ velocity / 2 + (omega / 2) @ inertia @ (omega / 2) / 2
    return float(energy)


def test_kinetic_energy_is_that_of_adams_mass_matrix(tmp_path):
    path = tmp_path / "odd.urdf"
    path.write_text(planar_urdf("fixed", 1.0)[0])
    arm = imported(tmp_path, path, JOINTS, *ODD_OPTIONS)
    adam = KinDynComputations(str(path), JOINTS)
    rng = np.random.default_rng(2)
    for q in states(arm, 4):
        dq = rng.uniform(-2, 2, 4)
        matrix = np.asarray(adam.mass_matrix(np.eye(4), q))[6:, 6:]
        assert kinetic_energy(arm, q, dq) == pytest.approx(dq @ matrix @ dq / 2, rel=1e-7)


def test_bodies_move_with_their_joints(odd):
    """The first joint's mass keeps its place but for the turn about z."""
    body = next(b for b in planar_urdf()[1] if b.moved_by == 1)
    for q in states(odd, 3):
        pose = body_poses(odd, q)[0]
        found = pose[:3, :3] @ odd.links[0].com + pose[:3, 3]
        expected = moved(q, 1) @ [*body.com, 1.0]
        np.testing.assert_allclose(found, expected[:3], atol=1e-12)


@pytest.mark.parametrize("name", ["panda", "fr3"])
def test_shipped_masses_are_those_of_bodies(name):
    links = load_arm(name).links
    assert len(links) == 8
    for link in links:
        xx, xy, xz, yy, yz, zz = link.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert link.mass > 0
        assert np.linalg.eigvalsh(inertia).min() > 0
    # The arms weigh about 18 kg with their bases, the hand 0.73 kg: data sheets.
    assert 13 < sum(link.mass for link in links[:7]) < 17
    assert links[7].mass == pytest.approx(0.73, abs=0.03)


# Throwing with an imported robot.


def test_imported_panda_throws_to_the_pose(tmp_path, panda):
    imported(tmp_path, PANDA_URDF, PANDA_JOINTS, *PANDA_OPTIONS)
    file = tmp_path / "mine.toml"
    file.write_text(scene_text("pose").replace('arm = "panda"', 'arm = "arm.toml"'))
    scene = tp.load_scene(file)
    assert scene.arm == panda
    plan = tp.Planner(scene).plan()
    assert plan.solved
    position, angle = plan.error_sent()
    assert abs(position) < 0.002 and abs(angle) < math.radians(0.5)
    # The shipped arm, sent the same joints, throws to the same place.
    shipped = tp.load_scene("pose")
    samples = plan.throw.samples
    thrown = throw(shipped, make_mover(shipped), samples, plan.throw.opening_time, shipped.target.z)
    assert thrown.landing.x == pytest.approx(shipped.target.x, abs=0.002)
    assert thrown.landing.theta == pytest.approx(shipped.target.theta, abs=math.radians(0.5))


# What is printed.


def test_json_is_one_object(tmp_path, odd_file, capsys):
    out = tmp_path / "odd.toml"
    words = ["import-robot", str(odd_file), "--joints", *JOINTS, *ODD_OPTIONS]
    assert main([*words, "--json", "--out", str(out)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["throwing"] == ["lift", "bend", "flick"]
    assert found["azimuth"] == "turn"
    assert sorted(found["held"]) == ["finger-1", "finger1", "roll"]
    assert found["states"] >= 20 and found["difference"] < 1e-9


def test_what_is_held_is_said(tmp_path, odd_file, capsys):
    imported(tmp_path, odd_file, JOINTS, *ODD_OPTIONS)
    assert "held at 0: roll, finger1, finger-1" in capsys.readouterr().out


def test_given_limits_go_before_the_files(tmp_path, odd_file):
    arm = imported(
        *(tmp_path, odd_file, JOINTS, *ODD_OPTIONS, "--velocity", "1", "-", "2", "-"),
        *("--position-max-deg", "90"),
    )
    assert arm.limits.velocity == (1.0, 3.0, 2.0, 3.0)
    assert arm.limits.position_max == pytest.approx((math.pi / 2,) * 4)
    assert arm.limits.position_min == (-2.0,) * 4
