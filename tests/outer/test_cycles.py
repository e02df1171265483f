"""Fails if a cycle breaks a limit by the oracle, leaves a pick askew, or hides a mistake."""

from __future__ import annotations

import dataclasses
import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import with_grip
from job_lists import HAMMER, ONE, POSE, TWO
from throwplan.cycles import Cycle, plan_cycle
from throwplan.cycles.job_files import jobs_names, load_jobs
from throwplan.lab import replay
from throwplan.models.robot import SpatialArm
from throwplan.planner.result import read_motion
from throwplan.planner.throw import TICK, Samples

from oracle import broken_limits

#: Between a part and the plane of its throw stands another one, higher, that comes next.
IN_THE_WAY = f"""order = "given"{ONE.replace("y = 0.1", "y = -0.2")}[[pick]]
name = "other part"
x = 0.6
y = -0.02
z = 0.62
"""


def test_a_cycle_breaks_no_limit(cycled: Path) -> None:
    assert broken_limits(cycled) == []


def hand_and_objects(folder: Path) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    """Of each object the poses of the pads on the way to its pick, at it, and on the way from it,
    by the arm's chain."""
    motion, begin, found = read_motion(folder), 0, []
    poses = SpatialArm(motion.arm).frames(motion.q)[-1].copy()
    poses[:, :3, 3] += motion.arm.tool.tcp * poses[:, :3, 2]
    for step in motion.carries:
        found.append(
            (poses[begin : step.reach + 1], poses[step.held], poses[step.held : step.free])
        )
        begin = int(np.ceil(step.detach_time / TICK))
    return found


def test_throws_that_are_not_quiet_keep_the_other_costs() -> None:
    jobs = load_jobs("belt")
    weights = [one.scene_of(one.picks[0], one.bins[0]).weights for one in (jobs, jobs.loud)]
    assert weights[1] == weights[0].changed(quiet=0.0) and weights[0].quiet > 0.0


def test_the_hand_comes_to_a_pick_and_leaves_it_straight(cycled: Path) -> None:
    """5 cm along its approach, turned as it is."""
    for way, pick, on in hand_and_objects(cycled):
        # The cycle begins at its first pick.
        for poses in (way[::-1], on) if len(way) > 1 else (on,):
            off = poses[:, :3, 3] - pick[:3, 3]
            near = poses[: np.flatnonzero(np.linalg.norm(off, axis=1) > 0.05)[0]]
            off = near[:, :3, 3] - pick[:3, 3]
            along = -off @ pick[:3, 2]
            assert along.max() > 0.045 and along.min() > -1e-6
            assert np.linalg.norm(off + along[:, None] * pick[:3, 2], axis=1).max() < 1e-4
            assert np.abs(near[:, :3, :3] - pick[:3, :3]).max() < 1e-3


def test_a_finger_that_sweeps_through_its_object_is_judged(cycled: Path) -> None:
    """The cycle's files with joint 1 turned by 4 degrees until 20 ms before the pick."""
    motion = read_motion(cycled)
    rows, second = motion.samples.rows, motion.carries[1]
    rows[0, second.reach - 40 : second.reach - 20, 0] += math.radians(4.0)
    words = dataclasses.replace(motion, samples=Samples(*rows)).verdict.words
    assert "open hand" in words and "the object that it comes for" in words


def test_a_cycle_is_read_back_and_judged_again(cycled: Path, tmp_path: Path) -> None:
    motion = read_motion(cycled)
    assert motion.verdict.ok and np.array_equal(motion.q[0], motion.q[-1])
    Cycle("two", motion.carries[0].throw.scene, motion).save(tmp_path)
    assert (tmp_path / "motion.csv").read_text() == (cycled / "motion.csv").read_text()


def test_an_edited_motion_is_refused_by_the_verdict(cycled: Path, tmp_path: Path) -> None:
    """A joint that jumps at one sample breaks limits of velocity, acceleration or jerk."""
    shutil.copy(cycled / "cycle.json", tmp_path)
    lines = (cycled / "motion.csv").read_text().splitlines()
    cells = lines[200].split(",")
    cells[1] = str(float(cells[1]) + 0.01)
    lines[200] = ",".join(cells)
    (tmp_path / "motion.csv").write_text("\n".join(lines) + "\n")
    assert "joint 1" in read_motion(tmp_path).verdict.words


