"""Sweeps: physics of disturbed throws, and what is kept of a stopped one."""

from __future__ import annotations

import dataclasses
import json
import math

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.models import FlightLaw, Trajectory
from throwplan.models.release import MODELS
from throwplan.models.robot import PlanarHand, hand_motion
from throwplan.planner.cli import common, main
from throwplan.planner.sweep import sweep_until_stopped
from throwplan.planner.sweep.statistics import derivatives, scan_delays
from throwplan.planner.throw import Throw, ThrowBatch, make_manipulator
from throwplan.planner.verdict import Judge, sampler_of
from throwplan.problems import Distribution, Gripper, Uncertainty

G = 9.81
POSE, TWIST = np.array([0.2, 0.9, -0.6]), np.array([1.9, 1.4, 2.5])
ACCELERATION = np.array([6.0, -4.0, 15.0])
ERRORS = ("hand_x", "hand_z", "hand_theta", "hand_vx", "hand_vz", "hand_omega")


def toy(section: Uncertainty, opening: float = 0.05, model: str = "sp") -> tuple:
    """A thrower of that hand and the sampler of `section`; nothing is planned."""
    scene = tp.load_scene("hand-flip").replace(
        gripper=Gripper(force=120.0, opening=opening), uncertainty=section
    )
    sampler = sampler_of(scene, 0)
    hand = Trajectory.accelerating(POSE, TWIST, ACCELERATION)
    manipulator = dataclasses.replace(
        make_manipulator(scene), motion=hand_motion(PlanarHand(True)), start=None
    )
    # The same motion from 0.2 s before its opening to 0.3 s after it.
    begin = [POSE - 0.2 * TWIST + 0.02 * ACCELERATION, TWIST - 0.2 * ACCELERATION, ACCELERATION]
    motion = Trajectory.cubics(np.array([0.0, 0.5]), *(v[None] for v in begin), np.zeros((1, 3)))
    throw = Throw(scene, manipulator, motion, 0.2, model=model)
    batch = ThrowBatch(throw, scene.target, model, sampler.names, hand, (-0.1, 0.1, 0.1), 400)
    return Judge(batch), sampler


def changed(judge: Judge, scene: tp.Scene) -> Judge:
    """The same throws in another scene."""
    batch = judge.batch
    throw = dataclasses.replace(batch.throw, scene=scene)
    return Judge(dataclasses.replace(batch, throw=throw, target=scene.target))


def small(*names: str, width: float = 1e-3) -> Uncertainty:
    return Uncertainty(**{name: Distribution(normal=width) for name in names})


# Physics.


@pytest.mark.parametrize("model", ["sp", "ls-step"])
def test_derivatives_of_an_instantaneous_release(model: str) -> None:
    """The CoM leaves with the held bar's state at the opening: closed form.

    b = a - (0, -g), landing velocity (v_x, -V): dx/ddelay = t_f (b_x + b_z v_x / V),
    dtheta/ddelay = t_f (alpha + omega b_z / V); the hand's errors move that state.
    """
    thrower, sampler = toy(small("delay", *ERRORS), opening=1e-5, model=model)
    found = derivatives(thrower.batch, sampler)
    h, (a_x, a_z, alpha), omega = thrower.batch.scene.com_offset, ACCELERATION, TWIST[2]
    r_x, r_z = h * math.cos(POSE[2]), h * math.sin(POSE[2])
    v_x, v_z = TWIST[0] - omega * r_z, TWIST[1] + omega * r_x
    b_x = a_x - alpha * r_z - omega**2 * r_x
    b_z = a_z + alpha * r_x - omega**2 * r_z + G
    fall = math.sqrt(v_z**2 + 2 * G * (POSE[1] + r_z - thrower.batch.target.z))
    t_f = (v_z + fall) / G

    def moved(dx: float, dz: float, dv_x: float, dv_z: float, dtheta: float, spin: float) -> tuple:
        dt = (dz + t_f * dv_z) / fall
        return dx + t_f * dv_x + v_x * dt, dtheta + t_f * spin + omega * dt

    expected = {
        "delay": (t_f * (b_x + b_z * v_x / fall), t_f * (alpha + omega * b_z / fall)),
        "hand_x": moved(1, 0, 0, 0, 0, 0),
        "hand_z": moved(0, 1, 0, 0, 0, 0),
        "hand_vx": moved(0, 0, 1, 0, 0, 0),
        "hand_vz": moved(0, 0, 0, 1, 0, 0),
        # The bar turns about the pads.
        "hand_theta": moved(-r_z, r_x, -omega * r_x, -omega * r_z, 1, 0),
        "hand_omega": moved(0, 0, -r_z, r_x, 0, 1),
    }
    for name, slopes in expected.items():
        assert found[name] == pytest.approx(slopes, rel=2e-3, abs=2e-3), name


