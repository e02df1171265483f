"""Arm and held bar in the base frame, for motions of all joints, in the throw's plane or not."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models import Array
from ...models.robot import PadMotion, PlanarArm, SpatialArm
from ...problems import Scene, ThrowPlane
from ..throw import Manipulator
from .bodies import BAR, CollisionScene, SweptBodies
from .outlines import bar_ends, held_bar

#: Points along the bar's axis whose distance from the base column is measured.
ALONG = 9


@dataclass(frozen=True, eq=False)
class SpatialScene:
    """A scene, its arm with all joints, and the bar in its hand; frames are the base's."""

    scene: Scene
    manipulator: Manipulator

    @cached_property
    def spatial(self) -> SpatialArm:
        """The arm."""
        return SpatialArm(self.kinematics.arm)

    @property
    def kinematics(self) -> PlanarArm:
        """The arm in the throw's plane."""
        assert isinstance(self.manipulator.kinematics, PlanarArm)
        return self.manipulator.kinematics

    @cached_property
    def bar_in_hand(self) -> Array:
        """Ends (2, 3) [m] of the held bar in the frame of the pads, the grasped end first."""
        rest = np.zeros((self.kinematics.coordinates, 1))
        pose = self.manipulator.motion(rest, rest, rest)[0]
        ends = bar_ends(self.scene.object, held_bar(self.scene, pose))[0, :, :, 0]
        ends[:, 1] = self.kinematics.arm.lateral
        pads = self.kinematics.placed(rest[:, 0])[-1]
        return np.asarray((ends - pads[:3, 3]) @ pads[:3, :3])

    @cached_property
    def plane_side(self) -> float:
        """1 if angles in the throw's plane turn about the pads' y axis, -1 if against it."""
        return float(-np.sign(self.kinematics.rest_frames[-1][1, 1]))

    def held_ends(self, pads: PadMotion) -> Array:
        """Ends (1, 2, 3, N) [m] of the held bar."""
        axes, places = pads.pose[:, :3, :3], pads.pose[:, :3, 3]
        return np.asarray(np.einsum("nij,kj->kin", axes, self.bar_in_hand)[None] + places.T)

    def bodies(self, q: Array, times: Array, bar: Array | None = None) -> SweptBodies:
        """Arm with joints q (N, joints) at times (N,) [s], and bar with ends (1, 2, 3, N)."""
        arm, capsules = self.kinematics.arm, self.manipulator.capsules
        names, ends, radius = list[str](), list[Array](), list[float]()
        if capsules is not None:
            frames = self.spatial.frames(q)
            names += capsules.names
            ends += [
                np.einsum("nij,kj->kin", frames[c.link][:, :3, :3], np.array([c.begin, c.end]))
                + frames[c.link][:, :3, 3].T
                for c in arm.capsules
            ]
            radius += capsules.radius.tolist()
        cover = [arm.cover] * len(names)
        if bar is not None:
            names, ends = [*names, BAR], [*ends, bar[0]]
            radius, cover = [*radius, self.scene.object.width / np.sqrt(2)], [*cover, 0.0]
        placed = np.array(ends) if ends else np.zeros((0, 2, 3, len(q)))
        return SweptBodies(tuple(names), placed, np.array(radius), np.array(cover), times)

    @cached_property
    def around(self) -> CollisionScene:
        """Obstacles, floor and pairs of bodies in the base frame, with all joints moving."""
        found = CollisionScene.of(self.scene, self.manipulator, ThrowPlane(0.0, 0.0))
        capsules = self.manipulator.capsules
        if capsules is None:
            return found
        # The first link turns about its own axis; the flange turns with the hand.
        last = self.kinematics.arm.joints
        moved = tuple((min(number, last) - 1) or -1 for number in capsules.number)
        return dataclasses.replace(found, arm=dataclasses.replace(capsules, moved_by=moved))

    def lowest_of_bar(self, pads: PadMotion) -> Array:
        """Height (N,) [m] of the held bar's lowest corner."""
        ends = self.held_ends(pads)[0]
        width, half = pads.pose[:, 2, 1], self.scene.object.width / 2
        along = (ends[1] - ends[0])[2] / self.scene.object.length
        # Half the extents of its square section: along the pads' y axis, and across that.
        across = np.sqrt(np.maximum(1.0 - along**2 - width**2, 0.0))
        return np.asarray(ends[:, 2].min(axis=0) - half * (np.abs(width) + across))

    def column_distance(self, pads: PadMotion, radius: float, height: float) -> Array:
        """Distance (N,) [m] of the held bar from the base column, aside or above; negative inside.

        The bar's half width is taken off on all sides.
        """
        first, last = self.held_ends(pads)[0]
        share = np.linspace(0.0, 1.0, ALONG)[:, None, None]
        points = first + share * (last - first)
        aside = np.hypot(points[:, 0], points[:, 1]) - radius
        gap = np.maximum(aside, points[:, 2] - height).min(axis=0)
        return np.asarray(gap - self.scene.object.width / 2)
