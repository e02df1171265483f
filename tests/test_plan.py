"""Every built-in scene, planned once: the promises of `solved` checked by other means."""

from __future__ import annotations

import csv
import json
import math
from functools import cache

import numpy as np
import pytest
import throwplan as tp
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

HAND = ("hand-box", "hand-flip")
ARM = ("pose", "cup", "box", "flip")

#: Panda limits by the maker, joints 1 to 7.
POSITION_MAX = np.array([2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973])
POSITION_MIN = np.array([-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973])
VELOCITY = np.array([2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61])
ACCELERATION = np.array([15, 7.5, 10, 12.5, 15, 20, 20])
JERK = np.array([7500, 3750, 5000, 6250, 7500, 10000, 10000])


@cache
def plan_of(name: str) -> tp.Plan:
    return tp.plan(name)


@pytest.mark.parametrize("name", HAND)
def test_hand_scenes_land_within_half_a_millimetre(name: str) -> None:
    result = plan_of(name).to_dict()
    assert result["status"] == "solved"
    assert result["error"]["sent"] is None
    assert result["error"]["exact"]["position"] <= 0.5e-3
    assert result["error"]["exact"]["angle"] <= math.radians(0.2)


@pytest.mark.parametrize("name", ARM)
def test_arm_scenes_land_within_two_millimetres_as_sent(name: str) -> None:
    result = plan_of(name).to_dict()
    assert result["status"] == "solved"
    assert result["error"]["sent"]["position"] <= 2e-3
    assert result["error"]["sent"]["angle"] <= math.radians(0.5)


@pytest.mark.parametrize("name", HAND + ARM)
def test_ipopt_solves_and_lands_the_same(name: str) -> None:
    other = tp.plan(name, solver="ipopt")
    assert other.solved
    assert other.to_dict()["solver"]["name"] == "ipopt"
    mine, theirs = (p.to_dict()["landing"]["exact"] for p in (plan_of(name), other))
    assert mine["x"] == pytest.approx(theirs["x"], abs=2.5e-4)
    if plan_of(name).target.theta is not None:
        assert mine["theta"] == pytest.approx(theirs["theta"], abs=1e-3)


@pytest.mark.parametrize("name", ARM)
def test_motion_csv_keeps_every_limit_and_rests_at_both_ends(name: str, tmp_path) -> None:
    plan_of(name).save(tmp_path, draw=False)
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    columns = {
        kind: np.column_stack([table[f"{kind}{j}"] for j in range(1, 8)])
        for kind in ("q", "dq", "ddq")
    }
    assert np.allclose(np.diff(table["t"]), 1e-3)
    q, dq, ddq = columns["q"], columns["dq"], columns["ddq"]
    assert (q <= POSITION_MAX).all() and (q >= POSITION_MIN).all()
    assert (np.abs(dq) <= VELOCITY).all() and (np.abs(ddq) <= ACCELERATION).all()
    assert (np.abs(np.diff(q, axis=0)) <= 1e-3 * VELOCITY).all()
    assert (np.abs(np.diff(dq, axis=0)) <= 1e-3 * ACCELERATION).all()
    assert (np.abs(np.diff(ddq, axis=0)) <= 1e-3 * JERK).all()
    for end in (0, -1):
        assert np.abs(dq[end]).max() < 1e-9 and np.abs(ddq[end]).max() < 1e-9


@pytest.mark.parametrize("name", ARM)
def test_columns_of_motion_csv_belong_together(name: str, tmp_path) -> None:
    plan_of(name).save(tmp_path, draw=False)
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    for j in (2, 4, 6):
        rate = CubicSpline(table["t"], table[f"q{j}"]).derivative()(table["t"])
        assert np.abs(rate - table[f"dq{j}"])[3:-3].max() < 1e-3


