"""Fails if a wrong file or command is run, leaves a file, or is not one line that names it."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
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


@dataclass(frozen=True)
class Wrong:
    """A scene with a mistake, and words that its one line of message must have."""

    id: str
    words: tuple[str, ...]
    scene: Sections = field(default_factory=dict)
    edits: dict[str, str | None] = field(default_factory=dict)
    text: str | bytes | None = None
    files: dict[str, str | bytes] = field(default_factory=dict)
    command: str = "plan"


def edited(id: str, scene: Sections, edits: dict[str, str | None], *words: str) -> Wrong:
    return Wrong(id, words, scene, edits)


def raw(id: str, text: str | bytes, *words: str) -> Wrong:
    return Wrong(id, words, text=text)


def grip(id: str, table: str | bytes | None, *words: str, scene: Sections = HAND) -> Wrong:
    """A measured grip.csv beside the scene; the message names the key and the file."""
    edits = {"gripper": 'table = "grip.csv"'}
    files = {} if table is None else {"grip.csv": table}
    return Wrong(id, ("gripper", "table", "grip.csv", *words), scene, edits, files=files)


FILES = [
    raw("binary file", bytes(range(256)), "not a text file"),
    raw("broken TOML", "[object]\nmass = \n", "TOML", "line 2"),
    raw("decimal comma", "[object]\nmass = 0,085\n", "line 2", "is it 0.085?"),
    raw("table twice", "[obstacle]\n[obstacle]\n", "for several write [[obstacle]]"),
    raw("section twice", "[object]\nmass = 1\n[object]\n", "TOML", "line 3"),
    edited("number for a section", HAND, {"object": None, ".object": "3"}, "object = 3", "section"),
    edited("list for a section", HAND, {"object": None, ".object": "[{mass = 1}]"}, "section"),
]


#: Start pose in which the Panda holds the bar level.
LEVEL = ROBOT | read('[robot] arm = "panda"; start_deg = [-45.0, -135.0, 180.0]')

#: A scene, edits of it (`-` leaves out), and words of the message; values as a user wrote them,
#: angles in degrees. Bounds by hand: inertia m c (l - c) + m w^2 / 4 = 0.00202 kg m^2; half the
#: bar's width and the clearance for the cup. The bar of 2.354 N needs 1.177 N from each of the two
#: faces even hanging, and 0.95 of the limit may be used (sticking_margin): 1.239 N. Level it
#: needs 0.2354 N m of torque too, of which 1 N gives 2 * 0.6 * 0.0025 = 0.003 N m: 82.6 N.
ROWS = """
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


def row(line: str) -> Wrong:
    """A case of the table."""
    name, changes, words = (part.strip() for part in line.split(" | "))
    pairs = [change.partition(":")[::2] for change in changes.split(" & ")]
    edits = {place: None if (v := value.strip()) == "-" else v for place, value in pairs}
    return edited(f"{name} {changes}", SCENES[name], edits, *words.split("; "))


GRIPS = [
    Wrong(
        "force and table",
        ("[gripper]", "force", "table"),
        HAND,
        {"gripper.table": '"grip.csv"'},
        files={"grip.csv": "t,f_N\n0,50\n0.05,0\n"},
    ),
    edited(
        "dwell and times",
        HAND,
        {"gripper": "times = [0, 0.05, 0.1]\nforces = [9, 9, 0]\ndwell = 0.3"},
        "[gripper] dwell = 0.3: only with 'force'",
    ),
    grip("table not there", None, "no such file"),
    grip("table with one row", "t,f_N\n0,50\n", "two rows"),
    grip("table without f_N", "t,force\n0,50\n0.05,0\n", "columns", "f_N"),
    grip("table with NaN", "t,f_N\n0,50\n0.02,nan\n0.05,0\n", "finite"),
    grip("table never at zero", "t,f_N\n0,50\n0.05,20\n", "end at 0", "20"),
    grip("table rising", "t,f_N\n0,50\n0.02,20\n0.03,40\n0.05,0\n", "rises", "5 %"),
    grip("table that starts low", "t,f_N\n0,5\n0.02,50\n0.05,0\n", "start at the full grip"),
    grip("table back in time", "t,f_N\n0,50\n0.04,30\n0.03,20\n0.05,0\n", "t must", "rise"),
    grip("table too weak", "t,f_N\n0,1\n0.05,1\n0.1,0\n", "1", "too weak", scene=TURNING),
]

