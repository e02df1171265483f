"""Fails if an imported arm is not the URDF's: frames, masses, shapes, limits, or its mistakes."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
import shlex
from pathlib import Path
from typing import Any

import casadi as ca
import mujoco
import numpy as np
import pytest
import throwplan as tp
import trimesh
import yourdfpy
from planar_urdf import JOINTS, ODD_OPTIONS, XACRO, hand_pose, planar_urdf
from throwplan.cli import main
from throwplan.models.robot import SpatialArm
from throwplan.problems.arm_files import load_arm, load_gripper

from oracle import read_oracle
from oracle.shapes import to_segment

PANDA_URDF = Path(__file__).parent.parent / "data" / "panda.urdf"
PANDA_JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
PANDA_OPTIONS = [
    *["--tool", "panda_hand", "--tcp", "0.1034", "--palm", "0.1034", "0.045", "0.033"],
    *["--acceleration", "15", "7.5", "10", "12.5", "15", "20", "20"],
    *["--jerk", "7500", "3750", "5000", "6250", "7500", "10000", "10000", "--name", "my-panda"],
]
RATES = ["--acceleration", "10", "--jerk", "1000"]
CHAIN = ["--joints", *JOINTS, *ODD_OPTIONS]


def imported(folder: Path, urdf: Path, *options: object, gripper: str = "") -> Any:
    """The arm of a scene that uses the file which `import-robot` writes."""
    out = folder / "arm.toml"
    words = ["import-robot", urdf, *options, "--force", "--out", out]
    assert main(list(map(str, words))) == 0
    return tp.load_scene(scene_of(folder, gripper)).arm


def scene_of(folder: Path, gripper: str = "", **places: object) -> Path:
    """The scene `pose` with the arm of `arm.toml`, which holds by its own hand or by a gripper."""
    text = re.sub(r"start_deg = .*|palm_clearance = .*", "", tp.scene_text("pose"))
    hand = f'file = "{gripper}"' if gripper else "dwell = 0.05\nopening = 0.05"
    text = text.replace('file = "franka-hand"', hand)
    for key, value in places.items():
        text = re.sub(rf"(?m)^{key} = \S+", f"{key} = {value}", text)
    (folder / "scene.toml").write_text(text.replace('arm = "panda"', 'arm = "arm.toml"'))
    return folder / "scene.toml"


@pytest.fixture(scope="module")
def panda(tmp_path_factory) -> Any:
    folder = tmp_path_factory.mktemp("panda")
    return imported(folder, PANDA_URDF, "--joints", *PANDA_JOINTS, *PANDA_OPTIONS)


@pytest.fixture(scope="module")
def odd_file(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("odd") / "odd.urdf"
    path.write_text(planar_urdf())
    return path


@pytest.fixture(scope="module")
def odd(odd_file) -> Any:
    return imported(odd_file.parent, odd_file, *CHAIN)


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
        poses, expected = ([np.array(pose) for pose in frames(q)] for frames in (mine, theirs))
        # Axes z along the joints, as in the Denavit-Hartenberg frames, and the pads' centre.
        for i in [*range(7), 8]:
            np.testing.assert_allclose(poses[i], expected[i], rtol=0, atol=1e-12)
    # The file has no masses, so nothing limits the torque rate.
    assert panda.limits == dataclasses.replace(shipped.limits, tool_speed=1.5, torque_rate=None)
    assert panda.assumed == ("tool_speed",)
    assert (panda.throwing_joints, panda.azimuth_joint) == ((2, 4, 6), 1)
    assert panda.posture[6] == pytest.approx(math.pi / 4)


@pytest.mark.parametrize("angle", ["1.571", "1.5708"])
def test_rounded_right_angles_and_undeclared_prefixes_do_not_matter(angle, tmp_path, panda) -> None:
    """A tilt of a joint by 4e-6 would take the hand out of the plane."""
    text = PANDA_URDF.read_text().replace("1.5707963267948966", angle)
    text = text.replace("<limit ", '<limit drake:acceleration="2" ')
    (tmp_path / "near.urdf").write_text(text.replace("</robot>", "<ros2:control/></robot>"))
    words = ("--joints", *PANDA_JOINTS, *PANDA_OPTIONS)
    assert imported(tmp_path, tmp_path / "near.urdf", *words) == panda


def test_odd_frames_and_axes_are_folded_into_the_chain(odd) -> None:
    mine = frames_of(odd)
    assert (odd.azimuth_joint, odd.throwing_joints) == (1, (2, 3, 4))
    for q in states(odd, 20):
        np.testing.assert_allclose(np.array(mine(q)[-1]), hand_pose(q, 0.08), rtol=0, atol=1e-12)


def test_a_link_may_be_the_base(tmp_path, odd_file, odd) -> None:
    words = "<robot name='odd'><link name='world'/><joint name='stand' type='fixed'>"
    words += "<parent link='world'/><child link='base'/><origin xyz='1 2 3' rpy='0 0 1'/></joint>"
    raised = tmp_path / "raised.urdf"
    raised.write_text(odd_file.read_text().replace('<robot name="odd">', words))
    turn = np.array([[math.cos(1), -math.sin(1), 0], [math.sin(1), math.cos(1), 0], [0, 0, 1]])
    # In the root's frame, moved onto the axis of the first joint, the arm is turned and raised.
    for base, by, up in ((["--base", "base"], np.eye(3), 0.0), ([], turn, 3.0)):
        arm = imported(tmp_path, raised, *CHAIN, *base)
        assert arm.lateral == 0.0
        for q in states(odd, 3):
            one, other = (np.array(frames_of(a)(q)[-1]) for a in (arm, odd))
            np.testing.assert_allclose(one[:3, 3], by @ other[:3, 3] + [0, 0, up], atol=1e-12)


def xacro(folder: Path, head: str = "") -> Path:
    """The planar arm as a xacro whose tool link's name is an argument."""
    text = planar_urdf().replace('"hand"', '"$(arg hand)"')
    path = folder / "odd.urdf.xacro"
    path.write_text(text.replace('<robot name="odd">', f'<robot name="odd" {XACRO}>{head}'))
    return path


