"""Forward kinematics of a serial arm in CasADi, from Denavit-Hartenberg rows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca

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
    rows: list[list[float]] = [
        [1, 0, 0, row.a],
        [0, cos_alpha, -sin_alpha, 0],
        [0, sin_alpha, cos_alpha, 0],
        [0, 0, 0, 1],
    ]
    return ca.sparsify(ca.SX(ca.DM(rows))) @ _screw(q, row.d)


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
