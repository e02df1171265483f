"""The planar motion of an arm's hand, and of a hand without an arm, for arrays and CasADi.

The torques come from the mass, centre of mass and moment of inertia of each body: Newton and Euler
about each joint's axis.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...core import Structure, library
from ..backend import Value, backend, components
from ..body import Array, read_only
from .arm import Arm, LinkInertia

#: Values of a link or a joint.
Row = Sequence[Value]


def turned_by(link: Row, cos: Value, sin: Value) -> Row:
    """A vector (x, z) [m] turned by an angle with this cosine and sine."""
    return link[0] * cos - link[1] * sin, link[0] * sin + link[1] * cos


def link_end(joint: Row, link: Row, turned: Row) -> Row:
    """The end of a link from its joint: x and z, their rates, their accelerations.

    link (x, z) [m]: from joint to end with all joints at 0; turned: its angle, rate, acceleration.
    """
    x, z, v_x, v_z, a_x, a_z = joint
    phi, rate, turn = turned
    xp = backend(phi)
    along, up = turned_by(link, xp.cos(phi), xp.sin(phi))
    return (
        x + along,
        z + up,
        v_x - rate * up,
        v_z + rate * along,
        a_x - turn * up - rate * rate * along,
        a_z + turn * along - rate * rate * up,
    )


def flange_velocity(tcp: Value, theta: Value, twist: Value) -> Row:
    """(x, z) [m/s] of the flange, `tcp` [m] behind the pads, of a hand's angle and twist."""
    xp, turning = backend(theta), tcp * twist[2]
    return twist[0] + turning * xp.sin(theta), twist[1] - turning * xp.cos(theta)


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
        for count, most, what in (
            (self.coordinates, library().AXES, "throwing joints"),
            (arm.joints, library().FRAMES - 1, "joints"),
        ):
            if count > most:
                raise ValueError(f"arm {arm.name}: has {count} {what}, at most {most} are allowed")
        for joint in self.throwing_joints:
            if not 1 <= joint <= arm.joints:
                raise ValueError(f"arm {arm.name}: has no joint {joint}")
        self._chain()

    def link_angles(self, q: Value) -> list[Value]:
        """Angle of each link in the plane: the sum of the joints before it."""
        angles = [self.signs[0] * q[0]]
        for i, sign in enumerate(self.signs[1:], start=1):
            angles.append(angles[-1] + sign * q[i])
        return angles

    def motion_of(
        self, angles: list[Value], rates: list[Value], turns: list[Value]
    ) -> tuple[list[Value], list[Value], list[Value]]:
        """Pose (x, z, theta), twist and acceleration of the pads' centre, from `link_angles`."""
        joint: Row = (*self.origin, 0.0, 0.0, 0.0, 0.0)
        for link, *turned in zip(self.links, angles, rates, turns, strict=True):
            joint = link_end(joint, link, turned)
        x, z, v_x, v_z, a_x, a_z = joint
        return ([x, z, self.theta + angles[-1]], [v_x, v_z, rates[-1]], [a_x, a_z, turns[-1]])

    def link_starts(self, angles: Sequence[Value]) -> list[tuple[Value, Value, Value, Value]]:
        """x, z [m] of each link's joint, and cosine and sine of the link's angle."""
        x, z = self.origin
        starts: list[tuple[Value, Value, Value, Value]] = []
        for (along, up), phi in zip(self.links, angles, strict=True):
            xp = backend(phi)
            cos, sin = xp.cos(phi), xp.sin(phi)
            starts.append((x, z, cos, sin))
            x, z = x + along * cos - up * sin, z + along * sin + up * cos
        return starts

    def heights(self, angles: list[Value]) -> list[Value]:
        """Heights [m] of the joint frames and the flange that move in the plane.

        From `link_angles`. Frames at one place count once; the TCP is left out.
        """
        starts = self.link_starts(angles)
        return [
            starts[link][1] + along * starts[link][3] + up * starts[link][2]
            for link, (along, up) in self.frames
        ]

    @functools.cached_property
    def core(self) -> Structure:
        """The arm for the compiled core."""
        (x, z), frames = self.origin, len(self.frames)
        linkage = Structure("linkage", n=self.coordinates, arm=1, frames=frames, theta=self.theta)
        linkage.attach(x=x, z=z, sign=self.signs)
        linkage.along, linkage.up = zip(*self.links, strict=True)
        linkage.link = [number for number, _ in self.frames]
        for k, (_, place) in enumerate(self.frames):
            linkage.frame_along[k], linkage.frame_up[k] = place
        return linkage

    def moved_by(self, joint: int) -> int:
        """Number, from 0, of the link that moves a joint's frame (0: the base's); -1 for none."""
        return sum(throwing <= joint for throwing in self.throwing_joints) - 1

    def placed(self, q: Array) -> list[Array]:
        """`Arm.placed` at azimuth 0, at the throwing joints' `q`."""
        return self.arm.placed(self.all_joints(q).tolist())

    def all_joints(self, q: Array, azimuth: float = 0.0) -> Array:
        """The angles (..., joints) of all joints at the throwing joints' `q` (..., n), in the plane
        at `azimuth` [rad]."""
        joints = np.tile(self.arm.posture, (*q.shape[:-1], 1))
        joints[..., self.arm.azimuth_joint - 1] = self.arm.azimuth_angle(azimuth)
        joints[..., [joint - 1 for joint in self.throwing_joints]] = q
        return joints

    @functools.cached_property
    def rest_frames(self) -> list[Array]:
        """4x4 poses with all coordinates 0: of each joint, then of the hand as in `Arm.links`."""
        *frames, flange, hand = self.placed(np.zeros(self.coordinates))
        hand[:3, 3] = flange[:3, 3]
        return [*map(read_only, (*frames, hand))]

    def _chain(self) -> None:
        """The planar chain behind the Denavit-Hartenberg rows.

        Each throwing joint turns everything after it by +-q about the plane's normal, so
        the hand is at origin + sum of links, each a constant vector turned by the sum of
        the angles before it: far fewer operations than the chain of 4x4 matrices. The
        vectors are read off the full kinematics and checked against it.
        """
        frames = self.placed(np.zeros(self.coordinates))
        joints = [frames[joint - 1] for joint in self.throwing_joints]
        # A rotation from +x to +z is about -y.
        self.signs = [float(np.round(-joint[1, 2])) for joint in joints]
        places = np.array([frame[[0, 2], 3] for frame in (*joints, frames[-1])])
        self.origin = (float(places[0, 0]), float(places[0, 1]))
        self.links = [(float(dx), float(dz)) for dx, dz in np.diff(places, axis=0)]
        self.theta = math.atan2(frames[-1][2, 2], frames[-1][0, 2])
        # Link, and place from the link's joint, of each frame that moves, without the TCP. Frames
        # at one place count once, and one at the joint itself belongs to the link before.
        moving: dict[tuple[int, tuple[float, float]], None] = {}
        for k, frame in enumerate(frames[:-1]):
            if (link := self.moved_by(k)) >= 0:
                along, up = np.round(frame[[0, 2], 3] - places[link], 12) + 0.0
                if (along, up) != (0.0, 0.0):
                    moving[link, (float(along), float(up))] = None
        self.frames = list(moving)
        self._verify()

    def _verify(self) -> None:
        """ValueError unless the planar chain is the arm's own kinematics."""
        zero = np.zeros(self.coordinates)
        for value in np.random.default_rng(0).uniform(-2, 2, (4, self.coordinates)):
            x, z, theta = self.motion_of(*map(self.link_angles, (value, zero, zero)))[0]
            frames = self.placed(value)
            axes = np.array([frames[joint - 1][1, 2] for joint in self.throwing_joints])
            expected = [[math.cos(theta), x], [0.0, self.arm.lateral], [math.sin(theta), z]]
            off = np.abs(frames[-1][:3, 2:] - expected).max()
            if off > 1e-9 or np.abs(np.abs(axes) - 1.0).max() > 1e-9:
                raise ValueError(
                    f"arm {self.arm.name}: joints {list(self.throwing_joints)} do not move the "
                    "hand in the vertical plane of the azimuth joint"
                )