#: In the job file of a part and a bin: what is replaced, by what, and what the message says.
MISTAKES = """
"pose" | "poze" | did you mean 'pose'
"pose" | "drop" | has no [robot]
"pose" | "pose"/order = "any" | order = 'any'
"pose" | "pose"/home_deg = [0.0] | must be a list of 7 angles
z = 0.35 | | pick 1: give 'joints_deg', or all of 'x', 'y' and 'z'
z = 0.35 | z = 'up' | pick 1: z = 'up'
z = 0.35 | z = 0.35/bins = ['bn'] | pick 1: bins: no bin 'bn', did you mean 'bin'?
z = 0.35 | z = 0.35/grasp_time = -1 | pick 1: grasp_time = -1
z = 0.35 | z = 0.35/object = { mass = -1 } | pick 1: [object] mass = -1
z = 0.35 | z = 0.35/contact = { pressure = 'hertz' } | [contact] pressure = 'hertz'
z = 0.35 | z = 0.35/contact = { shape = 'two-points' } | [contact] shape = 'two-points'
z = 0.2, | | bin 1: [target] key 'z' is missing
target = { | goal = { | section [bin.target] is missing
-90.0 } | -90.0 }/cup = { radius = 1 } | bin 1: [cup]
-90.0 } | -90.0, arrival = 2.0 } | bin 1: [target] arrival
x = 0.45 | x = 2.45 | pick 1: hand pose x = 2.45
[[pick]] | [[pck]] | unknown key 'pck'
"part" | "two\\nlines" | pick 1: name = 'two\\nlines': must be one line
x = 1.0, y = 0.3 | x = -1.0, y = 0.1 | bin 'bin': target: its azimuth
"""


@pytest.mark.parametrize("row", MISTAKES.strip().splitlines())
def test_mistakes_are_lines(row: str, tmp_path: Path, run) -> None:
    old, new, words = (part.strip() for part in row.split(" |"))
    assert old in ONE
    (tmp_path / "wrong.toml").write_text(ONE.replace(old, new.replace("/", "\n")))
    said = run("cycle", tmp_path / "wrong.toml", "--out", tmp_path / "out")
    assert said.status == 2 and words in said.err
    assert all(line.startswith("throwplan: ") for line in said.err.splitlines())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("section", ["rest]\nwithin = 0.1", "choice]\namong = 2", "robust]"])
def test_sections_for_one_throw_are_refused(section: str, tmp_path: Path, refused) -> None:
    """They are not left out in silence."""
    (tmp_path / "scene.toml").write_text(f"{POSE.read_text()}\n[{section}\n")
    file = tmp_path / "jobs.toml"
    file.write_text(ONE.replace('"pose"', '"scene.toml"'))
    assert f"[{section.partition(']')[0]}]: only a plan of one throw" in refused("cycle", file)


@pytest.mark.parametrize(
    ("section", "values", "words"),
    [
        ("gripper", {"force": 60.0}, "grip at"),
        ("target", {"x": 1.01}, "lands"),
        ("workspace", {"floor": 0.02, "column_radius": 0.5, "column_height": 0.9}, "base column"),
        ("torque", {"limits": [10.0, 60.0, 10.0]}, "torque of joint 2"),
        ("obstacle", [{"name": "post", "kind": "sphere", "size": [0.1]}], "flying bar, post"),
    ],
)
def test_the_judge_sees_what_is_broken(section, values, words, cycled, tmp_path: Path) -> None:
    """A cycle whose file has been given stricter limits."""
    shutil.copy(cycled / "motion.csv", tmp_path)
    cycle = json.loads((cycled / "cycle.json").read_text())
    for step in cycle["steps"]:
        if section == "obstacle":
            place = step["landing"]
            values[0]["position"] = [0.9 * place["x"], 0.9 * place["y"], 0.45]
        table = step["definition"]
        own = {} if section in ("workspace", "tolerance") else table.get(section, {})
        table[section] = values if section == "obstacle" else own | values
    (tmp_path / "cycle.json").write_text(json.dumps(cycle))
    found = broken_limits(tmp_path)
    assert any(words in each for each in found), found