COMMANDS = [
    Wrong("simulate without motion", ("[motion]",), HAND, command="simulate"),
    Wrong("plan with motion only", ("[motion]", "[hand]", "[robot]"), DROP),
    Wrong(
        "a place beside samples",
        ("[motion] position, angle, velocity and rate: not beside 'table'",),
        DROP,
        {"motion": 'table = "motion.csv"\nposition = [1.0, 0.0]'},
        files={"motion.csv": "t,x,z,theta\n0,0,0,0\n1,0,0,0\n"},
        command="simulate",
    ),
    Wrong(
        "joints of no arm",
        ("[motion] arm = 'pandas': unknown robot, did you mean 'panda'?",),
        DROP,
        {"motion": 'joints = "motion.csv"\narm = "pandas"'},
        command="simulate",
    ),
]


CASES = [*FILES, *map(row, ROWS.strip().splitlines()), *GRIPS, *COMMANDS]


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch) -> Path:
    """An own, empty folder as the working directory."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def put(case: Wrong, folder: Path) -> str:
    """Write a case's files; the scene file's name."""
    content = case.text if case.text is not None else toml(case.scene, case.edits)
    for name, data in {"scene.toml": content, **case.files}.items():
        (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)
    return "scene.toml"


@pytest.mark.parametrize("sections", [HAND, TURNING, ROBOT, CUP, DROP])
def test_the_unedited_scenes_are_right(sections, folder):
    """So that what is refused below is refused for the edit."""
    (folder / "scene.toml").write_text(toml(sections, {}))
    scene = load_scene("scene.toml")
    if scene.motion is None:
        Planner(scene)


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.id)
def test_wrong_scene(case, folder, refused, untouched):
    """Nothing is left behind, nor the folder that --out would have made."""
    scene = put(case, folder)
    untouched()
    message = refused(case.command, scene, "--out", "new/out")
    for word in (scene, *case.words):
        assert word in message


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
    put(edited("", HAND, edits), folder)
    lines = refused("plan scene.toml", lines=len(words)).splitlines()
    for line, word in zip(lines, words, strict=True):
        assert line.startswith("throwplan: scene.toml: ") and word in line


@pytest.mark.parametrize("bound", ["speed_max = 0.3", "speed_min = 12"])
def test_a_bound_that_no_throw_is_near_to_is_named(bound, folder, run):
    """Free fall from the hand's highest z, 1.1 m, alone gives 4.6 m/s; the hand adds 3 m/s."""
    put(edited("", HAND, {"landing": bound}), folder)
    said = run("plan scene.toml")
    assert said.status == 3 and "landing speed" in said.out and "[landing]" in said.out


def test_an_empty_file_misses_all_that_is_required(folder, refused):
    (folder / "scene.toml").write_text("")
    message = refused("plan scene.toml", lines=5)
    for word in ("[hand], [robot]", "[object]", "[contact]", "[gripper]", "[target]"):
        assert word in message


