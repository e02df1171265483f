"""Where the joints that are sent hold the hand in space.

Plans are made with a planar model of the arm. Here the pads' frame comes from all joints, by the
chain of the arm's data, so that a planar model that is wrong sends nothing.
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

#: Ticks between the samples that are looked at: the difference depends on the angles only.
EVERY = 10
#: The two agree where the pads' centre [m] and their axes differ by less.
AGREES = 1e-6


@functools.lru_cache(maxsize=16)
def _stiff_parts(kinematics: PlanarArm) -> Array:
    """4x4 poses (n + 2, 4, 4) of the azimuth joint in the base frame, of each throwing joint after
    the one before, then of the pads: with these joints at angle 0, the others where they are
    sent."""
    arm = kinematics.arm
    turning, joints = (arm.azimuth_joint, *kinematics.throwing_joints), list(arm.posture)
    for joint in turning:
        joints[joint - 1] = 0.0
    frames = [np.array(ca.evalf(frame)) for frame in arm.frames(ca.SX(ca.DM(joints)))]
    at = [np.eye(4), *(frames[joint - 1] for joint in turning), frames[-1]]
    return np.array([np.linalg.solve(before, after) for before, after in pairwise(at)])


def off_in_space(manipulator: Manipulator, sent: Samples, azimuth: float) -> float:
    """How far [m; 1] centre and axes of the pads are at most from what the planar model has.

    azimuth [rad]: how far the throw's plane is turned. 0 for a hand without an arm.
    """
    kinematics = manipulator.kinematics
    if not isinstance(kinematics, PlanarArm) or not sent.q.size:
        return 0.0
    chain, arm = _stiff_parts(kinematics), kinematics.arm
    if azimuth:
        chain = chain.copy()
        chain[0, :3] = about_z(-azimuth) @ chain[0, :3]
    samples, angle = SamplesC.of(TICK, sent.q), arm.azimuth_angle(azimuth)
    found = library().off_plane(samples, EVERY, kinematics.core, chain, angle, arm.lateral)
    return float(found)
