"""Fails if a disturbed throw lands elsewhere than by closed forms, by the hand or scene that the
disturbance stands for, or if a throw that misses or slips counts as a success."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import throwplan as tp
from builders import only, varied
from throwplan.models import FlightLaw, Trajectory
from throwplan.models.release import exact_pivot_release
from throwplan.planner.throw import Throw, ThrowBatch, make_manipulator
from throwplan.planner.uncertainty import sampler_of
from throwplan.planner.verdict import measures_of
from throwplan.problems import Distribution, Gripper, Uncertainty

from benchmarks.plain_pivot import PlainPivot

G = 9.81
POSE, TWIST = np.array([0.2, 0.9, -0.6]), np.array([1.9, 1.4, 2.5])
ACCELERATION = np.array([6.0, -4.0, 15.0])
ERRORS = ("hand_x", "hand_z", "hand_theta", "hand_vx", "hand_vz", "hand_omega")


def small(*names: str, width: float = 1e-3) -> Uncertainty:
    return only(**{name: Distribution(normal=width) for name in names})


def batch_of(section: Uncertainty, model: str = "sp") -> ThrowBatch:
    """That hand as a batch with the parameters of `section`; nothing is planned."""
    scene = tp.load_scene("hand-flip").replace(
        gripper=Gripper(force=120.0, opening=0.05), uncertainty=section
    )
    hand = Trajectory.accelerating(POSE, TWIST, ACCELERATION)
    throw = Throw(scene, make_manipulator(scene), hand, 0.0, model="sp")
    return ThrowBatch(throw, scene.target, model, section.names, hand, (-0.1, 0.1, 0.1))


# Physics.


@pytest.fixture(scope="module")
def posed(plan_of) -> tp.Plan:
    return plan_of("delay")


@pytest.mark.parametrize("model", ["sp", "ls-step"])
def test_derivatives_of_an_instantaneous_release(model: str, posed) -> None:
    """The CoM leaves with the held bar's state at the opening: closed form.

    b = a - (0, -g), landing velocity (v_x, -V): dx/ddelay = t_f (b_x + b_z v_x / V),
    dtheta/ddelay = t_f (alpha + omega b_z / V); the hand's errors move that state.
    """
    scene = varied(posed.scene, gripper={"opening": 1e-5}, uncertainty=small("delay", *ERRORS))
    found = tp.sweep(dataclasses.replace(posed, scene=scene), samples=8, model=model).derivatives
    hand = posed.throw.deciding.hand([posed.throw.opening_time])
    (_, z, theta), (v_x, v_z, omega) = hand.pose[:, 0], hand.twist[:, 0]
    a_x, a_z, alpha = hand.acceleration[:, 0]
    r_x, r_z = scene.com_offset * math.cos(theta), scene.com_offset * math.sin(theta)
    v_x, v_z = v_x - omega * r_z, v_z + omega * r_x
    b_x = a_x - alpha * r_z - omega**2 * r_x
    b_z = a_z + alpha * r_x - omega**2 * r_z + G
    fall = math.sqrt(v_z**2 + 2 * G * (z + r_z - posed.target.z))
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


@pytest.mark.parametrize(
    ("model", "exact", "near"),
    [("sp", exact_pivot_release, 1e-9), ("sp-paper", PlainPivot("paper", 4000).release, 1e-4)],
)
def test_disturbed_hands_are_the_hands_that_they_stand_for(model, exact, near) -> None:
    """A 50 ms opening with all errors at once, against hands given that way."""
    batch = batch_of(small("delay", *ERRORS, "grasp_angle", "com_offset", width=0.01), model)
    values = sampler_of(batch.scene, 0).draw(0, 16)
    columns = dict(zip(batch.names, values.T, strict=True))
    delay = columns["delay"][:, None]
    offset = np.column_stack([columns[name] for name in ERRORS])
    starts = POSE + delay * (TWIST + delay * ACCELERATION / 2) + offset[:, :3]
    twists = TWIST + delay * ACCELERATION + offset[:, 3:]
    ends = []
    for row, (start, twist) in enumerate(zip(starts, twists, strict=True)):
        hand = Trajectory.accelerating(start, twist, ACCELERATION)
        com = float(columns["com_offset"][row]) + batch.scene.grasp.offset
        body = dataclasses.replace(batch.throw.case.body, com_offset=com)
        angle = float(columns["grasp_angle"][row])
        case = dataclasses.replace(batch.throw.case, hand=hand, body=body, grasp_angle=angle)
        ends.append(exact(case).end)
    expected = FlightLaw(G).land(np.array(ends), batch.target.z)
    assert batch.fly(values).landing == pytest.approx(expected, abs=near)
    if model == "sp":
        ones = [batch.one(row).landing for row in values[:5]]
        assert [one.x for one in ones] == pytest.approx(expected[:5, 0], abs=near)
        assert [one.theta for one in ones] == pytest.approx(expected[:5, 1], abs=near)


@pytest.mark.parametrize("name", ["near-cup", "hand-flip"])
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


def test_a_weak_grip_is_no_success(posed) -> None:
    """Little friction: the bar slips in the full grip, wherever it would land."""
    section = only(friction=Distribution(uniform=0.5, mean=0.6))
    scene = posed.scene.replace(uncertainty=section)
    found = tp.sweep(dataclasses.replace(posed, scene=scene), samples=512)
    friction = found.values[:, 0]
    assert not found.landings.sticks[friction < 0.2].any()
    assert not (found.success & ~found.landings.sticks).any()
    # More friction holds what less did.
    slipped = friction[~found.landings.sticks]
    assert (found.landings.sticks == (friction > slipped.max())).all()
    assert slipped.max() == pytest.approx(
        measures_of(posed.throw.deciding).value("grip")[0], abs=0.02
    )
