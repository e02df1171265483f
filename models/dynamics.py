"""Inverse dynamics of an arm that moves in a vertical plane, for arrays and CasADi.

The links between two throwing joints move as one rigid body, and all turns are about the
plane's normal, so the torques of the throwing joints need only mass, CoM and one moment of
inertia of each such body: Newton and Euler about each joint's axis.
"""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np

from .body import Array, Value, backend
from .kinematics import LinkInertia, PlanarArm

#: x and z.
Pair = tuple[Value, Value]


@dataclass(frozen=True)
class PlanarBody:
    """What one throwing joint carries up to the next: mass [kg], CoM (along, up) [m] from the
    joint with all throwing joints at 0, inertia [kg m^2] about it and the plane's normal.
    """

    mass: float
    com: tuple[float, float]
    inertia: float


class PlanarDynamics:
    """Torques of an arm's throwing joints; ValueError for an arm without link masses.

    What is left out: friction and rotors of the drives, and the torques of the joints that
    only hold the posture.
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

        angles, rates, turns: `PlanarArm.turned` of q, dq, ddq. load: force (x, z) [N] and
        torque [N m] about the pads' centre that the hand gives to what it holds.
        """
        place: Pair = (0.0, 0.0)
        acceleration: Pair = (0.0, 0.0)
        joints, pushes = [], []
        for body, link, phi, rate, turn in zip(
            self.bodies, self._kinematics.links, angles, rates, turns, strict=True
        ):
            xp = backend(phi)
            cos, sin = xp.cos(phi), xp.sin(phi)
            com = _turned(body.com, cos, sin)
            a_x, a_z = _carried(acceleration, com, rate, turn)
            at = (place[0] + com[0], place[1] + com[1])
            push = (body.mass * a_x, body.mass * (a_z + gravity))
            joints.append(place)
            pushes.append((at, push, body.inertia * turn))
            along = _turned(link, cos, sin)
            acceleration = _carried(acceleration, along, rate, turn)
            place = (place[0] + along[0], place[1] + along[1])
        if load is not None:
            pushes.append((place, load[:2], load[2]))
        return [
            sign
            * sum(
                (at[0] - joint[0]) * push[1] - (at[1] - joint[1]) * push[0] + turning
                for at, push, turning in pushes[number:]
            )
            for number, (sign, joint) in enumerate(zip(self._kinematics.signs, joints, strict=True))
        ]


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


def _turned(vector: tuple[float, float], cos: Value, sin: Value) -> Pair:
    return vector[0] * cos - vector[1] * sin, vector[0] * sin + vector[1] * cos


def _carried(acceleration: Pair, arm: Pair, rate: Value, turn: Value) -> Pair:
    """Acceleration at the end of `arm`, which turns about a point with `acceleration`."""
    x, z = arm
    return (
        acceleration[0] - turn * z - rate * rate * x,
        acceleration[1] + turn * x - rate * rate * z,
    )
