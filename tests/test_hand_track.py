"""Given hand motions: pieces, samples, recorded joints; and their wrong inputs."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from throwplan.models import Path as Motion
from throwplan.models import low_pass
from throwplan.planner.check.given_motion import given_hand
from throwplan.planner.cli import main


def scene_with(tmp_path: Path, motion: str) -> Path:
    """The drop scene with another [motion], in a file."""
    path = tmp_path / "given.toml"
    text = (Path(__file__).parent.parent / "problems/scenes/drop.toml").read_text()
    path.write_text(text[: text.index("[motion]")] + "[motion]\n" + motion)
    return path


def test_pieces_join_smoothly_and_agree_with_one_piece() -> None:
    times = np.linspace(0, 0.06, 50)
    whole = Motion.accelerating((0, 0, 0.2), (1, 2, 3), (4, 5, 6)).at(times)
    cut = Motion.stepping((0, 0, 0.2), (1, 2, 3), (0.0, 0.02, 0.05), [(4, 5, 6)] * 3).at(times)
    assert cut.pose == pytest.approx(whole.pose)
    assert cut.twist == pytest.approx(whole.twist)
    stepped = Motion.stepping((0, 0, 0), (0, 0, 0), (0.0, 0.03), [(0, 9, 0), (0, -9, 0)])
    around = stepped.at(np.array([0.03 - 1e-9, 0.03 + 1e-9]))
    assert np.ptp(around.pose[1]) < 1e-8 and np.ptp(around.twist[1]) < 1e-7


def test_sampled_hand_has_the_derivatives_of_its_poses() -> None:
    t = np.linspace(-0.02, 0.1, 200)
    poses = np.column_stack([np.sin(5 * t), t**2, 0.3 + np.cos(4 * t)])
    hand = Motion.through(t, poses).at(np.linspace(0, 0.08, 33))
    s = hand.times
    assert hand.twist[0] == pytest.approx(5 * np.cos(5 * s), abs=1e-5)
    assert hand.acceleration[2] == pytest.approx(-16 * np.cos(4 * s), abs=1e-2)


def test_low_pass_keeps_slow_motion_in_phase_and_removes_noise() -> None:
    t = np.arange(0, 2, 0.002)
    slow = np.sin(2 * math.pi * 3 * t)
    noisy = slow + 0.1 * np.sin(2 * math.pi * 180 * t)
    even, smooth = low_pass(t, noisy[:, None], 35.0)
    middle = (even > 0.2) & (even < 1.8)
    assert np.abs(smooth[middle, 0] - slow[middle]).max() < 2e-3
    uneven = np.sort(t + 0.0004 * np.sin(np.arange(t.size)))
    even, smooth = low_pass(uneven, np.sin(2 * math.pi * 3 * uneven)[:, None], 35.0)
    middle = (even > 0.2) & (even < 1.8)
    assert np.abs(smooth[middle, 0] - np.sin(2 * math.pi * 3 * even[middle])).max() < 2e-3


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> tuple[Path, tp.Plan]:
    """A plan's joint motion as it would be recorded at 500 Hz, with encoder noise."""
    folder = tmp_path_factory.mktemp("recording")
    plan = tp.plan("pose")
    plan.save(folder, draw=False)
    table = np.genfromtxt(folder / "motion.csv", delimiter=",", names=True)[::2]
    noise = np.random.default_rng(0).standard_normal((len(table), 7)) * 1e-5
    joints = np.column_stack([table[f"q{j}"] for j in range(1, 8)]) + noise
    header = "t," + ",".join(f"q{j}" for j in range(1, 8))
    np.savetxt(
        folder / "joints.csv",
        np.column_stack([table["t"], joints]),
        delimiter=",",
        header=header,
        comments="",
    )
    return folder, plan


