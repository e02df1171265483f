"""Robots: arms from URDF files against other kinematics and dynamics; the Franka Research 3."""

from __future__ import annotations

import dataclasses
import json
import math
import re
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
import yourdfpy
from adam.numpy import KinDynComputations
from planar_urdf import JOINTS, hand_pose, moved, planar_urdf
from throwplan.models.arm import Arm
from throwplan.models.hand import PlanarArm
from throwplan.planner.check import broken_limits, throw
from throwplan.planner.cli import main
from throwplan.planner.motion import SampledMotion
from throwplan.planner.mover import make_mover
from throwplan.planner.nlp import ThrowNlp, build_nlp
from throwplan.planner.numbers import structure_of
from throwplan.problems.arm_file import load_arm
from throwplan.problems.load import scene_text

PANDA_URDF = Path(__file__).parent / "data" / "panda.urdf"
PANDA_JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
PANDA_OPTIONS = [
    *["--tool", "panda_hand", "--tcp", "0.1034", "--palm", "0.1034", "0.045", "0.033"],
    *["--acceleration", "15", "7.5", "10", "12.5", "15", "20", "20"],
    *["--jerk", "7500", "3750", "5000", "6250", "7500", "10000", "10000", "--name", "my-panda"],
]
ODD_OPTIONS = [
    *["--tool", "hand", "--approach=-x", "--closing", "z", "--tcp", "0.08"],
    *["--acceleration", "10", "--jerk", "1000"],
]


def imported(folder: Path, urdf: Path, joints: list[str], *options: str) -> Arm:
    out = folder / "arm.toml"
    out.unlink(missing_ok=True)
    words = ["import-robot", str(urdf), "--joints", *joints, *options, "--out", str(out)]
    assert main(words) == 0
    return load_arm(str(out))


@pytest.fixture(scope="module")
def panda(tmp_path_factory):
    folder = tmp_path_factory.mktemp("panda")
    return imported(folder, PANDA_URDF, PANDA_JOINTS, *PANDA_OPTIONS)


@pytest.fixture(scope="module")
def odd_file(tmp_path_factory):
    path = tmp_path_factory.mktemp("odd") / "odd.urdf"
    path.write_text(planar_urdf()[0])
    return path


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


def test_a_continuous_joint_needs_position_limits(tmp_path, odd_file, capsys):
    endless = tmp_path / "endless.urdf"
    text = odd_file.read_text()
    endless.write_text(text.replace('"flick" type="revolute"', '"flick" type="continuous"'))
    words = ["import-robot", str(endless), "--joints", *JOINTS, *ODD_OPTIONS]
    out = ["--out", str(tmp_path / "a.toml")]
    assert main([*words, *out]) == 2
    error = capsys.readouterr().err
    assert "position_min of flick (--position-min-deg)" in error
    ends = ["--position-min-deg", "-", "-", "-", "-300", "--position-max-deg", "-", "-", "-", "300"]
    assert main([*words, *ends, *out]) == 0
    assert load_arm(out[1]).limits.position_max[3] == pytest.approx(math.radians(300))


# Refused input.

