"""Fails if a wrong file or command is run, leaves a file, or is not one line that names it."""

from __future__ import annotations

import os
import re
from importlib import resources
from pathlib import Path

import pytest
from throwplan import InputError, Planner, load_scene

# Valid scenes as sections of TOML literals; a case edits one of them.

Sections = dict[str, dict[str, str]]


def read(text: str) -> Sections:
    """Sections of a line each: [name] key = literal; key = literal."""
    found: Sections = {}
    for line in text.strip().splitlines():
        name, _, keys = line.strip()[1:].partition("] ")
        found[name] = dict(pair.split(" = ") for pair in keys.split("; "))
    return found


HAND = read("""
    [object] mass = 0.2; inertia = 5e-4; length = 0.2; width = 0.02; com = 0.1
    [grasp] offset = 0.1
    [contact] friction = 0.8; patch_radius = 0.0075
    [gripper] force = 50.0; dwell = 0.05; opening = 0.05
    [hand] x = [-0.4, 0.4]; z = [0.3, 1.1]; speed = 3.0; acceleration = 30.0; start = [0.0, 0.7]
    [target] x = 1.2; z = 0.0
""")
TURNING = HAND | read("""
    [grasp] offset = 0.0
    [hand] theta_deg = [-120, 120]; angular_speed = 12; angular_acceleration = 80
    [target] x = 1.2; z = 0.2; theta_deg = 270.0
""")
TURNING["hand"] |= HAND["hand"] | {"start_theta_deg": "-90.0"}
ROBOT = read("""
    [object] mass = 0.24; inertia = 535e-6; length = 0.26; width = 0.02; com = 0.1
    [contact] friction = 1.0; patch_radius = 0.0025
    [gripper] force = 120.0; dwell = 0.05; opening = 0.05
    [robot] arm = "panda"; start_deg = [-45.0, -135.0, 90.0]
    [target] x = 0.9; z = 0.22; theta_deg = -90.0
""")
CUP = ROBOT | read("""
    [cup] x = 0.9; rim = 0.1; radius = 0.06; depth = 0.15; clearance = 0.005; insertion = 0.08
""")
DROP = {part: HAND[part] for part in ("object", "contact")} | read("""
    [gripper] force = 50.0; opening = 0.05
    [motion] position = [0.0, 0.0]
""")


def toml(sections: Sections, edits: dict[str, str | None]) -> str:
    """The TOML text of `sections` after edits.

    "section.key": literal sets a key, None leaves it out; ".key" stands above all
    sections; "section" alone: the section's whole text, or None to leave it out.
    """
    edited = {"": {}} | {name: dict(keys) for name, keys in sections.items()}
    whole = ""
    for place, literal in edits.items():
        name, dot, key = place.partition(".")
        if not dot:
            edited.pop(name, None)
            whole += "" if literal is None else f"[{name}]\n{literal}\n"
        elif literal is None:
            del edited[name][key]
        else:
            edited.setdefault(name, {})[key] = literal
    lines = []
    for name, keys in edited.items():
        lines += [f"[{name}]"] if name else []
        lines += [f"{key} = {literal}" for key, literal in keys.items()]
    return "\n".join(lines) + "\n" + whole


#: Whole files, and words of the message.
FILES = [
    (bytes(range(256)), "not a text file"),
    (b"[object]\nmass = \n", "line 2"),
    (b"[object]\nmass = 0,085\n", "is it 0.085?"),
    (b"[obstacle]\n[obstacle]\n", "for several write [[obstacle]]"),
    (b"[object]\nmass = 1\n[object]\n", "line 3"),
    (toml(HAND, {}).encode() + b"\n[x]\n" + b".".join([b"a"] * 100_000) + b" = 1", "nested too"),
    (toml(HAND, {}).encode() + b"\n[x]\na = " + b"[" * 100_000, "nested too deep"),
    (b"".join(b"k%d = 1\n" % i for i in range(100_000)), "at most 1 MB"),
    (b"[x]\na = 1" + b"0" * 5000, "too many digits"),
]
#: Start pose in which the Panda holds the bar level.
LEVEL = ROBOT | read('[robot] arm = "panda"; start_deg = [-45.0, -135.0, 180.0]')