def test_a_xacro_is_the_urdf_that_it_stands_for(tmp_path, odd, refused, monkeypatch) -> None:
    """With its arguments behind the file, and the packages that it includes."""
    package = tmp_path / "workspace" / "my_arm"
    package.mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>my_arm</name></package>")
    (package / "a").write_text(f"<robot {XACRO}/>")
    file = xacro(tmp_path, '<xacro:include filename="$(find my_arm)/a"/>')
    words = [*CHAIN, "--out", tmp_path / "a.toml"]
    assert "my_arm" in refused("import-robot", file, "hand:=hand", *words)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(package.parent))
    assert "add hand:=VALUE" in refused("import-robot", file, *words)
    assert "did you mean 'hand'?" in refused("import-robot", file, "hend:=hand", *words)
    assert imported(tmp_path, file, "hand:=hand", *CHAIN, "--name", odd.name) == odd
    endless = '<xacro:macro name="a"><xacro:a/></xacro:macro><xacro:a/>'
    assert "without an end" in refused("import-robot", xacro(tmp_path, endless), *words)


# Masses and shapes.

#: By the frame that is the tool: what else is said about it.
TOOLS = {
    "forearm_end": ["--approach=x", "--closing", "y", "--tcp", "0.25"],
    "mount": ["--tcp", "0.2"],
    "gripper": ["--tcp", "0.15"],
    "pads": [],
}
#: The hand's links and their masses [kg].
HAND = {"gripper": 0.7, "left": 0.1, "right": 0.1, "pads": 0.0}
#: Largest way [m] of each finger; the box of the wrist [m], which is a mesh in mm, and its place.
OPEN, WRIST, AT = 0.06, (0.1, 0.05, 0.05), (0.05, 0.0, 0.0)


def link(name: str, mass: float, size: str = "", at: str = "0 0 0", more: str = "") -> str:
    box = f'<geometry><box size="{size}"/></geometry>'
    shape = f'<collision><origin xyz="{at}"/>{box}</collision>' if size else more
    body = (
        f'<inertial><origin xyz="{at}" rpy="0.1 0.2 0.3"/><mass value="{mass}"/><inertia '
        f'ixx="{0.002 * mass}" iyy="{0.003 * mass}" izz="{0.004 * mass}" ixy="{0.0003 * mass}" '
        'ixz="0" iyz="0"/></inertial>'
    )
    return f'<link name="{name}">{body if mass else ""}{shape}</link>'


