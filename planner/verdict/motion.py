"""Limits on a motion alone, whatever object it throws."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from ...core import SamplesC, library
from ...models import Array
from ...models.robot import PlanarArm, about_z
from ...problems import Scene
from ..clearance import Clearance, CollisionScene, held_bar
from ..throw import TICK, Manipulator, Samples, Throw, excesses
from .findings import JOINT_LIMITS, Code, Finding, Verdict

#: Allowed violation [m] of a clearance: covers rounding.
NEAR = 1e-6
#: Name of the bar after detach, among bodies.
FLYING = "flying bar"
#: Largest difference of the pads' centre [m] and axes [-] between planar model and chain.
AGREES = 1e-6


def motion_findings(throw: Throw) -> Iterator[Finding]:
    """Limits that the motion of a throw breaks with any object: those of the joints' samples, and
    whether the arm's own chain puts the pads where the planar model of plans does."""
    if len(throw.samples.q):
        yield from _excesses(throw.manipulator, throw.samples)
    off = _off_in_space(throw.manipulator, throw.samples, throw.target.plane.azimuth)
    if not off <= AGREES:
        yield Finding(Code.KINEMATICS, off, AGREES)


def _excesses(manipulator: Manipulator, samples: Samples) -> Iterator[Finding]:
    for excess in excesses(manipulator, samples):
        yield Finding(
            JOINT_LIMITS[excess.kind], excess.value, excess.limit, excess.time, excess.joint
        )


@functools.lru_cache(maxsize=16)
def _stiff_parts(kinematics: PlanarArm) -> Array:
    """4x4 poses (n + 2, 4, 4) of the azimuth joint in the base frame, of each throwing joint after
    the one before, then of the pads: these joints at angle 0, the others in the posture."""
    arm = kinematics.arm
    turning, joints = (arm.azimuth_joint, *kinematics.throwing_joints), list(arm.posture)
    for joint in turning:
        joints[joint - 1] = 0.0
    frames = arm.placed(joints)
    at = [np.eye(4), *(frames[joint - 1] for joint in turning), frames[-1]]
    return np.array([np.linalg.solve(before, after) for before, after in pairwise(at)])


def _off_in_space(manipulator: Manipulator, sent: Samples, azimuth: float) -> float:
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
    # Every 10th sample is compared.
    return float(library().off_plane(samples, 10, kinematics.core, chain, angle, arm.lateral))


def held_verdict(scene: Scene, manipulator: Manipulator, samples: Samples, first: int) -> Verdict:
    """The verdict on a motion that keeps the object in the hand.

    It covers joint limits, and from sample `first` on collisions with obstacles, floor and the arm.
    """
    q, times = samples.q[first:].T, samples.times[first:]
    bar = held_bar(scene, manipulator.motion(q, 0 * q, 0 * q)[0])
    surroundings = CollisionScene.of(scene, manipulator)
    clearances = surroundings.clearances(surroundings.bodies_at(times, q, bar))
    return Verdict((*_excesses(manipulator, samples), *map(collision, clearances)))


def collision(pair: Clearance) -> Finding:
    """The finding about two bodies that are too close to each other."""
    body = FLYING if pair.flying else pair.body
    other = pair.other if pair.thing is None else pair.thing.words
    distance = pair.clearance - pair.penetration
    return Finding(Code.COLLISION, distance, pair.clearance, pair.time, body, other)
