"""Fails if a plan that says it is solved misses its target, or a limit, or its own files."""

from __future__ import annotations

import json
import math
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import edit_plan, loud, only, varied
from scipy.interpolate import CubicSpline
from throwplan.models.robot import SpatialArm
from throwplan.planner.throw import TICK
from throwplan.planner.verdict import Code, measures_of, verdict_on

from oracle import read_oracle

#: The JSON of `plan`: keys, and the keys below them.
KEYS: dict[str, set[str]] = {
    **{key: set() for key in ("scene", "status", "message", "nearest", "binding")},
    "target": {"x", "y", "z", "theta"},
    "landing": {"planned", "exact", "sent", "limit_surface"},
    "error": {"planned", "exact", "sent", "limit_surface"},
    "release": {"command_time", "opening_time", "detach_time", "landing_time"},
    "solver": {"name", "iterations"},
    "nlp": {"variables", "constraints"},
    "time": {"build", "guess", "solve", "smooth", "check", "total"},
}
PANDA = ("pose", "cup", "near-cup", "box", "flip", "delay")
#: Built-in scenes; of arms other than the Panda two are left to `make verify`.
ALL = [
    pytest.param(name, marks=pytest.mark.slow) if name in ("gen3", "iiwa14") else name
    for name in tp.scene_names()
    if tp.load_scene(name).motion is None
]

#: The Panda by its maker's data sheet, joints 1 to 7.
POSITION_MAX = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
POSITION_MIN = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
VELOCITY = np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61])
ACCELERATION = np.array([15, 7.5, 10, 12.5, 15, 20, 20])
JERK = np.array([7500, 3750, 5000, 6250, 7500, 10000, 10000])


def assert_interface_keys(answer: dict) -> None:
    assert set(answer) >= set(KEYS)
    for key, below in KEYS.items():
        assert not below or set(answer[key]) >= below, key
    assert isinstance(answer["binding"], list)
    assert type(answer["solver"]["iterations"]) is type(answer["starts"]) is int
    assert all(answer["nlp"][key] > 0 for key in ("variables", "constraints"))
    assert all(answer["time"][key] >= 0 for key in KEYS["time"])


# Every built-in scene.


@pytest.mark.parametrize("name", ALL)
def test_a_built_in_scene_is_solved_as_it_is_sent(name, plan_of, tmp_path) -> None:
    plan = plan_of(name)
    answer = plan.to_dict()
    assert_interface_keys(answer)
    assert plan.status == answer["status"] == "solved", plan.message
    assert answer["scene"] == name and answer["nearest"] is None
    assert answer["decides"] == "limit_surface"
    # The corrections' aim, far inside the tolerance.
    assert answer["error"]["limit_surface"]["position"] <= 1e-4
    assert answer["error"]["limit_surface"]["angle"] <= math.radians(0.02)
    # Where it is at the landing, if it moves.
    target, open_angle = plan.goal.table, answer["target"]["theta"] is None
    for stage, landing in answer["landing"].items():
        # The planned one comes down there by a constraint, to the solver's tolerance.
        near = 1e-7 if stage == "planned" else 1e-9
        assert landing["z"] == pytest.approx(target["z"], abs=near)
        assert landing["theta"] is not None
        error = answer["error"][stage]
        if isinstance(target["x"], list):
            assert target["x"][0] - near <= landing["x"] <= target["x"][1] + near
            continue
        across = landing["y"] - target["y"] if "y" in landing else 0.0
        away = math.hypot(landing["x"] - target["x"], across)
        assert error["position"] == pytest.approx(away, abs=1e-12)
        miss = 0.0 if open_angle else abs(landing["theta"] - target["theta"])
        assert error["angle"] == pytest.approx(miss, abs=1e-12)
    times, profile = answer["release"], plan.scene.gripper.profile()
    assert times["command_time"] >= -1e-6
    assert times["opening_time"] - times["command_time"] == pytest.approx(profile.dwell)
    assert times["detach_time"] - times["opening_time"] == pytest.approx(profile.opening)
    assert times["landing_time"] > times["detach_time"]
    plan.save(tmp_path)
    written = json.loads((tmp_path / "plan.json").read_text())
    assert set(written) >= set(answer)
    assert written["landing"] == answer["landing"] and written["release"] == times