#: A scene, edits of it (`-` leaves out), and words of the message; values as a user wrote them,
#: angles in degrees. Bounds by hand: inertia m c (l - c) + m w^2 / 4 = 0.00202 kg m^2; half the
#: bar's width and the clearance for the cup. The bar of 2.354 N needs 1.177 N from each of the two
#: faces even hanging, and 0.95 of the limit may be used (sticking_margin): 1.239 N. Level it
#: needs 0.2354 N m of torque too, of which 1 N gives 2 * 0.6 * 0.0025 = 0.003 N m: 82.6 N.
ROWS = """
HAND | object: - & .object: 3 | object = 3; section
HAND | gripper.table: "grip.csv" | [gripper]; force; table
HAND | object.mas: 1 | [object]; 'mas'; 'mass'
HAND | object.mass: - | [object]; 'mass'; missing
HAND | contact: - | [contact]; missing
HAND | target.theta: 1 | [target]; 'theta'; 'theta_deg'
HAND | object.mass: "heavy" | mass; 'heavy'; a number
HAND | hand.x: 0.4 | [hand]; x = 0.4; list of 2
ROBOT | robot.arm: 3 | [robot]; arm = 3; a text
HAND | contact.faces: 1.5 | faces; 1.5; whole number
HAND | .gravity: nan | gravity = nan; finite
HAND | object.mass: nan | [object]; mass = nan; finite
HAND | object.mass: 0 | mass = 0; above 0
HAND | object.com: 0.21 | com = 0.21; length; 0.2
HAND | grasp.offset: 0.15 | [grasp]; offset; 0.15; 0.1
HAND | gripper.dwell: -0.1 | dwell = -0.1; at least 0
ROBOT | .obstacle: 3 | obstacle = 3; list of tables, each under [[obstacle]]
ROBOT | .obstacle: [{name = "a", kind = "cube", size = [1], position = [2, 0, 2]}] | kind = 'cube'
ROBOT | workspace.floor: 0.9 | [robot] start contradicts; floor = 0.9; below it
ROBOT | object.com: 0.13 & grasp.offset: 0.1 | [grasp] angle_deg = 0, offset = 0.1; into the palm
ROBOT | workspace.floor: 0.9 & robot.start_deg: - | every start contradicts; floor = 0.9
HAND | object.mass: 310 | mass = 310; kg; grams
HAND | gripper.opening: 50 | opening = 50; at most 2 s
HAND | tolerance.position: 1e-6 | position = 1e-06; at least 0.0002 m
HAND | gripper:  | [gripper]; 'force'; 'opening'; 'table'
HAND | target: - | [target]; missing
HAND | motion:  | [hand]; [motion]; one of
HAND | hand.x: [0.4, -0.4] | x; [0.4, -0.4]; lowest
HAND | hand.start: [2.0, 0.7] | start; x = 2; [-0.4, 0.4]
HAND | hand.angular_jerk: 8000 | [hand]; angular_jerk; angular_speed
HAND | hand.jerk: 0 | jerk = 0; above 0
ROBOT | robot.control: "jerk" | [robot]; 'control'
HAND | target.y: 0.1 | [target]; y; [robot]
ROBOT | robot.arm: "pandas" | [robot]; 'pandas'; 'panda'?
ROBOT | robot.start_deg: [-45, -135] | start_deg; 135; 3
ROBOT | robot.start_deg: [-45.0, 10.0, 90.0] | start_deg; joint 4; 10.0; [-176.0, -4.0]
ROBOT | robot.throwing_joints: [2, 4, 8] | throwing_joints; 8; 7
CUP | cup.radius: 0.01 | radius = 0.01; above 0.01887
CUP | target.theta_deg: - | [cup]; theta_deg
CUP | cup.insertion: 0.3 | insertion = 0.3; depth 0.15
ROBOT | gripper.force: 1.2 | force = 1.2; too weak; start pose; 1.24 N
LEVEL | gripper.force: 80.0 | force = 80; too weak; start pose; 82.6 N
"""
SCENES = {"HAND": HAND, "TURNING": TURNING, "ROBOT": ROBOT, "CUP": CUP, "LEVEL": LEVEL}