def test_disturbed_hands_are_the_hands_that_they_stand_for() -> None:
    """A 50 ms opening with all errors at once, against hands given that way."""
    section = small("delay", *ERRORS, "grasp_angle", "com_offset", width=0.01)
    thrower, sampler = toy(section)
    values = sampler.draw(0, 64)
    columns = dict(zip(thrower.batch.names, values.T, strict=True))
    delay = columns["delay"][:, None]
    offset = np.column_stack([columns[name] for name in ERRORS])
    hands = Trajectory.accelerating(
        POSE + delay * (TWIST + delay * ACCELERATION / 2) + offset[:, :3],
        TWIST + delay * ACCELERATION + offset[:, 3:],
        np.tile(ACCELERATION, (64, 1)),
    )
    batch = thrower.batch.releases(thrower.batch.columns(values))
    plain = dataclasses.replace(batch, hands=hands, grasp_angle=columns["grasp_angle"])
    expected = FlightLaw(G).land(MODELS["sp"].throw(plain, 400).detach, thrower.batch.target.z)
    assert thrower.verdicts(values).pose == pytest.approx(expected, abs=1e-9)


def test_a_com_behind_the_pads_is_thrown_too() -> None:
    """Through h = 0 the landing goes on smoothly: no turn by pi, no kink."""
    thrower, _ = toy(small("com_offset"))
    pose = thrower.verdicts(np.linspace(-2e-3, 2e-3, 41)[:, None]).pose
    assert np.abs(np.diff(pose[:, 0])).max() < 1e-3
    assert np.abs(np.diff(pose[:, 1], 2)).max() < 5e-3


@pytest.fixture(scope="module")
def posed(plan_of) -> tp.Plan:
    return plan_of("delay")


@pytest.mark.parametrize("name", ["delay", "near-cup", "hand-flip"])
def test_the_nominal_throw_is_the_checked_one(name: str, plan_of) -> None:
    plan = plan_of(name)
    tolerance, exact = plan.scene.tolerance, plan.throw.deciding.sliding_pivot.landing
    x, theta, flight = tp.sweep(plan, samples=64, model="sp").nominal.pose[0]
    assert x == pytest.approx(exact.x, abs=0.1 * tolerance.position)
    assert theta == pytest.approx(exact.theta, abs=0.1 * tolerance.angle)
    assert flight == pytest.approx(exact.flight_time, abs=1e-3)
    surface = plan.to_dict()["landing"]["limit_surface"]
    x, theta, _ = tp.sweep(plan, samples=64).nominal.pose[0]
    # Its steps are not cut where a free hand's acceleration steps.
    share = 1.0 if plan.scene.robot is None else 0.2
    assert x == pytest.approx(surface["x"], abs=share * tolerance.position)
    assert theta == pytest.approx(surface["theta"], abs=share * tolerance.angle)


def test_samples_land_where_the_exact_model_throws_them(posed) -> None:
    """Ten samples one by one: another scene, another opening time, the plan's own check."""
    section = Uncertainty(
        delay=Distribution(uniform=0.008, mean=0.002),
        opening=Distribution(normal=0.05, relative=True),
        friction=Distribution(uniform=0.1, relative=True),
        patch_radius=Distribution(uniform=0.1, relative=True),
        mass=Distribution(normal=0.01),
        inertia=Distribution(normal=0.05, relative=True),
        com_offset=Distribution(uniform=0.004),
        grasp_angle=Distribution(normal=0.02),
    )
    scene = posed.scene.replace(uncertainty=section)
    found = tp.sweep(dataclasses.replace(posed, scene=scene), samples=10)
    for values, pose in zip(found.values, found.landings.pose, strict=True):
        given = dict(zip(found.sampler.names, values, strict=True))
        held = {name: given[name] for name in ("mass", "inertia")}
        pads = {name: given[name] for name in ("friction", "patch_radius")}
        sections = {"object": held | {"com": given["com_offset"]}, "contact": pads}
        grip, grasp = {"opening": given["opening"]}, {"angle": given["grasp_angle"]}
        other = varied(scene, gripper=grip, grasp=grasp, **sections)
        # The command went out earlier by the mean delay.
        opened = posed.throw.opening_time + given["delay"] - 0.002
        thrown = dataclasses.replace(posed.throw.deciding, scene=other, opening_time=opened)
        exact = thrown.landing
        assert pose[0] == pytest.approx(exact.x, abs=2e-4)
        assert pose[1] == pytest.approx(exact.theta, abs=2e-3)


