"""A serial arm as data: chain, tool, limits, masses, shapes; its frames in CasADi."""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from dataclasses import MISSING, dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ..body import Array

Vector = tuple[float, ...]
Point = tuple[float, float, float]


def described(meaning: str, default: Any = MISSING, **limits: float) -> Any:
    """A field with its unit, meaning and limits in arm data files."""
    return field(default=default, metadata={"meaning": meaning} | limits)


@dataclass(frozen=True)
class DHRow:
    """One joint, modified (Craig) convention: a, alpha before the joint, d along it."""

    a: float = described("m, before the joint")
    d: float = described("m, along it")
    alpha: float = described("rad, before the joint")

    def placed(self) -> ca.SX:
        """4x4: Rot_x(alpha) Trans_x(a) Trans_z(d), the joint's frame at angle 0."""
        cos, sin = exact(math.cos(self.alpha)), exact(math.sin(self.alpha))
        return placement((self.a, -sin * self.d, cos * self.d), (self.alpha, 0.0, 0.0))


@dataclass(frozen=True)
class JointFrame:
    """One joint as URDF places it, in a frame whose z is the joint's axis."""

    xyz: Point = described("m, in the frame before it, at angle 0")
    rpy: Point = described("rad, about the fixed x, y and z axes in turn", (0.0, 0.0, 0.0))

    def placed(self) -> ca.SX:
        """4x4: the joint's frame at angle 0."""
        return placement(self.xyz, self.rpy)


@dataclass(frozen=True)
class LinkInertia:
    """A link's mass [kg], CoM [m] and inertia about it [kg m^2], in its joint's frame."""

    mass: float = described("kg", least=0)
    com: Point = described("m, in the joint's frame")
    inertia: tuple[float, float, float, float, float, float] = described(
        "kg m² about the CoM: xx, xy, xz, yy, yz, zz"
    )


@dataclass(frozen=True)
class LinkCapsule:
    """All points within `radius` of a segment: a link's shape for collisions, or a part of it."""

    link: int = described("number of the joint that moves it; 0: the base, joints + 1: the hand")
    begin: Point = described("m, in that joint's frame; of the hand as in [[links]]")
    end: Point = described("m, in the same frame")
    radius: float = described("m", above=0)
    beside: bool = described(
        "whether it stands beside the arm, as a second arm that is held still: links next to the "
        "base keep off it, too",
        False,
    )


@dataclass(frozen=True)
class CapsuleOverlap:
    """How deep two capsules may overlap where the links in them do not meet."""

    capsules: tuple[int, int] = described(
        "two of [[capsules]], counted from 1, the lower one first"
    )
    depth: float = described("m, a deeper overlap is a contact", least=0)


@dataclass(frozen=True)
class Tool:
    """From the last joint to the pads, and the hand's body behind them.

    The palm is the rectangle from `palm_back` to `palm_front` behind the pads' centre,
    `palm_half_width` to either side in the throwing plane.
    """

    flange: float = described("m, along the mount's z axis to the flange")
    rotation: float = described("rad, about it")
    tcp: float = described("m, from the flange to the pads' centre")
    palm_back: float = described("m, the hand's body behind the pads' centre: from here")
    palm_front: float = described("m, to here")
    palm_half_width: float = described("m, half its thickness in the throwing plane", least=0)
    open_width: float = described("m, gap of the open pads", 0.08, above=0)
    xyz: Point = described("m, the mount in the last joint's frame", (0.0, 0.0, 0.0))
    rpy: Point = described("rad, rotation of the mount in the last joint's frame", (0.0, 0.0, 0.0))

    @property
    def has_palm(self) -> bool:
        """Whether the hand has a palm, which has a width above 0."""
        return self.palm_half_width > 0.0


@dataclass(frozen=True)
class Slowing:
    """Velocity limits that fall towards the ends of a joint's range, per joint.

    The velocity is at least the negative of its upper limit, with q - lower. Franka Research 3
    has such limits.
    """

    deceleration: Vector = described("rad/s²", above=0)
    offset: Vector = described(
        "rad/s: the velocity is at most √(2·deceleration·(upper − q)) − offset"
    )
    upper: Vector = described("rad, near the upper end of the range")
    lower: Vector = described("rad, the same at the lower end")


@dataclass(frozen=True)
class JointLimits:
    """Limits per joint: position [rad], velocity [rad/s], acceleration, jerk, torque [N m].

    torque_rate [N m/s], torque_margin (share of `torque`) and tool_speed [m/s] are what the maker
    recommends; None without a recommendation. slowing: None for constant velocity limits.
    """

    position_min: Vector = described("rad, lower end of the range")
    position_max: Vector = described("rad, upper end")
    velocity: Vector = described("rad/s", above=0)
    acceleration: Vector = described("rad/s²", above=0)
    jerk: Vector = described("rad/s³", above=0)
    torque: Vector = described("N m", above=0)
    torque_rate: float | None = described(
        "N m/s, of any joint's torque; a scene's [torque] rate replaces it", None, above=0
    )
    torque_margin: float | None = described(
        "share of `torque` that plans leave; a scene's [torque] margin replaces it; left out: 0.1",
        None,
        least=0,
        below=0.9,
    )
    tool_speed: float | None = described(
        "m/s, of flange and pads' centre; a scene's [robot] tool_speed replaces it; left out: as "
        "fast as the joints",
        None,
        above=0,
    )
    slowing: Slowing | None = described("section [limits.slowing]", None)