@pytest.mark.parametrize("name", PANDA)
def test_motion_csv_keeps_every_limit_and_rests_at_both_ends(name, saved, table) -> None:
    rows = table(saved(name) / "motion.csv")
    joints = range(1, 8)
    names = ["t", *(f"{kind}{j}" for kind in ("q", "dq", "ddq") for j in joints)]
    assert list(rows.dtype.names) == [*names, "gripper"]
    q, dq, ddq = (np.column_stack([rows[f"{k}{j}"] for j in joints]) for k in ("q", "dq", "ddq"))
    assert np.allclose(np.diff(rows["t"]), 1e-3)
    assert (q <= POSITION_MAX).all() and (q >= POSITION_MIN).all()
    assert (np.abs(dq) <= VELOCITY).all() and (np.abs(ddq) <= ACCELERATION).all()
    assert (np.abs(np.diff(q, axis=0)) <= 1e-3 * VELOCITY).all()
    assert (np.abs(np.diff(dq, axis=0)) <= 1e-3 * ACCELERATION).all()
    assert (np.abs(np.diff(ddq, axis=0)) <= 1e-3 * JERK).all()
    for end in (0, -1):
        assert np.abs(dq[end]).max() < 1e-9 and np.abs(ddq[end]).max() < 1e-9
    for j in (1, 3, 5):
        rate = CubicSpline(rows["t"], q[:, j]).derivative()(rows["t"])
        assert np.abs(rate - dq[:, j])[3:-3].max() < 1e-3


@pytest.mark.parametrize("name", ["hand-flip", "pose"])
def test_ipopt_lands_the_same(name, planner_of) -> None:
    """From the same motion, so that it is the same optimum."""
    planner = planner_of(name)
    plan = planner.plan(solver="fatrop")
    other = planner.plan(solver="ipopt", warm=plan).to_dict()
    assert (other["status"], other["solver"]["name"]) == ("solved", "ipopt")
    mine = plan.to_dict()["landing"]["exact"]
    theirs = other["landing"]["exact"]
    assert mine["x"] == pytest.approx(theirs["x"], abs=2.5e-4)
    assert mine["theta"] == pytest.approx(theirs["theta"], abs=1e-3)


def test_the_model_of_the_tolerance_decides() -> None:
    """By both models, and a warning where they land farther apart than the tolerance."""
    scene = varied(loud("hand-flip"), tolerance={"position": 5e-4, "angle": 3.5e-3})
    paper = tp.plan(varied(scene, tolerance={"model": "sp"}))
    for plan, row in ((tp.plan(scene), "limit_surface"), (paper, "sent")):
        answer = plan.to_dict()
        assert plan.solved and answer["decides"] == row
        other = ({"limit_surface", "sent"} - {row}).pop()
        error, apart = answer["error"][row], answer["error"][other]["position"]
        assert error["position"] <= 1e-4 < scene.tolerance.position < apart
        words = f"sliding pivot and limit surface land {1e3 * apart:.1f} mm"
        assert words in answer["warning"]
        (said,) = re.findall(r"disagree by ([\d.]+) mm", plan.summary())
        assert float(said) == pytest.approx(1e3 * apart, abs=0.11)
    quiet = tp.plan("hand-box")
    assert "warning" not in quiet.to_dict() and "disagree" not in quiet.summary()


# The command, its answer and its files.


@pytest.mark.slow
def test_files_in_the_folder(tmp_path, run) -> None:
    out = tmp_path / "out" / "deep"
    said = run("plan hand-flip --out", out)
    assert said.status == 0 and str(out) in said.out
    assert {path.name for path in out.iterdir()} == {
        *("plan.json", "motion.csv", "throw.png", "throw.gif")
    }
    header = (out / "motion.csv").read_text().splitlines()[0]
    assert header == "t,x,z,theta,vx,vz,omega,ax,az,alpha,gripper"
    from PIL import Image

    with Image.open(out / "throw.gif") as gif, Image.open(out / "throw.png") as png:
        assert gif.n_frames > 20 and min(gif.size) > 200
        assert min(png.size) > 300 and len(set(png.convert("L").tobytes())) > 20


