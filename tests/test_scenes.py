"""The scene format: built-in scenes, units, defaults, frozen sections, grip tables, bounds."""

from __future__ import annotations

import dataclasses
import datetime
import json
import math
import re
import tomllib
import typing
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from throwplan import InputError, Pose, Scene, load_scene, scene_names
from throwplan.planner.cli import main
from throwplan.problems.choice import Choice
from throwplan.problems.load import scene_text
from throwplan.problems.robust import Robust
from throwplan.problems.scene import (
    Cup,
    Grasp,
    Gripper,
    Hand,
    Landing,
    Mesh,
    Motion,
    PadContact,
    Robot,
    ThrownObject,
    Tolerance,
    Torque,
    Uncertainty,
    Workspace,
)
from throwplan.problems.section import Section, from_table

#: interface.md's list.
INTERFACE_SCENES = [
    "drop",
    "drop-2cm",
    "hand-box",
    "hand-flip",
    "pose",
    "cup",
    "box",
    "flip",
    "delay",
]

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


def write(folder: Path, text: str, name: str = "scene.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def loaded(folder: Path, text: str) -> Scene:
    return load_scene(write(folder, text))


def same_but_for_its_place(one: Scene, other: Scene) -> bool:
    return one.replace(name="", file="") == other.replace(name="", file="")


# Built-in scenes.


@pytest.mark.parametrize("name", INTERFACE_SCENES)
def test_interface_names_are_built_in(name):
    assert name in scene_names()


@pytest.mark.parametrize("name", scene_names())
def test_built_in_scene_loads(name):
    scene = load_scene(name)
    assert scene.name == name
    assert scene.description
    assert "\n" not in scene.description


@pytest.mark.parametrize("name", scene_names())
def test_built_in_scene_is_self_contained(name):
    """No measured table and no arm data of its own beside the scene file."""
    tables = tomllib.loads(scene_text(name))
    assert "table" not in tables["gripper"]
    assert not tables.get("robot", {}).get("arm", "").endswith(".toml")


@pytest.mark.parametrize("name", scene_names())
def test_written_copy_equals_the_built_in(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["scenes", "--write", name]) == 0
    assert [path.name for path in tmp_path.iterdir()] == [f"{name}.toml"]
    monkeypatch.chdir("/")
    copy = load_scene(tmp_path / f"{name}.toml")
    assert same_but_for_its_place(copy, load_scene(name))
    assert copy.file
    assert str(f"{name}.toml") in capsys.readouterr().out


def test_scenes_prints_a_line_each(capsys):
    assert main(["scenes"]) == 0
    out, err = capsys.readouterr()
    assert [line.split()[0] for line in out.splitlines()] == scene_names()
    assert err == ""


def test_scenes_json_is_one_object(capsys):
    assert main(["scenes", "--json"]) == 0
    out, err = capsys.readouterr()
    assert set(json.loads(out)["scenes"]) == set(scene_names())
    assert err == ""


def test_cup_is_the_interface_s():
    scene = load_scene("cup")
    cup = scene.cup
    assert (cup.x, cup.rim, cup.radius, cup.depth) == (0.90, 0.10, 0.06, 0.15)
    assert (cup.clearance, cup.insertion) == (0.005, 0.08)
    assert (scene.target.x, scene.target.y, scene.target.z) == (0.90, 0.0, 0.22)
    assert scene.target.theta == pytest.approx(-math.pi / 2, abs=1e-15)
    # CoM end down: at the target's instant the lower end is 4 cm below the rim.
    lower_end = scene.target.z - (scene.object.length - scene.object.com)
    assert cup.rim - lower_end == pytest.approx(0.04, abs=1e-12)


@pytest.mark.parametrize("name", ["pose", "cup", "box", "flip"])
def test_panda_scenes_share_the_paper_s_bar(name):
    scene = load_scene(name)
    bar, contact, grip = scene.object, scene.contact, scene.gripper
    assert (bar.mass, bar.length, bar.inertia) == (0.24, 0.26, 535e-6)
    assert scene.com_offset == pytest.approx(0.10)
    assert scene.grasp.angle == 0.0
    assert (contact.friction, contact.patch_radius, contact.torsion) == (1.0, 0.0025, 0.6)
    assert contact.faces == 2
    assert (grip.force, grip.dwell, grip.opening) == (120.0, 0.05, 0.05)
    assert scene.tolerance == Tolerance(position=0.002, angle=math.radians(0.5))
    assert scene.workspace.floor == 0.02
    assert scene.workspace.column_radius is not None
    assert scene.workspace.palm_clearance is not None
    assert scene.robot.arm == "panda"
    if name != "cup":
        assert scene.target.z == 0.1
    assert (scene.target.theta is None) == (name == "box")


@pytest.mark.parametrize(("name", "offset"), [("drop", 0.10), ("drop-2cm", 0.02)])
def test_drop_scenes_are_table_one(name, offset):
    scene = load_scene(name)
    assert scene.object.mass == 0.2
    assert scene.com_offset == pytest.approx(offset)
    assert math.sqrt(scene.object.inertia / scene.object.mass) == pytest.approx(0.05)
    assert (scene.contact.friction, scene.contact.patch_radius) == (0.8, 0.0075)
    assert (scene.contact.torsion, scene.contact.faces) == (0.6, 2)
    assert (scene.gripper.force, scene.gripper.dwell, scene.gripper.opening) == (50.0, 0.0, 0.05)
    assert scene.gravity == 9.81
    assert scene.target is None
    assert scene.motion == Motion()


def test_hand_scenes_are_the_interface_s():
    box, flip = load_scene("hand-box"), load_scene("hand-flip")
    assert box.target.theta is None
    assert box.com_offset == 0.0
    assert not box.hand.turns
    assert flip.hand.turns
    assert flip.target.theta - flip.hand.start_theta == pytest.approx(2 * math.pi)
    assert box.robot is None
    assert flip.robot is None


# Units, defaults, frozen, replace, aimed_at.


def test_degrees_become_radians(tmp_path):
    text = LEAST.replace("z = 0\n", "z = 0\ntheta_deg = -450\n").replace(
        "acceleration = 30",
        "acceleration = 30\ntheta_deg = [-180, 90]\nangular_speed = 12\n"
        "angular_acceleration = 80\nstart = [0, 0.7]\nstart_theta_deg = 30",
    )
    text += "[grasp]\nangle_deg = 60\n[tolerance]\nangle_deg = 1.8\n"
    scene = loaded(tmp_path, text)
    assert scene.target.theta == pytest.approx(-2.5 * math.pi)  # unwrapped
    assert scene.hand.theta == pytest.approx((-math.pi, math.pi / 2))
    assert scene.hand.start_theta == pytest.approx(math.pi / 6)
    assert scene.grasp.angle == pytest.approx(math.pi / 3)
    assert scene.tolerance.angle == pytest.approx(math.pi / 100)
    assert scene.hand.angular_speed == 12.0  # rad/s in the file too


def test_robot_start_in_degrees():
    assert load_scene("cup").robot.start == pytest.approx(
        (-math.pi / 4, -3 * math.pi / 4, math.pi / 2)
    )


def test_defaults(tmp_path):
    scene = loaded(tmp_path, LEAST)
    assert scene.name == "scene"
    assert scene.gravity == 9.81
    assert (scene.contact.torsion, scene.contact.faces) == (0.6, 2)
    assert scene.gripper.dwell == 0.0
    assert scene.object.width == 0.0
    assert scene.grasp == Grasp(offset=0.0, angle=0.0)
    assert scene.tolerance == Tolerance(position=0.002, angle=math.radians(0.5))
    assert scene.target == Pose(x=1.2, y=0.0, z=0.0, theta=None)
    assert scene.hand.start is None
    for section in ("robot", "motion", "cup", "landing", "workspace", "arm"):
        assert getattr(scene, section) is None


def test_whole_numbers_become_floats(tmp_path):
    scene = loaded(tmp_path, LEAST)
    assert type(scene.hand.speed) is float
    assert type(scene.target.z) is float


@pytest.mark.parametrize("name", ["cup", "hand-flip", "drop"])
def test_scenes_and_sections_are_frozen(name):
    scene = load_scene(name)
    parts = [scene] + [
        value
        for field in dataclasses.fields(scene)
        if dataclasses.is_dataclass(value := getattr(scene, field.name))
    ]
    assert len(parts) > 5
    for part in parts:
        field = dataclasses.fields(part)[0].name
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(part, field, getattr(part, field))


def test_replace_makes_a_variant():
    scene = load_scene("cup")
    moon = scene.replace(gravity=1.62)
    assert moon.gravity == 1.62
    assert scene.gravity == 9.81
    assert moon.replace(gravity=9.81) == scene


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"gravity": math.nan}, ["gravity", "nan", "finite"]),
        ({"gravity": -1.0}, ["gravity", "-1", "at least 0"]),
        ({"target": None}, ["[target]", "missing"]),
        ({"target": Pose(x=1.0, z=0.1)}, ["[cup]", "theta_deg"]),
        ({"robot": None, "arm": None}, ["[hand]", "[robot]", "[motion]"]),
        ({"grasp": Grasp(offset=0.11)}, ["offset", "0.11", "0.1"]),
        ({"object": "bar"}, ["object", "bar"]),
    ],
)
def test_replace_checks_again(changes, words):
    with pytest.raises(InputError) as caught:
        load_scene("cup").replace(**changes)
    for word in words:
        assert word in str(caught.value)


