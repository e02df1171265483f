"""Jobs by placing: what is carried is held, no limit is broken, nothing stops above the bins."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from job_lists import ONE
from throwplan.planner.clearance import SpatialScene
from throwplan.planner.cycle import Placing, UnsolvedError, place_jobs, slowed_transfer
from throwplan.planner.cycle.planning import with_joints
from throwplan.planner.throw import TICK, Samples, State, joint_limits, make_manipulator, transfer
from throwplan.planner.verdict import grip_use, motion_verdict
from throwplan.problems.job_files import Jobs, load_jobs

PICK = "[[pick]]\nname = {name!r}\njoints_deg = [{turn}, -8.62, 0.0, -126.61, 0.0, 117.99, 45.0]\n"
BIN = "[[bin]]\nname = {name!r}\n[bin.target]\nx = {x}\ny = {y}\nz = 0.22\n{more}\n"


def jobs_of(folder: Path, bins: str, turns: tuple[float, ...] = (-13.0, 0.0)) -> Jobs:
    """Objects in front of the Panda, picked with the base turned by these angles."""
    picks = (PICK.format(name=f"part {n}", turn=turn) for n, turn in enumerate(turns, start=1))
    (folder / "jobs.toml").write_text("\n".join(['scene = "cup"', bins, *picks]))
    return load_jobs(str(folder / "jobs.toml"))


@pytest.fixture(scope="module")
def jobs(tmp_path_factory) -> Jobs:
    """Two objects and two bins: an object stands in the first, and lies in the second."""
    bins = BIN.format(name="near", x=0.45, y=0.45, more="theta_deg = -90.0")
    bins += BIN.format(name="far", x=1.2, y=0.3, more="theta_deg = -90.0")
    return jobs_of(tmp_path_factory.mktemp("jobs"), bins)


@pytest.fixture(scope="module")
def placed(jobs: Jobs) -> Placing:
    return place_jobs(jobs)


def space_of(jobs: Jobs, part: int, name: str) -> SpatialScene:
    scene = jobs.scene_of(jobs.picks[part], next(one for one in jobs.bins if one.name == name))
    return SpatialScene(scene, make_manipulator(scene))


def part_of(samples: Samples, begin: int, end: int) -> Samples:
    rows = slice(begin, end + 1)
    return Samples(samples.q[rows], samples.dq[rows], samples.ddq[rows])


def test_all_is_done_within_the_limits_from_rest_to_rest(jobs: Jobs, placed: Placing) -> None:
    assert not placed.trouble and sorted(placed.steps) == [("part 1", "near"), ("part 2", "near")]
    space, samples, last = space_of(jobs, 0, "near"), placed.samples, 0
    assert samples.q[0].tolist() == samples.q[-1].tolist()
    assert not samples.dq[[0, -1]].any() and not samples.ddq[[0, -1]].any()
    for (name, _), (begin, end) in zip(placed.steps, placed.carried, strict=True):
        carried = part_of(samples, begin, end)
        assert motion_verdict(space, part_of(samples, last, begin), held=False).ok
        assert motion_verdict(space, carried, held=True).ok
        assert grip_use(space, carried).use.max() <= 1.0
        pick = next(pick for pick in jobs.picks if pick.name == name)
        # At rest at the pick for the grasp, and at the place while the pads open.
        waits = (
            (begin - math.ceil(pick.grasp_time / TICK), begin, pick.joints),
            (end, end + 50, None),
        )
        for first, until, joints in waits:
            rows = slice(first, until + 1)
            assert not samples.dq[rows].any() and np.ptp(samples.q[rows], axis=0).max() == 0.0
            assert joints is None or samples.q[first].tolist() == list(joints)
        last = end
    assert motion_verdict(space, part_of(samples, last, len(samples.q) - 1), held=False).ok
    assert placed.duration == pytest.approx(TICK * (len(samples.q) - 1))


def test_the_object_is_where_its_bin_is(jobs: Jobs, placed: Placing) -> None:
    space = space_of(jobs, 0, "near")
    for _, end in placed.carried:
        pads = space.kinematics.arm.placed(placed.samples.q[end])[-1]
        com = pads[:3, 3] + space.scene.com_offset * pads[:3, 2]
        np.testing.assert_allclose(com, [0.45, 0.45, 0.22], atol=1e-6)
        np.testing.assert_allclose(pads[:3, 2], [0.0, 0.0, -1.0], atol=1e-6)


def test_nothing_stops_above_the_bin(jobs: Jobs, placed: Placing) -> None:
    """The hand moves from the pick to the place and on to the next pick, down into the bin."""
    space = space_of(jobs, 0, "near")
    grasp = round(jobs.picks[1].grasp_time / TICK)
    ends = [begin - grasp for begin, _ in placed.carried[1:]] + [len(placed.samples.q) - 1]
    for (begin, end), after in zip(placed.carried, ends, strict=True):
        for first, last in ((begin, end), (end + 50, after)):
            moving = np.abs(placed.samples.dq[first + 20 : last - 20]).max(axis=1)
            assert moving.min() > 0.01
            # Not much slower than the fastest motion by the joints' limits that avoids nothing.
            states = (State(placed.samples.q[k], np.zeros(7), np.zeros(7)) for k in (first, last))
            direct = transfer(joint_limits(space.kinematics.arm, range(1, 8)), *states)
            assert direct.ticks < last - first < 1.6 * direct.ticks
        # In the bin it is hardly aside of the place.
        for k in range(end - 400, end + 400, 10):
            x, y, z = space.kinematics.arm.placed(placed.samples.q[k])[-1][:3, 3]
            if z < 0.22 + space.scene.com_offset + 0.05:
                assert math.hypot(x - 0.45, y - 0.45) < 0.03


def test_bins_out_of_reach_are_named(jobs: Jobs, placed: Placing, tmp_path: Path) -> None:
    assert set(placed.refused) == {"far"} and "out of reach of panda" in placed.refused["far"]
    far = BIN.format(name="far", x=1.2, y=0.3, more="theta_deg = -90.0")
    moving = BIN.format(name="belt", x=0.5, y=0.3, more="theta_deg = 0.0\nvelocity = [0.1]")
    for bins, words in ((far, "part 1 into far: .*out of reach"), (moving, "belt: the bin moves")):
        found = place_jobs(jobs_of(tmp_path, bins))
        assert math.isnan(found.duration) and not len(found.samples.q)
        assert "\n" not in found.words and found.words.startswith("by placing: not all")
        assert re.search(words, found.words)


def test_an_object_is_laid_down_at_its_angle(tmp_path: Path) -> None:
    bins = BIN.format(name="tray", x=0.5, y=0.2, more="theta_deg = -60.0")
    jobs = jobs_of(tmp_path, bins, (0.0,))
    found = place_jobs(jobs)
    assert not found.trouble, found.words
    space, azimuth, angle = space_of(jobs, 0, "tray"), math.atan2(0.2, 0.5), math.radians(-60.0)
    pads = space.kinematics.arm.placed(found.samples.q[found.carried[0][1]])[-1]
    ahead = [math.cos(angle) * math.cos(azimuth), math.cos(angle) * math.sin(azimuth)]
    np.testing.assert_allclose(pads[:3, 2], [*ahead, math.sin(angle)], atol=1e-6)


@pytest.mark.parametrize("name", ["ur5e", "gen3", "pose"])
def test_a_pick_is_taken_in_the_posture_of_throws(name: str, tmp_path: Path) -> None:
    """Joints that do not throw as in throws towards it, and the hand at -90 degrees: a shoulder
    that turns more than once could also hold it a whole turn further."""
    file = tmp_path / "jobs.toml"
    file.write_text(ONE.replace('"pose"', f'"{name}"').replace("z = 0.35", "z = 0.4"))
    jobs = with_joints(load_jobs(file))
    arm, joints = jobs.arm, np.array(jobs.picks[0].joints)
    kinematics = make_manipulator(tp.load_scene(name)).kinematics
    throwing = np.array(kinematics.throwing_joints) - 1
    aside = np.delete(joints - arm.posture, [*throwing, arm.azimuth_joint - 1])
    assert np.abs(aside).max() < 0.2
    angle = kinematics.theta + kinematics.link_angles(list(joints[throwing]))[-1]
    assert angle == pytest.approx(-math.pi / 2, abs=0.2)


# Slowed.

START, GOAL = ([turn, -0.3, 0.0, -2.2, 0.0, 1.9, 0.785] for turn in (-0.8, 0.8))


def resting(joints: list[float]) -> State:
    return State(np.array(joints), np.zeros(7), np.zeros(7))


def test_a_weak_grip_slows_the_way_as_far_as_it_must() -> None:
    times = []
    for force in (120.0, 30.0, 12.0):
        scene = varied(tp.load_scene("pose"), gripper={"force": force})
        space = SpatialScene(scene, make_manipulator(scene))
        found = slowed_transfer(space, resting(START), resting(GOAL), held=True)
        assert motion_verdict(space, found, held=True).ok
        times.append(len(found.q))
    assert times[0] < times[1] < times[2]
    # The last one is slow for its grip, which it uses.
    assert grip_use(space, found).use.max() > 0.8
    assert len(slowed_transfer(space, resting(START), resting(GOAL), held=False).q) <= times[0]


def test_a_grip_that_cannot_hold_at_rest_is_refused() -> None:
    scene = varied(tp.load_scene("pose"), gripper={"force": 1.0})
    space = SpatialScene(scene, make_manipulator(scene))
    with pytest.raises(UnsolvedError, match=r"grip on the way.* % of what the pads' force holds"):
        slowed_transfer(space, resting(START), resting(GOAL), held=True)
