"""`import-robot` with robots' files as makers write them: rounded angles, placeholders, xacro."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from imports import PANDA_JOINTS, PANDA_OPTIONS, PANDA_URDF, imported
from planar_urdf import JOINTS, ODD_OPTIONS, XACRO, planar_urdf

RIGHT = "1.5707963267948966"
CHAIN = ["--joints", *JOINTS, *ODD_OPTIONS]


def rounded(folder: Path, angle: str) -> Path:
    """The Panda's URDF with its right angles written in another way."""
    path = folder / "rounded.urdf"
    path.write_text(PANDA_URDF.read_text().replace(RIGHT, angle))
    return path


# Angles.


# Doosan's way of writing, and one as far off as 3.14 is from pi.
@pytest.mark.parametrize(("angle", "off"), [("1.571", "0.012"), ("1.5692", "0.091")])
def test_nearly_right_angles_are_right_and_said(angle, off, tmp_path, run) -> None:
    exact = imported(tmp_path, PANDA_URDF, PANDA_JOINTS, *PANDA_OPTIONS)
    assert imported(tmp_path, rounded(tmp_path, angle), PANDA_JOINTS, *PANDA_OPTIONS) == exact
    assert f"panda_joint2 ({off} deg off)" in (tmp_path / "arm.toml").read_text()
    words = ["--joints", *PANDA_JOINTS, *PANDA_OPTIONS, "--force", "--out", tmp_path / "arm.toml"]
    said = run("import-robot", rounded(tmp_path, angle), *words)
    (line,) = [line for line in said.out.splitlines() if "multiples of 90 deg" in line]
    # All joints of the Panda but the first have a right angle, the flange has none.
    assert re.findall(rf"panda_joint(\d) \({off} deg off\)", line) == list("234567")
    exactly = run("import-robot", PANDA_URDF, *words)
    assert exactly.status == 0 and "multiples of 90 deg" not in exactly.out


def test_an_arm_out_of_its_plane_is_refused_with_the_joint_and_its_angle(
    tmp_path, refused, untouched
) -> None:
    file = rounded(tmp_path, "1.58")  # 0.527 deg more
    untouched()
    words = ["import-robot", file, "--out", tmp_path / "arm.toml"]
    line = refused(*words, "--joints", *PANDA_JOINTS, *PANDA_OPTIONS)
    assert "vertical plane of the azimuth joint: the axis of 'panda_joint2' is 0.527 deg" in line
    # No command line is proposed that would not work.
    said = refused(*words, lines=3)
    assert "--tool is missing" in said and "with values to try" not in said
    assert re.search(r"'panda_joint\d' is [\d.]+ deg off .*; tried: throwplan import-robot", said)


# Torques.


def test_limits_that_do_not_hold_the_arm_are_refused_by_import_and_scene(
    tmp_path, run, refused
) -> None:
    file, out = tmp_path / "odd.urdf", tmp_path / "other.toml"
    file.write_text(planar_urdf())
    words = [file, *CHAIN, "--force", "--out", out]
    strong = run("import-robot", *words, "--torque", "150")
    assert strong.status == 0 and "at rest" not in strong.out
    # Enough in most poses, not in all.
    weak = run("import-robot", *words, "--torque", "150", "90", "150", "150", "--json").json["weak"]
    assert list(weak) == ["lift"] and weak["lift"][1] == 90.0
    torque = ["--torque", "150", "1", "150", "150"]
    need = f"lift needs {weak['lift'][0]:.3g} N m, has 1"
    assert need in refused("import-robot", *words, *torque, lines=2)
    # The file's own are taken for placeholders: a line proposes others.
    file.write_text(planar_urdf().replace('effort="40"', 'effort="1"'))
    said = refused("import-robot", *words, lines=2)
    assert run("", *shlex.split(said.partition("to try: throwplan ")[2])).status == 0
    file.write_text(planar_urdf())
    palm = ["--palm", "0.08", "0.04", "0.03"]
    arm = imported(tmp_path, file, JOINTS, *ODD_OPTIONS, *palm, "--torque", "150")
    text = (tmp_path / "arm.toml").read_text()
    weak_text = re.sub(r"(?m)^torque = \[.*?\]", "torque = [150.0, 1.0, 150.0, 150.0]", text)
    (tmp_path / "arm.toml").write_text(weak_text)
    scene = tmp_path / "scene.toml"
    line = refused("plan", scene)
    assert "joint 2 needs up to" in line and "its limit less the margin is 0.9 N m" in line
    assert "[limits] torque in the arm's file or [torque] limits" in line
    # In a given start the torque is the weights' about the joint.
    start = np.array([0.3, -0.2, 0.4])
    degrees = np.degrees(start).tolist()
    text = scene.read_text().replace("force = 70.0", "force = 120.0")
    scene.write_text(text.replace("[robot]", f"[robot]\nstart_deg = {degrees}"))
    words = r"joint 2 needs ([\d.]+) N m to hold the arm and the object at rest in \[robot\] start"
    said_torque = float(re.search(words, refused("plan", scene))[1])
    q = np.array(arm.posture)
    q[[joint - 1 for joint in arm.throwing_joints]] = start
    *frames, flange, pads = arm.placed(q)
    places = [*frames, np.hstack([pads[:, :3], flange[:, 3:]])]
    loaded = tp.load_scene(scene)
    angle = loaded.grasp.angle
    along = np.cos(angle) * pads[:3, 2] + np.sin(angle) * np.cross([0, -1, 0], pads[:3, 2])
    weights = [
        (link.mass, pose @ [*link.com, 1.0])
        for pose, link in zip(places[1:], arm.links[1:], strict=True)
    ]
    weights.append((loaded.object.mass, pads[:3, 3] + loaded.body.com_offset * along))
    torque = sum(9.81 * mass * (com[0] - frames[1][0, 3]) for mass, com in weights)
    assert said_torque == pytest.approx(abs(torque), rel=5e-3)


