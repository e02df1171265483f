"""`import-robot`: arms from URDF files, against other kinematics and dynamics, and refusals."""

from __future__ import annotations

import dataclasses
import io
import itertools
import math
import re
import shlex
import xml.etree.ElementTree as ET
from contextlib import redirect_stdout
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
import yourdfpy
from adam.numpy import KinDynComputations
from builders import inertia_matrix
from imports import PANDA_JOINTS, PANDA_OPTIONS, PANDA_URDF, imported
from planar_urdf import JOINTS, ODD_OPTIONS, XACRO, hand_pose, planar_urdf
from throwplan.cli import main

from oracle.shapes import to_segment


@pytest.fixture(scope="module")
def panda(tmp_path_factory):
    return imported(tmp_path_factory.mktemp("panda"), PANDA_URDF, PANDA_JOINTS, *PANDA_OPTIONS)


@pytest.fixture(scope="module")
def odd_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("odd") / "odd.urdf"
    path.write_text(planar_urdf())
    return path


@pytest.fixture(scope="module")
def odd(odd_file):
    return imported(odd_file.parent, odd_file, JOINTS, *ODD_OPTIONS)


def frames_of(arm) -> ca.Function:
    q = ca.SX.sym("q", arm.joints)
    return ca.Function("frames", [q], arm.frames(q))


def states(arm, count: int) -> np.ndarray:
    low, high = arm.limits.position_min, arm.limits.position_max
    return np.random.default_rng(11).uniform(low, high, (count, arm.joints))


# Kinematics.


def test_imported_panda_is_the_shipped_one(panda) -> None:
    shipped = tp.load_scene("pose").arm
    theirs, mine = frames_of(shipped), frames_of(panda)
    for q in states(panda, 20):
        poses = [np.array(pose) for pose in mine(q)]
        expected = [np.array(pose) for pose in theirs(q)]
        # Axes z along the joints, as in the Denavit-Hartenberg frames, and the pads' centre.
        for i in [*range(7), 8]:
            np.testing.assert_allclose(poses[i], expected[i], rtol=0, atol=1e-12)
    # The file has no masses, so nothing limits the torque rate.
    assert panda.limits == dataclasses.replace(shipped.limits, tool_speed=1.5, torque_rate=None)
    assert panda.assumed == ("tool_speed",)
    assert (panda.throwing_joints, panda.azimuth_joint) == ((2, 4, 6), 1)
    assert panda.posture[6] == pytest.approx(math.pi / 4)


def test_a_xacro_is_the_urdf_that_it_stands_for(tmp_path, odd_file, odd) -> None:
    text = odd_file.read_text()
    height = re.search(r'xyz="([^"]*)"', text)[1]
    named = f'{XACRO}><xacro:property name="at" value="{height}"/>'
    text = text.replace(f'xyz="{height}"', 'xyz="${at}"')
    (tmp_path / "odd.xacro").write_text(text.replace(">", f" {named}", 1))
    options = [*ODD_OPTIONS, "--name", odd.name]
    assert imported(tmp_path, tmp_path / "odd.xacro", JOINTS, *options) == odd


def test_odd_frames_and_axes_are_folded_into_the_chain(odd) -> None:
    mine = frames_of(odd)
    assert (odd.azimuth_joint, odd.throwing_joints) == (1, (2, 3, 4))
    for q in states(odd, 20):
        pose = np.array(mine(q)[-1])
        np.testing.assert_allclose(pose, hand_pose(q, 0.08), rtol=0, atol=1e-12)


