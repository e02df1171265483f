"""Arm and held bar in the base frame, for motions of all joints, in the throw's plane or not."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ....models import Array, read_only
from ....models.robot import PadMotion, PlanarArm, Solid, SpatialArm
from ....problems import Obstacle, Scene, ThrowPlane
from ...throw import Manipulator
from .bodies import CollisionScene, KeepOut, SweptBodies, bar_radii
from .outlines import bar_ends, held_bar

#: What follows the name of an object that waits in that of its obstacle.
WAITS = " at its pick"
#: Length [m] of a capsule that is a ball.
BALL = 1e-9


@dataclass(frozen=True, eq=False)
class SpatialScene:
    """A scene, its arm with all joints, and the object in its hand; frames are the base's."""

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
    def _at_rest(self) -> tuple[Array, Array]:
        """Poses of the held object's CoM (3, 1), x, z, theta, and of the pads (4, 4), with the
        throwing joints at zero."""
        rest = np.zeros((self.kinematics.coordinates, 1))
        hand = self.manipulator.motion(rest, rest, rest)[0]
        return held_bar(self.scene, hand), self.kinematics.placed(rest[:, 0])[-1]

    def _in_pads(self, places: Array) -> Array:
        """Places (..., 3) [m] in the throw's plane at rest, in the frame of the pads."""
        pads, lateral = self._at_rest[1], [0.0, self.kinematics.arm.lateral, 0.0]
        return read_only((places + lateral - pads[:3, 3]) @ pads[:3, :3])

    @cached_property
    def com_in_hand(self) -> Array:
        """The held object's CoM (3,) [m] in the frame of the pads."""
        x, z, _ = self._at_rest[0][:, 0]
        return self._in_pads(np.array([x, 0.0, z]))

    @cached_property
    def axis_in_hand(self) -> Array:
        """The held object's axis (3,), from the end that `com` counts from, in the pads' frame."""
        theta, pads = self._at_rest[0][2, 0], self._at_rest[1]
        return read_only(np.array([np.cos(theta), 0.0, np.sin(theta)]) @ pads[:3, :3])

    @cached_property
    def parts_in_hand(self) -> Array:
        """Ends (K, 2, 3) [m] of the axes of the held object's K capsules, one for a bar, in the
        frame of the pads."""
        return self._in_pads(bar_ends(self.scene.object, self._at_rest[0])[..., 0])

    @cached_property
    def plane_side(self) -> float:
        """1 if angles in the throw's plane turn about the pads' y axis, -1 if against it."""
        return float(-np.sign(self.kinematics.rest_frames[-1][1, 1]))

    def held_ends(self, pads: PadMotion) -> Array:
        """Ends (K, 2, 3, N) [m] of the axes of the held object's capsules, one for a bar."""
        axes, places = pads.pose[:, :3, :3], pads.pose[:, :3, 3]
        return np.asarray(np.einsum("nij,pkj->pkin", axes, self.parts_in_hand) + places.T)

    def object_wrench(self, pads: PadMotion) -> tuple[Array, Array]:
        """Force [N] and torque about the pads' centre [N m], (N, 3), that the hand gives to the
        object, in the base frame.

        [object] inertia is that about the pads' normal; about the axis across both a bar has the
        same, and about its own mass width^2 / 6, as a uniform one of square section.
        """
        axes, thrown = pads.pose[:, :3, :3], self.scene.object
        r = axes @ self.com_in_hand
        swing = np.cross(pads.omega, r)
        a = pads.acceleration + np.cross(pads.alpha, r) + np.cross(pads.omega, swing)
        force = thrown.mass * (a + np.array([0.0, 0.0, self.scene.gravity]))
        own, u = thrown.mass * thrown.width**2 / 6, axes @ self.axis_in_hand
        own = min(own, 2 * thrown.inertia)
        spins = [
            thrown.inertia * w + (own - thrown.inertia) * (w * u).sum(axis=1)[:, None] * u
            for w in (pads.omega, pads.alpha)
        ]
        return force, np.cross(r, force) + spins[1] + np.cross(pads.omega, spins[0])

    def bodies(self, q: Array, times: Array, bar: Array | None = None) -> SweptBodies:
        """Arm with joints q (N, joints) at times (N,) [s], and the object's capsules with ends
        (K, 2, 3, N)."""
        if self.manipulator.capsules is None:
            return self.around.swept(times, None, bar)
        frames, links = self.spatial.frames(q), self.kinematics.arm.capsules
        ends = [
            np.einsum("nij,kj->kin", frames[c.link][:, :3, :3], np.array([c.begin, c.end]))
            + frames[c.link][:, :3, 3].T
            for c in links
        ]
        return self.around.swept(times, np.array(ends), bar)

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
        arm = dataclasses.replace(capsules, moved_by=moved, hand_moved_by=last - 1)
        return dataclasses.replace(found, arm=arm)

    @cached_property
    def open_hand(self) -> CollisionScene:
        """All that moves with the last joint, the fingers open, as obstacles in the frame of the
        pads: boxes around the capsules, ahead of the palm without the gap between the pads."""
        arm, found = self.kinematics.arm, list[KeepOut]()
        gap, front = arm.tool.open_width / 2, -arm.tool.palm_front
        for one in arm.capsules:
            if one.link < arm.joints:
                continue
            frame = np.linalg.inv(self._at_rest[1]) @ self.kinematics.rest_frames[one.link - 1]
            ends = np.array([one.begin, one.end]) @ frame[:3, :3].T + frame[:3, 3]
            low, high = ends.min(axis=0) - one.radius, ends.max(axis=0) + one.radius
            behind, ahead, inf = high.copy(), low.copy(), np.full(3, np.inf)
            behind[2], ahead[2] = min(high[2], front), max(low[2], front)
            left, right = inf.copy(), -inf
            left[1], right[1] = -gap, gap
            for begin, end in (
                (low, behind),
                (ahead, np.minimum(high, left)),
                (np.maximum(ahead, right), high),
            ):
                if (end > begin).all():
                    box = Solid((begin + end) / 2, np.eye(3), (end - begin) / 2, 0.0)
                    found.append(KeepOut("hand", box, 0.0))
        return CollisionScene(self.scene, tuple(found), None)

    def waiting_object(self, joints: Array, name: str) -> tuple[Obstacle, ...]:
        """The capsules of the object at its pick, where the hand takes it with joints (n,)."""
        q, found = joints[None], list[Obstacle]()
        ends = self.held_ends(self.spatial.pads(q, 0 * q, 0 * q))[..., 0]
        for (begin, end), radius in zip(ends, bar_radii(self.scene.object), strict=True):
            way = end - begin
            found.append(
                Obstacle(
                    name=name + WAITS,
                    kind="capsule",
                    size=(radius, max(float(np.linalg.norm(way)), BALL)),
                    position=tuple(((begin + end) / 2).tolist()),
                    yaw=math.atan2(way[1], way[0]),
                    pitch=math.atan2(math.hypot(way[0], way[1]), way[2]),
                )
            )
        return tuple(found)

    def among(self, obstacles: tuple[Obstacle, ...]) -> SpatialScene:
        """The scene with more obstacles."""
        if not obstacles:
            return self
        scene = self.scene.replace(obstacle=(*self.scene.obstacle, *obstacles))
        return SpatialScene(scene, self.manipulator)

    def object_in_pads(self, q: Array, joints: Array) -> Array:
        """Ends (K, 2, 3, N) [m] of the axes of the object's capsules in the frame of the pads with
        joints q (N, joints), the object where pads with `joints` (joints,) hold it."""
        both = np.vstack([q, joints])
        poses = self.spatial.pads(both, 0.0 * both, 0.0 * both).pose
        axes, places = poses[:-1, :3, :3], poses[:-1, :3, 3]
        ends = self.parts_in_hand @ poses[-1, :3, :3].T + poses[-1, :3, 3]
        return np.asarray(np.einsum("nji,npkj->pkin", axes, ends - places[:, None, None]))

    def lowest_of_bar(self, pads: PadMotion) -> Array:
        """Height (N,) [m] of the held object's lowest point, of a bar its lowest corner."""
        bar, ends = self.scene.object, self.held_ends(pads)
        if bar.outline:
            least = ends[:, :, 2].min(axis=1) - np.array(bar_radii(bar))[:, None]
            return np.asarray(least.min(axis=0))
        ends = ends[0]
        width, half = pads.pose[:, 2, 1], bar.width / 2
        along = (ends[1] - ends[0])[2] / bar.length
        # Half the extents of its square section: along the pads' y axis, and across that.
        across = np.sqrt(np.maximum(1.0 - along**2 - width**2, 0.0))
        return np.asarray(ends[:, 2].min(axis=0) - half * (np.abs(width) + across))

    def column_distance(self, pads: PadMotion, radius: float, height: float) -> Array:
        """Distance (N,) [m] of the held object from the base column, aside or above; negative
        inside.

        A bar's half width is taken off on all sides.
        """
        bar = self.scene.object
        radii = bar_radii(bar) if bar.outline else [bar.width / 2]
        gaps = [
            _off_column(first, last, radius, height) - around
            for (first, last), around in zip(self.held_ends(pads), radii, strict=True)
        ]
        return np.asarray(np.min(gaps, axis=0))


def _off_column(first: Array, last: Array, radius: float, height: float) -> Array:
    """The least of max(distance aside, height above) (N,) [m] along segments between points (3, N)
    and a column about the z axis.

    Both are convex along a segment, so the least is at an end, at the point nearest to the axis or
    where the two are equal.
    """
    way, start = last - first, first[2] - height + radius
    square = way[0] ** 2 + way[1] ** 2
    towards = first[0] * way[0] + first[1] * way[1]
    a, b = square - way[2] ** 2, towards - start * way[2]
    c = first[0] ** 2 + first[1] ** 2 - start**2
    with np.errstate(all="ignore"):
        q = -(b + np.copysign(np.sqrt(np.maximum(b * b - a * c, 0.0)), b))
        shares = np.array([0 * a, 1 + 0 * a, -towards / square, q / a, c / q])
    shares = np.clip(np.nan_to_num(shares, nan=0.0), 0.0, 1.0)
    points = first + shares[:, None] * way
    aside = np.hypot(points[:, 0], points[:, 1]) - radius
    return np.asarray(np.maximum(aside, points[:, 2] - height).min(axis=0))
