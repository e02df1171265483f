"""A serial arm and the planar motion of its hand, in CasADi: chain, limits, masses, kinematics."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import MISSING, dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from ..core import AXES, FRAMES, LinkageC
from .body import Array, Value, backend, components, exact, placement, screw

Vector = tuple[float, ...]
Point = tuple[float, float, float]


def described(meaning: str, default: Any = MISSING, **limits: float) -> Any:
    """A field, with what arm data files say of it: unit and meaning, and its limits."""
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
    """One joint as URDF places it, turned so that it turns about its z axis."""

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
    """All points within `radius` of a segment: a link as its maker publishes it for collisions."""

    link: int = described("number of the joint that moves it; 0: the base, joints + 1: the hand")
    begin: Point = described("m, in that joint's frame; of the hand as in [[links]]")
    end: Point = described("m, the same")
    radius: float = described("m", above=0)


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
    palm_half_width: float = described("m, half its thickness in the throwing plane")
    xyz: Point = described("m, the mount in the last joint's frame", (0.0, 0.0, 0.0))
    rpy: Point = described("rad, the same", (0.0, 0.0, 0.0))


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

    torque_rate [N m/s]: None where it is not known. tool_speed [m/s]: None for an arm whose tool
    may be as fast as its joints. slowing: None for one whose velocity limits are the same
    everywhere.
    """

    position_min: Vector = described("rad, lower end of the range")
    position_max: Vector = described("rad, upper end")
    velocity: Vector = described("rad/s", above=0)
    acceleration: Vector = described("rad/s²", above=0)
    jerk: Vector = described("rad/s³", above=0)
    torque: Vector = described("N m", above=0)
    torque_rate: Vector | None = described("N m/s; reported, not kept", None, above=0)
    tool_speed: float | None = described(
        "m/s, of flange and pads' centre; left out: as fast as the joints", None, above=0
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
        "rad, what the other joints keep; of the azimuth joint, where the throw goes along x"
    )
    links: tuple[LinkInertia, ...] = described(
        "masses, a table per joint and one for the hand, see [[links]]", ()
    )
    capsules: tuple[LinkCapsule, ...] = described(
        "shapes of the links, see [[capsules]]; left out: the arm meets nothing", ()
    )
    joint_names: tuple[str, ...] = described(
        "the joints' names in ROS; left out: NAME_joint1 and so on", ()
    )
    cover: float = described("m, how far the links' covers stick out of `capsules`", 0.0, least=0)

    @property
    def joints(self) -> int:
        """Number of joints."""
        return len(self.chain)

    @functools.cached_property
    def _plane(self) -> tuple[float, float]:
        """y [m] of the pads' centre in the posture, and z of the azimuth joint's axis."""
        frames = [np.array(ca.evalf(pose)) for pose in self.frames(ca.SX(ca.DM(self.posture)))]
        lateral, up = np.round([frames[-1][1, 3], frames[self.azimuth_joint - 1][2, 2]], 12) + 0.0
        return float(lateral), float(up)

    @property
    def lateral(self) -> float:
        """How far [m] the throwing plane is beside the base's z axis, to the left of a throw."""
        return self._plane[0]

    def azimuth_angle(self, azimuth: float) -> float:
        """The azimuth joint's angle [rad] that turns the plane by `azimuth` [rad] from x to y.

        Of those that are whole turns apart, one within the limits where there is any.
        """
        joint = self.azimuth_joint - 1
        angle = self.posture[joint] + self._plane[1] * azimuth
        low, high = self.limits.position_min[joint], self.limits.position_max[joint]
        turns = (angle, angle - 2 * math.pi, angle + 2 * math.pi)
        return next((turn for turn in turns if low <= turn <= high), angle)

    def azimuth_at(self, angle: float) -> float:
        """How far [rad] the plane is turned from x to y at the azimuth joint's angle [rad]."""
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


