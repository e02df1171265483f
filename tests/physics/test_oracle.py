"""Fails if the oracle itself is wrong: beside published values, energy and dense sampling."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from builders import swinging
from release_cases import STILL, VALUES, expected
from scipy.interpolate import PPoly

from oracle import shapes
from oracle.motion import Curve
from oracle.release import Held, released

#: Landing of the reference [m], [rad] that the oracle must meet, 1 m below the hand.
LANDING = (2e-4, 2e-3)


def held_of(name: str) -> tuple[Held, Curve]:
    """A reference case, and its hand at constant acceleration."""
    case = VALUES[name]
    body, contact = case["object"], case["contact"]
    hand = STILL if case["hand"] == "drop" else case["hand"]
    powers = [(*np.array(hand["a"]) / 2, hand["alpha"] / 2)]
    powers += [(*hand["v0"], hand["omega0"]), (0.0, 0.0, hand["theta0"])]
    given = (body["m"], body["I"], body["h"], 0.0, contact["mu"], contact["c"] * contact["r"])
    numbers = [np.array([float(v)]) for v in (*given, case["T"], 0.0, 0.0)]
    gripper = SimpleNamespace(force=case["fN0"])
    held = Held(*numbers, case["fN0"], contact["faces"], 9.81, gripper)
    return held, Curve(PPoly(np.array(powers)[:, None], [0.0, 1.0]))


@pytest.mark.parametrize(
    ("model", "reference"), [("ls-step", "ls_timestepping_n5000"), ("sp", "sp_continuous")]
)
@pytest.mark.parametrize("name", ["drop_h100_faces2", "throw_com2_slow_opening"])
def test_releases_land_where_the_reference_does(name: str, model: str, reference: str) -> None:
    found = released(*held_of(name), model)
    states = np.concatenate([found.com[-1, 0], found.twist[0]]), expected(name, reference)
    (x, theta), (other, turn) = (
        (s[0] + s[3] * t, s[2] + s[5] * t)
        for s in states
        for t in [(s[4] + np.sqrt(s[4] ** 2 + 2 * 9.81 * (s[1] + 1.0))) / 9.81]
    )
    assert abs(x - other) < LANDING[0]
    assert abs(theta - turn) < LANDING[1]


def test_wrench_is_what_moves_the_held_bar() -> None:
    """Newton's and Euler's laws by second differences of the bar's pose."""
    held, hand = held_of("throw_accelerating")
    step, time = 1e-4, 0.02
    poses = hand.at(time + step * np.arange(-1, 2))[0]
    com = poses[:, :2] + np.column_stack(held.lever(poses[:, 2]))
    (a_x, a_z), alpha = np.diff(com, 2, axis=0)[0] / step**2, np.diff(poses[:, 2], 2) / step**2
    f_x, f_z = held.mass * a_x, held.mass * (a_z + 9.81)
    r_x, r_z = com[1] - poses[1, :2]
    torque = held.inertia * alpha + r_x * f_z - r_z * f_x
    found = held.wrench(hand.at(np.array([time])))
    assert np.allclose(found, [f_x, f_z, torque], rtol=1e-5, atol=1e-6)


def test_torques_give_the_links_their_energy() -> None:
    motion = swinging("ur5e", every=True)
    times = motion.samples.times

    def energy(t: np.ndarray) -> np.ndarray:
        frames, total = motion.frames(t), np.zeros(t.size)
        for frame, link in zip(frames[1:-1], motion.arm.links, strict=True):
            place, v, _ = frame.point(link.com)
            xx, xy, xz, yy, yz, zz = link.inertia
            local = np.einsum("kij,ki->kj", frame.axes, frame.omega)
            spin = local @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            total += link.mass * ((v**2).sum(axis=1) / 2 + 9.81 * place[:, 2])
            total += (local * spin).sum(axis=1) / 2
        return total

    at = times[20:-20]
    torques, _ = motion.torques(at, 9.81)
    power = (torques * motion.joints.at(at)[1][:, motion.throwing]).sum(axis=1)
    change = (energy(at + 1e-5) - energy(at - 1e-5)) / 2e-5
    assert np.abs(power - change).max() < 1e-4 * np.abs(change).max()


# Distances, by many points.


def dense(a: np.ndarray, b: np.ndarray, count: int = 401) -> np.ndarray:
    return a + np.linspace(0.0, 1.0, count)[:, None] * (b - a)


@pytest.mark.parametrize("seed", range(3))
def test_distances_are_those_of_the_nearest_points(seed: int) -> None:
    random = np.random.default_rng(seed)
    a, b, c, d = random.uniform(-1, 1, (4, 1, 3))
    apart = np.linalg.norm(dense(a[0], b[0])[:, None] - dense(c[0], d[0]), axis=2).min()
    assert abs(shapes.between_segments(a, b, c, d)[0] - apart) < 0.01

    axes, _ = np.linalg.qr(random.normal(size=(3, 3)))
    half = random.uniform(0.1, 0.5, 3)
    local = (dense(a[0], b[0], 2001) - c) @ axes.T
    away = np.linalg.norm(np.maximum(np.abs(local) - half, 0.0), axis=1).min()
    assert abs(shapes.to_box(a, b, c[0], axes, half)[0] - away) < 1e-3

    one, other = (
        shapes.outline(random.uniform(-1, 1, (1, 3)) * [1, 1, 3], -0.3, 0.5, 0.1) for _ in range(2)
    )
    edges = [
        np.concatenate([dense(p, q) for p, q in zip(o, np.roll(o, -1, 0), strict=True)])
        for o in (one[0], other[0])
    ]
    apart = np.linalg.norm(edges[0][:, None] - edges[1][::2], axis=2).min()
    found = shapes.between_outlines(one, other)[0]
    # Outlines that overlap are apart by no more than their edges, with the sign of depth.
    assert abs(found - apart) < 5e-3 if apart > 5e-3 and found > 0.0 else found < 5e-3
    beyond = np.maximum(np.abs(edges[0][:, 0]) - 0.2, edges[0][:, 1] - 0.4).min()
    assert abs(shapes.from_column(one, 0.2, 0.4)[0] - beyond) < 2e-3
