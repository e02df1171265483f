"""A serial arm: its chain, limits and masses; forward kinematics in CasADi."""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca

Vector = tuple[float, ...]
Point = tuple[float, float, float]


@dataclass(frozen=True)
class DHRow:
    """One joint, modified (Craig) convention: a, alpha before the joint, d along it."""

    a: float
    d: float
    alpha: float

    def placed(self) -> ca.SX:
        """4x4: Rot_x(alpha) Trans_x(a) Trans_z(d), the joint's frame at angle 0."""
        cos, sin = _exact(math.cos(self.alpha)), _exact(math.sin(self.alpha))
        rows: list[list[float]] = [
            [1, 0, 0, self.a],
            [0, cos, -sin, -sin * self.d],
            [0, sin, cos, cos * self.d],
            [0, 0, 0, 1],
        ]
        return ca.sparsify(ca.SX(ca.DM(rows)))


@dataclass(frozen=True)
class JointFrame:
    """One joint as URDF places it, turned so that it turns about its z axis.

    xyz [m] and rpy [rad] (about the fixed x, y, z axes in turn) from the frame before, at
    angle 0.
    """

    xyz: Point
    rpy: Point = (0.0, 0.0, 0.0)

    def placed(self) -> ca.SX:
        """4x4: the joint's frame at angle 0."""
        return placement(self.xyz, self.rpy)


@dataclass(frozen=True)
class LinkInertia:
    """A link's mass [kg], CoM [m] and inertia about it [kg m^2], in its joint's frame.

    inertia: xx, xy, xz, yy, yz, zz.
    """

    mass: float
    com: Point
    inertia: tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class Tool:
    """From the last joint to the pads, and the hand's body behind them.

    xyz [m], rpy [rad]: how the mount lies in the last joint's frame; flange [m] along its
    z axis, rotation [rad] about it, tcp [m] from the flange to the centre of the pads.
    The palm is the rectangle from `palm_back` to `palm_front` behind the pads' centre,
    `palm_half_width` to either side in the throwing plane.
    """

    flange: float
    rotation: float
    tcp: float
    palm_back: float
    palm_front: float
    palm_half_width: float
    xyz: Point = (0.0, 0.0, 0.0)
    rpy: Point = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Slowing:
    """Velocity limits that fall towards the ends of a joint's range, per joint.

    The velocity is at most sqrt(2 deceleration (upper - q)) - offset, and at least the
    same with the other sign and q - lower. deceleration [rad/s^2], offset [rad/s], upper
    and lower [rad]. Franka Research 3 has such limits.
    """

    deceleration: Vector
    offset: Vector
    upper: Vector
    lower: Vector


@dataclass(frozen=True)
class JointLimits:
    """Limits per joint: position [rad], velocity [rad/s], acceleration, jerk, torque [N m].

    slowing: None for an arm whose velocity limits are the same everywhere.
    """

    position_min: Vector
    position_max: Vector
    velocity: Vector
    acceleration: Vector
    jerk: Vector
    torque: Vector
    slowing: Slowing | None = None


@dataclass(frozen=True)
class Arm:
    """A serial arm with rotary joints. Joint numbers count from 1, as on the robot.

    links: of each joint, then of the hand in the flange's frame (turned by the tool's
    rotation); empty where masses are not known.
    """

    name: str
    description: str
    chain: tuple[DHRow | JointFrame, ...]
    tool: Tool
    limits: JointLimits
    azimuth_joint: int
    throwing_joints: tuple[int, ...]
    posture: Vector
    links: tuple[LinkInertia, ...] = ()

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.chain)

    def frames(self, q: ca.SX) -> list[ca.SX]:
        """4x4 poses in the base frame after each joint, then of the flange and the TCP."""
        transform = ca.SX.eye(4)
        poses = []
        for i, joint in enumerate(self.chain):
            transform = transform @ joint.placed() @ _screw(q[i], 0.0)
            poses.append(transform)
        mount = transform @ placement(self.tool.xyz, self.tool.rpy)
        flange = mount @ _screw(0.0, self.tool.flange)
        tcp = flange @ _screw(self.tool.rotation, self.tool.tcp)
        return [*poses, flange, tcp]


def placement(xyz: Point, rpy: Point) -> ca.SX:
    """4x4 pose of a frame at xyz, turned by rpy about the fixed x, y, z axes in turn."""
    (cr, sr), (cp, sp), (cy, sy) = ((_exact(math.cos(a)), _exact(math.sin(a))) for a in rpy)
    rows: list[list[float]] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
        [-sp, cp * sr, cp * cr, xyz[2]],
        [0.0, 0.0, 0.0, 1.0],
    ]
    return ca.sparsify(ca.SX(ca.DM([[_exact(value) for value in row] for row in rows])))


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
