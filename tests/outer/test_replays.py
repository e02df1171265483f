"""Fails if MuJoCo throws a plan or a cycle elsewhere, or sees no hit where there is one."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import edit_plan, with_grip
from throwplan import lab
from throwplan.lab import ObjectReplay
from throwplan.planner.result import read_motion

pytest.importorskip("mujoco")

#: A coarser step than the usual one: half the digits, a fraction of the time.
COARSE = 2e-4


def edited(folder: Path, copy: Path, **sections) -> Path:
    """A copy of a plan whose definition says something else."""
    return edit_plan(Path(shutil.copytree(folder, copy)), definition=sections)


@pytest.fixture(scope="module")
def into_cup(saved) -> ObjectReplay:
    return lab.replay(saved("near-cup")).objects[0]


def assert_off(result: ObjectReplay, other: str, millimetres: float, degrees: float) -> None:
    difference = result.to_dict()["difference"][other]
    assert 1e3 * difference["position"] < millimetres
    assert math.degrees(difference["angle"]) < degrees


def test_the_cup_is_hit_as_the_limit_surface_says_and_the_bar_rests_in_it(into_cup) -> None:
    assert_off(into_cup, "limit_surface", 0.5, 0.1)
    assert_off(into_cup, "sp", 3.0, 1.5)
    cup = into_cup.to_dict()["cup"]
    assert cup["in"] and cup["at_rest"] and cup["entered"] and not cup["touched_rim"]
    scene = tp.load_scene("near-cup")
    rest = cup["rest"]
    assert math.hypot(rest["x"] - scene.cup.x, rest["y"]) < scene.cup.radius
    assert scene.cup.rim - scene.cup.depth < rest["z"]
    assert "hand" not in into_cup.touched
    assert np.abs(np.diff(into_cup.com[:, -50:])).max() < 1e-5


def test_flight_keeps_energy_and_momentum(into_cup, plan_of) -> None:
    release = plan_of("near-cup").to_dict()["release"]
    times = into_cup.times
    flying = (times > release["detach_time"]) & (times < release["landing_time"])
    times, com = times[flying], into_cup.com[:, flying]
    for row, degree, bend in ((0, 1, None), (1, 2, -9.81 / 2), (2, 1, None)):
        curve = np.polynomial.Polynomial.fit(times, com[row], degree).convert()
        assert np.abs(curve(times) - com[row]).max() < 1e-6
        assert bend is None or curve.coef[2] == pytest.approx(bend, rel=1e-4)


def test_a_contact_with_torsion_is_the_limit_surface(saved) -> None:
    """The same ellipsoid: only the solvers differ."""
    (result,) = lab.replay(saved("pose")).objects
    assert_off(result, "limit_surface", 0.04, 0.03)
    assert result.hits == []


def test_what_is_in_the_way_or_elsewhere_is_hit_or_missed(saved, tmp_path) -> None:
    """The cup a little aside, and far away; a column at the base."""
    for x, touched in ((0.82, True), (2.5, False)):
        folder = edited(saved("near-cup"), tmp_path / str(x), cup={"x": x})
        (result,) = lab.replay(folder, COARSE).objects
        cup = result.to_dict()["cup"]
        assert not cup["in"] and cup["touched_rim"] == touched
    column = {"workspace": {"column_radius": 0.95, "column_height": 0.8}}
    (result,) = lab.replay(edited(saved("pose"), tmp_path / "column", **column), COARSE).objects
    assert "base column" in result.touched


def test_files_and_a_hand_that_throws_full_turns(saved, tmp_path, run, table) -> None:
    out = tmp_path / "out"
    said = run("replay", saved("hand-flip"), "--out", out)
    assert said.status == 0 and f"written to {out}" in said.out
    assert sorted(p.name for p in out.iterdir()) == ["replay.csv", "replay.json", "replay.png"]
    rows = table(out / "replay.csv")
    assert rows.dtype.names == ("object", "t", "x", "y", "z", "theta")
    np.testing.assert_allclose(np.diff(rows["t"]), 1e-3, atol=1e-8)
    landing = json.loads((out / "replay.json").read_text())["objects"][0]["landing"]["mujoco"]
    assert landing["theta"] == pytest.approx(math.radians(270), abs=math.radians(1.5))
    assert "y" not in landing


def test_a_cycles_objects_land_in_mujoco_where_they_are_to(cycled, tmp_path, run, table) -> None:
    """By the command line; the paths are flights in the base frame, on the cycle's clock."""
    done = run("replay", cycled, "--out", tmp_path)
    assert done.status == 0
    assert "two: in MuJoCo 2 of 2 land inside the tolerance" in done.out
    found = json.loads((tmp_path / "replay.json").read_text())["objects"]
    steps = json.loads((cycled / "cycle.json").read_text())["steps"]
    assert [(one["pick"], one["bin"]) for one in found] == [
        (step["pick"], step["bin"]) for step in steps
    ]
    paths = table(tmp_path / "replay.csv")
    for number, (one, step) in enumerate(zip(found, steps, strict=True), start=1):
        landing, target = one["landing"]["mujoco"], step["target"]
        assert one["inside"] and "hand" not in one["touched"]
        assert math.hypot(landing["x"] - target["x"], landing["y"] - target["y"]) < 2e-3
        path = paths[paths["object"] == number]
        assert 0.0 <= path["t"][0] - step["opening_time"] < 1e-3
        # Held by friction alone, until the opening.
        assert one["slip"]["position"] < 1e-4 and one["slip"]["angle"] < 1e-3
        assert one["hits"] == {"waiting": [], "carried": [], "flying": []}
        free = path[path["t"] > step["detach_time"]]
        for name, degree, bend in (("x", 1, 0.0), ("y", 1, 0.0), ("z", 2, -9.81 / 2)):
            curve = np.polynomial.Polynomial.fit(free["t"], free[name], degree).convert()
            assert np.abs(curve(free["t"]) - free[name]).max() < 1e-6
            assert bend == 0.0 or curve.coef[2] == pytest.approx(bend, rel=1e-4)


@pytest.mark.slow
def test_a_grip_too_weak_for_the_carry_turns_the_object(cycled) -> None:
    """As the verdict says of it."""
    weak = with_grip(read_motion(cycled), 0.3)
    assert "grip" in weak.verdict.words
    for one in lab.replay(weak).objects:
        assert one.turn > math.radians(1) and not one.inside


@pytest.mark.slow
def test_an_object_at_its_pick_is_met_by_the_one_that_is_carried_through_it(cycled) -> None:
    """The second one stands where the hand is while it carries the first."""
    motion = read_motion(cycled)
    first, second = motion.carries
    through = (first.held + first.join) // 2
    second = dataclasses.replace(second, reach=through, held=through)
    one, _ = lab.replay(dataclasses.replace(motion, carries=(first, second))).objects
    assert "object other part" in one.collisions["carried"] and one.turn > math.radians(1)