def test_a_plan_is_read_back(saved, plan_of, table) -> None:
    for name in ("near-cup", "hand-flip"):
        plan, found = plan_of(name), tp.read_plan(saved(name))
        assert found.scene.unnamed == plan.scene.unnamed and found.target == plan.target
        release = plan.to_dict()["release"]
        assert found.opening_time == pytest.approx(release["opening_time"], abs=1e-12)
        assert found.landing_time == pytest.approx(release["landing_time"], abs=1e-6)
        assert found.miss() == pytest.approx(plan.throw.deciding.miss(), abs=1e-5)
        # The gripper is told to open with the first sample from the command on.
        rows = table(saved(name) / "motion.csv")
        opens = rows["t"][rows["gripper"] == 0.0][0]
        assert 0.0 <= opens - release["command_time"] < 1.001e-3


@pytest.fixture
def hand_box(planner_of) -> tp.Planner:
    return planner_of("hand-box")


def test_without_a_throw_it_exits_3_with_the_nearest_and_all_that_holds_it(tmp_path, run) -> None:
    """The cup 0.3 m too far."""
    out = tmp_path / "out"
    said = run("plan cup --target 1.5 0.22 -90 --patience 4 --json --out", out)
    answer, nearest = said.json, said.json["nearest"]
    assert (said.status, answer["status"], answer["scene"]) == (3, "not_found", "cup")
    assert_interface_keys(answer)
    for key in ("landing", "error", "release"):
        assert set(answer[key].values()) == {None}, key
    names = [one["limit"] for one in answer["binding"]]
    assert "tool speed" in names and all(name in answer["message"] for name in names)
    # One line on stderr says it too.
    assert len(said.err.splitlines()) == 1 and answer["message"] in said.err
    assert 0.9 < nearest["x"] < 1.5 and nearest["theta"] == pytest.approx(-math.pi / 2, abs=0.3)
    assert nearest["error"]["position"] == pytest.approx(1.5 - nearest["x"])
    # Its files are apart, and are sent only to those who say so.
    assert {path.name for path in out.iterdir()} == {"plan.json", "nearest"}
    assert tp.read_plan(out / "nearest").landing.x == pytest.approx(nearest["x"], abs=1e-6)
    to = ("export", out / "nearest", "--franka", tmp_path / "sent")
    assert run(*to).status == 2 and not (tmp_path / "sent").exists()
    assert run(*to, "--nearest").status == 0


def test_the_nearest_is_possible_and_no_more_is(hand_box) -> None:
    far = hand_box.plan(tp.Pose(x=5.0, z=0.0))
    assert far.status == "not_found"
    nearest = far.nearest.target
    # Braking from 3 m/s with 30 m/s^2 takes 0.15 m of the hand's range, so the object leaves
    # from x 0.25 m, z 0.95 m at 3 m/s each way at the very best.
    flight = (3.0 + math.sqrt(9.0 + 2 * 9.81 * 0.95)) / 9.81
    assert nearest.x < 0.25 + 3.0 * flight
    for step, status in ((-0.005, "solved"), (0.01, "not_found")):
        assert hand_box.plan(tp.Pose(x=nearest.x + step, z=0.0)).status == status


def test_no_motion_of_another_plan_stays(tmp_path, hand_box) -> None:
    """A second plan into the same folder that finds no throw: motion.csv is not its own."""
    hand_box.plan().save(tmp_path)
    assert (tmp_path / "motion.csv").exists()
    hand_box.plan(tp.Pose(x=0.3, z=1.7)).save(tmp_path)
    assert json.loads((tmp_path / "plan.json").read_text())["status"] != "solved"
    assert not (tmp_path / "motion.csv").exists()


