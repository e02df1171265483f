"""Inverse dynamics in the plane against the oracle's of the whole arm, by virtual work in space."""

import casadi as ca
import numpy as np
import pytest
from builders import swinging
from throwplan.models.robot import PlanarArm, PlanarDynamics

GRAVITY = 9.81
#: At the pads' centre: forces along x and z [N], and a torque [N m].
LOAD = (3.0, -7.0, 0.4)


@pytest.mark.parametrize("name", ["pose", "fr3", "gen3"])
def test_torques_are_those_of_the_whole_arm(name):
    """Of an empty hand, and what a load adds."""
    motion, t = swinging(name), np.linspace(0.02, 0.38, 20)
    kinematics = PlanarArm(motion.arm)
    rates = [ca.SX.sym(part, kinematics.coordinates) for part in ("q", "dq", "ddq")]
    turned = [kinematics.link_angles(values) for values in rates]
    found = [
        ca.vertcat(*PlanarDynamics(kinematics).torques(*turned, GRAVITY, load))
        for load in (None, tuple(ca.SX(v) for v in LOAD))
    ]
    torques = ca.Function("torques", rates, found)
    states = zip(*(values[:, motion.throwing] for values in motion.joints.at(t)), strict=True)
    for state, empty, lever in zip(states, *motion.torques(t, GRAVITY), strict=True):
        free, loaded = (np.array(values).ravel() for values in torques(*state))
        assert np.abs(free - empty).max() < 1e-9
        assert np.abs(loaded - free - lever @ LOAD).max() < 1e-9
