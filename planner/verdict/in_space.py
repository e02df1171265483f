"""The hand's pose in space under the joint angles that are sent.

Plans use a planar model of the arm. This check computes the pads' frame from all joints, by the
chain of the arm's data; a wrong planar model is refused.
"""

from __future__ import annotations

import functools
from itertools import pairwise

import casadi as ca
import numpy as np

from ...core import SamplesC, library
from ...models import Array
from ...models.robot import PlanarArm, about_z
from ..throw import TICK, Manipulator, Samples

#: Ticks between checked samples; the difference depends on the angles only.
EVERY = 10
#: Largest difference of the pads' centre [m] and axes [-] between planar model and chain.
AGREES = 1e-6


@functools.lru_cache(maxsize=16)
def _stiff_parts(kinematics: PlanarArm) -> Array:
    """4x4 poses (n + 2, 4, 4) of the azimuth joint in the base frame, of each throwing joint after
    the one before, then of the pads: these joints at angle 0, the others in the posture."""
    arm = kinematics.arm
    turning, joints = (arm.azimuth_joint, *kinematics.throwing_joints), list(arm.posture)
    for joint in turning:
        joints[joint - 1] = 0.0
    frames = [np.array(ca.evalf(frame)) for frame in arm.frames(ca.SX(ca.DM(joints)))]
    at = [np.eye(4), *(frames[joint - 1] for joint in turning), frames[-1]]
    return np.array([np.linalg.solve(before, after) for before, after in pairwise(at)])


def off_in_space(manipulator: Manipulator, sent: Samples, azimuth: float) -> float:
    """Largest difference [m; -] of the pads' centre and axes from the planar model; 0 without an
    arm.

    azimuth [rad]: of the throw's plane.
    """
    kinematics = manipulator.kinematics
    if not isinstance(kinematics, PlanarArm) or not sent.q.size:
        return 0.0
    chain, arm = _stiff_parts(kinematics), kinematics.arm
    if azimuth:
        chain = chain.copy()
        chain[0, :3] = about_z(-azimuth) @ chain[0, :3]
    samples, angle = SamplesC.of(TICK, sent.q), arm.azimuth_angle(azimuth)
    difference = library().off_plane(samples, EVERY, kinematics.core, chain, angle, arm.lateral)
    return float(difference)
