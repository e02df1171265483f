"""Fails if planar inverse dynamics is not the oracle's of the whole arm, by virtual work."""

import casadi as ca
import numpy as np
import pytest
from builders import swinging
from throwplan.models.robot import PlanarArm, PlanarDynamics

from oracle import oracle_of
from oracle.release import released

GRAVITY = 9.81
#: At the pads' centre: forces along x and z [N], and a torque [N m].
LOAD = (3.0, -7.0, 0.4)


@pytest.mark.parametrize("name", ["pose", "gen3"])
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


def test_the_step_of_load_is_that_of_the_released_object(loud_plan_of):
    """By Newton's and Euler's laws from the oracle's release and its arm, within a millisecond."""
    plan = loud_plan_of("near-cup")
    oracle, thing, steps = oracle_of(plan), plan.scene.object, plan.to_dict()["torque"]["load_step"]
    release = released(oracle.held(oracle.columns({}, 1)), oracle.hand, "ls-step", 1000)
    times, com = release.times[:, 0], release.com[:, 0]
    velocity, middle = np.diff(com, axis=0) / np.diff(times)[:, None], (times[1:] + times[:-1]) / 2
    a = (np.diff(velocity, axis=0) / np.diff(middle)[:, None]).T
    t = times[1:-1]
    x, z = (com[1:-1] - oracle.hand.at(t)[0])[:, :2].T
    force = thing.mass * (a[:2] + np.array([[0.0], [GRAVITY]]))
    load = [*force, thing.inertia * a[2] - force[0] * z + force[1] * x]
    torques = np.einsum("kjw,wk->jk", oracle.motion.torques(t, GRAVITY)[1], load)
    begin = np.arange(times[0], times[-1], 2e-5)
    for torque, step in zip(torques, steps, strict=True):
        held = [*torque, 0.0]
        early, late = (np.interp(begin + s, [*t, times[-1]], held) for s in (0.0, 1e-3))
        assert step == pytest.approx(np.abs(late - early).max(), rel=0.02)
    assert max(steps) > 0.05