class PlanarArm:
    """The hand of an arm that throws in a vertical plane.

    The azimuth joint turns the plane about the base's z axis, beside which it lies by the arm's
    `lateral`; the throwing joints move in it, and the others keep the arm's posture. Coordinates q
    are the throwing joints [rad]; the hand angle is that of the approach axis in the plane,
    unwrapped.
    """

    def __init__(self, arm: Arm, throwing_joints: Sequence[int] | None = None) -> None:
        self.arm = arm
        self.throwing_joints = tuple(throwing_joints or arm.throwing_joints)
        self.coordinates = len(self.throwing_joints)
        for joint in self.throwing_joints:
            if not 1 <= joint <= arm.joints:
                raise ValueError(f"arm {arm.name}: has no joint {joint}")
        self._chain()

    def full(self, q: ca.SX) -> ca.SX:
        """All joint angles at azimuth 0 for the throwing joints' `q`."""
        joints = ca.SX(ca.DM(list(self.arm.posture)))
        for i, joint in enumerate(self.throwing_joints):
            joints[joint - 1] = q[i]
        return joints

    def turned(self, q: Value) -> list[Value]:
        """How far each link is turned in the plane: sums of the joints before it."""
        angles = [self.signs[0] * q[0]]
        for i, sign in enumerate(self.signs[1:], start=1):
            angles.append(angles[-1] + sign * q[i])
        return angles

    def motion(
        self, q: Value, dq: Value, ddq: Value
    ) -> tuple[list[Value], list[Value], list[Value]]:
        """Pose (x, z, theta), twist and acceleration of the pads' centre in the plane."""
        return self.motion_of(self.turned(q), self.turned(dq), self.turned(ddq))

    def motion_of(
        self, angles: list[Value], rates: list[Value], turns: list[Value]
    ) -> tuple[list[Value], list[Value], list[Value]]:
        """The same from `turned` values: each link's share depends on its own three only."""
        pose: list[Value] = [*self.origin, self.theta]
        twist: list[Value] = [0.0, 0.0, 0.0]
        acceleration: list[Value] = [0.0, 0.0, 0.0]
        for i, (phi, rate, turn) in enumerate(zip(angles, rates, turns, strict=True)):
            xp = backend(phi)
            cos, sin = xp.cos(phi), xp.sin(phi)
            length_x, length_z = self.links[i]
            x, z = length_x * cos - length_z * sin, length_x * sin + length_z * cos
            pose[0], pose[1] = pose[0] + x, pose[1] + z
            twist[0], twist[1] = twist[0] - rate * z, twist[1] + rate * x
            acceleration[0] = acceleration[0] - turn * z - rate * rate * x
            acceleration[1] = acceleration[1] + turn * x - rate * rate * z
        pose[2], twist[2], acceleration[2] = pose[2] + angles[-1], rates[-1], turns[-1]
        return pose, twist, acceleration

    def heights(self, angles: list[Value]) -> list[Value]:
        """Heights [m] of the joint frames and the flange that move in the plane.

        From `turned` values. Frames at one place count once; the TCP is left out.
        """
        found = []
        xp = backend(*angles)
        for link, place in self.frames:
            z: Value = self.origin[1]
            for phi, (along, up) in zip(angles, [*self.links[:link], place], strict=False):
                z = z + along * xp.sin(phi) + up * xp.cos(phi)
            found.append(z)
        return found

    @functools.cached_property
    def core(self) -> LinkageC | None:
        """The arm as the compiled core takes it; None for one with too many joints."""
        if self.coordinates > AXES or len(self.frames) > FRAMES:
            return None
        found = LinkageC(self.coordinates, 1, len(self.frames), *self.origin, self.theta)
        found.sign[: self.coordinates] = self.signs
        for i, link in enumerate(self.links):
            found.along[i], found.up[i] = link
        for k, (number, place) in enumerate(self.frames):
            found.link[k] = number
            found.frame_along[k], found.frame_up[k] = place
        return found

    def points(self, q: ca.SX) -> ca.SX:
        """2 x n points (x, z) of the arm in the plane: joint frames, flange and TCP."""
        frames = self.arm.frames(self.full(q))
        return ca.horzcat(*[ca.vertcat(f[0, 3], f[2, 3]) for f in frames])

    def _chain(self) -> None:
        """The planar chain behind the Denavit-Hartenberg rows.

        Each throwing joint turns everything after it by +-q about the plane's normal, so
        the hand is at origin + sum of links, each a constant vector turned by the sum of
        the angles before it: far fewer operations than the chain of 4x4 matrices. The
        vectors are read off the full kinematics and checked against it.
        """
        q = ca.SX.sym("q", self.coordinates)
        frames = self.arm.frames(self.full(q))
        axes = ca.horzcat(*[frames[j - 1][:3, 2] for j in self.throwing_joints])
        joints = ca.horzcat(*[frames[j - 1][:3, 3] for j in self.throwing_joints])
        full = ca.Function("full", [q], [axes, joints, frames[-1][:3, 3], frames[-1][:3, 2]])
        axis, position, tcp, approach = (np.array(o) for o in full(np.zeros(self.coordinates)))
        # Turning from +x to +z is a turn about -y.
        self.signs = [float(s) for s in np.round(-axis[1])]
        points = np.column_stack([position, tcp])[[0, 2]]
        self.origin = (float(points[0, 0]), float(points[1, 0]))
        self.links = [(float(dx), float(dz)) for dx, dz in np.diff(points).T]
        self.theta = math.atan2(approach[2, 0], approach[0, 0])
        still = np.array(ca.evalf(self.points(ca.SX(self.coordinates, 1))))
        self.frames = self._frames_of(still, points)
        self._verify(full)

    def _frames_of(self, places: Array, joints: Array) -> list[tuple[int, tuple[float, float]]]:
        """(link, its place from the link's joint at rest) of each frame that moves, TCP left out.

        places (2, frames), joints (2, links + 1): at q = 0. Frame k is that of joint k + 1
        and is moved by the joints up to k.
        """
        found: list[tuple[int, tuple[float, float]]] = []
        for k in range(places.shape[1] - 1):
            link = sum(joint <= k for joint in self.throwing_joints) - 1
            if link < 0:
                continue
            along, up = np.round(places[:, k] - joints[:, link], 12) + 0.0
            # At the joint itself: the link before has that place.
            if (along, up) != (0.0, 0.0):
                found.append((link, (float(along), float(up))))
        return list(dict.fromkeys(found))

    def _verify(self, full: ca.Function) -> None:
        """ValueError unless the planar chain is the arm's own kinematics."""
        q, zero = ca.SX.sym("q", self.coordinates), ca.SX.zeros(self.coordinates)
        planar = ca.Function("planar", [q], [ca.vertcat(*self.motion(q, zero, zero)[0])])
        for value in np.random.default_rng(0).uniform(-2, 2, (4, self.coordinates)):
            x, z, theta = np.array(planar(value)).ravel()
            axis, _, tcp, approach = (np.array(o) for o in full(value))
            expected = [x, self.arm.lateral, z, math.cos(theta), 0.0, math.sin(theta)]
            off = np.abs(np.vstack([tcp, approach]).ravel() - expected).max()
            if off > 1e-9 or np.abs(np.abs(axis[1]) - 1.0).max() > 1e-9:
                raise ValueError(
                    f"arm {self.arm.name}: joints {list(self.throwing_joints)} do not move the "
                    "hand in the vertical plane of the azimuth joint"
                )