def test_a_link_may_be_the_base(tmp_path, odd_file, odd) -> None:
    words = "<robot name='odd'><link name='world'/><joint name='stand' type='fixed'>"
    words += "<parent link='world'/><child link='base'/><origin xyz='1 2 3' rpy='0 0 1'/></joint>"
    raised = tmp_path / "raised.urdf"
    raised.write_text(odd_file.read_text().replace('<robot name="odd">', words))
    arm = imported(tmp_path, raised, JOINTS, *ODD_OPTIONS, "--base", "base")
    for q in states(odd, 3):
        one, other = (np.array(frames_of(a)(q)[-1]) for a in (arm, odd))
        np.testing.assert_allclose(one, other, atol=1e-12)
    # In the root's frame, moved onto the axis of the first joint, the arm is turned and raised.
    arm = imported(tmp_path, raised, JOINTS, *ODD_OPTIONS)
    assert arm.posture[0] == pytest.approx(-1.0) and arm.lateral == 0.0
    for q in states(odd, 3):
        one, other = (np.array(frames_of(a)(q)[-1]) for a in (arm, odd))
        turned = np.array(
            [[math.cos(1), -math.sin(1), 0], [math.sin(1), math.cos(1), 0], [0, 0, 1]]
        )
        np.testing.assert_allclose(one[:3, 3], turned @ other[:3, 3] + [0, 0, 3], atol=1e-12)


# Masses.


def body_poses(arm, q: np.ndarray) -> list[np.ndarray]:
    """Poses of the frames in which the arm's links are given."""
    poses = [np.array(pose) for pose in frames_of(arm)(q)]
    back = np.eye(4)
    back[2, 3] = -arm.tool.tcp
    return [*poses[: arm.joints], poses[-1] @ back]


def kinetic_energy(arm, q: np.ndarray, dq: np.ndarray) -> float:
    """Of all links, their velocities by differences of their poses."""
    h = 1e-6
    before, now, after = (body_poses(arm, q + step * dq) for step in (-h, 0.0, h))
    energy = 0.0
    for link, a, pose, b in zip(arm.links, before, now, after, strict=True):
        velocity = ((b - a) @ [*link.com, 1.0])[:3] / (2 * h)
        spin = pose[:3, :3].T @ (b - a)[:3, :3] / (4 * h)
        omega = np.array([spin[2, 1], spin[0, 2], spin[1, 0]])
        omega -= [spin[1, 2], spin[2, 0], spin[0, 1]]
        energy += link.mass * velocity @ velocity / 2 + omega @ inertia_matrix(link) @ omega / 2
    return float(energy)


def test_kinetic_energy_is_that_of_adams_mass_matrix(tmp_path) -> None:
    path = tmp_path / "odd.urdf"
    path.write_text(planar_urdf("fixed", 1.0))
    arm = imported(tmp_path, path, JOINTS, *ODD_OPTIONS)
    adam = KinDynComputations(str(path), JOINTS)
    rng = np.random.default_rng(2)
    for q in states(arm, 4):
        dq = rng.uniform(-2, 2, 4)
        matrix = np.asarray(adam.mass_matrix(np.eye(4), q))[6:, 6:]
        assert kinetic_energy(arm, q, dq) == pytest.approx(dq @ matrix @ dq / 2, rel=1e-7)


# Shapes.

#: Of a mesh, and of a box, each [m] in its own frame; where the URDF has them in the link's.
BLOCK = 0.04 * np.array(list(itertools.product((-1, 1), repeat=3))) + [0.06, 0.0, 0.01]
BOX = BLOCK @ np.diag([1.0, 0.6, 0.25]) - [0.06, 0.0, 0.0025]
PLACE = np.array([0.01, 0.0, 0.02])