def test_recorded_joints_throw_as_the_motion_they_record(recording) -> None:
    folder, plan = recording
    opening = plan.throw.opening_time
    text = (Path(__file__).parent.parent / "problems/scenes/pose.toml").read_text()
    text = text[: text.index("[robot]")] + text[text.index("[target]") : text.index("[workspace]")]
    motion = f'\n[motion]\njoints = "joints.csv"\narm = "panda"\nopening_time = {opening}\n'
    (folder / "recorded.toml").write_text(text + motion)
    scene = tp.load_scene(folder / "recorded.toml")
    hand = given_hand(scene).at(np.array([0.0, 0.05]))
    planned = plan.mover.motion(*plan.throw.samples.at(opening + np.array([0.0, 0.05])))
    assert hand.pose == pytest.approx(np.array(planned[0]), abs=2e-3)
    assert hand.twist == pytest.approx(np.array(planned[1]), abs=0.1)
    landing = tp.simulate(scene, "sp")["sp"].landing
    assert landing.x == pytest.approx(plan.throw.sent.landing.x, abs=0.02)
    assert landing.theta == pytest.approx(plan.throw.sent.landing.theta, abs=math.radians(10))


def test_simulate_takes_pieces_and_samples(tmp_path: Path) -> None:
    pieces = "times = [0.0, 0.02]\naccelerations = [[1.0, 0.0, 0.0], [0.0, 2.0, 5.0]]\n"
    release = tp.simulate(scene_with(tmp_path, pieces), "sp")["sp"].release
    assert np.isfinite(release.com).all()
    t = np.linspace(0, 0.1, 30)
    table = np.column_stack([t, 0.5 * t**2, 0 * t, 0 * t])
    np.savetxt(tmp_path / "hand.csv", table, delimiter=",", header="t,x,z,theta", comments="")
    sampled = tp.simulate(scene_with(tmp_path, 'table = "hand.csv"\n'), "sp")["sp"].release
    plain = tp.simulate(scene_with(tmp_path, "acceleration = [1.0, 0.0]\n"), "sp")["sp"].release
    assert sampled.com[:, -1] == pytest.approx(plain.com[:, -1], abs=1e-6)


@pytest.mark.parametrize(
    ("motion", "words"),
    [
        ("times = [0.0]\n", "times: has 1 entries, accelerations has 0"),
        ("times = [0.01]\naccelerations = [[0, 0, 0]]\n", "times: must start at 0"),
        ('table = "absent.csv"\n', "absent.csv: no such file"),
        ('table = "short.csv"\n', "four samples"),
        ('table = "back.csv"\n', "t must rise"),
        ('table = "nan.csv"\n', "line 3 has a value that is not finite"),
        ('table = "columns.csv"\n', "must name the columns t, x, z and theta"),
        ('table = "good.csv"\nopening_time = 0.08\n', "the samples cover"),
        ('joints = "good.csv"\n', "joints and arm: give both"),
        ('joints = "good.csv"\narm = "pandaa"\n', "did you mean 'panda'"),
    ],
)
def test_bad_motions_are_one_clear_line(tmp_path: Path, capsys, motion: str, words: str) -> None:
    (tmp_path / "short.csv").write_text("t,x,z,theta\n0,0,0,0\n0.1,0,0,0\n")
    rows = "\n".join(f"{0.01 * k},0,0,0" for k in range(11))
    (tmp_path / "good.csv").write_text(f"t,x,z,theta\n{rows}\n")
    (tmp_path / "back.csv").write_text(f"t,x,z,theta\n{rows}\n0.05,0,0,0\n")
    (tmp_path / "nan.csv").write_text("t,x,z,theta\n0,0,0,0\n0.1,nan,0,0\n")
    (tmp_path / "columns.csv").write_text("time,x,z,theta\n0,0,0,0\n")
    status = main(["simulate", str(scene_with(tmp_path, motion))])
    out, err = capsys.readouterr()
    assert status == 2 and out == ""
    assert err.count("\n") == 1 and words in err