#: A measured grip.csv, in which / ends a line, and words of the message.
GRIPS = """
t,f_N/0,50 | two rows
t,force/0,50/0.05,0 | columns; f_N
t,f_N/0,50/0.02,nan/0.05,0 | finite
t,f_N/0,50/0.05,20 | end at 0; 20
t,f_N/0,50/0.02,20/0.03,40/0.05,0 | rises; 5 %
t,f_N/0,5/0.02,50/0.05,0 | start at the full grip
t,f_N/0,50/0.04,30/0.03,20/0.05,0 | t must; rise
"""


def edits_of(changes: str) -> dict[str, str | None]:
    """Edits of a row: `place: literal`, parted by &; - leaves out."""
    pairs = [change.partition(":")[::2] for change in changes.split(" & ")]
    return {place: None if (v := value.strip()) == "-" else v for place, value in pairs}


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    """An own, empty folder as the working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def put(folder: Path, scene: Sections, edits: dict[str, str | None]) -> None:
    (folder / "scene.toml").write_text(toml(scene, edits))


@pytest.mark.parametrize("sections", [HAND, TURNING, ROBOT, CUP, DROP])
def test_the_unedited_scenes_are_right(sections, folder):
    """So that what is refused below is refused for the edit."""
    (folder / "scene.toml").write_text(toml(sections, {}))
    scene = load_scene("scene.toml")
    if scene.motion is None:
        Planner(scene)


def check(folder, refused, untouched, words, command="plan") -> None:
    """Nothing is left behind, nor the folder that --out would have made."""
    untouched()
    message = refused(command, "scene.toml", "--out", "new/out")
    for word in ("scene.toml", *words.split("; ")):
        assert word in message


@pytest.mark.parametrize("row", ROWS.strip().splitlines())
def test_wrong_values_are_refused(row, folder, refused, untouched):
    name, changes, words = row.split(" | ")
    put(folder, SCENES[name], edits_of(changes))
    check(folder, refused, untouched, words)


@pytest.mark.parametrize(("text", "words"), FILES, ids=[words for _, words in FILES])
def test_files_that_are_no_scene_are_refused(text, words, folder, refused, untouched):
    (folder / "scene.toml").write_bytes(text)
    check(folder, refused, untouched, words)


@pytest.mark.parametrize("row", ["- | no such file", *GRIPS.strip().splitlines()])
def test_wrong_grips_are_refused(row, folder, refused, untouched):
    table, words = row.split(" | ")
    put(folder, HAND, {"gripper": 'table = "grip.csv"'})
    if table != "-":
        (folder / "grip.csv").write_text(table.replace("/", "\n") + "\n")
    check(folder, refused, untouched, f"[gripper] table; grip.csv; {words}")


#: Mistakes that are said together: edits, and words of each line.
TOGETHER = [
    (
        {"object.mas": "1", "object.mass": None, "object.com": "nan", "contact.friction": "-1"},
        ["com = nan", "[object] unknown key 'mas', did you mean 'mass'?", "friction = -1"],
    ),
    (
        {"hand": None, "gripper": None, "object.length": '"long"', ".gravity": "-1"},
        ["gravity = -1", "length = 'long'", "exactly one of [hand]", "[gripper] is missing"],
    ),
    (
        {"grasp.offset": "0.15", "gripper.dwell": "1.99"},
        ["[grasp] offset = 0.15", "[gripper] dwell = 1.99"],
    ),
]


@pytest.mark.parametrize(("edits", "words"), TOGETHER)
def test_all_mistakes_are_said_together(edits, words, folder, refused):
    """A line each; a mistyped key is not missing, too."""
    put(folder, HAND, edits)
    lines = refused("plan scene.toml", lines=len(words)).splitlines()
    for line, word in zip(lines, words, strict=True):
        assert line.startswith("throwplan: scene.toml: ") and word in line


@pytest.mark.parametrize("bound", ["speed_max = 0.3", "speed_min = 12"])
def test_a_bound_that_no_throw_is_near_to_is_named(bound, folder, run):
    """Free fall from the hand's highest z, 1.1 m, alone gives 4.6 m/s; the hand adds 3 m/s."""
    put(folder, HAND, {"landing": bound})
    said = run("plan scene.toml")
    assert said.status == 3 and "landing speed" in said.out and "[landing]" in said.out


