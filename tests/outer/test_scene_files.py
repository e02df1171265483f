"""Fails if a scene file is read in another unit, loses a value, or a useless key passes."""

from __future__ import annotations

import dataclasses
import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image
from throwplan.problems.scene_files import scene_from_table

#: Only what has no default: a hand that throws.
LEAST = """
[object]
mass = 0.2
inertia = 5e-4
length = 0.2
com = 0.1
[contact]
friction = 0.8
patch_radius = 0.0075
[gripper]
force = 50.0
opening = 0.05
[hand]
x = [-0.4, 0.4]
z = [0.3, 1.1]
speed = 3
acceleration = 30
[target]
x = 1.2
z = 0
"""


def loaded(folder: Path, text: str) -> tp.Scene:
    path = folder / "scene.toml"
    path.write_text(text, encoding="utf-8")
    return tp.load_scene(path)


def refusal(folder: Path, text: str) -> str:
    """The message that a scene file is refused with; it is one line and names the file."""
    with pytest.raises(tp.InputError) as caught:
        loaded(folder, text)
    message = str(caught.value)
    assert "scene.toml" in message and "\n" not in message
    return message


# Built-in scenes.


@pytest.mark.parametrize("name", tp.scene_names())
def test_a_built_in_scene_is_self_contained_and_can_be_copied(name, tmp_path, monkeypatch, run):
    scene, tables = tp.load_scene(name), tomllib.loads(tp.scene_text(name))
    assert scene.name == name
    assert scene.description and "\n" not in scene.description
    assert "table" not in tables["gripper"]
    assert not tables.get("robot", {}).get("arm", "").endswith(".toml")
    monkeypatch.chdir(tmp_path)
    said = run("scenes --write", name)
    assert said.status == 0 and f"{name}.toml" in said.out
    assert [path.name for path in tmp_path.iterdir()] == [f"{name}.toml"]
    monkeypatch.chdir("/")
    copy = tp.load_scene(tmp_path / f"{name}.toml")
    assert copy.file
    assert copy.replace(name="", file="") == scene.replace(name="", file="")


# Units, defaults, frozen, replace, aimed_at.


def test_degrees_become_radians(tmp_path) -> None:
    text = LEAST.replace("z = 0\n", "z = 0\ntheta_deg = -450\n").replace(
        "acceleration = 30",
        "acceleration = 30\ntheta_deg = [-180, 90]\nangular_speed = 12\n"
        "angular_acceleration = 80\nstart = [0, 0.7]\nstart_theta_deg = 30",
    )
    scene = loaded(tmp_path, text + "[grasp]\nangle_deg = 60\n[tolerance]\nangle_deg = 1.8\n")
    assert scene.target.theta == pytest.approx(-2.5 * math.pi)  # unwrapped
    assert scene.hand.theta == pytest.approx((-math.pi, math.pi / 2))
    assert scene.hand.start_theta == pytest.approx(math.pi / 6)
    assert scene.grasp.angle == pytest.approx(math.pi / 3)
    assert scene.tolerance.angle == pytest.approx(math.pi / 100)
    assert scene.hand.angular_speed == 12.0  # rad/s in the file too


def test_replace_checks_again() -> None:
    for changes, words in (
        ({"gravity": math.nan}, "gravity = nan"),
        ({"target": None}, "target.* missing"),
        ({"target": tp.Pose(x=1.0, z=0.1)}, "cup.*theta_deg"),
        ({"robot": None, "arm": None}, "hand.*robot.*motion"),
        ({"object": "bar"}, "object.*bar"),
        ({"obstacles": ()}, "unknown key 'obstacles', did you mean 'obstacle'"),
        ({"robot": tp.Robot(arm="iiwa41")}, "iiwa41.*shipped: "),
    ):
        with pytest.raises(tp.InputError, match=words):
            tp.load_scene("near-cup").replace(**changes)
    # Another arm is loaded; one that is given stays.
    other = tp.load_scene("iiwa14").replace(robot=tp.Robot(arm="panda"))
    assert other.arm.limits == tp.load_scene("pose").arm.limits
    assert other.replace(gravity=9.8).arm is other.arm


