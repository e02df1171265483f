"""A plan thrown in MuJoCo: where it lands, and whether it ends in the cup."""

from __future__ import annotations

import dataclasses
import json
import math
import subprocess
import sys

import numpy as np
import pytest
import throwplan as tp
from throwplan.planner.cli import main
from throwplan.planner.cli.replay import text
from throwplan.planner.result.files import read_plan
from throwplan.planner.robot.replay_model import FRICTION, damping_ratio
from throwplan.problems import InputError

mujoco = pytest.importorskip("mujoco")

from throwplan.planner.robot.replay import replay  # noqa: E402


def planned(folder, name, target=None):
    """A folder with a plan's files, no pictures."""
    tp.plan(name, target=target).save(folder, draw=False)
    return folder


def edited(folder, copy, **sections):
    """A copy of a plan whose definition says something else."""
    copy.mkdir()
    (copy / "motion.csv").write_text((folder / "motion.csv").read_text())
    plan = json.loads((folder / "plan.json").read_text())
    for section, values in sections.items():
        if isinstance(values, dict):
            plan["definition"].setdefault(section, {}).update(values)
        else:
            plan["definition"][section] = values
    (copy / "plan.json").write_text(json.dumps(plan))
    return copy


@pytest.fixture(scope="module")
def cup(tmp_path_factory):
    return planned(tmp_path_factory.mktemp("cup"), "cup")


@pytest.fixture(scope="module")
def pose(tmp_path_factory):
    return planned(tmp_path_factory.mktemp("pose"), "pose")


@pytest.fixture(scope="module")
def into_cup(cup):
    return replay(cup)


def assert_off(result, other, millimetres, degrees):
    dx, dtheta = result.off(other)
    assert abs(1e3 * dx) < millimetres
    assert abs(math.degrees(dtheta)) < degrees


def test_the_cup_is_hit_as_the_limit_surface_says(into_cup):
    assert_off(into_cup, "limit_surface", 0.5, 0.1)
    assert_off(into_cup, "sp", 3.0, 1.5)


def test_one_contact_with_torsion_is_the_limit_surface(cup):
    # The same ellipsoid: only the solvers differ.
    assert_off(replay(cup, points=1, flight_step=2e-4), "limit_surface", 0.02, 0.02)


def test_the_bar_rests_in_the_cup(into_cup):
    rest, cup = into_cup.rest, into_cup.throw.scene.cup
    assert rest.inside and rest.at_rest and rest.entered and not rest.touched_rim
    assert "hand" not in into_cup.touched
    x, y, z, _ = rest.pose
    assert math.hypot(x - cup.x, y) < cup.radius
    assert cup.rim - cup.depth < z
    assert np.abs(np.diff(into_cup.com[:, -50:])).max() < 1e-5
    words = "\n".join(text(into_cup))
    assert "comes to rest in the cup" in words
    assert f"friction {FRICTION:g}" in words


@pytest.mark.parametrize("change", [{"step": 5e-6}, {"flight_step": 5e-5}, {"points": 16}])
def test_neither_steps_nor_points_decide_the_landing(into_cup, cup, change):
    other = replay(cup, **change)
    assert other.landing[0] == pytest.approx(into_cup.landing[0], abs=1e-4)
    assert other.landing[2] == pytest.approx(into_cup.landing[2], abs=math.radians(0.05))
    assert other.rest.inside


def test_another_hold_before_the_opening_changes_nothing(into_cup, cup, monkeypatch):
    monkeypatch.setattr("throwplan.planner.robot.replay_runs.LEAD", 0.15)
    other = replay(cup)
    assert other.landing[0] == pytest.approx(into_cup.landing[0], abs=5e-5)
    assert other.landing[2] == pytest.approx(into_cup.landing[2], abs=math.radians(0.02))


def test_the_bar_sticks_until_the_opening(into_cup):
    # From the hold's start on it is held by friction alone.
    start = into_cup.throw.final.release.com[:, 0]
    np.testing.assert_allclose(into_cup.com[:, 0], start, atol=2e-6)