class PlanarHand:
    """A hand that moves by itself in the plane: coordinates (x, z) or (x, z, theta)."""

    def __init__(self, turns: bool, theta: float = 0.0) -> None:
        self.coordinates = 3 if turns else 2
        self.theta = theta
        self.core = LinkageC(self.coordinates, 0, 0, 0.0, 0.0, theta)

    def turned(self, q: Value) -> list[Value]:
        """The coordinates themselves."""
        return list(components(q))

    def motion(
        self, q: Value, dq: Value, ddq: Value
    ) -> tuple[list[Value], list[Value], list[Value]]:
        """Pose (x, z, theta), twist and acceleration; theta fixed where it does not turn."""
        return self.motion_of(self.turned(q), self.turned(dq), self.turned(ddq))

    def motion_of(
        self, q: list[Value], dq: list[Value], ddq: list[Value]
    ) -> tuple[list[Value], list[Value], list[Value]]:
        """The same from lists of scalars."""
        fixed = [] if self.coordinates == 3 else [0.0]
        pose = [self.theta] if fixed else []
        return [*q, *pose], [*dq, *fixed], [*ddq, *fixed]


def hand_motion(kinematics: PlanarArm | PlanarHand) -> Callable[..., list[Array]]:
    """Function of q, dq, ddq, each (n, K): pose, twist, acceleration of the hand, each (3, K)."""
    return functools.partial(_hand_motion, kinematics)


def _hand_motion(kinematics: PlanarArm | PlanarHand, *coordinates: Array) -> list[Array]:
    given = np.broadcast_arrays(*(np.asarray(rows, float) for rows in coordinates))
    # Rows that do not depend on the coordinates are numbers.
    shape = given[0].shape[1:]
    return [
        np.array([np.broadcast_to(row, shape) for row in rows])
        for rows in kinematics.motion(*given)
    ]