def test_aimed_at_takes_the_cup_along():
    scene = load_scene("cup")
    moved = scene.aimed_at(Pose(x=1.1, z=0.5, theta=-math.pi / 2))
    assert moved.target == Pose(x=1.1, z=0.5, theta=-math.pi / 2)
    assert moved.cup.x - scene.cup.x == pytest.approx(0.2)
    assert moved.cup.rim - scene.cup.rim == pytest.approx(0.28)
    kept = {"x": 0.0, "rim": 0.0}
    assert dataclasses.replace(moved.cup, **kept) == dataclasses.replace(scene.cup, **kept)
    assert scene.cup == load_scene("cup").cup


def test_aimed_at_another_azimuth_moves_the_cup_in_the_plane():
    """Turned by 50 degrees at the same distance, the cup stays where it is in the plane."""
    turn = math.radians(50)
    target = Pose(x=0.9 * math.cos(turn), y=0.9 * math.sin(turn), z=0.22, theta=-math.pi / 2)
    moved = load_scene("cup").aimed_at(target)
    assert moved.cup.x == pytest.approx(0.9)
    assert moved.target.azimuth == pytest.approx(turn)
    assert moved.target.plane_x == pytest.approx(0.9)


def test_aimed_at_without_a_cup():
    target = Pose(x=1.0, z=0.3, theta=1.0)
    scene = load_scene("pose")
    assert scene.aimed_at(target) == scene.replace(target=target)