def joint(name: str, kind: str, parent: str, child: str, at: str, axis: str = "", more: str = ""):
    """axis: with a limit of 2 rad, or of a finger's way."""
    ends = (0, OPEN) if kind == "prismatic" else (-2, 2)
    limit = f'<limit lower="{ends[0]}" upper="{ends[1]}" velocity="4" effort="200"/>'
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f"<origin {at}/>" + (f'<axis xyz="{axis}"/>{limit}' if axis else "") + f"{more}</joint>"
    )


def handy(folder: Path, hand: bool = True) -> Path:
    """An arm of four joints with a camera beside its gripper, whose fingers are closed at 0."""
    trimesh.creation.box(1e3 * np.array(WRIST)).export(folder / "wrist.obj")
    mesh = f'<collision><origin xyz="{AT[0]} 0 0"/><geometry><mesh scale="0.001 0.001 0.001" '
    mesh += f'filename="package://{folder.name}/wrist.obj"/></geometry></collision>'
    tilt = 'rpy="0 1.5707963267948966 0"'
    parts = [
        *(link(*one) for one in (("base", 3.0), ("column", 2.0), ("arm", 1.5), ("forearm", 1.2))),
        link("forearm_end", 0.5, more=mesh),
        link("mount", 0.0),
        link("camera", 0.3, "0.04 0.04 0.04", "0 0.06 0"),
        joint("turn", "revolute", "base", "column", 'xyz="0 0 0.1"', "0 0 1"),
        joint("lift", "revolute", "column", "arm", 'xyz="0 0 0.2"', "0 1 0"),
        joint("bend", "revolute", "arm", "forearm", 'xyz="0.4 0 0"', "0 1 0"),
        joint("flick", "revolute", "forearm", "forearm_end", 'xyz="0.35 0 0"', "0 1 0"),
        joint("screws", "fixed", "forearm_end", "mount", f'xyz="0.1 0 0" {tilt}'),
        joint("bracket", "fixed", "mount", "camera", 'xyz="0 0 0"'),
    ]
    if hand:
        mimics = '<mimic joint="left_slide"/>'
        parts += [
            link("gripper", 0.7, "0.06 0.12 0.08", "0 0 0.04"),
            link("left", 0.1, "0.02 0.02 0.08", "0 0.01 0.04"),
            link("right", 0.1, "0.02 0.02 0.08", "0 -0.01 0.04"),
            link("pads", 0.0),
            joint("coupling", "fixed", "mount", "gripper", 'xyz="0 0 0.05"'),
            joint("left_slide", "prismatic", "gripper", "left", 'xyz="0 0 0.08"', "0 1 0"),
            joint(
                "right_slide", "prismatic", "gripper", "right", 'xyz="0 0 0.08"', "0 -1 0", mimics
            ),
            joint("centre", "fixed", "gripper", "pads", 'xyz="0 0 0.15"'),
        ]
    path = folder / "handy.urdf"
    path.write_text("\n".join(['<robot name="handy">', *parts, "</robot>"]))
    return path


@pytest.fixture(scope="module", params=TOOLS)
def handed(request, tmp_path_factory) -> Any:
    """The arm by each of the frames that may be its tool, and its URDF."""
    urdf = handy(tmp_path_factory.mktemp("handy"))
    words = ["--joints", *JOINTS, "--tool", request.param, *TOOLS[request.param], *RATES]
    return imported(urdf.parent, urdf, *words), urdf


def test_torques_are_those_of_the_whole_file_whichever_frame_is_the_tool(handed) -> None:
    arm, urdf = handed
    text = re.sub(r"<collision>.*?</collision>", "", urdf.read_text())
    model = mujoco.MjModel.from_xml_string(text)
    data, moving = mujoco.MjData(model), [model.joint(name).qposadr[0] for name in JOINTS]
    q, dq, ddq = np.random.default_rng(3).uniform(-1.5, 1.5, (3, 5, 4))
    found = SpatialArm(arm).torques(q, dq, ddq, 9.81, np.zeros((5, 6)))
    for row, *state in zip(found, q, dq, ddq, strict=True):
        data.qpos[moving], data.qvel[moving], data.qacc[moving] = state
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(row, data.qfrc_inverse[moving], rtol=1e-9, atol=1e-9)
    assert arm.links[-1].mass == pytest.approx(sum(HAND.values()))
    assert set(arm.hand_links) == set(HAND)


