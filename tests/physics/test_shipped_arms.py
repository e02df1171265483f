"""Shipped arms against what their makers publish: frames by Denavit-Hartenberg, URDFs, limits."""

import dataclasses
import sysconfig
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from throwplan.problems import load_arm
from throwplan.problems.urdf import (
    chain_of,
    kinematics_difference,
    limits_of,
    link_inertias,
    read_urdf,
)

STATES = 20
#: Where packages with robots' files put them (extra `sim`).
SHARE = Path(sysconfig.get_path("purelib")) / "cmeel.prefix" / "share"


def random_frames(arm):
    """Joint states inside the limits with the frames of the arm at each."""
    q = ca.SX.sym("q", arm.joints)
    frames = ca.Function("frames", [q], arm.frames(q))
    limits = arm.limits
    shape = (STATES, arm.joints)
    for state in np.random.default_rng(3).uniform(limits.position_min, limits.position_max, shape):
        yield state, [np.array(pose) for pose in frames(state)]


def test_iiwa_is_the_arm_of_its_denavit_hartenberg_parameters():
    """Craig's convention, constDhDataOf14R820.m of KST-Kuka-Sunrise-Toolbox."""
    lengths = [0.36, 0.0, 0.42, 0.0, 0.4, 0.0, 0.126]
    turns = [0, -1, 1, 1, -1, -1, 1]
    for state, frames in random_frames(load_arm("iiwa14")):
        expected = np.eye(4)
        for frame, angle, length, turn in zip(frames[:7], state, lengths, turns, strict=True):
            cos, sin = np.cos(angle), np.sin(angle)
            step = np.eye(4)
            step[:3, :3] = [[1, 0, 0], [0, 1 - abs(turn), -turn], [0, turn, 1 - abs(turn)]] @ (
                np.array([[cos, -sin, 0], [sin, cos, 0], [0, 0, 1]])
            )
            step[:3, 3] = step[:3, 2] * length
            expected = expected @ step
            np.testing.assert_allclose(frame[:3, 2], expected[:3, 2], atol=1e-9)
        np.testing.assert_allclose(frames[7], expected, atol=1e-9)


def test_xarm7_is_the_arm_of_its_makers_urdf():
    path = SHARE / "example-robot-data/robots/xarm_description/urdf/xarm7.urdf"
    if not path.is_file():
        pytest.skip("needs example-robot-data (extra sim)")
    arm = load_arm("xarm7")
    joints = [f"joint{i}" for i in range(1, 8)]
    chain = chain_of(read_urdf(path), joints, "link_eef", "link_base", "z", "y")
    # The file's right angles are 1.5708.
    assert kinematics_difference(arm, chain) < 5e-5
    given = {"acceleration": arm.limits.acceleration, "jerk": arm.limits.jerk}
    found = dataclasses.asdict(limits_of(chain, given))
    for name in ("position_min", "position_max", "velocity", "torque"):
        np.testing.assert_allclose(getattr(arm.limits, name), found[name], rtol=1e-4)
    for own, maker in zip(arm.links[:6], link_inertias(chain)[:6], strict=True):
        assert own.mass == pytest.approx(maker.mass)
        np.testing.assert_allclose(own.com, maker.com, atol=1e-6)
        np.testing.assert_allclose(own.inertia, maker.inertia, atol=1e-7)