def wrench_and_limits(scene: tp.Scene, hand: dict, state: np.ndarray, grip: float):
    """Textbook sliding pivot in world coordinates, written apart from the package's."""
    x, z, _, vx, vz, omega = state
    body, contact = scene.object, scene.contact
    m, inertia, h = body.mass, body.inertia, scene.com_offset
    rx, rz = x - hand["x"], z - hand["z"]
    fx = m * (hand["ax"] - hand["alpha"] * rz - omega**2 * rx)
    fz = m * (hand["az"] + hand["alpha"] * rx - omega**2 * rz + scene.gravity)
    big_j = m * h * h + inertia
    tau = big_j * hand["alpha"] - m * (hand["ax"] * rz - hand["az"] * rx) + m * scene.gravity * rx
    f_max = contact.faces * contact.friction * grip
    tau_max = contact.torsion * contact.patch_radius * f_max
    alpha = hand["alpha"] - np.sign(tau) * max(abs(tau) - tau_max, 0.0) / big_j
    size = math.hypot(fx, fz)
    over = max(1.0 - f_max / size, 0.0) if size > 0 else 0.0
    dx, dz = over * fx, over * fz
    alpha -= (-rx * dz + rz * dx) / big_j
    ax = hand["ax"] - alpha * rz - omega**2 * rx - dx / m
    az = hand["az"] + alpha * rx - omega**2 * rz - dz / m
    return np.array([vx, vz, omega, ax, az, alpha])


def hand_from_csv(table) -> tuple:
    """Hand pose by textbook trigonometry of the Panda's plane, as splines of time."""
    q2, q4, q6 = table["q2"], table["q4"], table["q6"]
    x = 0.316 * np.sin(q2) + 0.0825 * np.cos(q2)
    z = 0.333 + 0.316 * np.cos(q2) - 0.0825 * np.sin(q2)
    # Direction of the forearm: joint 4 is negative and folds it forward.
    elbow = q2 - q4
    x += -0.0825 * np.cos(elbow) + 0.384 * np.sin(elbow)
    z += 0.0825 * np.sin(elbow) + 0.384 * np.cos(elbow)
    wrist = elbow - q6
    x += 0.088 * np.cos(wrist) - 0.2104 * np.sin(wrist)
    z += -0.088 * np.sin(wrist) - 0.2104 * np.cos(wrist)
    theta = -math.pi / 2 - wrist
    return tuple(CubicSpline(table["t"], value) for value in (x, z, theta))


@pytest.mark.parametrize("name", ARM)
def test_landing_again_from_motion_csv_alone(name: str, tmp_path) -> None:
    """Another kinematics, other coordinates, another integrator: the same landing."""
    plan = plan_of(name)
    plan.save(tmp_path, draw=False)
    result = json.loads((tmp_path / "plan.json").read_text())
    table = np.genfromtxt(tmp_path / "motion.csv", delimiter=",", names=True)
    curves = hand_from_csv(table)
    opening, detach = result["release"]["opening_time"], result["release"]["detach_time"]
    scene = plan.scene

    def hand(t: float) -> dict:
        pose, rate, turn = ([float(c(t, k)) for c in curves] for k in range(3))
        return dict(
            zip(
                ("x", "z", "theta", "vx", "vz", "omega", "ax", "az", "alpha"),
                pose + rate + turn,
                strict=True,
            )
        )

    start, h = hand(opening), scene.com_offset
    rx, rz = h * math.cos(start["theta"]), h * math.sin(start["theta"])
    state = np.array(
        [
            start["x"] + rx,
            start["z"] + rz,
            start["theta"],
            start["vx"] - start["omega"] * rz,
            start["vz"] + start["omega"] * rx,
            start["omega"],
        ]
    )

    def rates(t: float, y: np.ndarray) -> np.ndarray:
        grip = 120.0 * max(1.0 - (t - opening) / 0.05, 0.0)
        return wrench_and_limits(scene, hand(t), y, grip)

    run = solve_ivp(rates, (opening, detach), state, rtol=1e-9, atol=1e-11, max_step=2e-4)
    x, z, theta, vx, vz, omega = run.y[:, -1]
    flight = (vz + math.sqrt(vz**2 + 2 * scene.gravity * (z - plan.target.z))) / scene.gravity
    assert x + vx * flight == pytest.approx(result["landing"]["sent"]["x"], abs=3e-4)
    assert theta + omega * flight == pytest.approx(
        result["landing"]["sent"]["theta"], abs=math.radians(0.1)
    )
    assert detach + flight == pytest.approx(result["release"]["landing_time"], abs=1e-3)


