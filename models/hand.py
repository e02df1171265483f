"""The hand's planar motion from the coordinates that are planned."""

from __future__ import annotations

import math
from collections.abc import Sequence

import casadi as ca
import numpy as np

from .arm import Arm


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
    names = ["pose", "twist", "acceleration"]
    return ca.Function("hand_motion", [q, dq, ddq], outputs, ["q", "dq", "ddq"], names)