class PlanarHand:
    """A hand that moves by itself in the plane: coordinates (x, z) or (x, z, theta)."""

    def __init__(self, turns: bool, theta: float = 0.0) -> None:
        self.coordinates = 3 if turns else 2
        self.theta = theta
        self.core = Structure("linkage", n=self.coordinates, theta=theta)

    def link_angles(self, q: Value) -> list[Value]:
        """The coordinates themselves."""
        return list(components(q))

    def motion_of(
        self, q: list[Value], dq: list[Value], ddq: list[Value]
    ) -> tuple[list[Value], list[Value], list[Value]]:
        """Pose (x, z, theta), twist and acceleration; theta is constant without a coordinate."""
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
        for rows in kinematics.motion_of(*map(kinematics.link_angles, given))
    ]


# Torques.


@dataclass(frozen=True)
class PlanarBody:
    """What one throwing joint carries up to the next: mass [kg], CoM (along, up) [m] from the
    joint with all throwing joints at 0, inertia [kg m^2] about it and the plane's normal.
    """

    mass: Value
    com: tuple[Value, Value]
    inertia: Value

    def push(self, joint: Row, turned: Row, gravity: Value) -> Row:
        """Force (x, z) [N] and torque about the origin [N m] that move it, as `link_end` has it."""
        x, z, _, _, a_x, a_z = link_end(joint, self.com, turned)
        f_x, f_z = self.mass * a_x, self.mass * (a_z + gravity)
        return f_x, f_z, x * f_z - z * f_x + self.inertia * turned[2]


