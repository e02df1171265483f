"""Inverse dynamics of an arm that moves in a vertical plane, for arrays and CasADi.

The links between two throwing joints move as one rigid body, and all rotations are about the
plane's normal. The torques of the throwing joints thus depend on mass, CoM and one moment of
inertia of each body: Newton and Euler about each joint's axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from ..body import Array, Value
from .arm import LinkInertia
from .kinematics import PlanarArm, Row, link_end


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
        frames = ca.Function(
            "frames", [], arm.frames(kinematics.full(ca.SX(kinematics.coordinates, 1)))
        )
        poses = [np.array(pose) for pose in frames.call([])]
        hand = poses[-1].copy()
        hand[:3, 3] = poses[-2][:3, 3]
        places = [*poses[: arm.joints], hand]
        joints = np.array([poses[j - 1][[0, 2], 3] for j in kinematics.throwing_joints])
        self.bodies = [
            _composite(
                [
                    (link, place)
                    for k, (link, place) in enumerate(zip(arm.links, places, strict=True))
                    if sum(j - 1 <= k for j in kinematics.throwing_joints) == number + 1
                ],
                joint,
            )
            for number, joint in enumerate(joints)
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