def with_shapes(folder: Path) -> Path:
    """The odd robot with a mesh in mm on one link, one that is missing, and boxes."""
    lines = [f"v {x} {y} {z}" for x, y, z in 1e3 * BLOCK]
    faces = ["1 2 4", "4 3 1", "5 7 8", "8 6 5", "1 5 6", "6 2 1", "3 4 8", "8 7 3", "1 3 7"]
    (folder / "block.obj").write_text("\n".join(lines + [f"f {face}" for face in faces]))
    mesh = '<mesh filename="package://odd/{}" scale="0.001 0.001 0.001"/>'
    size = " ".join(map(str, np.ptp(BOX, axis=0)))
    shapes = {"after_lift": mesh.format("block.obj"), "after_bend": mesh.format("none.stl")}
    shapes |= dict.fromkeys(("base", "hand", "pad1", "pad-1"), f'<box size="{size}"/>')
    text, at = planar_urdf(axis_length=1.0), " ".join(map(str, PLACE))
    for link, shape in shapes.items():
        part = f'<collision><origin xyz="{at}"/><geometry>{shape}</geometry></collision>'
        text = text.replace(f'<link name="{link}">', f'<link name="{link}">{part}')
    (folder / "odd.urdf").write_text(text)
    return folder / "odd.urdf"


@pytest.fixture(scope="module")
def shaped(tmp_path_factory):
    """The robot with shapes, its arm, and what is printed about it."""
    file = with_shapes(tmp_path_factory.mktemp("shaped"))
    with redirect_stdout(io.StringIO()) as said:
        arm = imported(file.parent, file, JOINTS, *ODD_OPTIONS)
    return file, arm, said.getvalue()


def test_capsules_contain_the_meshes_as_they_move(shaped) -> None:
    """Corners by yourdfpy at random states and openings of the fingers are inside."""
    file, arm, _ = shaped
    robot, frames = yourdfpy.URDF.load(file, load_meshes=False), frames_of(arm)
    links, out = {"base": 0, "after_lift": 2, "hand": 5, "pad1": 5, "pad-1": 5}, []
    for q in states(arm, 60):
        fingers = dict.fromkeys(["finger1", "finger-1"], float(np.clip(2 * q[0], -2.0, 2.2)))
        robot.update_cfg(dict(zip(JOINTS, q, strict=True)) | fingers | {"roll": 0.0})
        poses = [np.eye(4), *(np.array(pose) for pose in frames(q))]
        poses[5] = poses[-1].copy()
        poses[5][:3, 3] -= arm.tool.tcp * poses[5][:3, 2]
        for name, number in links.items():
            corners = np.column_stack([(BLOCK if number == 2 else BOX) + PLACE, np.ones(8)])
            turn = np.linalg.inv(poses[number]) @ robot.get_transform(name, robot.base_link)
            own = [c for c in arm.capsules if c.link == number]
            at = (corners @ turn.T)[:, :3]
            away = [to_segment(at, *map(np.array, (c.begin, c.end))) - c.radius for c in own]
            out.append(np.min(away, axis=0).max())
    assert max(out) <= 1e-9
    # No larger than needed: a ball around the block's corners is.
    assert max(c.radius for c in arm.capsules if c.link == 2) < 0.04 * math.sqrt(3)


def test_links_without_a_mesh_are_named(shaped) -> None:
    file, arm, said = shaped
    assert len(arm.capsules) >= 3
    assert re.search(r"meshes not read: after_bend \(tried .*/odd/none.stl\)", said)
    assert "no mesh was read of after_bend" in (file.parent / "arm.toml").read_text()


# Joints that are held.


def lifted(text: str) -> str:
    """The odd robot on a lift of 0.15 to 0.4 m, beside a mast with an arm of a range above 0."""
    limit = '<limit lower="{}" upper="{}" velocity="1" effort="9"/>'
    joints = [
        ("lift0", "prismatic", "world", "base", "0 0 0", "0 0 2", limit.format(0.15, 0.4)),
        ("mast", "fixed", "world", "pole", "0 0.6 0", "0 0 1", ""),
        ("aside", "revolute", "pole", "plank", "0 0 0.8", "1 0 0", limit.format(0.5, 2.0)),
        ("follows", "prismatic", "pole", "slider", "0 0 0", "0 0 1", '<mimic joint="lift0"/>'),
    ]
    words = '<robot name="odd"><link name="world"/><link name="pole"/><link name="slider"/>'
    words += '<link name="plank"><collision><origin xyz="0 0 0.2"/><geometry>'
    words += '<box size="0.02 0.02 0.4"/></geometry></collision></link>'
    for name, kind, parent, child, at, axis, rest in joints:
        words += (
            f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        )
        words += f'<origin xyz="{at}"/><axis xyz="{axis}"/>{rest}</joint>'
    return text.replace('<robot name="odd">', words)


