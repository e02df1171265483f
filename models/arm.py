"""Forward kinematics of a serial arm in CasADi, from Denavit-Hartenberg rows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

Vector = tuple[float, ...]


@dataclass(frozen=True)
class DHRow:
    """One joint, modified (Craig) convention: a, alpha before the joint, d along it."""

    a: float
    d: float
    alpha: float


@dataclass(frozen=True)
class Tool:
    """From the last joint to the pads, and the hand's body behind them.

    flange [m] along the last axis, rotation [rad] about it, tcp [m] from the flange to
    the centre of the pads. The palm is the rectangle from `palm_back` to `palm_front`
    behind the pads' centre, `palm_half_width` to either side in the throwing plane.
    """

    flange: float
    rotation: float
    tcp: float
    palm_back: float
    palm_front: float
    palm_half_width: float


@dataclass(frozen=True)
class JointLimits:
    """Limits per joint: position [rad], velocity [rad/s], acceleration, jerk, torque [N m]."""

    position_min: Vector
    position_max: Vector
    velocity: Vector
    acceleration: Vector
    jerk: Vector
    torque: Vector


@dataclass(frozen=True)
class Arm:
    """A serial arm with rotary joints. Joint numbers count from 1, as on the robot."""

    name: str
    description: str
    dh: tuple[DHRow, ...]
    tool: Tool
    limits: JointLimits
    azimuth_joint: int
    throwing_joints: tuple[int, ...]
    posture: Vector

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.dh)

    def frames(self, q: ca.SX) -> list[ca.SX]:
        """4x4 poses in the base frame after each joint, then of the flange and the TCP."""
        transform = ca.SX.eye(4)
        poses = []
        for i, row in enumerate(self.dh):
            transform = transform @ _dh_transform(row, q[i])
            poses.append(transform)
        flange = transform @ _screw(0.0, self.tool.flange)
        tcp = flange @ _screw(self.tool.rotation, self.tool.tcp)
        return [*poses, flange, tcp]


def _dh_transform(row: DHRow, q: ca.SX) -> ca.SX:
    """Rot_x(alpha) Trans_x(a) Rot_z(q) Trans_z(d)."""
    cos_alpha, sin_alpha = _exact(math.cos(row.alpha)), _exact(math.sin(row.alpha))
    tilt = ca.SX(ca.DM([[1, 0, 0, row.a], [0, cos_alpha, -sin_alpha, 0], [0, sin_alpha, cos_alpha, 0], [0, 0, 0, 1]]))
    return ca.sparsify(tilt) @ _screw(q, row.d)


def _screw(angle: ca.SX | float, distance: float) -> ca.SX:
    """Rot_z(angle) Trans_z(distance)."""
    if isinstance(angle, ca.SX):
        cos, sin = ca.cos(angle), ca.sin(angle)
    else:
        cos, sin = ca.SX(_exact(math.cos(angle))), ca.SX(_exact(math.sin(angle)))
    pose = ca.SX(4, 4)
    pose[0, 0], pose[0, 1], pose[1, 0], pose[1, 1] = cos, -sin, sin, cos
    pose[2, 2], pose[3, 3] = 1, 1
    if distance:
        pose[2, 3] = distance
    return pose


def _exact(value: float) -> float:
    """Zeros as zeros: cos(pi/2) is not 6e-17, so the planar chain stays planar."""
    return 0.0 if abs(value) < 1e-15 else value


class PlanarArm:
    """The hand of an arm that throws in a vertical plane through its base axis.

    The azimuth joint turns the plane, the throwing joints move in it, and the
    others keep the arm's posture. Coordinates q are the throwing joints [rad]; the
    hand angle is that of the approach axis in the plane, unwrapped.
    """

    def __init__(self, arm: Arm, throwing_joints: Sequence[int] | None = None) -> None:
        self.arm = arm
        self.throwing_joints = tuple(throwing_joints or arm.throwing_joints)
        self.coordinates = len(self.throwing_joints)
        self._signs, self._theta_ref = self._plane()

    def full(self, q: ca.SX) -> ca.SX:
        """All joint angles at azimuth 0 for the throwing joints' `q`."""
        joints = ca.SX(ca.DM(list(self.arm.posture)))
        joints[self.arm.azimuth_joint - 1] = 0
        for i, joint in enumerate(self.throwing_joints):
            joints[joint - 1] = q[i]
        return joints

    def pose(self, q: ca.SX) -> ca.SX:
        """(x, z, theta) of the pads' centre in the throwing plane."""
        tcp = self.arm.frames(self.full(q))[-1]
        theta = self._theta_ref + ca.dot(ca.DM(self._signs), q)
        return ca.vertcat(tcp[0, 3], tcp[2, 3], theta)

    def points(self, q: ca.SX) -> ca.SX:
        """2 x n points (x, z) of the arm in the plane: joint frames, flange and TCP."""
        frames = self.arm.frames(self.full(q))
        return ca.horzcat(*[ca.vertcat(f[0, 3], f[2, 3]) for f in frames])

    def _plane(self) -> tuple[list[float], float]:
        """Sign of each throwing joint in theta and the reference angle; checks the plane."""
        q = ca.SX.sym("q", self.coordinates)
        frames = self.arm.frames(self.full(q))
        axes = ca.horzcat(*[frames[j - 1][:3, 2] for j in self.throwing_joints])
        outputs = ca.Function("plane", [q], [axes, frames[-1][:3, 2], frames[-1][1, 3]])
        signs = np.zeros(self.coordinates)
        rng = np.random.default_rng(0)
        reference = 0.0
        for trial in range(4):
            value = rng.uniform(-1, 1, self.coordinates) if trial else np.zeros(self.coordinates)
            axis, approach, offset = (np.array(o) for o in outputs(value))
            # Turning from +x to +z is a turn about -y.
            turn = -axis[1]
            if np.abs(np.abs(turn) - 1).max() > 1e-9 or abs(offset[0, 0]) > 1e-9:
                raise ValueError(
                    f"arm {self.arm.name}: joints {list(self.throwing_joints)} do not move the "
                    "hand in the vertical plane of the azimuth joint"
                )
            if trial == 0:
                signs = np.round(turn)
                reference = math.atan2(approach[2, 0], approach[0, 0])
        return [float(s) for s in signs], reference


class PlanarHand:
    """A hand that moves by itself in the plane: coordinates (x, z) or (x, z, theta)."""

    def __init__(self, turns: bool, theta: float = 0.0) -> None:
        self.coordinates = 3 if turns else 2
        self._theta = theta

    def pose(self, q: ca.SX) -> ca.SX:
        """(x, z, theta) of the pads' centre; theta fixed where the hand does not turn."""
        return q if self.coordinates == 3 else ca.vertcat(q, self._theta)


def hand_motion(kinematics: PlanarArm | PlanarHand) -> ca.Function:
    """Function (q, dq, ddq) -> pose, twist, acceleration of the hand, each (3,)."""
    n = kinematics.coordinates
    q, dq, ddq = (ca.SX.sym(name, n) for name in ("q", "dq", "ddq"))
    pose = kinematics.pose(q)
    twist = ca.jtimes(pose, q, dq)
    acceleration = ca.jtimes(pose, q, ddq) + ca.jtimes(twist, q, dq)
    outputs = ca.cse([ca.simplify(pose), ca.simplify(twist), ca.simplify(acceleration)])
    return ca.Function("hand_motion", [q, dq, ddq], outputs, ["q", "dq", "ddq"], ["pose", "twist", "acceleration"])
