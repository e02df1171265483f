"""What `import-robot` refuses, in one line and without leaving a file."""

from __future__ import annotations

import math
import re
import sys
import xml.etree.ElementTree as ET

import pytest
from planar_urdf import JOINTS, ODD_OPTIONS, XACRO
from throwplan.planner.cli import main
from throwplan.problems import load_arm

MIMIC = '<mimic joint="lift"/>'
FLICK = '"flick" type="revolute"'
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