def joint_torque(joint: Row, push: Row) -> Value:
    """Torque [N m] about a joint of what pushes all that it carries."""
    return push[2] - joint[0] * push[1] + joint[1] * push[0]


class PlanarDynamics:
    """Torques of an arm's throwing joints; ValueError for an arm without link masses.

    It neglects friction and rotors of the drives, and the torques of joints that hold the posture.
    """

    def __init__(self, kinematics: PlanarArm) -> None:
        arm = kinematics.arm
        if not arm.links:
            raise ValueError(f"arm {arm.name}: has no link masses ('links' in its data file)")
        self._kinematics = kinematics
        frames = kinematics.rest_frames
        links = list(zip(arm.links, frames, strict=True))
        self.bodies = [
            _composite(
                [link for k, link in enumerate(links, start=1) if kinematics.moved_by(k) == number],
                frames[joint - 1][[0, 2], 3],
            )
            for number, joint in enumerate(kinematics.throwing_joints)
        ]

    def torques(
        self,
        angles: list[Value],
        rates: list[Value],
        turns: list[Value],
        gravity: Value,
        load: tuple[Value, Value, Value] | None = None,
    ) -> list[Value]:
        """Torque [N m] of each throwing joint, in its own sense of turning.

        angles, rates, turns: `PlanarArm.link_angles` of q, dq, ddq. load: force (x, z) [N] and
        torque [N m] about the pads' centre that the hand gives to what it holds.
        """
        joint: Row = (0.0,) * 6
        joints, pushes = [], []
        for body, link, *turned in zip(
            self.bodies, self._kinematics.links, angles, rates, turns, strict=True
        ):
            joints.append(joint)
            pushes.append(body.push(joint, turned, gravity))
            joint = link_end(joint, link, turned)
        total: Row = (0.0, 0.0, 0.0)
        if load is not None:
            total = load[0], load[1], load[2] + joint[0] * load[1] - joint[1] * load[0]
        joint_torques = []
        for sign, joint, push in zip(
            reversed(self._kinematics.signs), reversed(joints), reversed(pushes), strict=True
        ):
            total = total[0] + push[0], total[1] + push[1], total[2] + push[2]
            joint_torques.append(sign * joint_torque(joint, total))
        return joint_torques[::-1]


def _composite(parts: list[tuple[LinkInertia, Array]], joint: Array) -> PlanarBody:
    """Links at their 4x4 poses as one body, seen from `joint` (x, z)."""
    masses = np.array([link.mass for link, _ in parts])
    coms = np.array([(pose @ [*link.com, 1.0])[[0, 2]] for link, pose in parts])
    mass = float(masses.sum())
    centre = masses @ coms / mass if mass > 0 else joint
    about = 0.0
    for (link, pose), com in zip(parts, coms, strict=True):
        xx, xy, xz, yy, yz, zz = link.inertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        normal = pose[1, :3]
        about += float(normal @ tensor @ normal + link.mass * ((com - centre) ** 2).sum())
    along, up = centre - joint
    return PlanarBody(mass, (float(along), float(up)), about)