#: Changes of a plan's file or its whole text, and words of the message.
PLAN_FILES = [
    ({}, None, "plan.json: no such file"),
    ({}, "[1, 2", "is not JSON"),
    ({}, "[1, 2]", "is not a plan file"),
    ({"format": 99}, "", "a plan file of version 99"),
    ({"status": "not_found"}, "", "holds no throw"),
    ({"release": {"opening_time": None}}, "", "is not a complete plan file"),
    ({"release": {"opening_time": 10**400}}, "", "is not a complete plan file (int too large"),
    ({"definition": {"target": {"z": 50.0}}}, "", "never falls to the target's height"),
]


@pytest.mark.parametrize(("changes", "text", "words"), PLAN_FILES, ids=[w for *_, w in PLAN_FILES])
def test_files_that_hold_no_throw_are_refused(changes, text, words, saved, tmp_path, refused):
    """By commands that read plans; nothing is written."""
    folder = Path(shutil.copytree(saved("hand-flip"), tmp_path / "plan"))
    edit_plan(folder, **changes)
    if text is None:
        (folder / "plan.json").unlink()
    elif text:
        (folder / "plan.json").write_text(text)
    for command in ("view", "sweep", "export --ros out"):
        name, *options = command.split()
        assert words in refused(name, folder, *options)
    assert [path.name for path in tmp_path.iterdir()] == ["plan"]


def test_angles_on_the_command_line(run) -> None:
    answer = run("plan hand-flip --target 0.9 0.2 -9.0E1 --json").json
    assert answer["status"] == "solved"
    assert answer["target"]["theta"] == pytest.approx(-math.pi / 2)


# Planners and their options.


def test_one_planner_serves_many_targets_and_starts_warm(planner_of) -> None:
    planner = planner_of("near-cup")
    first = planner.plan()
    again = planner.plan(tp.Pose(x=0.92, z=0.22, theta=-math.pi / 2), warm=first)
    assert first.status == again.status == "solved"
    answer = again.to_dict()
    assert answer["solver"]["iterations"] < first.iterations
    assert again.time.keys() >= KEYS["time"]
    # The cup went along: the plan's own cup is the one that the bar enters.
    assert again.scene.cup.x == pytest.approx(0.92)
    assert answer["landing"]["sent"]["x"] == pytest.approx(0.92, abs=2e-3)
    assert planner.plan().to_dict()["landing"] == first.to_dict()["landing"]


def test_turns_any_takes_the_angle_modulo_full_turns(pose_planner) -> None:
    theta = 20 * math.pi - 0.5
    plan = pose_planner.plan(tp.Pose(x=1.1, z=0.1, theta=theta), turns="any")
    assert plan.status == "solved" and plan.target.theta != theta
    landed = plan.to_dict()["landing"]["sent"]["theta"]
    assert math.remainder(landed - theta, 2 * math.pi) == pytest.approx(0, abs=0.01)


def test_azimuth_turns_the_plane_by_joint_1(turned, table) -> None:
    plan, folder = turned
    sent = plan.to_dict()["landing"]["sent"]
    assert (sent["x"], sent["y"]) == pytest.approx((plan.target.x, plan.target.y), abs=1e-3)
    assert np.allclose(table(folder / "motion.csv")["q1"], math.radians(20))


#: Where the hand has two throws, of which neither is quiet.
TWO_THROWS = loud("hand-flip").replace(target=tp.Pose(x=0.9, z=0.2, theta=math.radians(270)))


def test_alternatives_are_other_throws_to_the_same_target() -> None:
    plan = tp.Planner(TWO_THROWS).plan(alternatives=2)
    assert plan.status == "solved" and len(plan.alternatives) >= 1
    times = [one.to_dict()["release"]["opening_time"] for one in (plan, *plan.alternatives)]
    assert len({round(t, 3) for t in times}) == len(times)
    for other in plan.alternatives:
        assert other.status == "solved" and other.error_sent()[0] < 1e-3
        assert other.throw.effort > plan.throw.effort


def test_of_throws_that_succeed_alike_the_least_scattered_is_chosen() -> None:
    """Here the dearer one."""
    angle = tp.Distribution(normal=0.002)
    scene = TWO_THROWS.replace(uncertainty=only(grasp_angle=angle))
    plan = tp.Planner(scene).plan(alternatives=2)
    error, *others = (
        tp.sweep(one, samples=512).to_dict()["quantiles"]["scaled"]["95"]
        for one in (plan, *plan.alternatives)
    )
    assert others and error < min(others)
    assert plan.throw.effort > min(one.throw.effort for one in plan.alternatives)