def test_flight_keeps_energy_and_momentum(into_cup):
    scene, throw = into_cup.throw.scene, into_cup.throw
    flying = (into_cup.times > throw.detach_time) & (into_cup.times < throw.landing_time)
    times, com = into_cup.times[flying], into_cup.com[:, flying]
    for row, degree, bend in ((0, 1, None), (1, 2, -scene.gravity / 2), (2, 1, None)):
        curve = np.polynomial.Polynomial.fit(times, com[row], degree).convert()
        assert np.abs(curve(times) - com[row]).max() < 1e-6
        assert bend is None or curve.coef[2] == pytest.approx(bend, rel=1e-4)


@pytest.mark.parametrize(
    "target", [(0.80, 0.22, -90), (0.85, 0.22, -90), (0.95, 0.22, -90), (1.0, 0.22, -90)]
)
def test_other_cups_are_hit_too(tmp_path, target):
    x, z, degrees = target
    folder = planned(tmp_path / "plan", "cup", tp.Pose(x=x, z=z, theta=math.radians(degrees)))
    result = replay(folder, step=2e-5)
    assert result.rest.inside
    assert_off(result, "limit_surface", 1.0, 0.2)


def test_what_bounces_may_leave_the_cup(cup):
    # The CoM stands at the rim's height: half its speed back is too much.
    assert not replay(cup, step=2e-5, restitution=0.5).rest.inside


@pytest.mark.parametrize("restitution", [0.05, 0.135, 0.3, 0.8])
def test_a_mass_leaves_its_spring_with_the_restitution_asked_for(restitution):
    d = damping_ratio(restitution)
    x, v, h = 0.0, -1.0, 1e-4
    while -2 * d * v - x > 0 or x == 0.0:
        v += h * (-2 * d * v - x)
        x += h * v
    assert v == pytest.approx(restitution, abs=2e-3)


def test_a_cup_moved_aside_is_missed(cup, tmp_path):
    aside = edited(cup, tmp_path / "aside", cup={"x": 0.85})
    result = replay(aside, step=2e-5)
    assert not result.rest.inside
    assert result.rest.touched_rim
    words = "\n".join(text(result))
    assert "does NOT end in the cup" in words
    assert "touches the cup's wall or rim on the way in" in words


def test_a_cup_far_away_is_not_entered_at_all(cup, tmp_path):
    far = edited(cup, tmp_path / "far", cup={"x": 2.5})
    result = replay(far, step=2e-5)
    assert not (result.rest.inside or result.rest.entered or result.rest.touched_rim)
    assert "does not go in at all" in "\n".join(text(result))


def test_a_plan_without_a_cup_reports_its_landing(pose, capsys):
    assert main(["replay", str(pose / "plan.json"), "--json"]) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["cup"] is None and result["touched"] == []
    assert result["landing"]["mujoco"]["y"] == 0.0
    sp = json.loads((pose / "plan.json").read_text())["landing"]["sent"]
    assert result["landing"]["sp"]["x"] == pytest.approx(sp["x"], abs=1e-7)
    assert result["difference"]["limit_surface"]["position"] < 3e-4


def test_a_base_column_in_the_way_is_hit(pose, tmp_path):
    sections = {"workspace": {"column_radius": 0.95, "column_height": 0.8}}
    result = replay(edited(pose, tmp_path / "column", **sections), step=2e-5)
    assert result.touched == ("base column",)
    assert "hits: base column" in "\n".join(text(result))


def test_a_hand_throws_full_turns(tmp_path):
    result = replay(planned(tmp_path / "plan", "hand-flip"), step=2e-5)
    assert result.landing[2] == pytest.approx(math.radians(270), abs=math.radians(1.5))
    assert_off(result, "limit_surface", 0.5, 0.1)
    assert "y" not in result.to_dict()["landing"]["mujoco"]


