"""The grip on an object that the hand carries in space, out of a throw's plane."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ...models import Array, PinchUse, pinch_use
from ...models.robot import PadMotion
from ...problems import InputError
from ..throw import Samples
from .clearance import SpatialScene
from .findings import Code, Finding

#: Parts of the use of a pinch, in words.
_PARTS = {
    "friction": "friction in the pads' plane",
    "tilting": "tilting out of the pads' plane",
    "lifting": "force across the pads",
}


def grip_use(space: SpatialScene, samples: Samples) -> PinchUse:
    """Share (N,) of the full grip that a motion of all joints (N, joints) needs to hold the object.

    In the throw's plane it is the grip use of `verdict`. InputError for samples of another number
    of joints.
    """
    joints = space.kinematics.arm.joints
    if samples.q.ndim != 2 or samples.q.shape[1] != joints or not len(samples.q):
        raise InputError(f"samples: must be (N, {joints}), of all joints")
    return pinch_of(space, space.spatial.pads(samples.q, samples.dq, samples.ddq))


def pinch_of(space: SpatialScene, pads: PadMotion) -> PinchUse:
    """Share (N,) of the full grip that holds the object by pads that move."""
    axes = pads.pose[:, :3, :3]
    normal, along = space.plane_side * axes[:, :, 1], axes[:, :, 2]
    hand = np.stack([along, np.cross(normal, along), normal])
    force, torque = (np.einsum("rnk,nk->rn", hand, part) for part in space.object_wrench(pads))
    return pinch_use(space.scene.patch, force, torque, space.scene.gripper.profile().full)


def grip_findings(space: SpatialScene, pads: PadMotion, times: Array) -> Iterator[Finding]:
    """The instant of `times` (N,) [s] that needs most of the grip, if it needs too much, and the
    largest part of it."""
    grip = pinch_of(space, pads)
    worst = int(grip.use.argmax())
    if grip.use[worst] > 1.0:
        part = max(_PARTS, key=lambda name: float(getattr(grip, name)[worst]))
        yield Finding(Code.CARRY, float(grip.use[worst]), 1.0, float(times[worst]), _PARTS[part])
