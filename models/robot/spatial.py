"""Motions of all joints of an arm in space: its frames' accelerations, and the wrenches they take.

Newton and Euler, in the base frame. `PlanarArm` has the throw's plane only, for the optimisation.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ..body import Array, ReadOnly, read_only
from .arm import Arm, LinkInertia


@dataclass(frozen=True, eq=False)
class FrameMotion(ReadOnly):
    """A frame at N instants, in the base frame: rotation (N, 3, 3); position [m], velocity [m/s]
    and acceleration [m/s^2] of its origin, rate [rad/s] and turning [rad/s^2], each (N, 3)."""

    rotation: Array
    position: Array
    velocity: Array
    acceleration: Array
    rate: Array
    turning: Array

    def moved(self, pose: Array) -> FrameMotion:
        """A frame fixed to this one at `pose` (4, 4)."""
        lever = self.rotation @ pose[:3, 3]
        swing = np.cross(self.rate, lever)
        return FrameMotion(
            self.rotation @ pose[:3, :3],
            self.position + lever,
            self.velocity + swing,
            self.acceleration + np.cross(self.turning, lever) + np.cross(self.rate, swing),
            self.rate,
            self.turning,
        )

    def turned(self, angle: Array, rate: Array, turning: Array) -> FrameMotion:
        """A frame that turns about this one's z axis by `angle` [rad] and so on, each (N,)."""
        cos, sin, axis = np.cos(angle), np.sin(angle), self.rotation[:, :, 2]
        turn = np.zeros((len(angle), 3, 3))
        turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1] = cos, -sin, sin, cos
        turn[:, 2, 2] = 1.0
        own = axis * rate[:, None]
        return FrameMotion(
            self.rotation @ turn,
            self.position,
            self.velocity,
            self.acceleration,
            self.rate + own,
            self.turning + axis * turning[:, None] + np.cross(self.rate, own),
        )

    def wrench(self, body: LinkInertia, gravity: float) -> tuple[Array, Array]:
        """Force [N] and torque [N m] about this frame's origin (N, 3) that move a body fixed to it.

        body: its CoM and inertia in this frame. gravity [m/s^2]: along -z of the base. Both are in
        the axes of the base frame.
        """
        xx, xy, xz, yy, yz, zz = body.inertia
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        pose = np.eye(4)
        pose[:3, 3] = body.com
        com = self.moved(pose)
        force = body.mass * (com.acceleration + [0.0, 0.0, gravity])
        inertia = self.rotation @ tensor @ self.rotation.transpose(0, 2, 1)
        change = _applied(inertia, self.turning)
        change = change + np.cross(self.rate, _applied(inertia, self.rate))
        return force, change + np.cross(com.position - self.position, force)

    def seen(self, vectors: Array) -> Array:
        """Vectors (N, 3) of the base frame in the axes of this one."""
        return _applied(self.rotation.transpose(0, 2, 1), vectors)


def _applied(matrices: Array, vectors: Array) -> Array:
    return np.asarray((matrices @ vectors[..., None])[..., 0])


@functools.lru_cache(maxsize=16)
def _steps(arm: Arm) -> Array:
    """4x4 pose of each of `Arm.frames` in the one before, with all joints at 0."""
    frames = [np.eye(4), *arm.placed([0.0] * arm.joints)]
    return read_only(np.array([np.linalg.solve(one, other) for one, other in pairwise(frames)]))


def frame_motions(arm: Arm, q: Array, dq: Array, ddq: Array) -> list[FrameMotion]:
    """Motions of `Arm.frames`: after each joint, then of the flange and of the pads' centre.

    q, dq, ddq: all joints (N, joints) [rad, rad/s, rad/s^2].
    """
    count, still = len(q), np.zeros((len(q), 3))
    frame = FrameMotion(np.broadcast_to(np.eye(3), (count, 3, 3)), *[still] * 5)
    frames = []
    for i, pose in enumerate(_steps(arm)):
        frame = frame.moved(pose)
        if i < arm.joints:
            frame = frame.turned(q[:, i], dq[:, i], ddq[:, i])
        frames.append(frame)
    return frames


def arm_torques(
    arm: Arm, frames: Sequence[FrameMotion], gravity: float, held: LinkInertia | None = None
) -> Array:
    """Torques (N, joints) [N m] of all joints whose `frame_motions` these are.

    They neglect friction and rotors of the drives. held: the object, in the pads' frame. ValueError
    for an arm without link masses.
    """
    if not arm.links:
        raise ValueError(f"arm {arm.name}: has no link masses ('links' in its data file)")
    hand = np.eye(4)
    hand[2, 3] = -arm.tool.tcp
    carried = [(frames[-1].moved(hand), arm.links[-1])]
    if held is not None:
        carried.append((frames[-1], held))
    force, moment = np.zeros((2, len(frames[0].position), 3))
    torques = np.empty((len(force), arm.joints))
    for i in reversed(range(arm.joints)):
        for frame, link in (*carried, (frames[i], arm.links[i])):
            push, torque = frame.wrench(link, gravity)
            force, moment = force + push, moment + torque + np.cross(frame.position, push)
        carried = []
        about = moment - np.cross(frames[i].position, force)
        torques[:, i] = np.einsum("nk,nk->n", frames[i].rotation[:, :, 2], about)
    return torques
