"""Inverse dynamics in the plane against another library's, and by virtual work."""

import casadi as ca
import numpy as np
import pytest
from adam.numpy import KinDynComputations
from throwplan.models.robot import PlanarArm, PlanarDynamics
from throwplan.problems import load_arm

PANDA = load_arm("panda")
THROWING = [1, 3, 5]
#: Azimuth 0, the pads parallel to the plane.
POSTURE = np.array(PANDA.posture)
GRAVITY = 9.81


def joint(kind, name, parent, child, pose, more=""):
    """A joint of a URDF at a 4x4 pose."""
    xyz = " ".join(f"{v:.17g}" for v in pose[:3, 3])
    pitch = -np.arcsin(np.clip(pose[2, 0], -1, 1))
    roll, yaw = np.arctan2(pose[2, 1], pose[2, 2]), np.arctan2(pose[1, 0], pose[0, 0])
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{roll:.17g} {pitch:.17g} {yaw:.17g}"/>{more}</joint>'
    )


def link(name, inertia):
    names = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    values = " ".join(f'{n}="{v:.17g}"' for n, v in zip(names, inertia.inertia, strict=True))
    com = " ".join(f"{v:.17g}" for v in inertia.com)
    return (
        f'<link name="{name}"><inertial><origin xyz="{com}" rpy="0 0 0"/>'
        f'<mass value="{inertia.mass:.17g}"/><inertia {values}/></inertial></link>'
    )


@pytest.fixture(scope="module")
def adam(tmp_path_factory):
    """The Panda's chain and masses written as URDF and read by adam."""
    parts = ['<link name="base"/>']
    parent = "base"
    axis = '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="87" velocity="2"/>'
    for number, (frame, inertia) in enumerate(zip(PANDA.chain, PANDA.links, strict=False)):
        pose = np.array(ca.evalf(frame.placed()))
        parts.append(link(f"l{number}", inertia))
        parts.append(joint("revolute", f"j{number}", parent, f"l{number}", pose, axis))
        parent = f"l{number}"
    hand = np.eye(4)
    turn = PANDA.tool.rotation
    hand[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    hand[2, 3] = PANDA.tool.flange
    parts += [link("hand", PANDA.links[-1]), joint("fixed", "mount", parent, "hand", hand)]
    path = tmp_path_factory.mktemp("urdf") / "arm.urdf"
    path.write_text(f'<robot name="arm">{"".join(parts)}</robot>')
    return KinDynComputations(
        str(path), [f"j{k}" for k in range(7)], gravity=np.array([0, 0, -GRAVITY, 0, 0, 0.0])
    )


def torques(load=None):
    """Function (q, dq, ddq) -> torques of the three throwing joints."""
    kinematics = PlanarArm(PANDA)
    dynamics = PlanarDynamics(kinematics)
    values = [ca.SX.sym(name, 3) for name in ("q", "dq", "ddq")]
    turned = [kinematics.link_angles(value) for value in values]
    found = dynamics.torques(*turned, GRAVITY, load)
    return ca.Function("torques", values, [ca.vertcat(*found)])


def states(count):
    rng = np.random.default_rng(3)
    low, high = (
        np.array(v)[THROWING] for v in (PANDA.limits.position_min, PANDA.limits.position_max)
    )
    for _ in range(count):
        yield rng.uniform(low, high), rng.uniform(-2, 2, 3), rng.uniform(-15, 15, 3)


def test_torques_are_those_of_the_whole_arm(adam):
    function = torques()
    base, still = np.eye(4), np.zeros(6)
    for q, dq, ddq in states(20):
        full, rate, turn = POSTURE.copy(), np.zeros(7), np.zeros(7)
        full[0] = 0.0
        full[THROWING], rate[THROWING], turn[THROWING] = q, dq, ddq
        mass = np.asarray(adam.mass_matrix(base, full))[6:, 6:]
        bias = np.asarray(adam.bias_force(base, full, still, rate)).ravel()[6:]
        expected = (mass @ turn + bias)[THROWING]
        assert np.abs(np.array(function(q, dq, ddq)).ravel() - expected).max() < 1e-9


def test_a_load_adds_its_moment_about_each_joint():
    """By virtual work: its torques are the Jacobian's transpose times force and torque."""
    force = (3.0, -7.0, 0.4)
    free, loaded = torques(), torques(tuple(ca.SX(v) for v in force))
    kinematics = PlanarArm(PANDA)
    q, zero = ca.SX.sym("q", 3), ca.SX.zeros(3)
    pose = ca.vertcat(*kinematics.motion_of(*map(kinematics.link_angles, (q, zero, zero)))[0])
    jacobian = ca.Function("jacobian", [q], [ca.jacobian(pose, q)])
    for start, rate, turn in states(5):
        added = np.array(loaded(start, rate, turn)) - np.array(free(start, rate, turn))
        expected = np.array(jacobian(start)).T @ np.array(force)
        assert np.abs(added.ravel() - expected).max() < 1e-12