def test_an_empty_file_misses_all_that_is_required(folder, refused):
    (folder / "scene.toml").write_text("")
    message = refused("plan scene.toml", lines=5)
    for word in ("[hand], [robot]", "[object]", "[contact]", "[gripper]", "[target]"):
        assert word in message


def test_what_is_left_out_and_taken_is_said(folder, run):
    """A bar's inertia is a uniform one's, m (l² + w²) / 12; a patch has the usual radius."""
    put(folder, HAND, {"object.inertia": None, "contact.patch_radius": None})
    scene = load_scene("scene.toml")
    assert scene.object.inertia == pytest.approx(0.2 * (0.2**2 + 0.02**2) / 12)
    assert scene.contact.patch_radius == 0.0025
    said = run("plan scene.toml --verbose").out
    assert "note: [object] inertia is left out: a uniform bar's, 0.0006733 kg m^2" in said
    assert "note: [contact] patch_radius is left out: 0.0025 m" in said
    notes = run("plan scene.toml --json").json["notes"]
    assert len(notes) == 2 and all("left out" in note for note in notes)
    put(folder, DROP, {"object.inertia": None})
    assert "note: [object] inertia is left out" in run("simulate scene.toml --model sp").out
    put(folder, HAND, {})
    assert "notes" not in run("plan scene.toml --json").json


@pytest.mark.parametrize(("sections", "force"), [(ROBOT, "1.3"), (LEVEL, "83.0")])
def test_grip_that_can_hold_the_start_is_not_refused(sections, force, folder):
    put(folder, sections, {"gripper.force": force})
    Planner(load_scene("scene.toml"))


#: In the data file of an arm or a gripper: what is replaced, by what, and words of the message.
PARTS = """
panda | velocity = [2.1750, 2.1750 | velocity = [2.1750, inf | velocity; inf
panda | velocity = [2.1750, | velocity = [ | velocity; 7
panda | jerk = | jrek = | jrek
panda | azimuth_joint = 1 | azimuth_joint = 9 | azimuth_joint; 9
panda | azimuth_joint = 1 | | azimuth_joint; missing
panda | d = 0.333 | d = nan | dh; nan
panda | inertia = [0.0156 | inertia = [-0.0156 | links 1: inertia = [-0.0156; at least 0
panda | 00248480843 | 0248480843 | links 1: inertia; at least 0, one is -0.0156
panda | _joint = 1 | _joint = 1/overlaps = [{ capsules = [4, 5], depth = 0.1 }] | two links that
panda | 0.083], radius = 0.05 | 0.083], radius = 0.05, beside = true | only with link = 0
panda | [tool] | [tool]/tcp = 0.1 | tcp = 0.1: only without gripper = 'franka-hand'
franka-hand | description = | assumed = ['mass']/description = | assumed = 'mass':
"""


@pytest.mark.parametrize("row", PARTS.strip("\n").splitlines())
def test_data_files_of_arms_and_grippers(row, folder, refused):
    """A copy of the shipped file is right; with a mistake the message names it."""
    name, right, wrong, words = (part.strip() for part in row.split(" |"))
    kind = "arms" if name == "panda" else "grippers"
    text = (resources.files("throwplan.problems") / kind / f"{name}.toml").read_text("utf-8")
    text = re.sub(r"(?m)^(assumed|overlaps) = .*\n", "", text)
    hand = {"gripper": 'file = "my.toml"\nforce = 70.0'}
    put(folder, ROBOT, {"robot.arm": '"my.toml"'} if kind == "arms" else hand)
    assert right in text
    (folder / "my.toml").write_text(text.replace(right, wrong.replace("/", "\n"), 1), "utf-8")
    message = refused("plan scene.toml")
    for word in ("scene.toml", "my.toml", *words.split("; ")):
        assert word in message