def test_open_fingers_meshes_and_all_else_are_inside_the_capsules(handed) -> None:
    arm, urdf = handed
    robot = yourdfpy.URDF.load(urdf, load_meshes=False)
    numbers = {"camera": 4, "forearm_end": 4} | dict.fromkeys(("gripper", "left", "right"), 5)
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    for q, opening in itertools.product(states(arm, 5), (0.0, OPEN)):
        robot.update_cfg(dict(zip(JOINTS, q, strict=True)) | {"left_slide": opening})
        frames = SpatialArm(arm).frames(q[None])[:, 0]
        for name, number in numbers.items():
            (shape,) = robot.link_map[name].collisions
            size = shape.geometry.box.size if shape.geometry.box else WRIST
            corners = signs * size + shape.origin[:3, 3]
            turn = np.linalg.inv(frames[number]) @ robot.get_transform(name, "base")
            points = corners @ turn[:3, :3].T + turn[:3, 3]
            own = [c for c in arm.capsules if c.link == number]
            away = [to_segment(points, *map(np.array, (c.begin, c.end))) - c.radius for c in own]
            assert np.min(away, axis=0).max() <= 1e-6
    # No larger than needed: a ball around the wrist's corners is.
    assert min(c.radius for c in arm.capsules if c.link == 4) < np.linalg.norm(WRIST) / 2


# Grippers.


@pytest.mark.parametrize("hand", [True, False])
def test_a_gripper_file_replaces_the_hand_only(hand, tmp_path) -> None:
    imported(tmp_path, handy(tmp_path, hand), "--tool", "mount", *RATES)
    own, gripper = load_arm("arm.toml", tmp_path), load_gripper("robotiq-2f-85")
    arm = load_arm("arm.toml", tmp_path, gripper)
    masses = [each.mass for each in arm.links]
    assert masses == pytest.approx([2.0, 1.5, 1.2, 0.8, gripper.mass])
    assert [c for c in arm.capsules if c in own.capsules] == [c for c in own.capsules if c.link < 5]
    # Without a gripper file the hand is there.
    assert own.links[-1].mass == pytest.approx(0.9 * hand)


def test_no_gripper_is_mounted_on_a_hand(tmp_path, refused) -> None:
    imported(tmp_path, handy(tmp_path), "--tool", "pads", *RATES)
    said = refused("plan", scene_of(tmp_path, "robotiq-2f-85"))
    assert "hand = 'pads'" in said and "import the arm with --tool FLANGE" in said


# Torques and a plan.


def test_limits_that_do_not_hold_the_arm_are_refused_by_import_and_scene(
    tmp_path, run, refused, odd_file
) -> None:
    words = [
        "import-robot",
        odd_file,
        *CHAIN,
        "--force",
        "--out",
        tmp_path / "arm.toml",
        "--torque",
    ]
    strong = run("", *words, "150", "--palm", "0.08", "0.04", "0.03", "--json").json
    # Enough in most poses, not in all.
    weak = run("", *words, "150", "90", "150", "150", "--json").json["weak"]
    assert not strong.get("weak") and list(weak) == ["lift"] and weak["lift"][1] == 90.0
    need = f"lift needs {weak['lift'][0]:.3g} N m, has 1"
    assert need in refused("", *words, "150", "1", "150", "150", lines=2)
    imported(tmp_path, odd_file, *CHAIN, "--torque", "150")
    text = (tmp_path / "arm.toml").read_text()
    weak_text = re.sub(r"(?m)^torque = \[.*?\]", "torque = [150.0, 1.0, 150.0, 150.0]", text)
    (tmp_path / "arm.toml").write_text(weak_text)
    assert "its limit less the margin is 0.9 N m" in refused("plan", tmp_path / "scene.toml")


def test_an_imported_arm_s_throw_is_planned_judged_and_exported(tmp_path, run, table) -> None:
    """From a URDF to a bag for ROS 2; the oracle throws the plan's files anew."""
    rosbags = pytest.importorskip("rosbags.highlevel")
    words = ["--joints", *JOINTS, "--tool", "pads", "--palm", ".15", ".08", ".04", *RATES]
    imported(tmp_path, handy(tmp_path), *words)
    options = ("--target", "0.9", "0.2", "free", "--json", "--out", tmp_path / "out")
    said = run("plan", scene_of(tmp_path, force=120.0), *options)
    assert said.status == 0, said.err
    assert "arm.tool_speed" in said.json["assumed"]
    oracle = read_oracle(tmp_path / "out").judge(planned=True)
    assert oracle.broken() == [()]
    assert oracle.landing[0, 0] == pytest.approx(0.9, abs=1e-3)
    assert run("export", tmp_path / "out", "--ros", tmp_path / "bag").status == 0
    rows = table(tmp_path / "out" / "motion.csv")
    with rosbags.AnyReader([tmp_path / "bag"]) as reader:
        (message,) = (
            reader.deserialize(data, connection.msgtype)
            for connection, _, data in reader.messages()
            if connection.topic == "/joint_trajectory"
        )
    assert message.joint_names == JOINTS
    sent = np.array([point.positions for point in message.points])
    q = np.column_stack([rows[f"q{j}"] for j in range(1, 5)])
    np.testing.assert_allclose(sent, q, rtol=0, atol=1e-9)