def test_the_judge_sees_an_object_at_its_pick(cycled: Path, tmp_path: Path) -> None:
    """The second one is taken where the hand has been with the first."""
    first, second = read_motion(cycled).carries
    lines = (cycled / "motion.csv").read_text().splitlines()
    time, through = lines[1 + second.held].split(",")[0], (first.held + first.join) // 2
    lines[1 + second.held] = ",".join([time, *lines[1 + through].split(",")[1:]])
    (tmp_path / "motion.csv").write_text("\n".join(lines) + "\n")
    shutil.copy(cycled / "cycle.json", tmp_path)
    words = " ".join(broken_limits(tmp_path))
    assert f"link 8, {second.pick} at its pick: " in words
    assert f"{first.pick} as it is carried, {second.pick} at its pick: -" in words


def test_picks_whose_objects_overlap_are_refused(tmp_path: Path, refused) -> None:
    file = tmp_path / "jobs.toml"
    file.write_text(
        IN_THE_WAY.replace("x = 0.6\ny = -0.02\nz = 0.62", "x = 0.46\ny = -0.21\nz = 0.42")
    )
    said = refused("cycle", file)
    assert "jobs: pick 1 (part) and pick 2 (other part): their objects overlap by" in said
    assert said.count("\n") <= 1


@pytest.mark.slow
@pytest.mark.parametrize("name", jobs_names())
def test_shipped_jobs_are_solved(name: str, tmp_path: Path) -> None:
    """Also by the oracle, and in MuJoCo, where the least force that the verdict allows holds each
    object while it is carried, and half of that does not."""
    cycle = plan_cycle(load_jobs(name), patience=30)
    assert cycle.solved, cycle.message
    cycle.save(tmp_path)
    assert broken_limits(tmp_path) == []
    for one in replay(tmp_path).objects:
        assert one.inside and one.hits == []
        assert one.slip < 1e-4 and one.turn < 1e-3
    for one in replay(with_grip(cycle.motion, 1.0)).objects:
        assert one.slip < 1e-4 and one.turn < 1e-3
    # A short peak turns an object a little only.
    turned = [one.turn for one in replay(with_grip(cycle.motion, 0.5)).objects]
    assert min(turned) > 1e-3 and max(turned) > math.radians(1)


@pytest.mark.slow
def test_among_obstacles_and_with_another_object(tmp_path: Path) -> None:
    post = "\n[[obstacle]]\nname = 'post'\nkind = 'box'\nsize = [0.05, 0.1, 0.5]\n"
    text = tp.scene_text("fr3") + post + "position = [0.65, 0.1, 0.25]\n"
    (tmp_path / "scene.toml").write_text(text)
    (tmp_path / "jobs.toml").write_text(TWO.replace('"fr3"', '"scene.toml"') + HAMMER)
    cycle = plan_cycle(load_jobs(tmp_path / "jobs.toml").loud)
    assert cycle.solved, cycle.message
    cycle.save(tmp_path)
    assert broken_limits(tmp_path) == []


def test_a_cycle_s_files_fit_each_other(cycled: Path, tmp_path: Path, refused) -> None:
    """Steps that were edited, or lost, are refused by all that reads a cycle."""
    shutil.copy(cycled / "motion.csv", tmp_path)
    text = (cycled / "cycle.json").read_text()

    def edited(change) -> str:
        cycle = json.loads(text)
        change(cycle["steps"])
        (tmp_path / "cycle.json").write_text(json.dumps(cycle))
        return refused("export", tmp_path, "--franka", tmp_path / "out")

    high = edited(lambda steps: steps[1]["definition"]["target"].update(z=50.0))
    late = edited(lambda steps: steps[-1]["definition"]["gripper"].update(opening=2.0))
    assert (
        "step 2: " in high
        and "must land" in high
        and f"step {len(json.loads(text)['steps'])}" in late
    )
    wrong = edited(lambda steps: steps[0]["definition"]["contact"].update(friction="?"))
    assert "step 1: [contact] friction" in wrong
    assert not (tmp_path / "out").exists()
