"""A throw in space: where the arm's links, the hand and the bar are over time.

The throw's plane is vertical through the base's z axis, turned by the target's azimuth.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import Arm, DHRow, PlanarArm, placement
from .timeline import Timeline, timeline

if TYPE_CHECKING:
    from ...problems import Scene
    from ..check import Throw

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class SpaceThrow:
    """4x4 poses in the base frame over `line.times` (N,).

    hand (N, 4, 4): at the pads' centre, x the approach axis, z the plane's normal, which
    the pads press along; bar (N, 4, 4): at the CoM, x along the bar. joints (N, n, 4, 4):
    the arm's frames after each joint, n = 0 for a hand.
    """

    throw: Throw
    line: Timeline
    hand: Array
    bar: Array
    joints: Array

    @property
    def scene(self) -> Scene:
        """The scene, aimed at the target."""
        return self.throw.scene

    @property
    def azimuth(self) -> float:
        """How far the plane is turned about the base's z axis [rad]."""
        return self.throw.target.azimuth

    def phases(self) -> dict[str, float]:
        """When each phase that occurs begins, and the landing [s]."""
        release, opening = self.throw.final.release, self.throw.opening_time
        found = {"carry": 0.0, "stick": opening}
        for name, onset in (("pivot", release.pivot), ("slide", release.slide)):
            if onset is not None:
                found[name] = opening + float(onset)
        return found | {"flight": self.throw.detach_time, "landing": self.throw.landing_time}

    def target(self) -> Array:
        """4x4: the target pose; at the angle of the landing where the target has none."""
        target = self.throw.target
        theta = float(self.line.com[2, -1]) if target.theta is None else target.theta
        poses = placed(np.array([[target.plane_x], [target.z], [theta]]), self.azimuth)
        return np.asarray(poses[0])

    def extent(self) -> tuple[Array, Array]:
        """Least and largest (x, z) in the plane of what moves, the cup and an arm's base."""
        low, high = self.line.extent(self.scene)
        if self.scene.cup is not None:
            cup = self.scene.cup
            low = np.minimum(low, [cup.x - cup.radius, cup.rim - cup.depth])
            high = np.maximum(high, [cup.x + cup.radius, cup.rim])
        if self.scene.arm is not None:
            low, high = np.minimum(low, [-0.1, 0.0]), np.maximum(high, [0.1, 0.0])
        return low, high


def space_throw(throw: Throw) -> SpaceThrow:
    """The throw in space every millisecond."""
    line, azimuth = timeline(throw), throw.target.azimuth
    hand, bar = placed(line.hand, azimuth), placed(line.com, azimuth)
    joints = np.empty((len(line.times), 0, 4, 4))
    if isinstance(throw.mover.kinematics, PlanarArm):
        joints = _joint_frames(throw, throw.mover.kinematics, line.times)
    return SpaceThrow(throw, line, hand, bar, joints)


def in_space(x: Array, z: Array, azimuth: float) -> Array:
    """Points (..., 3) of plane coordinates x and z."""
    return np.stack([x * math.cos(azimuth), x * math.sin(azimuth), z], axis=-1)


def normal(azimuth: float) -> Array:
    """The plane's normal: x along the plane, z up and this one are left-handed."""
    return np.array([math.sin(azimuth), -math.cos(azimuth), 0.0])


def placed(pose: Array, azimuth: float) -> Array:
    """4x4 poses (N, 4, 4) of plane poses (3, N): x at angle theta, z the plane's normal."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    poses = np.zeros((pose.shape[1], 4, 4))
    poses[:, :3, 0] = in_space(cos, sin, azimuth)
    poses[:, :3, 1] = in_space(-sin, cos, azimuth)
    poses[:, :3, 2] = normal(azimuth)
    poses[:, :3, 3] = in_space(pose[0], pose[1], azimuth)
    poses[:, 3, 3] = 1.0
    return poses


def link_pieces(arm: Arm) -> list[list[tuple[Array, Array]]]:
    """Straight pieces (begin, end) [m] that show the links: of the base, then of each joint.

    Each in the frame that carries it. A Denavit-Hartenberg row goes along its a, then its d.
    """
    found: list[list[tuple[Array, Array]]] = []
    zero = np.zeros(3)
    for joint in arm.chain:
        end = _number(joint.placed())[:3, 3]
        corner = np.array([joint.a, 0.0, 0.0]) if isinstance(joint, DHRow) else zero
        found.append([(zero, corner), (corner, end)])
    mount = _number(placement(arm.tool.xyz, arm.tool.rpy))
    flange = mount[:3, 3] + arm.tool.flange * mount[:3, 2]
    found.append([(zero, mount[:3, 3]), (mount[:3, 3], flange)])
    return [[p for p in pieces if np.linalg.norm(p[1] - p[0]) > 1e-6] for pieces in found]


def _joint_frames(throw: Throw, kinematics: PlanarArm, times: Array) -> Array:
    """The arm's frames (N, n, 4, 4) after each joint."""
    arm = kinematics.arm
    moving = throw.path.at(times).pose
    joints = np.tile(np.array(arm.posture)[:, None], (1, len(times)))
    joints[arm.azimuth_joint - 1] = throw.target.azimuth
    joints[[j - 1 for j in kinematics.throwing_joints]] = moving
    q = ca.SX.sym("q", arm.joints)
    function = ca.Function("frames", [q], [ca.horzcat(*arm.frames(q)[: arm.joints])])
    values = np.array(function.map(len(times))(joints))
    return values.reshape(4, len(times), arm.joints, 4).transpose(1, 2, 0, 3)


def _number(matrix: ca.SX) -> Array:
    return np.array(ca.evalf(matrix))