def test_planned_exact_and_limit_surface_landings_are_three_different_models() -> None:
    landing = plan_of("cup").to_dict()["landing"]
    xs = [landing[name]["x"] for name in ("planned", "exact", "limit_surface")]
    assert len({round(x, 6) for x in xs}) == 3
    assert max(xs) - min(xs) < 0.02


@pytest.mark.parametrize("name", HAND + ARM)
def test_command_precedes_opening_by_the_dwell(name: str) -> None:
    plan = plan_of(name)
    release, profile = plan.to_dict()["release"], plan.scene.gripper.profile()
    assert release["command_time"] >= -1e-6
    assert release["opening_time"] - release["command_time"] == pytest.approx(profile.dwell)
    assert release["detach_time"] - release["opening_time"] == pytest.approx(profile.opening)
    assert release["landing_time"] > release["detach_time"]


def test_full_turns_count() -> None:
    """hand-flip starts hanging at -90 deg and lands at 270: one full turn."""
    plan = plan_of("hand-flip")
    throw = plan.throw
    assert throw is not None
    turned = throw.exact.landing.theta - throw.exact.release.com[2, 0]
    assert throw.exact.landing.theta == pytest.approx(1.5 * math.pi, abs=math.radians(0.2))
    assert turned > math.radians(200)


def test_turns_any_takes_the_angle_modulo_full_turns() -> None:
    planner = tp.Planner(tp.load_scene("pose"))
    target = tp.Pose(x=1.0, z=0.1, theta=2 * math.pi - 0.5)
    plan = planner.plan(target, turns="any")
    assert plan.solved
    landed = plan.to_dict()["landing"]["sent"]["theta"]
    assert math.remainder(landed - target.theta, 2 * math.pi) == pytest.approx(0, abs=0.01)
    assert plan.target.theta != target.theta


def test_one_planner_serves_many_targets_and_starts_warm() -> None:
    planner = tp.Planner(tp.load_scene("cup"))
    first = planner.plan()
    moved = tp.Pose(x=0.92, z=0.22, theta=-math.pi / 2)
    again = planner.plan(moved, warm=first)
    assert first.solved and again.solved
    times = again.to_dict()["time"]
    assert times["build"] == 0.0 and times["guess"] == 0.0
    # The cup went along: the plan's own cup is the one that the bar enters.
    assert again.scene.cup is not None and again.scene.cup.x == pytest.approx(0.92)
    assert again.to_dict()["landing"]["sent"]["x"] == pytest.approx(0.92, abs=2e-3)


def test_azimuth_turns_the_plane_by_joint_1(tmp_path) -> None:
    turn = math.radians(40)
    target = tp.Pose(x=0.9 * math.cos(turn), y=0.9 * math.sin(turn), z=0.22, theta=-math.pi / 2)
    plan = tp.Planner(tp.load_scene("cup")).plan(target)
    straight = plan_of("cup")
    assert plan.solved
    sent = plan.to_dict()["landing"]["sent"]
    assert (sent["x"], sent["y"]) == pytest.approx((target.x, target.y), abs=1e-3)
    plan.save(tmp_path, draw=False)
    with open(tmp_path / "motion.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["q1"]) for row in rows] == pytest.approx([turn] * len(rows))
    assert plan.throw is not None and straight.throw is not None
    assert plan.throw.opening_time == pytest.approx(straight.throw.opening_time, abs=0.02)


def test_position_only_leaves_the_angle_alone() -> None:
    result = plan_of("box").to_dict()
    assert result["target"]["theta"] is None
    assert result["error"]["sent"]["angle"] == 0
    assert result["landing"]["sent"]["theta"] is not None


def test_a_start_without_heavy_guards_is_taken_up_again_with_them() -> None:
    """Starts come twice: first without guards that cost much, then with them."""
    scene = tp.load_scene("flip")
    target = scene.target.in_plane(-0.23749494304997687, math.radians(-91.33577420668458))
    assert tp.Planner(scene).plan(target).solved