# What a plan keeps.


@pytest.mark.parametrize(("given", "jerk"), [({}, 3000.0), ({"jerk": 1500.0}, 1500.0)])
def test_a_hand_keeps_its_limits_until_it_rests(given, jerk, tmp_path, table) -> None:
    """Without one of its own its jerk is limited to 100 1/s times its acceleration."""
    hand = {"z": (0.66, 0.74), "x": (-0.4, 0.25), **given}
    plan = tp.plan(varied(tp.load_scene("hand-box"), hand=hand, gripper={"opening": 0.1}))
    assert plan.status == "solved"
    plan.save(tmp_path)
    rows = table(tmp_path / "motion.csv")
    assert rows["z"].max() <= 0.74 and rows["z"].min() >= 0.66 and rows["x"].max() <= 0.25
    assert np.abs([rows["vx"], rows["vz"]]).max() <= 3.0
    assert np.abs([rows["ax"], rows["az"]]).max() <= 30.0
    assert 0.5 * jerk < np.abs(np.diff([rows["ax"], rows["az"]])).max() / 1e-3 <= jerk
    assert rows["vx"][-1] == rows["vz"][-1] == 0.0


def test_no_bound_forbids_letting_go_at_rest(planner_of) -> None:
    """A hand that can hardly move: still the start pose is a release. Hanging at -90 degrees from
    a hand at (0, 0.7) m, its CoM 0.1 m below, the bar comes down through (0, 0.3)."""
    hand = {"x": (-0.001, 0.001), "z": (0.699, 0.701)}
    scene = varied(planner_of("hand-flip").scene, hand=hand)
    assert tp.plan(scene, tp.Pose(x=0.0, z=0.3, theta=-math.pi / 2)).bound is None


def test_a_quiet_plan_scatters_a_tenth_and_a_robust_one_no_more(plan_of, loud_plan_of) -> None:
    """Of one whose load on the pads costs nothing."""
    robust = tp.plan("delay", robust=True)
    spread = [
        tp.sweep(one, samples=256).to_dict()["quantiles"]["scaled"]["95"]
        for one in (robust, plan_of("delay"), loud_plan_of("delay"))
    ]
    assert robust.robust and spread[1] < spread[2] / 10 and spread[0] < 1.1 * spread[1]


@pytest.mark.slow
def test_a_choice_among_throws_takes_the_cheapest(tmp_path, plan_of) -> None:
    path = tmp_path / "choice.toml"
    path.write_text(tp.scene_text("hand-flip") + "\n[choice]\namong = 3\n")
    found = tp.plan(path)
    assert found.solved and found.throw.effort <= plan_of("hand-flip").throw.effort * (1 + 1e-6)


# What makers recommend.

ARM_SCENES = [name for name in tp.scene_names() if tp.load_scene(name).robot is not None]
EVERY_DAY = ("cup", "pose", "ur5e")


def tool_speed(plan: tp.Plan) -> float:
    """Highest speed [m/s] of flange and pads' centre, by differences of what is sent."""
    path, arm = plan.path(), plan.scene.arm
    flange = SpatialArm(arm).frames(path.joints)[-1]
    pads = flange[:, :3, 3] + arm.tool.tcp * flange[:, :3, 2]
    moved = np.diff([flange[:, :3, 3], pads], axis=1) / TICK
    return float(np.linalg.norm(moved, axis=2).max())


@pytest.mark.parametrize(
    "name", [n if n in EVERY_DAY else pytest.param(n, marks=pytest.mark.slow) for n in ARM_SCENES]
)
def test_shipped_scenes_keep_all_that_makers_recommend(plan_of, saved, name: str) -> None:
    """Tool speed and torque by code of their own; no shipped scene has a warning."""
    plan = plan_of(name)
    assert plan.solved and not plan.exceeds and not plan.verdict.warnings
    limits = plan.scene.arm.limits
    assert tool_speed(plan) <= limits.tool_speed * (1 + 1e-6)
    throw = plan.throw.deciding
    found = read_oracle(saved(name)).judge(planned=True).found
    assert float(found["torque"].value[0]) <= 0.9 + 1e-4
    assert measures_of(throw).value("rate")[0] <= limits.torque_rate