# xacro.


def xacro(folder: Path, head: str = "") -> Path:
    """The planar arm as a xacro whose tool link's name is an argument."""
    text = planar_urdf().replace('"hand"', '"$(arg hand)"')
    path = folder / "odd.urdf.xacro"
    path.write_text(text.replace('<robot name="odd">', f'<robot name="odd" {XACRO}>{head}'))
    return path


def test_arguments_of_a_xacro_are_given_behind_the_file(tmp_path, run, refused, untouched) -> None:
    out = ["--out", tmp_path / "arm.toml"]
    file = xacro(tmp_path)
    untouched()
    line = refused("import-robot", file, *CHAIN, *out)
    assert "its xacro argument 'hand' has no value: add hand:=VALUE behind the file" in line
    xacro(tmp_path, '<xacro:arg name="hand" default="other"/>')
    untouched()
    line = refused("import-robot", file, "hend:=hand", *CHAIN, *out)
    assert "no argument 'hend', did you mean 'hand'? (it has: hand)" in line
    assert "--tool: no link 'hand'" in refused("import-robot", file, *CHAIN, *out)
    assert "hand=x: must be NAME:=VALUE" in refused("import-robot", file, "hand=x", *CHAIN, *out)
    plain = tmp_path.parent / "plain.urdf"
    plain.write_text(planar_urdf())
    line = refused("import-robot", plain, "hand:=hand", *CHAIN, *out)
    assert "hand:=hand: only a xacro file takes arguments" in line
    found = run("import-robot", file, "hand:=hand", *CHAIN, "--out", plain.with_suffix(".toml"))
    assert found.status == 0 and "hand hand" in found.out


def test_a_xacro_s_missing_package_and_macros_alone_are_one_clear_line(
    tmp_path, run, refused, monkeypatch
) -> None:
    words = [*CHAIN, "--out", tmp_path / "arm.toml"]
    include = '<xacro:arg name="hand" default="hand"/><xacro:include filename="$(find my_arm)/a"/>'
    line = refused("import-robot", xacro(tmp_path, include), *words)
    assert line.count("my_arm") == 1 and "class" not in line
    assert "'my_arm' is not found: the environment variable ROS_PACKAGE_PATH must name" in line
    # The remedy that it names is one.
    package = tmp_path / "workspace" / "my_arm"
    package.mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>my_arm</name></package>")
    (package / "a").write_text(f"<robot {XACRO}/>")
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(package.parent))
    assert run("import-robot", xacro(tmp_path, include), *words).status == 0
    # The folder's name is enough, as for meshes.
    bare = package.with_name("bare_arm")
    bare.mkdir()
    (bare / "a").write_text(f"<robot {XACRO}/>")
    include = include.replace("my_arm", "bare_arm")
    assert run("import-robot", xacro(tmp_path, include), *words, "--force").status == 0
    macros = tmp_path / "macros.xacro"
    macros.write_text(f'<robot {XACRO}><xacro:macro name="arm" params="a"/></robot>')
    line = refused("import-robot", macros, *words)
    assert "no links; of a file that only defines xacro macros, give the one that calls" in line
    endless = '<xacro:macro name="a"><xacro:a/></xacro:macro><xacro:a/>'
    line = refused("import-robot", xacro(tmp_path, endless), *words)
    assert "a macro or a file of the xacro calls itself without an end" in line