def test_a_turned_plane_gives_poses_in_the_base_frame(cup, into_cup, tmp_path):
    turned = edited(
        cup, tmp_path / "turned", target={"x": 0.9 * math.cos(1), "y": 0.9 * math.sin(1)}
    )
    landing = replay(turned, step=2e-5).to_dict()["landing"]["mujoco"]
    assert math.atan2(landing["y"], landing["x"]) == pytest.approx(1.0)
    assert math.hypot(landing["x"], landing["y"]) == pytest.approx(into_cup.landing[0], abs=1e-5)


def test_a_throw_checked_by_the_limit_surface_has_a_sliding_pivot_too(cup, into_cup, tmp_path):
    other = edited(cup, tmp_path / "ls", tolerance={"model": "ls-step"})
    result = replay(other, step=5e-5, points=1)
    np.testing.assert_allclose(result.sp, into_cup.sp, atol=1e-9)
    np.testing.assert_allclose(result.limit_surface, into_cup.limit_surface, atol=1e-9)


def test_one_face_and_a_measured_grip(pose):
    # Twice the force on one pad is the same release.
    throw = read_plan(pose)
    scene = throw.scene
    contact = dataclasses.replace(scene.contact, faces=1)
    gripper = tp.load_scene("pose").gripper
    times, forces = (0.0, 0.05, 0.1), (240.0, 240.0, 0.0)
    gripper = dataclasses.replace(
        gripper, force=None, opening=None, dwell=0.0, times=times, forces=forces
    )
    other = dataclasses.replace(throw, scene=scene.replace(contact=contact, gripper=gripper))
    assert other.scene.gripper.profile().opening == pytest.approx(0.05)
    ours, theirs = replay(throw, step=2e-5), replay(other, step=2e-5)
    np.testing.assert_allclose(theirs.landing, ours.landing, atol=1e-4)


def test_without_gravity_nothing_comes_down(cup, tmp_path):
    result = replay(edited(cup, tmp_path / "space", gravity=0.0), step=5e-5)
    json.dumps(result.to_dict(), allow_nan=False)
    assert not result.rest.at_rest or not result.rest.inside


def test_files(cup, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["replay", str(cup), "--out", str(out)]) == 0
    assert sorted(p.name for p in out.iterdir()) == ["replay.csv", "replay.json", "replay.png"]
    printed = capsys.readouterr().out
    assert "inside the tolerance" in printed and f"written to {out}" in printed
    table = np.genfromtxt(out / "replay.csv", delimiter=",", names=True)
    assert table.dtype.names == ("t", "x", "y", "z", "theta")
    np.testing.assert_allclose(np.diff(table["t"]), 1e-3, atol=1e-8)
    rest = json.loads((out / "replay.json").read_text())["cup"]["rest"]
    assert table["x"][-1] == pytest.approx(rest["x"], abs=1e-5)


def refused(capsys, *words):
    assert main(["replay", *words]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1
    return lines[0]


def test_wrong_input_is_refused_in_one_line(cup, tmp_path, capsys):
    assert "no such file" in refused(capsys, str(tmp_path / "none"))
    old = edited(cup, tmp_path / "old")
    plan = json.loads((old / "plan.json").read_text())
    (old / "plan.json").write_text(json.dumps({**plan, "format": 0}))
    assert "plan it again" in refused(capsys, str(old))
    (old / "plan.json").write_text(json.dumps({**plan, "status": "out_of_reach"}))
    assert "it holds no throw" in refused(capsys, str(old))
    assert "restitution" in refused(capsys, str(cup), "--restitution", "1")
    (tmp_path / "file").write_text("")
    assert "--out" in refused(capsys, str(cup), "--out", str(tmp_path / "file"))


def test_without_mujoco_a_line_says_what_to_install(cup, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert "pip install 'throwplan[mujoco]'" in refused(capsys, str(cup))
    with pytest.raises(InputError, match="MuJoCo"):
        replay(cup)


def test_mujoco_is_imported_for_a_replay_only():
    code = (
        "import sys, throwplan as tp; from throwplan.planner import cli, command_replay, replay; "
        "cli.main(['scenes', '--json']); print('mujoco' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip().endswith("False")