def test_a_scene_is_drawn_before_any_plan(run, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    said = run("scenes --draw near-cup --json")
    with Image.open(tmp_path / said.json["file"]) as picture:
        assert picture.format == "PNG" and picture.width > picture.height > 700
    assert "exists already" in run("scenes --draw near-cup").err
    assert run("scenes --draw drop").status == 2
    assert [path.name for path in tmp_path.iterdir()] == ["near-cup.png"]


def test_a_cup_without_x_stands_at_the_target() -> None:
    """In the throw's plane, where an arm that throws beside its axis has the target nearer."""
    scene = tp.load_scene("ur5e").replace(target=tp.Pose(x=1.2, z=0.1, theta=-math.pi / 2))
    cup = tp.Cup(rim=0.1, radius=0.1, depth=0.2)
    stands = scene.replace(cup=cup)
    assert stands.cup.x == stands.target.plane_x < 1.2 and not stands.notes
    assert "leave x out" in scene.replace(cup=dataclasses.replace(cup, x=1.2)).notes[0]
    with pytest.raises(tp.InputError, match="x = nan: must be a finite number"):
        tp.Cup(x=math.nan, rim=0.1, radius=0.1, depth=0.2)


def test_a_grippers_file_gives_its_grip() -> None:
    gripper = tp.Gripper(file="robotiq-2f-85")
    assert gripper.profile() == tp.load_scene("iiwa14").gripper.profile()
    own = tp.Gripper(file="robotiq-2f-85", dwell=0.1, force=50.0)
    assert (own.dwell, own.force, own.opening) == (0.1, 50.0, gripper.opening)
    # A force that the file assumes is no recommendation; its maker's peak holds.
    assert own.continuous is None and own.peak == 235.0
    assert tp.Gripper(file="franka-hand").continuous == 70.0
    with pytest.raises(tp.InputError, match=r"file = 'robotiq': unknown gripper"):
        tp.Gripper(file="robotiq")


def test_aimed_at_takes_the_cup_along() -> None:
    scene = tp.load_scene("near-cup")
    moved = scene.aimed_at(tp.Pose(x=1.1, z=0.5, theta=-math.pi / 2))
    assert moved.target == tp.Pose(x=1.1, z=0.5, theta=-math.pi / 2)
    assert moved.cup.x - scene.cup.x == pytest.approx(0.2)
    assert moved.cup.rim - scene.cup.rim == pytest.approx(0.28)
    kept = {"x": 0.0, "rim": 0.0}
    assert dataclasses.replace(moved.cup, **kept) == dataclasses.replace(scene.cup, **kept)
    # Turned by 50 degrees at the same distance, the cup stays where it is in the plane.
    turn = math.radians(50)
    aside = tp.Pose(x=0.9 * math.cos(turn), y=0.9 * math.sin(turn), z=0.22, theta=-math.pi / 2)
    moved = scene.aimed_at(aside)
    assert moved.cup.x == pytest.approx(0.9)
    assert moved.target.plane.azimuth == pytest.approx(turn)
    assert moved.target.plane_x == pytest.approx(0.9)
    pose = tp.load_scene("pose")
    assert pose.aimed_at(aside) == pose.replace(target=aside)


def test_a_target_at_which_the_bar_is_not_in_the_cup() -> None:
    scene = tp.load_scene("near-cup")
    for x, z, degrees, cup_x, words in (
        (0.9, 0.22, -90, 1.3, "0.4 m off its centre, radius 0.06 m"),
        (0.9, 0.22, -60, 0.9, "0.08 m off its centre"),
        # The lower end is inside, but the bar leans through the wall.
        (0.84, 0.073, -45, 0.9, "0.087 m off its centre"),
        (0.9, 0.08, -90, 0.9, "0.18 m below its rim, depth 0.15 m"),
    ):
        target, cup = tp.Pose(x=x, z=z, theta=math.radians(degrees)), scene.cup.changed(x=cup_x)
        with pytest.raises(tp.InputError, match=rf"the bar is not in the cup.*{words}"):
            scene.replace(target=target, cup=cup)


# Wrong keys, sections and values.

TWO = "delay = { normal = 1e-3 } & mass = { normal = 1e-3 } & opening = { normal = 1e-3 }"
BALL = 'name = "a" & kind = "sphere" & size = [0.1] & position = [0, 0, 0]'
#: A scene, a section with keys that it is given, and what the message says of them.
WRONG = f"""
pose | [torque] margin = 1.0 | margin.*below 0.9
pose | [torque] limits = [80.0, 80.0] | limits.*3
pose | [choice] among = 0 | among = 0
pose | [cost] jerk = 0.0 | jerk.*at least 0.001
pose | [robust] method = "loud" | method
pose | [landing] speed_max = -1 | speed_max
pose | [uncertainty] | nothing is uncertain
pose | [uncertainty] delay = 0.01 | delay = 0.01: must be
pose | [uncertainty] friction = 0 | friction = 0: must be
pose | [uncertainty] delay = {{ uniform = -0.01 }} | delay: uniform = -0.01: must be at least 0
pose | [uncertainty] delay = {{ uniform = 0.01, normal = 0.01 }} | exactly one of
pose | [uncertainty] delay = {{ uniform = 0.01, mean = -5 }} | its mean = -5: must be -0.05 to
pose | [uncertainty] friction = {{ uniform = 1.0 }} | friction: reaches .0, 2.: must stay with
pose | [uncertainty] mass = {{ samples = [0.2, -0.1] }} | mass: reaches
pose | [uncertainty] {TWO} & correlation = [["delay", "friction", 0.5]] | 'friction' is not unce
pose | [uncertainty] {TWO} & correlation = [["dlay", "mass", 0.5]] | 'dlay', did you mean 'delay'
pose | [uncertainty] {TWO} & correlation = [["delay", "mass", 1.0]] | = 1: must be between -1
pose | [uncertainty] {TWO} & correlation = [["delay", "mass", 0.9], ["mass", "opening", 0.9], \
["delay", "opening", -0.9]] | positive definite
pose | [gripper] raw = true | raw
pose | [[obstacle]] {BALL} & yaw_deg = 20.0 | yaw_deg = 20: not of a sphere
hand-box | [torque] | only for a scene with .robot
hand-box | [workspace] palm_clearance = 0.01 | palm_clearance: only for
hand-box | [hand] theta_deg = [-30.0, 30.0] | theta_deg
drop | [tolerance] position = 0.01 | only for a scene
drop | [cost] | only for a scene
drop | [choice] | only for a scene
drop | [cup] rim = 0.1 & radius = 0.1 & depth = 0.1 & x = 0.3 | only for a scene
drop | [landing] speed_max = 1.0 | only for a scene
drop | [workspace] floor = 0.0 | only for a scene
drop | [[obstacle]] {BALL} | only for a scene
drop | [uncertainty] delay = {{ uniform = 0.01 }} | only for a scene
drop | [robust] | only for a scene
drop | [nlp] carry = 8 | only for a scene
drop | [target] x = 0.3 & z = -0.5 & arrival = 1.0 | velocity and arrival: only
drop | [gripper] sticking_margin = 0.2 | sticking_margin
drop | [motion] cutoff = 20.0 | cutoff
drop | [motion] opening_time = 0.2 | opening_time
"""


@pytest.mark.parametrize("row", WRONG.replace("\\\n", "").strip().splitlines())
def test_wrong_sections_and_what_would_do_nothing_are_refused(row, tmp_path) -> None:
    name, given, words = row.split(" | ")
    heading, _, keys = given.partition("] ")
    heading = heading.rstrip("]") + ("]]" if "[[" in heading else "]")
    text, lines = tp.scene_text(name), keys.lstrip("] ").replace(" & ", "\n")
    if heading in text:
        text = text.replace(heading, f"{heading}\n{lines}", 1)
    else:
        text += f"\n{heading}\n{lines}\n"
    message = refusal(tmp_path, text)
    assert heading.strip("[]") in message and re.search(words, message), message


def test_uncertainty_in_every_unit(tmp_path) -> None:
    section = """
    [uncertainty]
    delay = { samples = [0.001, 0.002, 0.006] }
    opening = { normal = 0.1, relative = true }
    mass = { uniform = 0.012, mean = 0.25 }
    grasp_angle_deg = { uniform = 2.0 }
    hand_omega_deg = { normal = 10.0, mean = -5.0 }
    """
    scene = loaded(tmp_path, tp.scene_text("pose") + section)
    names = ("delay", "opening", "mass", "grasp_angle", "hand_omega")
    assert scene.uncertainty.names == names
    assert scene.mean_delay == pytest.approx(0.003)
    assert tp.load_scene("pose").mean_delay == 0.0
    none = "\n[uncertainty]\ndelay = 0\nopening = 0.0\n"
    certain = loaded(tmp_path, tp.scene_text("pose") + none)
    assert certain.uncertainty.names == ()
    assert certain.assumed_spreads == ()
    for one in (scene, scene_from_table(scene.table())):
        angle, omega = one.uncertainty.grasp_angle, one.uncertainty.hand_omega
        assert angle.uniform == pytest.approx(math.radians(2))
        assert (omega.normal, omega.mean) == pytest.approx((math.radians(10), math.radians(-5)))


# The measured grip force.

ROWS = [(0.0, 50.0), (0.04, 50.0), (0.06, 45.0), (0.07, 20.0), (0.09, 0.0)]
FORCE = "force = 50.0\nopening = 0.05"
WITH_TABLE = LEAST.replace(FORCE, 'table = "measured/grip.csv"')


def write_table(folder: Path, rows, header: str = "t,f_N") -> None:
    (folder / "measured").mkdir(parents=True, exist_ok=True)
    lines = [header, *(",".join(map(str, row)) for row in rows)]
    (folder / "measured" / "grip.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


def test_grip_table_is_relative_to_the_scene_file(tmp_path, monkeypatch) -> None:
    folder, elsewhere = tmp_path / "scenes", tmp_path / "elsewhere"
    write_table(folder, ROWS)
    write_table(elsewhere, [(0.0, 7.0), (0.1, 0.0)])
    monkeypatch.chdir(elsewhere)
    profile = loaded(folder, WITH_TABLE).gripper.profile()
    assert profile.full == 50.0
    assert profile.dwell == pytest.approx(0.04) and profile.opening == pytest.approx(0.05)
    after = np.array([t - 0.04 for t, _ in ROWS[1:]])
    assert profile.force(after) == pytest.approx([f for _, f in ROWS[1:]], abs=1e-9)


# The bound on the inertia.

sizes = st.floats(1e-3, 2.0)


@given(mass=sizes, length=sizes, share=st.floats(0.01, 0.99), slimness=st.floats(0.0, 0.5))
def test_inertia_up_to_two_point_masses(mass, length, share, slimness) -> None:
    """The most a bar with that CoM can have is two point masses at its two ends."""
    com, width = share * length, slimness * length
    near, far = mass * (1 - share), mass * share
    ends = near * com**2 + far * (length - com) ** 2
    most = ends + mass * (width / 2) ** 2  # and as far off the axis as the width allows
    assert most == pytest.approx(mass * com * (length - com) + mass * width**2 / 4)
    rest = {"mass": mass, "length": length, "com": com, "width": width}
    bar = tp.load_scene("drop").object
    assert dataclasses.replace(bar, inertia=most, **rest).inertia == most
    for inertia in (mass * length**2 / 12, mass * length**2 / 4):  # a rod and a dumbbell
        dataclasses.replace(bar, **rest | {"inertia": inertia, "com": length / 2})
    with pytest.raises(tp.InputError, match="inertia"):
        dataclasses.replace(bar, inertia=1.0001 * most, **rest)


def test_a_scene_s_throwing_joints_are_its_arm_s() -> None:
    other = varied(tp.load_scene("pose"), robot={"throwing_joints": (2, 4)})
    assert other.arm.throwing_joints == (2, 4)
    # The scene's file says it, and reads back to the same joints.
    assert other.table()["robot"]["throwing_joints"] == [2, 4]
    planner = tp.Planner(other, library=False)
    assert planner.manipulator.size == 2


def test_sections_of_defaults_alone_are_kept_in_tables() -> None:
    for scene in (
        tp.load_scene("cup").replace(robust=tp.Robust(), torque=tp.Torque(), choice=tp.Choice()),
        tp.load_scene("drop"),
    ):
        assert scene_from_table(scene.table()).unnamed == scene.unnamed