# Wrong keys.


@pytest.mark.parametrize(
    ("right", "wrong"),
    [
        ("mass = ", "masss = "),
        ("patch_radius = ", "patch_radios = "),
        ("force = ", "forse = "),
        ("opening = ", "openning = "),
        ("speed = ", "sped = "),
        ("[contact]", "[contacts]"),
        ("[target]", "[traget]"),
    ],
)
def test_unknown_key_names_the_nearest(right, wrong, tmp_path):
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, LEAST.replace(right, wrong, 1))
    message = str(caught.value)
    nearest = right.strip(" =[]")
    assert "scene.toml" in message
    assert re.search(rf"did you mean .?{nearest}\b", message)
    assert f"'{wrong.strip(' =[]')}'" in message


def test_key_with_a_degree_twin_is_named(tmp_path):
    """The usual mistake with angles: theta instead of theta_deg."""
    with pytest.raises(InputError, match=r"'theta', did you mean 'theta_deg'"):
        loaded(tmp_path, LEAST + "theta = -90\n")


@pytest.mark.parametrize(
    "line",
    ["mass = 0.2", "length = 0.2", "friction = 0.8", "opening = 0.05", "speed = 3", "x = 1.2"],
)
def test_missing_key_is_named(line, tmp_path):
    with pytest.raises(InputError) as caught:
        loaded(tmp_path, LEAST.replace(line + "\n", "", 1))
    assert "missing" in str(caught.value)
    assert f"'{line.split()[0]}'" in str(caught.value)


# The measured grip force.

ROWS = [(0.0, 50.0), (0.04, 50.0), (0.06, 45.0), (0.07, 20.0), (0.09, 0.0)]
WITH_TABLE = LEAST.replace("force = 50.0\nopening = 0.05", 'table = "measured/grip.csv"')


def write_table(folder: Path, text: str) -> None:
    (folder / "measured").mkdir(parents=True, exist_ok=True)
    write(folder / "measured", text, "grip.csv")


def csv_text(rows, header="t,f_N") -> str:
    return "\n".join([header, *(f"{t},{f}" for t, f in rows)]) + "\n"


def test_grip_table_is_relative_to_the_scene_file(tmp_path, monkeypatch):
    folder, elsewhere = tmp_path / "scenes", tmp_path / "elsewhere"
    folder.mkdir()
    elsewhere.mkdir()
    write_table(folder, csv_text(ROWS))
    write_table(elsewhere, csv_text([(0.0, 7.0), (0.1, 0.0)]))
    monkeypatch.chdir(elsewhere)
    profile = loaded(folder, WITH_TABLE).gripper.profile()
    assert profile.full == 50.0
    assert profile.dwell == pytest.approx(0.04)
    assert profile.opening == pytest.approx(0.05)
    after = np.array([t - 0.04 for t, _ in ROWS[1:]])
    assert profile.force(after) == pytest.approx([f for _, f in ROWS[1:]], abs=1e-9)