def test_joints_beside_the_chain_are_held_inside_their_ranges(tmp_path, odd_file, odd, run) -> None:
    """The lift stands at its lowest, the plank leans by the least that it can."""
    urdf, out = tmp_path / "odd.urdf", tmp_path / "arm.toml"
    urdf.write_text(lifted(odd_file.read_text()))
    words = ["import-robot", urdf, "--joints", *JOINTS, *ODD_OPTIONS, "--force", "--out", out]
    for hold, lift, lean in (
        ([], 0.15, 0.5),
        (["--hold", "lift0=0.3", "aside=90"], 0.3, 0.5 * math.pi),
    ):
        held = run("", *words, *hold, "--json").json["held"]
        zero = dict.fromkeys(["roll", "finger1", "finger-1"], 0.0)
        assert held == pytest.approx({"lift0": lift, "follows": lift, "aside": lean} | zero)
        text = out.read_text()
        assert f"lift0 at {lift:g} m" in text and f"aside at {math.degrees(lean):.6g} deg" in text
        arm = imported(tmp_path, urdf, JOINTS, *ODD_OPTIONS, *hold)
        for q in states(odd, 3):
            one, other = (np.array(frames_of(a)(q)[-1]) for a in (arm, odd))
            np.testing.assert_allclose(one[:3, 3], other[:3, 3] + [0, 0, lift], atol=1e-12)
        # Turned about x by the lean, the plank's axis goes from the mast's top to y < 0.
        (plank,) = arm.capsules
        assert plank.link == 0 and plank.beside
        tip = max((plank.begin, plank.end), key=lambda end: end[2] if lean < 1 else -end[1])
        far = np.array(tip) - [0.0, 0.6, 0.8]
        np.testing.assert_allclose(
            far / np.linalg.norm(far), [0.0, -math.sin(lean), math.cos(lean)], atol=0.02
        )


def test_a_position_that_a_held_joint_does_not_take_is_refused(tmp_path, odd_file, refused) -> None:
    (tmp_path / "odd.urdf").write_text(lifted(odd_file.read_text()))
    words = ["import-robot", tmp_path / "odd.urdf", "--joints", *JOINTS, *ODD_OPTIONS]
    for hold, message in (
        ("lift0=0.1", "--hold lift0: must be in its range, 0.15 m to 0.4 m"),
        ("turn=1", "--hold turn: this joint is one of --joints"),
        ("follows=0.2", "--hold follows: this joint mimics lift0"),
        ("lift00=0.2", "no joint 'lift00', did you mean 'lift0'"),
        ("lift0", "must be JOINT=VALUE"),
    ):
        said = refused(*words, "--hold", hold, "--out", tmp_path / "arm.toml")
        assert message in said


# Throwing, and what is printed.


def test_what_is_printed_and_given_limits_go_before_the_file_s(tmp_path, odd_file, run) -> None:
    out = tmp_path / "odd.toml"
    words = ["import-robot", odd_file, "--joints", *JOINTS, *ODD_OPTIONS]
    found = run("", *words, "--json", "--out", out).json
    assert found["throwing"] == ["lift", "bend", "flick"] and found["azimuth"] == "turn"
    assert sorted(found["held"]) == ["finger-1", "finger1", "roll"]
    assert found["states"] >= 20 and found["difference"] < 1e-9
    said = run("", *words, "--out", tmp_path / "other.toml")
    assert "at 0: roll, finger1, finger-1" in said.out
    limits = imported(
        *(tmp_path, odd_file, JOINTS, *ODD_OPTIONS, "--velocity", *"1-2-"),
        *("--position-max-deg", "90"),
    ).limits
    assert limits.velocity == (1.0, 3.0, 2.0, 3.0)
    assert limits.position_max == pytest.approx((math.pi / 2,) * 4)
    assert limits.position_min == (-2.0,) * 4


