"""Where the joints that are sent hold the hand in space.

Plans are made with a planar model of the arm. Here the pads' frame comes from all joints, by the
chain of the arm's data, so that a planar model that is wrong sends nothing.
"""

from __future__ import annotations

import functools
from itertools import pairwise

import casadi as ca
import numpy as np

from ...models import Array, PlanarArm, about_z
from .mover import Mover
from .sending import Samples

#: Ticks between the samples that are looked at: the difference depends on the angles only.
EVERY = 10
#: The two agree where the pads' centre [m] and their axes differ by less.
AGREES = 1e-6


@functools.lru_cache(maxsize=16)
def _stiff_parts(kinematics: PlanarArm, azimuth: float) -> list[Array]:
    """4x4 poses of each throwing joint at angle 0 after the one before, then of the pads.

    The other joints stand where they are sent: the azimuth joint turns the plane by `azimuth`
    [rad]. The first pose is seen from the plane so turned.
    """
    arm, joints = kinematics.arm, list(kinematics.arm.posture)
    joints[arm.azimuth_joint - 1] = arm.azimuth_angle(azimuth)
    for joint in kinematics.throwing_joints:
        joints[joint - 1] = 0.0
    frames = [np.array(ca.evalf(frame)) for frame in arm.frames(ca.SX(ca.DM(joints)))]
    turned = np.eye(4)
    turned[:3, :3] = about_z(azimuth)
    at = [turned, *(frames[joint - 1] for joint in kinematics.throwing_joints), frames[-1]]
    return [np.linalg.solve(before, after) for before, after in pairwise(at)]


def off_in_space(mover: Mover, sent: Samples, azimuth: float) -> float:
    """How far [m; 1] centre and axes of the pads are at most from what the planar model has.

    azimuth [rad]: how far the throw's plane is turned. 0 for a hand without an arm.
    """
    kinematics, q = mover.kinematics, sent.q[::EVERY].T
    if not isinstance(kinematics, PlanarArm) or not q.size:
        return 0.0
    *parts, pads = _stiff_parts(kinematics, azimuth)
    # Closing axis, approach axis and centre of the pads (4, 3, N), in the plane's frame at last.
    seen = np.repeat(pads[:, 1:, None], q.shape[1], axis=2)
    turns = zip(parts[::-1], np.cos(q)[::-1], np.sin(q)[::-1], strict=True)
    for part, cos, sin in turns:
        x, y = seen[0].copy(), seen[1]
        seen[0], seen[1] = cos * x - sin * y, sin * x + cos * y
        seen = (part @ seen.reshape(4, -1)).reshape(seen.shape)
    still = [0.0] * len(q)
    along, up, theta = kinematics.motion_of(kinematics.turned(q), still, still)[0]
    meant = np.zeros((3, *seen.shape[1:]))
    meant[1, 0] = np.sign(seen[1, 0])
    meant[0, 1], meant[2, 1] = np.cos(theta), np.sin(theta)
    meant[0, 2], meant[1, 2], meant[2, 2] = along, kinematics.arm.lateral, up
    return float(np.abs(seen[:3] - meant).max())