def test_grip_table_columns_may_be_in_any_order(tmp_path):
    rows = [f"{f},x,{t}" for t, f in ROWS]
    write_table(tmp_path, "\n".join(["f_N,note,t", *rows]))
    turned = loaded(tmp_path, WITH_TABLE).gripper
    assert list(zip(turned.times, turned.forces, strict=True)) == ROWS


def test_grip_table_in_the_file_itself(tmp_path):
    write_table(tmp_path, csv_text(ROWS))
    lists = f"times = {[t for t, _ in ROWS]}\nforces = {[f for _, f in ROWS]}"
    inside = loaded(tmp_path, LEAST.replace("force = 50.0\nopening = 0.05", lists)).gripper
    beside = loaded(tmp_path, WITH_TABLE).gripper
    assert (inside.times, inside.forces) == (beside.times, beside.forces)


def test_measured_linear_fall_is_the_linear_profile(tmp_path):
    """The same force given both ways."""
    times = [0.0, 0.01, 0.02, *np.linspace(0.03, 0.08, 41)]
    forces = [50.0, 50.0, 50.0, *np.linspace(50.0, 0.0, 41)]
    write_table(tmp_path, csv_text(zip(times, forces, strict=True)))
    measured = loaded(tmp_path, WITH_TABLE).gripper.profile()
    linear = Gripper(force=50.0, dwell=0.03, opening=0.05).profile()
    assert measured.dwell == pytest.approx(linear.dwell)
    assert measured.opening == pytest.approx(linear.opening)
    instants = np.linspace(0.0, 0.06, 61)
    assert measured.force(instants) == pytest.approx(linear.force(instants), abs=0.2)


# The bound on the inertia.

sizes = st.floats(1e-3, 10.0)


@given(mass=sizes, length=sizes, share=st.floats(0.01, 0.99), slimness=st.floats(0.0, 0.5))
def test_inertia_up_to_two_point_masses(mass, length, share, slimness):
    """The most a bar with that CoM can have is two point masses at its two ends."""
    com, width = share * length, slimness * length
    near, far = mass * (1 - share), mass * share
    ends = near * com**2 + far * (length - com) ** 2
    most = ends + mass * (width / 2) ** 2  # and as far off the axis as the width allows
    assert most == pytest.approx(mass * com * (length - com) + mass * width**2 / 4)
    rest = {"mass": mass, "length": length, "com": com, "width": width}
    assert ThrownObject(inertia=most, **rest).inertia == most
    with pytest.raises(InputError, match="inertia"):
        ThrownObject(inertia=1.0001 * most, **rest)


@given(mass=sizes, length=sizes)
def test_rods_and_dumbbells_are_allowed(mass, length):
    for inertia in (mass * length**2 / 12, mass * length**2 / 4):
        ThrownObject(mass=mass, inertia=inertia, length=length, com=length / 2)


# Wrong types.

VALID: dict[type, dict[str, object]] = {
    ThrownObject: {"mass": 0.2, "inertia": 5e-4, "length": 0.2, "com": 0.1, "width": 0.02},
    Grasp: {"offset": 0.01, "angle_deg": 5.0},
    PadContact: {"friction": 0.8, "patch_radius": 0.0075, "torsion": 0.6, "faces": 2},
    Gripper: {"force": 50.0, "dwell": 0.05, "opening": 0.05},
    Hand: {
        "x": [-0.4, 0.4],
        "z": [0.3, 1.1],
        "theta_deg": [-90, 90.0],
        "speed": 3,
        "acceleration": 30.0,
        "angular_speed": 12.0,
        "angular_acceleration": 80.0,
        "start": [0.0, 0.7],
        "start_theta_deg": -90.0,
    },
    Robot: {
        "arm": "panda",
        "start_deg": [-45.0, -135, 90.0],
        "throwing_joints": [2, 4, 6],
        "control": "jerk",
        "velocity_margin": 0.02,
    },
    Pose: {"x": 1.2, "z": 0, "theta_deg": -90.0},
    Tolerance: {"position": 0.002, "angle_deg": 0.5},
    Cup: {"x": 0.9, "rim": 0.1, "radius": 0.06, "depth": 0.15, "insertion": 0.08},
    Landing: {"speed_min": 1.0, "speed_max": 3.0, "rate_max": 2.0},
    Workspace: {"floor": 0.02, "column_radius": 0.1, "column_height": 0.4},
    Motion: {"position": [0.0, 0.1], "angle_deg": 10.0, "velocity": [1, 0], "rate": 2.0},
    Torque: {"limits": [80.0, 80.0, 10.0], "margin": 0.1},
    Robust: {"method": "quiet", "early": 0.01, "late": 0.02},
    Choice: {"by": "time", "among": 3},
    Mesh: {"carry": 10, "opening": 10, "substeps": 2, "epsilon": 0.03},
}