# Throwing, and what is said.


def test_given_limits_go_before_the_file_s(tmp_path, odd_file, run) -> None:
    given = ("--velocity", *"1-2-", "--position-max-deg", "90")
    soft = '<safety_controller soft_lower_limit="-1" soft_upper_limit="3" k_velocity="9"/>'
    (tmp_path / "odd.urdf").write_text(odd_file.read_text().replace("</joint>", f"{soft}</joint>"))
    limits = imported(tmp_path, tmp_path / "odd.urdf", *CHAIN, *given).limits
    assert limits.velocity == (1.0, 3.0, 2.0, 3.0)
    assert limits.position_max == pytest.approx((math.pi / 2,) * 4)
    # Of a safety controller, where they are tighter.
    assert limits.position_min == (-1.0,) * 4
    found = run("import-robot", odd_file, *CHAIN, "--json", "--out", tmp_path / "odd.toml").json
    assert found["throwing"] == ["lift", "bend", "flick"] and found["azimuth"] == "turn"
    assert found["states"] >= 20 and found["difference"] < 1e-9


def chain_urdf(axes: dict[str, str], hand: float) -> str:
    """An arm of joints 0.2 m apart, by name, each with its axis; its hand so far above the last."""
    text = '<robot name="arm"><link name="l0"/>'
    for i, (name, axis) in enumerate(axes.items()):
        text += f'<link name="l{i + 1}"/>'
        text += joint(name, "revolute", f"l{i}", f"l{i + 1}", 'xyz="0 0 0.2"', axis)
    end = joint("to_ee", "fixed", f"l{len(axes)}", "ee", f'xyz="0 0 {hand}"')
    return f'{text}<link name="ee"/>{end}</robot>'.replace('"-2" upper="2"', '"-1.5" upper="1.5"')


UP, X, Y = "0 0 1", "1 0 0", "0 1 0"


def test_joints_that_throw_are_those_with_the_pads_across_the_plane(tmp_path, refused) -> None:
    """b and f throw as many as d and g, with fingers that close in their plane; the first upright
    joint turns the plane."""
    urdf, words = tmp_path / "arm.urdf", ["--tool", "ee", *RATES]
    for axes, azimuth, throwing in (
        ((UP, X, UP, Y, UP, X, Y), 1, (4, 7)),
        ((Y, UP, Y, Y, Y), 2, (3, 4, 5)),
    ):
        urdf.write_text(chain_urdf(dict(zip("abcdefg", axes, strict=False)), 0.12))
        arm = imported(tmp_path, urdf, *words)
        assert (arm.azimuth_joint, arm.throwing_joints) == (azimuth, throwing)
    for axes, more, said in (
        ((UP, Y, Y, Y), ["--closing", "x"], "pads 90.0 deg askew"),
        ((X, Y, Y, Y), [], "none of the joints a, b, c, d turns about the z axis of link 'l0'"),
    ):
        urdf.write_text(chain_urdf(dict(zip("abcd", axes, strict=True)), 0.16))
        out = tmp_path / "new.toml"
        assert said in refused("import-robot", urdf, *words, *more, "--out", out)


def test_all_that_is_missing_comes_at_once_with_a_command_line_that_works(
    odd_file, refused, run, tmp_path
) -> None:
    out = tmp_path / "arm.toml"
    said = refused("import-robot", odd_file, "--out", out, lines=5)
    for option in ("--tool", "--approach", "--closing"):
        assert f"{option} is missing" in said
    words = shlex.split(said.splitlines()[-1].partition("with values to try: ")[2])
    assert words[0] == "throwplan" and run("", *words[1:]).status == 0 and out.exists()


# What is refused, in one line and without leaving a file.