def test_what_is_left_out_and_taken_is_said(folder, run):
    """A bar's inertia is a uniform one's, m (l² + w²) / 12; a patch has the usual radius."""
    put(edited("", HAND, {"object.inertia": None, "contact.patch_radius": None}), folder)
    scene = load_scene("scene.toml")
    assert scene.object.inertia == pytest.approx(0.2 * (0.2**2 + 0.02**2) / 12)
    assert scene.contact.patch_radius == 0.0025
    said = run("plan scene.toml --verbose").out
    assert "note: [object] inertia is left out: a uniform bar's, 0.0006733 kg m^2" in said
    assert "note: [contact] patch_radius is left out: 0.0025 m" in said
    notes = run("plan scene.toml --json").json["notes"]
    assert len(notes) == 2 and all("left out" in note for note in notes)
    put(edited("", DROP, {"object.inertia": None}), folder)
    assert "note: [object] inertia is left out" in run("simulate scene.toml --model sp").out
    put(edited("", HAND, {}), folder)
    assert "notes" not in run("plan scene.toml --json").json


@pytest.mark.parametrize(
    ("sections", "edits"),
    [
        (ROBOT, {"gripper.force": "1.3"}),
        (ROBOT, {"gripper.force": "1.3", "robot.start_deg": None}),
        (LEVEL, {"gripper.force": "83.0"}),
    ],
)
def test_grip_that_can_hold_the_start_is_not_refused(sections, edits, folder):
    (folder / "scene.toml").write_text(toml(sections, edits))
    Planner(load_scene("scene.toml"))


#: Edits of the shipped arm's data file, and words of the message beside file and key.
ARMS = [
    ("velocity = [2.1750, 2.1750", "velocity = [2.1750, inf", ["velocity", "inf"]),
    ("velocity = [2.1750, ", "velocity = [", ["velocity", "7"]),
    ("jerk = ", "jrek = ", ["jrek"]),
    ("azimuth_joint = 1", "azimuth_joint = 9", ["azimuth_joint", "9"]),
    ("azimuth_joint = 1", "", ["azimuth_joint", "missing"]),
    ("d = 0.333", "d = nan", ["dh", "nan"]),
    ("inertia = [0.0156", "inertia = [-0.0156", ["links 1: inertia = [-0.0156", "at least 0"]),
    ("00248480843", "0248480843", ["links 1: inertia", "at least 0, one is -0.0156"]),
]


@pytest.mark.parametrize(("right", "wrong", "words"), [(None, None, []), *ARMS])
def test_arm_data_file(right, wrong, words, folder, refused):
    """A copy of the shipped file is right; with a mistake the message names it."""
    text = (resources.files("throwplan.problems") / "arms" / "panda.toml").read_text()
    put(edited("", ROBOT, {"robot.arm": '"my-arm.toml"'}), folder)
    if right is None:
        (folder / "my-arm.toml").write_text(text)
        assert load_scene("scene.toml").arm == load_scene("pose").arm
        return
    assert right in text
    (folder / "my-arm.toml").write_text(text.replace(right, wrong, 1))
    message = refused("plan scene.toml")
    for word in ("scene.toml", "my-arm.toml", *words):
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


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ("[x]\n" + ".".join(["a"] * 100_000) + " = 1", "nested too deep"),
        ("[x]\na = " + "[" * 100_000, "nested too deep"),
        ("".join(f"k{i} = 1\n" for i in range(100_000)), "at most 1 MB"),
        ("[x]\na = 1" + "0" * 5000, "too many digits"),
    ],
)
def test_endless_files_are_refused_at_once(more: str, words: str, tmp_path: Path, refused) -> None:
    path = tmp_path / "scene.toml"
    path.write_text(toml(HAND, {}) + "\n" + more + "\n")
    assert words in refused("plan", path)


def test_a_name_is_drawn_as_it_is_written(tmp_path: Path, run) -> None:
    name = "$\\frac{$ \\u001b[31m 投"
    (tmp_path / "scene.toml").write_text(f'name = "{name}"\n' + toml(DROP, {}), "utf-8")
    said = run("simulate --model sp", tmp_path / "scene.toml", "--out", tmp_path / "out")
    assert (said.status, said.err) == (0, "") and (tmp_path / "out/releases.png").is_file()