texts = st.text(max_size=5)
dates = st.just(datetime.date(2024, 2, 29))
tables = st.dictionaries(st.text(max_size=3), st.floats(0, 1), max_size=2)
numbers = st.floats(-2, 2) | st.integers(-3, 3)
anything = texts | dates | tables | st.booleans()


def wrong_for(valid: object) -> st.SearchStrategy[object]:
    """TOML values of every type but that of `valid`; for a list also of a wrong length or item."""
    if isinstance(valid, str):
        return dates | tables | st.booleans() | numbers | st.lists(texts, max_size=3)
    if isinstance(valid, list):
        broken = st.integers(0, len(valid) - 1).flatmap(
            lambda i: anything.map(lambda item: [*valid[:i], item, *valid[i + 1 :]])
        )
        return anything | numbers | broken
    lists = st.lists(numbers | anything, max_size=3)
    return anything | lists


@pytest.mark.parametrize("kind", VALID, ids=lambda kind: kind.__name__)
def test_the_valid_table_is_taken(kind):
    assert isinstance(from_table(kind, VALID[kind]), kind)


@pytest.mark.parametrize("kind", VALID, ids=lambda kind: kind.__name__)
@given(data=st.data())
def test_wrong_types_are_refused(kind, data):
    key = data.draw(st.sampled_from(sorted(VALID[kind])))
    value = data.draw(wrong_for(VALID[kind][key]))
    with pytest.raises(InputError) as caught:
        from_table(kind, VALID[kind] | {key: value})
    assert key in str(caught.value)
    assert "must be" in str(caught.value)


@pytest.mark.parametrize("key", ["faces"])
def test_whole_numbers_only(key):
    with pytest.raises(InputError, match=f"{key} = 2.5: must be a whole number"):
        from_table(PadContact, VALID[PadContact] | {key: 2.5})


@pytest.mark.parametrize("kind", VALID, ids=lambda kind: kind.__name__)
@given(data=st.data(), value=st.sampled_from([math.nan, math.inf, -math.inf]))
def test_only_finite_numbers(kind, data, value):
    """NaN and inf are refused anywhere that a number may stand."""
    table = VALID[kind]
    key = data.draw(st.sampled_from(sorted(k for k in table if not isinstance(table[k], str))))
    good = table[key]
    bad = [value, *good[1:]] if isinstance(good, list) else value
    with pytest.raises(InputError, match=key):
        from_table(kind, table | {key: bad})


def test_every_section_has_a_valid_table():
    """A new section of the scene joins the property tests above."""
    sections = set()
    for hint in typing.get_type_hints(Scene).values():
        for option in typing.get_args(hint) or (hint,):
            if dataclasses.is_dataclass(option) and issubclass(option, Section):
                sections.add(option)
    assert sections <= set(VALID) | {Uncertainty}  # holds sections itself: tested below


def test_uncertainty_is_data_and_leaves_the_plan_alone() -> None:
    scene, plain = load_scene("delay"), load_scene("pose")
    assert scene.uncertainty is not None and scene.uncertainty.delay is not None
    assert scene.uncertainty.delay.uniform == 0.010
    same = scene.replace(uncertainty=None, name=plain.name, description=plain.description)
    assert same == plain


@pytest.mark.parametrize(
    ("delay", "words"),
    [
        ("{ uniform = -0.01 }", "delay: uniform = -0.01: must be above 0"),
        ("{ uniform = 0.01, normal = 0.01 }", "exactly one of"),
        ("{ unifrom = 0.01 }", "did you mean 'uniform'"),
        ("0.01", "delay = 0.01: must be"),
    ],
)
def test_wrong_uncertainty_is_one_line(tmp_path, delay: str, words: str) -> None:
    text = scene_text("pose") + f"\n[uncertainty]\ndelay = {delay}\n"
    (tmp_path / "wrong.toml").write_text(text)
    with pytest.raises(InputError, match=words):
        load_scene(tmp_path / "wrong.toml")
