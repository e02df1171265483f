"""Bodies around segments: an arm's links, and boxes with rounded corners."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...core import array, library, out
from ..backend import Value
from ..body import Array, ReadOnly
from .kinematics import PlanarArm


@dataclass(frozen=True, eq=False)
class Solid(ReadOnly):
    """A box grown by `radius` [m]: a sphere without extents, a capsule with one extent.

    centre (3,) [m]; axes (3, 3): its directions as rows; half (3,) [m]: half its extents.
    """

    centre: Array
    axes: Array
    half: Array
    radius: float

    def turned(self, angle: float) -> Solid:
        """The solid turned by `angle` [rad] about the world's z axis."""
        turn = about_z(angle)
        return Solid(turn @ self.centre, self.axes @ turn.T, self.half, self.radius)

    def support(self, directions: Array) -> Array:
        """Its largest coordinate (K,) [m] along each of `directions` (K, 3)."""
        extent = np.abs(directions @ self.axes.T) @ self.half
        return np.asarray(directions @ self.centre + extent + self.radius)

    def outline(self, points: int = 90) -> Array:
        """Outline (points, 2) of its shadow along y: x, z [m]."""
        angles = np.linspace(0.0, 2 * np.pi, points, endpoint=False)
        ways = np.column_stack([np.cos(angles), 0 * angles, np.sin(angles)])
        corners = np.sign(ways @ self.axes.T) * self.half @ self.axes
        return np.asarray((self.centre + corners + self.radius * ways)[:, [0, 2]])

    def section(self) -> Array | None:
        """Outline (N, 2) of its section with the plane y = 0: x, z [m]; None beside the plane."""
        from scipy.spatial import ConvexHull, QhullError

        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        corners = self.centre + np.unique(signs * self.half, axis=0) @ self.axes
        pairs = np.array(list(itertools.combinations_with_replacement(range(len(corners)), 2)))
        begin, end = corners[pairs].transpose(1, 0, 2)
        rise = end[:, 1] - begin[:, 1]
        crossing = np.clip(-begin[:, 1] / np.where(rise == 0.0, 1.0, rise), 0.0, 1.0)[:, None]
        # Balls of the radius about points between all corners; of a box, where the plane is.
        shares = np.linspace(0.0, 1.0, 61 if self.radius else 2)
        shares = np.hstack([np.tile(shares, (len(pairs), 1)), crossing])[..., None]
        middle = (begin[:, None] + shares * (end - begin)[:, None]).reshape(-1, 3)
        middle = middle[np.abs(middle[:, 1]) <= self.radius + 1e-9]
        cut = np.sqrt(np.maximum(self.radius**2 - middle[:, 1] ** 2, 0.0))[:, None, None]
        angles = np.linspace(0.0, 2 * np.pi, 90 if self.radius else 1, endpoint=False)
        circle = np.column_stack([np.cos(angles), np.sin(angles)])
        points = (middle[:, None, [0, 2]] + cut * circle).reshape(-1, 2)
        try:
            return np.asarray(points[ConvexHull(points).vertices])
        except (QhullError, ValueError):
            # No point, or the plane touches it.
            return None


def about_z(angle: float) -> Array:
    """3x3: a turn by `angle` [rad] about z."""
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def segment_distance(begin: Array, end: Array, other: Array, last: Array) -> Array:
    """Distance (N,) [m] of segments, each (N, 3): `begin` to `end` from `other` to `last`."""
    pairs = np.ascontiguousarray(np.stack([begin, end, other, last], axis=1))
    distances = np.empty(len(begin))
    n = len(distances)
    library().segment_distances(n, array(pairs, n, 4, 3), out(distances, n))
    return distances


@dataclass(frozen=True, eq=False)
class ArmCapsules(ReadOnly):
    """An arm's capsules under the motion of its throwing joints, in the plane at azimuth 0.

    number (C,): of the arm's link; 0 is the base, the last one the hand. moved_by (C,): the link of
    `PlanarArm` that moves it, -1 for none. places (C, 2, 3): ends x, y, z [m]; x and z from the
    joint of that link with all coordinates 0, y from the plane. radius (C,) [m]. hand_moved_by: the
    link that moves the hand.
    """

    arm: PlanarArm
    number: tuple[int, ...]
    moved_by: tuple[int, ...]
    places: Array
    radius: Array
    hand_moved_by: int

    @property
    def hand(self) -> int:
        """Number of the hand among the links."""
        return self.arm.arm.joints + 1

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the links."""
        words = {0: "base", self.hand: "hand"}
        return tuple(words.get(number, f"link {number}") for number in self.number)

    @cached_property
    def moves(self) -> tuple[bool, ...]:
        """Flags (C,) of the capsules whose place the throwing joints change."""
        aside = np.abs(self.places[:, :, [0, 2]]).max(axis=(1, 2)) > 1e-12
        return tuple(
            link > 0 or (link == 0 and bool(far))
            for link, far in zip(self.moved_by, aside, strict=True)
        )

    @classmethod
    def of(cls, arm: PlanarArm) -> ArmCapsules:
        """The capsules of the arm's data."""
        given, at = arm.arm.capsules, [np.eye(4), *arm.rest_frames]
        joints = np.vstack([np.zeros(2), np.cumsum([arm.origin, *arm.links[:-1]], axis=0)])
        places, moved = np.zeros((len(given), 2, 3)), []
        for i, capsule in enumerate(given):
            frame = at[capsule.link]
            link = arm.moved_by(capsule.link)
            ends = np.array([capsule.begin, capsule.end])
            places[i] = ends @ frame[:3, :3].T + frame[:3, 3]
            x, z = joints[link + 1]
            places[i] = np.round(places[i] - [x, arm.arm.lateral, z], 12)
            moved.append(link)
        radius = np.array([capsule.radius for capsule in given])
        hand = arm.moved_by(arm.arm.joints + 1)
        return cls(arm, tuple(c.link for c in given), tuple(moved), places, radius, hand)

    def aimed(self, azimuth: float) -> ArmCapsules:
        """The capsules in a plane at `azimuth` [rad]; the base does not turn with it."""
        return replace(self, places=self.places_at(azimuth))

    def places_at(self, azimuth: float) -> Array:
        """`places` for a plane at that azimuth [rad]."""
        base = np.array(self.number) < self.arm.arm.azimuth_joint
        beside, places = np.array([0.0, self.arm.arm.lateral, 0.0]), self.places.copy()
        places[base] = (places[base] + beside) @ about_z(azimuth) - beside
        return places

    def ends(self, angles: Sequence[Value], which: Sequence[int]) -> list[list[list[Any]]]:
        """x, y, z [m] of both ends of some capsules from `PlanarArm.link_angles` values."""
        starts = self.arm.link_starts(angles)
        end_points = []
        for i in which:
            ends = self.places[i].tolist()
            link = self.moved_by[i]
            if link >= 0:
                x, z, cos, sin = starts[link]
                ends = [
                    [x + along * cos - up * sin, y, z + along * sin + up * cos]
                    for along, y, up in ends
                ]
            end_points.append(ends)
        return end_points

    def at(self, q: Array) -> Array:
        """Ends x, y, z [m] of all capsules (C, 2, 3, N) at coordinates q (n, N)."""
        places = self.ends(self.arm.link_angles(q), range(len(self.number)))
        rows = [np.broadcast_to(value, q.shape[1:]) for ends in places for e in ends for value in e]
        return np.array(rows).reshape(len(places), 2, 3, -1)