# What is refused, in one line and without leaving a file.

MIMIC = '<mimic joint="lift"/>'
FLICK = '"flick" type="revolute"'
ROLL = [*JOINTS[:3], "roll", "flick"]
REFUSED = {
    "no such joint": (["turn", "lift", "bent"], [], None, r"no joint 'bent', did you mean 'bend'"),
    "prismatic": (["turn", "lift", "finger1"], [], None, "'finger1' is prismatic"),
    "fixed": (["turn", "lift", "flange"], [], None, "'flange' is fixed"),
    "one joint": (["turn"], [], None, "two joints or more"),
    "twice": (["turn", "lift", "lift"], [], None, "each once"),
    "order": (["turn", "bend", "lift"], [], None, "from the base on: turn lift bend"),
    "tool": (JOINTS, ["--tool", "base"], None, "must hang on the last joint 'flick'"),
    "no such tool": (JOINTS, ["--tool", "hant"], None, "no link 'hant', did you mean 'hand'"),
    "base": (JOINTS, ["--base", "hand"], None, "must not move with the joint 'turn'"),
    "closing": (JOINTS, ["--closing", "x", "--approach=-x"], None, "must not be the axis"),
    "azimuth": (JOINTS, ["--azimuth", "lift"], None, "'lift' does not turn about the z axis"),
    "azimuth unknown": (JOINTS, ["--azimuth", "roll"], None, "no joint 'roll' among"),
    "throwing": (JOINTS, ["--throwing", "turn"], None, "behind 'turn' that turns the plane"),
    "posture length": (JOINTS, ["--posture-deg", "1"], None, "must be 4 values"),
    "posture": (ROLL, ["--posture-deg", *"000", "170", "0", "--throwing", "lift"], None,
                r"--posture-deg: 170 for 'roll': must be in \[-114.592, 126.051\]"),
    "plane": (ROLL, ["--posture-deg", *"000", "40", "0"], None,
              "do not move the hand in the vertical plane.*change --azimuth"),
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
    "endless": (JOINTS, [], (FLICK, '"flick" type="continuous"'),
                r"--position-min-deg \(position_min of flick\)"),
    "boundless": (JOINTS, [], ('lower="-2" upper="2.2"', 'lower="-inf" upper="inf"'),
                  r"--position-min-deg \(position_min of all joints\)"),
    "too fast": (JOINTS, [], ('velocity="3"', 'velocity="1e9"'),
                 r"odd.urdf: limits: velocity = 1e\+09: must be at most"),
    "axis": (JOINTS, [], ("<axis xyz=", '<axis xyz="0 0 0" was='), "axis must be three numbers"),
    "negative mass": (JOINTS, [], ('<link name="hand"><inertial>',
                      '<link name="hand"><inertial><mass value="-1"/>'), "link 'hand': mass = -1"),
    "not XML": (JOINTS, [], ("<robot", "robot"), "cannot be read as a URDF"),
    "cut short": (JOINTS, [], ("</robot>", ""), "cannot be read as a URDF: no element found"),
    "another root": (JOINTS, [], ("robot", "sdf"), "its root is <sdf>, must be <robot>"),
    "MJCF": (JOINTS, [], ("robot", "mujoco"), "MuJoCo's MJCF, which is not read: give the robot's"),
    "no name": (JOINTS, [], ('<link name="hand">', "<link>"), "lacks the attribute 'name'"),
    "xacro": (JOINTS, [], (">", f" {XACRO}><xacro:macro/>", 1), "cannot be read as a URDF"),
    "no link": (JOINTS, [], ('<child link="hand"/>', '<child link="nothing"/>'), "'nothing'"),
    "same names": (JOINTS, [], ('<joint name="lift"', '<joint name="turn"'), "called 'turn'"),
    "ring": (JOINTS, [], ('<parent link="base"/>', '<parent link="hand"/>'), "form a ring"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_bad_input_is_one_line_and_writes_nothing(case, tmp_path, odd_file, refused, untouched):
    joints, options, change, message = REFUSED[case]
    urdf, text = tmp_path / "odd.urdf", odd_file.read_text()
    urdf.write_text(text if change is None else text.replace(*change))
    untouched()
    words = ["--joints", *joints, "--acceleration", "10", "--jerk", "1000"]
    words += [] if "--approach=-x" in options else ["--approach=-x"]
    words += [] if "--closing" in options else ["--closing", "z"]
    lines = 2 if case in ("endless", "boundless") else 1
    said = refused(
        "import-robot", urdf, *words, *options, "--out", tmp_path / "arm.toml", lines=lines
    )
    assert re.search(message, said)


def test_rounded_right_angles_and_undeclared_prefixes_do_not_matter(tmp_path, panda) -> None:
    """1.5708 for pi/2 tilts a joint by 4e-6: the hand would leave the plane."""
    text = PANDA_URDF.read_text().replace("1.5707963267948966", "1.5708")
    text = text.replace("<limit ", '<limit drake:acceleration="2" ').replace(
        "</robot>", "<ros2:control/></robot>"
    )
    (tmp_path / "rounded.urdf").write_text(text)
    assert imported(tmp_path, tmp_path / "rounded.urdf", PANDA_JOINTS, *PANDA_OPTIONS) == panda


def test_joints_by_number_or_all_on_the_way_to_the_tool(tmp_path, odd_file, odd, refused) -> None:
    numbered = imported(
        tmp_path, odd_file, ["1", "2", "3", "5"], *ODD_OPTIONS, "--throwing", *"234"
    )
    assert numbered == odd and odd.joint_names == tuple(JOINTS)
    out = tmp_path / "all.toml"
    words = ["--force", "--out", out, "--acceleration", "10", "--jerk", "1000"]
    hand = ["--tool", "hand", "--approach=-x", "--closing", "z"]
    assert main([str(word) for word in ("import-robot", odd_file, *words, *hand)]) == 0
    assert 'joint_names = ["turn", "lift", "bend", "roll", "flick"]' in out.read_text()
    said = refused("import-robot", odd_file, *words, lines=4)
    assert "one of hand, after_flick" in said
    line = refused("import-robot", odd_file, *words, "--tool", "hand", "--joints", "1", "6")
    assert "--joints: no joint '6'" in line


def test_all_that_is_missing_comes_at_once_with_a_command_line_that_works(
    odd_file, refused, run, tmp_path
) -> None:
    out = tmp_path / "arm.toml"
    said = refused("import-robot", odd_file, "--out", out, lines=5)
    for option in ("--tool", "--approach", "--closing"):
        assert f"{option} is missing" in said
    assert "limits are missing" in said
    words = shlex.split(said.splitlines()[-1].partition("with values to try: ")[2])
    assert words[0] == "throwplan" and run("", *words[1:]).status == 0 and out.exists()


def chain_urdf(joints: dict[str, tuple[str, str]], hand: str) -> str:
    """An arm of joints, by name, each with its axis and place in the link before; then XML."""
    text = '<robot name="arm"><link name="l0"/>'
    for i, (name, (axis, at)) in enumerate(joints.items()):
        text += f'<link name="l{i + 1}"/>' + joint_xml(name, f"l{i}", f"l{i + 1}", at, axis)
    return f"{text}{hand}</robot>"


def joint_xml(name, parent, child, at, axis="", kind="revolute", rest="") -> str:  # type: ignore[no-untyped-def]
    limit = '<limit lower="-1.5" upper="1.5" effort="40" velocity="4"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{at}"/>'
        + (f'<axis xyz="{axis}"/>{limit}{rest}' if axis else "")
        + "</joint>"
    )


UP, X, Y = "0 0 1", "1 0 0", "0 1 0"
ROLLING = {"j1": UP, "j2": X, "j3": UP, "j4": Y, "j5": UP, "j6": X, "j7": Y}
HAND = '<link name="ee"/>' + joint_xml("e", "l4", "ee", "0 0 0.16", kind="fixed")
LIFTING = {name: (axis, "0 0 0.2") for name, axis in zip("abcd", (UP, Y, Y, Y), strict=True)}


def test_joints_that_throw_are_those_with_the_pads_across_the_plane(tmp_path, run) -> None:
    """j2 and j6 throw as many as j4 and j7, with fingers that close in their plane."""
    places = dict(zip(ROLLING, (0.1, 0.1, 0.1, 0.15, 0.1, 0.12, 0.0), strict=True))
    chain = {name: (axis, f"0 0 {places[name]}") for name, axis in ROLLING.items()}
    hand = '<link name="hand"/>' + joint_xml("h", "l7", "hand", "0 0 0.12", kind="fixed")
    (tmp_path / "arm.urdf").write_text(chain_urdf(chain, hand))
    arm = imported(
        tmp_path, tmp_path / "arm.urdf", [*ROLLING], "--tool", "hand", "--acceleration", "10",
        "--jerk", "1000",
    )  # fmt: skip
    assert arm.throwing_joints == (4, 7)
    # The scene of the arm is taken.
    tp.Planner(tp.load_scene(tmp_path / "scene.toml").changed(workspace=None))


def test_an_arm_that_no_scene_takes_is_refused_and_not_written(tmp_path, refused) -> None:
    urdf, out = tmp_path / "arm.urdf", tmp_path / "arm.toml"
    urdf.write_text(chain_urdf(LIFTING, HAND))
    words = ["--tool", "ee", "--closing", "x", "--acceleration", "10", "--jerk", "1000"]
    assert "pads 90.0 deg askew" in refused("import-robot", urdf, *words, "--out", out)


def test_an_arm_without_an_upright_joint_is_refused_and_the_first_upright_one_turns_the_plane(
    tmp_path, refused
) -> None:
    urdf, out = tmp_path / "arm.urdf", tmp_path / "arm.toml"
    words = ["--tool", "ee", "--acceleration", "10", "--jerk", "1000"]
    level = {name: (X if axis == UP else axis, at) for name, (axis, at) in LIFTING.items()}
    urdf.write_text(chain_urdf(level, HAND))
    line = refused("import-robot", urdf, *words, "--out", out)
    assert "none of the joints a, b, c, d turns about the z axis of link 'l0'" in line
    leaning = {"lean": (Y, "0 0 0.3")} | LIFTING
    urdf.write_text(chain_urdf(leaning, HAND.replace('"l4"', '"l5"')))
    arm = imported(tmp_path, urdf, [*leaning], *words)
    assert (arm.azimuth_joint, arm.throwing_joints) == (2, (3, 4, 5))


def test_all_missing_limits_are_named_in_one_line(tmp_path, odd_file, refused) -> None:
    tree = ET.parse(odd_file)
    for name in ("lift", "bend"):
        tree.find(f"joint[@name='{name}']/limit").set("velocity", "0")
    tree.write(tmp_path / "odd.urdf")
    words = ["--joints", *JOINTS, "--approach=-x", "--closing", "z", "--out", tmp_path / "arm.toml"]
    said = refused("import-robot", tmp_path / "odd.urdf", *words, lines=2)
    for part in (
        "--velocity (velocity of lift, bend)",
        "--acceleration (acceleration of all joints)",
        "--jerk (jerk of all joints)",
        "--velocity - 1 1 - --acceleration 10 --jerk 1000",
    ):
        assert part in said