MIMIC = '<mimic joint="lift"/>'
FLICK = '"flick" type="revolute"'
ROLL = [*JOINTS[:3], "roll", "flick"]
TILT = ('rpy="', 'rpy="0.01 0 0" was="')
#: Joints, options, a change of the file, and what the message says.
REFUSED = [
    (["turn", "lift", "bent"], [], None, r"no joint 'bent', did you mean 'bend'"),
    (["turn", "lift", "finger1"], [], None, "'finger1' is prismatic"),
    (["turn"], [], None, "two joints or more"),
    (["turn", "lift", "lift"], [], None, "each once"),
    (["turn", "bend", "lift"], [], None, "from the base on: turn lift bend"),
    (JOINTS, ["--tool", "base"], None, "must hang on the last joint 'flick'"),
    (JOINTS, ["--base", "hand"], None, "must not move with the joint 'turn'"),
    (JOINTS, ["--closing", "x", "--approach=-x"], None, "must not be the axis"),
    (JOINTS, ["--azimuth", "lift"], None, "'lift' does not turn about the z axis"),
    (JOINTS, ["--throwing", "turn"], None, "behind 'turn' that turns the plane"),
    (ROLL, ["--posture-deg", *"000", "170", "0", "--throwing", "lift"], None, r"170 for 'roll'"),
    (ROLL, ["--posture-deg", *"000", "40", "0"], None, "hand in the vertical plane"),
    (JOINTS, ["--velocity", "fast"], None, "--velocity fast: must be a finite number"),
    (JOINTS, ["--velocity", "1", "2"], None, "--velocity: must be 4 values"),
    (JOINTS, ["--velocity", "0"], None, "must be above 0"),
    (JOINTS, ["--position-max-deg", "-170"], None, "must be below -170"),
    (JOINTS, ["--palm", "0.01", "0.05", "0.03"], None, "BACK above FRONT"),
    (JOINTS, ["--name", ""], None, "--name"),
    (JOINTS, ["--hold", "finger1=9"], None, "--hold finger1: must be in its range"),
    (JOINTS, ["--hold", "turn=1"], None, "--hold turn: this joint is one of --joints"),
    (JOINTS, ["--hold", "rol=0.2"], None, "no joint 'rol', did you mean 'roll'"),
    (JOINTS, [], TILT, "none of the joints turn, lift, bend, flick turns about the z axis"),
    (JOINTS, [], ("</joint>", f"{MIMIC}</joint>"), "'turn' mimics 'lift'"),
    (JOINTS, [], (FLICK, '"flick" type="floating"'), "'flick' is floating"),
    (JOINTS, [], ('velocity="3"', 'velocity="1e9"'), r"limits: velocity = 1e\+09: must be at most"),
    (JOINTS, [], ("<axis xyz=", '<axis xyz="0 0 0" was='), "axis must be three numbers"),
    (JOINTS, [], ('<link name="hand"><inertial>', '<link name="hand"><inertial><mass value="-1"/>'),
     "link 'hand': mass = -1"),
    (JOINTS, [], ("</robot>", ""), "cannot be read as a URDF: no element found"),
    (JOINTS, [], ("robot", "mujoco"), "MuJoCo's MJCF, which is not read: give the robot's"),
    (JOINTS, [], ('<link name="hand">', "<link>"), "lacks the attribute 'name'"),
    (JOINTS, [], ('<child link="hand"/>', '<child link="nothing"/>'), "'nothing'"),
    (JOINTS, [], ('<joint name="lift"', '<joint name="turn"'), "called 'turn'"),
    (JOINTS, [], ('<parent link="base"/>', '<parent link="hand"/>'), "form a ring"),
]  # fmt: skip


@pytest.mark.parametrize("case", REFUSED, ids=lambda case: case[-1])
def test_bad_input_is_one_line_and_writes_nothing(case, tmp_path, odd_file, refused, untouched):
    joints, options, change, message = case
    urdf, text = tmp_path / "odd.urdf", odd_file.read_text()
    urdf.write_text(text if change is None else text.replace(*change))
    untouched()
    words = ["--joints", *joints, *RATES]
    words += [] if "--approach=-x" in options else ["--approach=-x"]
    words += [] if "--closing" in options else ["--closing", "z"]
    said = refused("import-robot", urdf, *words, *options, "--out", tmp_path / "arm.toml")
    assert re.search(message, said)