def test_the_largest_delays_are_where_success_ends(posed) -> None:
    scan = tp.sweep(posed, samples=64).delays
    for edge in (scan.early, scan.late):
        assert edge is not None and edge != 0.0
        for delay, inside in ((edge * 0.98, True), (edge * 1.02, False)):
            opened = posed.throw.opening_time + delay
            thrown = dataclasses.replace(posed.throw.deciding, opening_time=opened)
            dx, dtheta = thrown.miss(posed.target)
            tolerance = posed.scene.tolerance
            met = abs(dx) <= tolerance.position and abs(dtheta) <= tolerance.angle
            assert met == inside


def test_no_delay_fails_in_a_wide_tolerance() -> None:
    thrower, _ = toy(small("delay"))
    scene = varied(thrower.batch.scene, tolerance={"position": 50.0, "angle": 100.0})
    scan = scan_delays(changed(thrower, scene=scene))
    assert (scan.early, scan.late) == (None, None)
    nowhere = thrower.batch.scene.aimed_at(dataclasses.replace(thrower.batch.target, x=9.0))
    scan = scan_delays(changed(thrower, scene=nowhere))
    assert (scan.early, scan.late) == (0.0, 0.0)


def test_a_weak_grip_is_no_success(posed) -> None:
    """Little friction: the bar slips in the full grip, wherever it would land."""
    section = Uncertainty(friction=Distribution(uniform=0.5, mean=0.6))
    scene = posed.scene.replace(uncertainty=section)
    found = tp.sweep(dataclasses.replace(posed, scene=scene), samples=512)
    friction = found.values[:, 0]
    assert not found.landings.sticks[friction < 0.2].any()
    assert not (found.success & ~found.landings.sticks).any()
    # More friction holds what less did.
    slipped = friction[~found.landings.sticks]
    assert (found.landings.sticks == (friction > slipped.max())).all()
    assert slipped.max() == pytest.approx(posed.throw.deciding.grip_use, abs=0.02)


# Stopping.


def test_what_was_done_is_kept_when_stopped(posed, monkeypatch) -> None:
    monkeypatch.setitem(MODELS, "ls-step", dataclasses.replace(MODELS["ls-step"], chunk=256))
    whole = tp.sweep(posed, samples=3 * 256)

    def stop(done: int, total: int) -> None:
        if done >= 2 * 256:
            raise KeyboardInterrupt

    part = sweep_until_stopped(posed, samples=3 * 256, progress=stop)
    count = 2 * 256
    assert part is not None and part.samples == count
    assert np.array_equal(part.values, whole.values[:count])
    assert np.array_equal(part.landings.pose, whole.landings.pose[:count])


def test_a_stopped_command_says_how_much_is_done(tmp_path, capsys, monkeypatch) -> None:
    monkeypatch.setitem(MODELS, "ls-step", dataclasses.replace(MODELS["ls-step"], chunk=256))

    class Stopping(common.Progress):
        def __call__(self, done: int, total: int) -> None:
            raise KeyboardInterrupt

    monkeypatch.setattr("throwplan.planner.cli.sweep.Progress", Stopping)
    line = ["sweep", "hand-box", "--samples", "1000", "--json", "--out", str(tmp_path / "out")]
    assert main(line) == 130
    out, err = capsys.readouterr()
    assert err == "throwplan: interrupted: 256 of 1,000 samples\n"
    assert (json.loads(out)["samples"], json.loads(out)["asked"]) == (256, 1000)
    assert len((tmp_path / "out" / "sweep.csv").read_text().splitlines()) == 257