def test_the_verdict_keeps_the_margin_that_the_nlp_keeps() -> None:
    """A throw that uses more than the margin leaves is not solved; with a smaller margin it is."""
    wide = tp.plan(varied(tp.load_scene("pose"), torque=tp.Torque(margin=0.0)))
    throw = wide.throw.deciding
    use = float(measures_of(throw).torque[0].max())
    assert wide.solved and use > 0.9
    for margin, kept in ((1 - use + 0.01, False), (1 - use - 0.01, True)):
        scene = varied(throw.scene, torque=tp.Torque(margin=margin))
        assert (Code.TORQUE not in verdict_on(throw.in_scene(scene)).codes) == kept


@pytest.mark.parametrize("name", ["near-cup", "hand-flip"])
def test_the_verdict_keeps_the_grip_s_margin(plan_of, name: str) -> None:
    """A throw that uses more than [gripper] sticking_margin leaves breaks it, short of slipping."""
    throw = plan_of(name).throw.deciding
    use = float(measures_of(throw).value("grip")[0])
    assert use <= 1.0 - throw.scene.gripper.sticking_margin + 0.002
    for margin, kept in ((1 - use + 0.01, False), (1 - use - 0.01, True)):
        scene = varied(throw.scene, gripper={"sticking_margin": margin})
        judged = verdict_on(throw.in_scene(scene))
        assert (Code.SLIP_BEFORE_OPENING not in judged.codes) == kept
        assert judged.reserves == (not kept)


def test_a_scene_may_ask_for_more_and_the_plan_says_by_how_much() -> None:
    scene = tp.load_scene("pose")
    scene = varied(
        scene,
        torque=tp.Torque(rate=2e4, margin=0.02),
        robot={"tool_speed": 2.5},
        gripper={"force": 120.0},
    )
    plan = tp.plan(scene)
    said = plan.to_dict()["exceeds"]
    assert plan.solved
    assert said["grip_force"] == {"value": 120.0, "recommended": 70.0}
    assert said["torque_rate"]["recommended"] == 1000.0
    assert 1000.0 < said["torque_rate"]["value"] <= 2e4
    lines = [line for line in plan.summary().splitlines() if "the maker recommends" in line]
    assert len(lines) == len(said)
    for key, most in (("[gripper] force", "70"), ("[torque] rate", "1000")):
        assert sum(f"{key} = {most}" in line for line in lines) == 1


def test_a_grippers_spread_is_the_scenes_uncertainty_where_that_is_silent(tmp_path: Path) -> None:
    shipped = Path(tp.__file__).parent / "problems" / "grippers" / "franka-hand.toml"
    lines = "delay = {{ uniform = 0.004 }}\nopening_spread = {{ uniform = 0.5, relative = true }}\n"
    text = shipped.read_text(encoding="utf-8").replace("capsules", lines.format() + "capsules", 1)
    (tmp_path / "hand.toml").write_text(text, encoding="utf-8")
    scene_text = tp.scene_text("pose").replace('"franka-hand"', '"hand.toml"')
    for name, more in (("silent", ""), ("own", "dwell = 0.06\nopening = 0.04\n")):
        file = tmp_path / f"{name}.toml"
        file.write_text(scene_text.replace("force = 70.0", f"{more}force = 70.0"), encoding="utf-8")
    silent, own = (tp.load_scene(tmp_path / f"{name}.toml") for name in ("silent", "own"))
    assert silent.uncertainty.delay.uniform == 0.004
    assert silent.uncertainty.opening.uniform == 0.5 and silent.uncertainty.opening.relative
    assert own.uncertainty is None
    assert set(silent.assumed) - set(own.assumed) == {"gripper.dwell", "gripper.opening"}
