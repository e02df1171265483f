"""Fails if an arm's hand is not where another library has it, or its rates are not derivatives."""

import dataclasses
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
import throwplan as tp
from adam.numpy import KinDynComputations
from hypothesis import given, settings
from hypothesis import strategies as st
from throwplan.models.robot import PlanarArm, PlanarHand, hand_motion
from throwplan.problems.arm_files import load_arm

URDF = Path(__file__).parent.parent / "data" / "panda.urdf"
PANDA = load_arm("panda")
JOINTS = [f"panda_joint{i}" for i in range(1, 8)]
#: Where the arm's list of frames has each link of the URDF.
LINKS = {f"panda_link{i}": i - 1 for i in range(1, 8)} | {"panda_link8": 7, "panda_hand_tcp": 8}

angles = st.lists(st.floats(-3, 3), min_size=3, max_size=3)


@pytest.fixture(scope="module")
def adam():
    return KinDynComputations(str(URDF), JOINTS)


@pytest.fixture(scope="module")
def frames():
    q = ca.SX.sym("q", 7)
    return ca.Function("frames", [q], PANDA.frames(q))


@pytest.fixture(scope="module")
def planar():
    return hand_motion(PlanarArm(PANDA))


def all_joints(throwing):
    """Azimuth 0, joints 2, 4 and 6 as given, the pads parallel to the plane."""
    q2, q4, q6 = throwing
    return np.array([0.0, q2, 0.0, q4, 0.0, q6, np.pi / 4])


def pose_of(adam, joints, link="panda_hand_tcp"):
    return np.asarray(adam.forward_kinematics(link, np.eye(4), joints))


def smooth_joints(t):
    """Some smooth motion of three joints and its two derivatives."""
    wide, rate = np.array([0.9, 1.3, 0.7]), np.array([2.1, 1.7, 2.9])
    turn = rate * t + np.arange(3)
    return wide * np.sin(turn), wide * rate * np.cos(turn), -wide * rate**2 * np.sin(turn)


def test_frames_agree_with_adam(adam, frames):
    rng = np.random.default_rng(7)
    low, high = np.array(PANDA.limits.position_min), np.array(PANDA.limits.position_max)
    for joints in rng.uniform(low, high, (5, 7)):
        poses = np.array(frames(joints))
        for link, at in LINKS.items():
            np.testing.assert_allclose(poses[at], pose_of(adam, joints, link), atol=1e-9)


@given(throwing=angles)
@settings(max_examples=20, deadline=None)
def test_planar_chain_is_the_arm_in_its_plane(adam, planar, throwing):
    pose = pose_of(adam, all_joints(throwing))
    x, z, theta = np.array(planar(throwing, 0, 0)[0]).ravel()
    np.testing.assert_allclose([x, 0.0, z], pose[:3, 3], atol=1e-9)
    np.testing.assert_allclose([np.cos(theta), 0.0, np.sin(theta)], pose[:3, 2], atol=1e-9)


def test_hand_angle_is_unwrapped(planar):
    sweep = np.linspace(0.0, 4 * np.pi, 400)
    theta = np.array([float(planar([q, 0, 0], 0, 0)[0][2]) for q in sweep])
    assert abs(abs(theta[-1] - theta[0]) - 4 * np.pi) < 1e-9
    assert np.abs(np.diff(theta)).max() < 0.04


@pytest.mark.parametrize("t", [0.3, 2.7])
def test_twist_and_acceleration_are_rates(planar, t):
    dt, found = 1e-5, planar(*smooth_joints(t))
    before, after = (planar(*smooth_joints(t + d)) for d in (-dt, dt))
    for order, near in ((0, 1e-7), (1, 1e-6)):
        rate = np.array(after[order] - before[order]) / (2 * dt)
        np.testing.assert_allclose(np.array(found[order + 1]), rate, atol=near)


def test_joints_that_do_not_throw_are_refused():
    """Those out of the plane, and more than the core takes: nine in the plane, of two Pandas."""
    for joints in ((2, 3, 6), (2, 4, 7), (6, 4, 2)):
        with pytest.raises(ValueError, match="do not move the hand in the vertical plane"):
            PlanarArm(PANDA, joints)
    with pytest.raises(ValueError, match="at most 8"):
        PlanarArm(dataclasses.replace(PANDA, chain=PANDA.chain * 2), range(2, 11))
    for change in ({"azimuth_joint": 3}, {"posture": (0, 0, 0, 0, 0, 0, 1.2)}):
        with pytest.raises(tp.InputError, match=next(iter(change))):
            tp.Planner(tp.load_scene("pose").replace(arm=dataclasses.replace(PANDA, **change)))


@pytest.mark.parametrize("joints", [(2, 4), (6,)], ids=str)
def test_fewer_throwing_joints_leave_the_others_in_posture(adam, joints):
    posture = np.array([0, 0.3, 0, -1.8, 0, 2.0, np.pi / 4])
    motion = hand_motion(PlanarArm(dataclasses.replace(PANDA, posture=tuple(posture)), joints))
    values, full = np.random.default_rng(3).uniform(-2, 2, len(joints)), posture.copy()
    full[[j - 1 for j in joints]] = values
    x, z, _ = np.array(motion(values, 0, 0)[0]).ravel()
    np.testing.assert_allclose([x, z], pose_of(adam, full)[[0, 2], 3], atol=1e-9)


def test_limits_are_the_published_ones():
    # libfranka, "Robot and interface specifications".
    limits = PANDA.limits
    assert limits.position_max == (2.8973, 1.7628, 2.8973, -0.0698, 2.8973, 3.7525, 2.8973)
    assert limits.position_min == (-2.8973, -1.7628, -2.8973, -3.0718, -2.8973, -0.0175, -2.8973)
    assert limits.velocity == (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61)
    assert limits.acceleration == (15, 7.5, 10, 12.5, 15, 20, 20)
    assert limits.jerk == (7500, 3750, 5000, 6250, 7500, 10000, 10000)
    assert limits.torque == (87, 87, 87, 87, 12, 12, 12)


def test_a_hand_that_does_not_turn_keeps_its_angle():
    motion = hand_motion(PlanarHand(turns=False, theta=0.7))
    pose, twist, acceleration = (np.array(o).ravel() for o in motion([1, 2], [3, 4], [5, 6]))
    np.testing.assert_array_equal(pose, [1, 2, 0.7])
    np.testing.assert_array_equal(twist, [3, 4, 0])
    np.testing.assert_array_equal(acceleration, [5, 6, 0])