# The command line.

#: Command lines, and words of their messages, capitals or not. Joint 1 of the Panda turns by
#: +-2.8973 rad.
LINES = """
plan gone.toml | gone.toml; no such file
plan . | is a directory
plan cpu | 'cpu'; did you mean 'cup'; hand-box
simulate dorp | 'dorp'; did you mean 'drop'
plan cup --target nan 0.2 -90 | --target; nan; finite number
plan cup --target 0.9 0.2 down | --target; down; 'free'
plan cup --target 0.9 0.2 | --target; 3
plan cup --target 0.9 0.2 free | cup; theta
plan cup --azimuth 400 | --azimuth; 400; -180 to 180
plan cup --targt 1 0 0 | --targt; --target; throwplan plan --help
plan plan.json | plan.json; .toml; view
plan pose --azimuth 170 | azimuth; 170; joint 1; [-166.0, 166.0]
plan drop | drop; [motion]; [robot]
simulate cup | cup; [motion]
plan | SCENE
 | COMMAND
throw cup | throw; plan; simulate; scenes
plan cup --out | --out
sweep hand-box --samples 0 --out new | --samples; 0; at least 1
sweep hand-box --workers 0 --out new | --workers; 0; 1 to
sweep hand-box --model lss --out new | model; lss; ls-step
sweep hand-box --robust=quite --out new | --robust; quite
map drop --out new | no [hand] or [robot]
map pose --z 1e9 --out new | --z = 1e+09: must be at most
map pose --samples 0 --out new | --samples 0: must be a whole number, 1 to
plan pose --velocity 9 | velocity = 9: must be at most 5
plan pose --arrival 0.05 | arrival = 0.05: must be above 0.1 s, the gripper's dwell and opening
plan pose --arrival 2 1 | arrival = [2, 1]: the earliest comes first
plan pose --velocity 0.1 --robust | velocity and arrival go with neither robust nor
prepare hand-box --throws 0 | --throws 0: must be a whole number, 1 to 10000
prepare drop | no [hand] or [robot]
play drop | drop: has a given [motion] and no [hand] or [robot]
plan box --target -0.6 0.1 free --azimuth 10 | above 0 with --azimuth
"""


@pytest.mark.parametrize("row", LINES.strip("\n").splitlines())
def test_wrong_arguments(row, refused, untouched):
    untouched()
    line, _, words = row.partition(" | ")
    message = refused(line).lower()
    for word in words.split("; "):
        assert word.lower() in message


@pytest.mark.parametrize("command", ["plan hand-box", "simulate drop --model sp"])
@pytest.mark.parametrize("out", ["taken", "taken/out", "taken/out/deep"])
def test_unwritable_output(command, out, folder, refused, untouched):
    """A file in the way of the folder, or of one above it."""
    (folder / "taken").write_text("mine")
    untouched()
    message = refused(f"{command} --out", out)
    assert "--out" in message and out in message


def test_what_cannot_be_written_whole_is_not_begun(folder, refused, untouched, plan_of):
    for name in ("simulation.json", "plan.json"):
        (folder / "out" / name).mkdir(parents=True)
    untouched()
    assert "--out" in refused("simulate drop --model sp --out out")
    with pytest.raises(InputError, match="--out out"):
        plan_of("hand-box").save("out")


# What is odd. Hostile files and words are in test_fuzz.py.


def test_only_regular_files_are_read(tmp_path: Path, refused) -> None:
    """A pipe that nobody writes to, and a device without an end, would never be read."""
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        assert refused("plan", path) == f"throwplan: {path}: is no regular file\n"


def test_a_name_is_drawn_as_it_is_written(tmp_path: Path, run) -> None:
    name = "$\\frac{$ \\u001b[31m 投"
    (tmp_path / "scene.toml").write_text(f'name = "{name}"\n' + toml(DROP, {}), "utf-8")
    said = run("simulate --model sp", tmp_path / "scene.toml", "--out", tmp_path / "out")
    assert (said.status, said.err) == (0, "") and (tmp_path / "out/releases.png").is_file()