MIMIC = '<mimic joint="lift"/>'
FLICK = '"flick" type="revolute"'
XACRO = 'xmlns:xacro="http://ros.org/xacro"'
REFUSED = {
    "no such joint": (["turn", "lift", "bent"], [], None, r"no joint 'bent', did you mean 'bend'"),
    "prismatic": (["turn", "lift", "finger1"], [], None, "'finger1' is prismatic"),
    "fixed": (["turn", "lift", "flange"], [], None, "'flange' is fixed"),
    "one joint": (["turn"], [], None, "two joints or more"),
    "twice": (["turn", "lift", "lift"], [], None, "each once"),
    "order": (["turn", "bend", "lift"], [], None, "from the base on: turn lift bend"),
    "tool": (JOINTS, ["--tool", "base"], None, "must hang on the last joint 'flick'"),
    "no such tool": (JOINTS, ["--tool", "hant"], None, "no link 'hant', did you mean 'hand'"),
    "base": (JOINTS, ["--base", "hand"], None, "before the first joint 'turn'"),
    "closing": (JOINTS, ["--closing", "x", "--approach=-x"], None, "must not be the axis"),
    "azimuth": (JOINTS, ["--azimuth", "lift"], None, "'lift' does not turn upwards"),
    "azimuth unknown": (JOINTS, ["--azimuth", "roll"], None, "no joint 'roll' among"),
    "throwing": (JOINTS, ["--throwing", "turn"], None, "not the azimuth joint"),
    "posture length": (JOINTS, ["--posture-deg", "1"], None, "must be 4 values"),
    "posture": (
        [*JOINTS[:3], "roll", "flick"],
        ["--posture-deg", "0", "0", "0", "170", "0", "--throwing", "lift"],
        None,
        r"--posture-deg: 170 for 'roll': must be in \[-114.592, 126.051\]",
    ),
    "plane": (
        [*JOINTS[:3], "roll", "flick"],
        ["--posture-deg", "0", "0", "0", "40", "0"],
        None,
        "do not move the hand in the vertical plane.*change --azimuth",
    ),
    "number": (JOINTS, ["--velocity", "fast"], None, "--velocity fast: must be a finite number"),
    "count": (JOINTS, ["--velocity", "1", "2"], None, "--velocity: must be 4 values"),
    "zero": (JOINTS, ["--velocity", "0"], None, "must be above 0"),
    "range": (JOINTS, ["--position-max-deg", "-170"], None, "must be below -170"),
    "palm": (JOINTS, ["--palm", "0.01", "0.05", "0.03"], None, "BACK above FRONT"),
    "name": (JOINTS, ["--name", ""], None, "--name"),
    "mimic": (JOINTS, [], ("</joint>", f"{MIMIC}</joint>"), "'turn' mimics 'lift'"),
    "follower": (JOINTS, [], ('finger1" type="prismatic">', f'finger1" type="revolute">{MIMIC}'),
                 "'finger1' mimics 'lift'"),
    "floating": (JOINTS, [], (FLICK, '"flick" type="floating"'), "'flick' is floating"),
    "axis": (JOINTS, [], ("<axis xyz=", '<axis xyz="0 0 0" was='), "axis must be three numbers"),
    "negative mass": (JOINTS, [], ('<link name="hand"><inertial>',
                      '<link name="hand"><inertial><mass value="-1"/>'), "link 'hand': mass = -1"),
    "not XML": (JOINTS, [], ("<robot", "robot"), "cannot be read as a URDF"),
    "cut short": (JOINTS, [], ("</robot>", ""), "cannot be read as a URDF: no element found"),
    "another root": (JOINTS, [], ("robot", "sdf"), "its root is not <robot>"),
    "xacro": (JOINTS, [], (">", f" {XACRO}><xacro:macro/>", 1), "it is a xacro"),
    "no link": (JOINTS, [], ('<child link="hand"/>', '<child link="nothing"/>'), "'nothing'"),
    "same names": (JOINTS, [], ('<joint name="lift"', '<joint name="turn"'), "called 'turn'"),
    "ring": (JOINTS, [], ('<parent link="base"/>', '<parent link="hand"/>'), "form a ring"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_one_line_and_writes_nothing(case, tmp_path, odd_file, capsys):
    joints, options, change, message = REFUSED[case]
    urdf, out = tmp_path / "odd.urdf", tmp_path / "arm.toml"
    text = odd_file.read_text()
    urdf.write_text(text if change is None else text.replace(*change))
    words = ["import-robot", str(urdf), "--joints", *joints, "--acceleration", "10"]
    given = [] if "--approach=-x" in options else ["--approach=-x"]
    given += [] if "--closing" in options else ["--closing", "z"]
    assert main([*words, "--jerk", "1000", *given, *options, "--out", str(out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.startswith("throwplan: ") and len(printed.err.splitlines()) == 1
    assert re.search(message, printed.err)
    assert [path.name for path in tmp_path.iterdir()] == ["odd.urdf"]


def test_all_missing_limits_are_named_in_one_line(tmp_path, odd_file, capsys):
    tree = ET.parse(odd_file)
    for name in ("lift", "bend"):
        limit = tree.find(f"joint[@name='{name}']/limit")
        limit.set("velocity", "0")
    tree.write(tmp_path / "odd.urdf")
    words = ["import-robot", str(tmp_path / "odd.urdf"), "--joints", *JOINTS]
    assert main([*words, "--out", str(tmp_path / "arm.toml")]) == 2
    error = capsys.readouterr().err
    assert len(error.splitlines()) == 1
    for part in (
        "velocity of lift, bend (--velocity)",
        "acceleration of all joints (--acceleration)",
        "jerk of all joints (--jerk)",
    ):
        assert part in error


def test_files_that_are_not_there_or_in_the_way(tmp_path, odd_file, capsys):
    words = ["import-robot", str(odd_file), "--joints", *JOINTS, *ODD_OPTIONS, "--out"]
    taken = tmp_path / "taken.toml"
    taken.write_text("mine")
    for out, message in (
        (tmp_path / "no" / "arm.toml", "its folder is not there"),
        (tmp_path / "arm.json", "must end in .toml"),
        (taken, "exists already"),
        (taken / "arm.toml", "its folder is not there"),
    ):
        assert main([*words, str(out)]) == 2
        assert message in capsys.readouterr().err
    assert taken.read_text() == "mine"
    words[1] = str(tmp_path / "none.urdf")
    assert main([*words, str(tmp_path / "arm.toml")]) == 2
    assert "none.urdf: no such file" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["taken.toml"]


def test_without_yourdfpy_the_extra_is_named(tmp_path, odd_file, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "yourdfpy", None)
    words = ["import-robot", str(odd_file), "--joints", *JOINTS, *ODD_OPTIONS]
    assert main([*words, "--out", str(tmp_path / "arm.toml")]) == 2
    assert "throwplan[urdf]" in capsys.readouterr().err


# Franka Research 3: velocity limits that depend on the position.


def fr3_velocity(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest velocity of joints 2, 4, 6 at q (N, 3): libfranka, rate_limiting.h."""
    high = [
        np.minimum(2.62, -0.20 + np.sqrt(np.maximum(5.17 * (1.79180 - q[:, 0]), 0))),
        np.minimum(2.62, -0.30 + np.sqrt(np.maximum(8.00 * (-0.1458 - q[:, 1]), 0))),
        np.minimum(4.18, -0.35 + np.sqrt(np.maximum(11.0 * (4.52050 - q[:, 2]), 0))),
    ]
    low = [
        np.maximum(-2.62, 0.20 - np.sqrt(np.maximum(5.17 * (1.79180 + q[:, 0]), 0))),
        np.maximum(-2.62, 0.30 - np.sqrt(np.maximum(8.00 * (3.04810 + q[:, 1]), 0))),
        np.maximum(-4.18, 0.35 - np.sqrt(np.maximum(11.0 * (-0.54092 + q[:, 2]), 0))),
    ]
    return np.minimum(low, 0.0).T, np.maximum(high, 0.0).T


def without_slowing(scene: tp.Scene) -> tp.Scene:
    limits = dataclasses.replace(scene.arm.limits, slowing=None)
    return scene.replace(arm=dataclasses.replace(scene.arm, limits=limits))


@pytest.fixture(scope="module")
def fr3():
    return tp.load_scene("fr3")


@pytest.fixture(scope="module")
def fr3_planner(fr3):
    return tp.Planner(fr3)


#: A throw backwards over the base, joint 4 fast near the end of its range; two more.
NEAR_THE_END = tp.Pose(x=-2.07, z=0.1, theta=5.9)
FR3_TARGETS = [NEAR_THE_END, tp.Pose(x=-0.592, z=0.1, theta=0.657), None]


def test_shipped_limits_are_libfrankas(fr3):
    mover = make_mover(fr3)
    q = np.random.default_rng(0).uniform(mover.hard.q_min, mover.hard.q_max, (200, 3))
    for found, expected in zip(mover.hard.velocity(q), fr3_velocity(q), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-12)
    planned = mover.planning.velocity(q)[1]
    np.testing.assert_allclose(planned, 0.99 * fr3_velocity(q)[1], atol=1e-12)


@pytest.mark.parametrize("target", FR3_TARGETS, ids=str)
def test_every_sample_keeps_the_velocity_limits(fr3_planner, target):
    plan = fr3_planner.plan(target)
    assert plan.solved
    position, angle = plan.error_sent()
    assert abs(position) < 0.002 and abs(angle) < math.radians(0.5)
    samples = plan.throw.samples
    low, high = fr3_velocity(samples.q)
    assert (samples.dq <= high).all() and (samples.dq >= low).all()
    assert np.abs(samples.dq[-1]).max() == pytest.approx(0.0, abs=1e-9)


def test_the_limits_bind_near_a_joints_end(fr3, fr3_planner):
    """Without them the arm would go faster than it may; with them it goes as fast as it may."""
    free = tp.Planner(without_slowing(fr3)).plan(NEAR_THE_END)
    assert free.solved
    low, high = fr3_velocity(free.throw.samples.q)
    dq = free.throw.samples.dq
    assert max((dq - high).max(), (low - dq).max()) > 0.01
    mover = make_mover(fr3)
    broken = broken_limits(mover.hard, mover.joints, free.throw.samples)
    assert broken and all(words.endswith("velocity") for words in broken)

    samples = fr3_planner.plan(NEAR_THE_END).throw.samples
    _, high = fr3_velocity(samples.q)
    # Where the limit has fallen by a tenth or more, joint 4 uses all but the 1 % kept back.
    slower = (high[:, 1] < 0.9 * 2.62) & (high[:, 1] > 0.5)
    used = samples.dq[slower, 1] / high[slower, 1]
    assert 0.985 < used.max() <= 0.996


@pytest.mark.parametrize("slowing", [True, False])
def test_a_sample_over_the_curve_is_named(fr3, slowing):
    """Joint 4 at a steady 2 rad/s to 0.15 rad before its end: under 2.62, over the curve."""
    mover = make_mover(fr3 if slowing else without_slowing(fr3))
    ticks = np.arange(300)[:, None]
    q = np.array([0.0, -0.9, 2.0]) + 0.001 * ticks * np.array([0.0, 2.0, 0.0])
    dq = np.tile([0.0, 2.0, 0.0], (300, 1))
    broken = broken_limits(mover.hard, mover.joints, SampledMotion(q, dq, 0.0 * q))
    assert broken == (["joint 4 velocity"] if slowing else [])


@pytest.mark.parametrize(
    ("robot", "target"),
    [
        ({"control": "acceleration"}, FR3_TARGETS[1]),
        ({"start": (-math.pi / 4, -3 * math.pi / 4, math.pi / 2)}, NEAR_THE_END),
    ],
    ids=["acceleration", "start"],
)
def test_other_ways_to_plan_keep_the_limits(fr3, robot, target):
    scene = fr3.replace(robot=dataclasses.replace(fr3.robot, **robot))
    plan = tp.Planner(scene).plan(target)
    assert plan.solved
    low, high = fr3_velocity(plan.throw.samples.q)
    dq = plan.throw.samples.dq
    assert (dq <= high).all() and (dq >= low).all()


def test_releases_keep_the_limits_at_both_ends_of_the_opening(fr3_planner, fr3):
    releases = fr3_planner.releases()
    opening = fr3.gripper.profile().opening
    end = releases.q + opening * (releases.dq + opening * releases.ddq / 2)
    rate = releases.dq + opening * releases.ddq
    assert len(releases.q) > 1000
    for q, dq in ((releases.q, releases.dq), (end, rate)):
        low, high = fr3_velocity(q)
        assert (dq <= high).all() and (dq >= low).all()


def nlp_of(scene: tp.Scene) -> ThrowNlp:
    mover = make_mover(scene)
    return build_nlp(structure_of(scene, mover, True), mover)


def operations(nlp: ThrowNlp) -> int:
    """Of its constraints and objective."""
    outputs = [nlp.problem["g"], nlp.problem["f"]]
    function = ca.Function("nlp", [nlp.problem["x"], nlp.problem["p"]], outputs)
    return int(function.expand().n_instructions())


def test_an_arm_without_such_limits_has_nothing_of_them(fr3):
    full, bare = nlp_of(fr3), nlp_of(without_slowing(fr3))
    panda = nlp_of(tp.load_scene("pose"))
    assert bare.size == panda.size
    assert set(bare.parameters.blocks) == set(panda.parameters.blocks)
    assert operations(bare) == operations(panda) < operations(full)
    assert full.size[0] == bare.size[0]
    more = Counter(full.row_names) - Counter(bare.row_names)
    assert set(more) == {f"joint {j} velocity" for j in (2, 4, 6)}
    assert sum(more.values()) == full.size[1] - bare.size[1]
    assert set(full.parameters.blocks) - set(bare.parameters.blocks) == {
        "slowing", "slowing_offset", "slowing_upper", "slowing_lower",
    }  # fmt: skip