@dataclass(frozen=True)
class Arm:
    """A serial arm with rotary joints. Joint numbers count from 1, as on the robot.

    links: of each joint, then of the hand in the flange's frame (turned by the tool's
    rotation); empty where masses are not known.
    """

    name: str = described("name of the arm")
    description: str = described("one line")
    chain: tuple[DHRow | JointFrame, ...] = described("a joint's frame each")
    tool: Tool = described("section [tool]")
    limits: JointLimits = described("section [limits]")
    azimuth_joint: int = described("turns the throw's vertical plane about the base's z axis")
    throwing_joints: tuple[int, ...] = described("move in that plane")
    posture: Vector = described(
        "rad, fixed angles of the other joints; of the azimuth joint, its angle for a throw along x"
    )
    links: tuple[LinkInertia, ...] = described(
        "masses, a table per joint and one for the hand, see [[links]]", ()
    )
    capsules: tuple[LinkCapsule, ...] = described(
        "shapes of the links, see [[capsules]]; left out: collisions of the arm are not checked", ()
    )
    overlaps: tuple[CapsuleOverlap, ...] = described(
        "how deep capsules may overlap, see [[overlaps]]; of others by how often they do", ()
    )
    joint_names: tuple[str, ...] = described(
        "the joints' names in ROS; left out: NAME_joint1 and so on", ()
    )
    hand: str | None = described(
        "name of the hand that [tool], [[links]] and [[capsules]] include: a scene's "
        "[gripper] file is refused; left out: there is none, or a gripper may take its place",
        None,
    )
    hand_links: tuple[str, ...] = described(
        "links of the URDF that are the hand in [[links]] and [[capsules]]: a scene's [gripper] "
        "file takes their place",
        (),
    )
    assumed: tuple[str, ...] = described(
        "keys of [limits] whose values neither maker nor measurement gives; plans name them", ()
    )
    notes: tuple[str, ...] = described("sentences that plans with this arm repeat", ())

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.chain)

    @functools.cached_property
    def _plane(self) -> tuple[float, float]:
        """y [m] of the pads' centre in the posture, and z of the azimuth joint's axis."""
        frames = self.placed(self.posture)
        lateral, up = np.round([frames[-1][1, 3], frames[self.azimuth_joint - 1][2, 2]], 12) + 0.0
        return float(lateral), float(up)

    @property
    def lateral(self) -> float:
        """Distance [m] of the throwing plane from the base's z axis, to the left of a throw."""
        return self._plane[0]

    def azimuth_angle(self, azimuth: float) -> float:
        """The azimuth joint's angle [rad] that turns the plane by `azimuth` [rad] from x to y.

        Among angles that differ by whole turns it prefers one inside the limits.
        """
        joint = self.azimuth_joint - 1
        angle = self.posture[joint] + self._plane[1] * azimuth
        low, high = self.limits.position_min[joint], self.limits.position_max[joint]
        turns = (angle, angle - 2 * math.pi, angle + 2 * math.pi)
        return next((turn for turn in turns if low <= turn <= high), angle)

    def azimuth_at(self, angle: float) -> float:
        """The plane's azimuth [rad], from x to y, at the azimuth joint's angle [rad]."""
        return (angle - self.posture[self.azimuth_joint - 1]) / self._plane[1]

    def frames(self, q: ca.SX) -> list[ca.SX]:
        """4x4 poses in the base frame after each joint, then of the flange and the TCP."""
        transform = ca.SX.eye(4)
        poses = []
        for i, joint in enumerate(self.chain):
            transform = transform @ joint.placed() @ screw(q[i], 0.0)
            poses.append(transform)
        mount = transform @ placement(self.tool.xyz, self.tool.rpy)
        flange = mount @ screw(0.0, self.tool.flange)
        tcp = flange @ screw(self.tool.rotation, self.tool.tcp)
        return [*poses, flange, tcp]

    def placed(self, q: Sequence[float]) -> list[Array]:
        """`frames` as numbers, at joint angles q [rad]."""
        return [np.array(ca.evalf(pose)) for pose in self.frames(ca.SX(ca.DM(list(q))))]


def placement(xyz: tuple[float, float, float], rpy: tuple[float, float, float]) -> ca.SX:
    """4x4 pose of a frame at xyz, turned by rpy about the fixed x, y, z axes in turn."""
    (cr, sr), (cp, sp), (cy, sy) = ((exact(math.cos(a)), exact(math.sin(a))) for a in rpy)
    rows: list[list[float]] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, xyz[0]],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, xyz[1]],
        [-sp, cp * sr, cp * cr, xyz[2]],
        [0.0, 0.0, 0.0, 1.0],
    ]
    return ca.sparsify(ca.SX(ca.DM([[exact(value) for value in row] for row in rows])))


def screw(angle: ca.SX | float, distance: float) -> ca.SX:
    """Rot_z(angle) Trans_z(distance)."""
    if isinstance(angle, ca.SX):
        cos, sin = ca.cos(angle), ca.sin(angle)
    else:
        cos, sin = ca.SX(exact(math.cos(angle))), ca.SX(exact(math.sin(angle)))
    pose = ca.SX(4, 4)
    pose[0, 0], pose[0, 1], pose[1, 0], pose[1, 1] = cos, -sin, sin, cos
    pose[2, 2], pose[3, 3] = 1, 1
    if distance:
        pose[2, 3] = distance
    return pose


def exact(value: float) -> float:
    """Rounds tiny values to zero: with cos(pi/2) = 6e-17 a planar chain would not be planar."""
    return 0.0 if abs(value) < 1e-15 else value
