"""Fails if a hand's motion, given by pieces, samples or recorded joints, is not that motion."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from throwplan.models import Trajectory, low_pass


def scene_with(folder: Path, motion: str) -> Path:
    """The drop scene with another [motion], in a file."""
    path, text = folder / "given.toml", tp.scene_text("drop")
    path.write_text(text[: text.index("[motion]")] + "[motion]\n" + motion)
    return path


def write(path: Path, names: list[str], *columns: np.ndarray) -> None:
    rows, header = np.column_stack(columns), ",".join(names)
    np.savetxt(path, rows, delimiter=",", header=header, comments="")


def test_pieces_join_smoothly_and_agree_with_one_piece() -> None:
    times = np.linspace(0, 0.06, 50)
    whole = Trajectory.accelerating((0, 0, 0.2), (1, 2, 3), (4, 5, 6)).at(times)
    pieces = (0.0, 0.02, 0.05), [(4, 5, 6)] * 3
    cut = Trajectory.stepping((0, 0, 0.2), (1, 2, 3), *pieces).at(times)
    assert cut.pose == pytest.approx(whole.pose)
    assert cut.twist == pytest.approx(whole.twist)
    stepped = Trajectory.stepping((0, 0, 0), (0, 0, 0), (0.0, 0.03), [(0, 9, 0), (0, -9, 0)])
    around = stepped.at(np.array([0.03 - 1e-9, 0.03 + 1e-9]))
    assert np.ptp(around.pose[1]) < 1e-8 and np.ptp(around.twist[1]) < 1e-7


def test_sampled_hand_has_the_derivatives_of_its_poses() -> None:
    t = np.linspace(-0.02, 0.1, 200)
    poses = np.column_stack([np.sin(5 * t), t**2, 0.3 + np.cos(4 * t)])
    s = np.linspace(0, 0.08, 33)
    hand = Trajectory.through(t, poses).at(s)
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


def test_recorded_joints_throw_as_the_motion_they_record(tmp_path, plan_of, saved) -> None:
    """A plan's joints as they would be recorded at 500 Hz, with encoder noise."""
    plan = plan_of("pose")
    table = np.genfromtxt(saved("pose") / "motion.csv", delimiter=",", names=True)[::2]
    noise = np.random.default_rng(0).standard_normal((len(table), 7)) * 1e-5
    joints = np.column_stack([table[f"q{j}"] for j in range(1, 8)]) + noise
    write(tmp_path / "joints.csv", ["t", *(f"q{j}" for j in range(1, 8))], table["t"], joints)
    answer, text = plan.to_dict(), tp.scene_text("pose")
    text = re.sub(r"\[(robot|workspace)\].*?(?=\n\[|\Z)", "", text, flags=re.S)
    motion = f"opening_time = {answer['release']['opening_time']}\n"
    motion = f'\n[motion]\njoints = "joints.csv"\narm = "panda"\n{motion}'
    (tmp_path / "recorded.toml").write_text(text + motion)
    landing = tp.simulate(tmp_path / "recorded.toml", "sp")["sp"].to_dict()["landing"]
    assert landing["x"] == pytest.approx(answer["landing"]["sent"]["x"], abs=0.02)
    assert landing["theta"] == pytest.approx(answer["landing"]["sent"]["theta"], abs=0.17)


def test_simulate_takes_pieces_and_samples(tmp_path) -> None:
    t = np.linspace(0, 0.06, 61)
    poses = np.column_stack([t, 1.5 * t + t**2, 0.2 + 2 * t])
    write(tmp_path / "hand.csv", ["t", "x", "z", "theta"], t, poses)
    whole = "angle_deg = 11.459155902616466\nvelocity = [1.0, 1.5]\nrate = 2.0\n"
    motions = {
        "constant": whole + "acceleration = [0.0, 2.0]\n",
        "pieces": whole + "times = [0.0, 0.03]\naccelerations = [[0, 2, 0], [0, 2, 0]]\n",
        "samples": 'table = "hand.csv"\n',
    }
    ends = [
        tp.simulate(scene_with(tmp_path, motion), "sp")["sp"].to_dict()["detach"]
        for motion in motions.values()
    ]
    for other in ends[1:]:
        assert other == pytest.approx(ends[0], abs=1e-4)


def test_samples_are_met_by_quintics_exactly_and_held_outside() -> None:
    t = 1e-3 * np.arange(30)
    polynomial = np.polynomial.Polynomial([0.3, -1.0, 2.0, 30.0, -400.0, 5e3])
    exact = [polynomial, polynomial.deriv(1), polynomial.deriv(2)]
    path = Trajectory.quintics(1e-3, *(curve(t)[:, None] for curve in exact))
    between = np.linspace(0, 0.0285, 101)
    for curve, found in zip(exact, path.at(between), strict=True):
        assert found[0] == pytest.approx(curve(between), rel=1e-9, abs=1e-9)
    assert path.at(np.array([-1.0, 1.0])).pose[0] == pytest.approx(polynomial(t[[0, -1]]))
