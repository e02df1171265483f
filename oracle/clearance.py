"""Clearances of the arm, the held bar and the flying bar to the bodies around them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.optimize import brentq

from . import bins, shapes
from .motion import ArmMotion, Array, HandMotion, Plane, rotation

#: Number of instants of a flight at which the bar is checked.
FLIGHT = 800
#: Number of instants of the way into a cup at which the bar is checked.
WAY_IN = 1500
#: Time [s] after the landing for which the way into a cup is followed.
BEYOND = 0.3
#: Time [s] before the landing in which a bar may be as near to an obstacle as at the landing.
LANDS = 0.05
#: Share of the radius within which it may be in none as it lands.
MIDDLE = 0.35
#: A limit is kept if its room is above minus this.
ROUNDING = 1e-6
#: Error of a room, as a share of its limit.
SHARE = 1e-4
#: Error [m] of a distance.
DISTANCE = 1e-4
#: Error [m] of a cup's clearance, whose instants the planner finds by bisection.
CUP_NEAR = 1e-5


@dataclass(frozen=True)
class Found:
    """A quantity of N throws: value and limit (N,), and its room relative to the limit, or, for a
    distance, to the bar's length. The limit is broken if the room is below 0; known: its error."""

    value: Array
    limit: Array
    room: Array
    known: float

    @property
    def broken(self) -> Array:
        return ~(self.room >= -ROUNDING)

    @property
    def doubtful(self) -> Array:
        return np.abs(self.room) <= self.known


def at_most(value: Any, limit: Any, known: float = SHARE) -> Found:
    value, limit = np.broadcast_arrays(np.atleast_1d(np.asarray(value, float)), limit)
    return Found(value, limit, (limit - value) / np.maximum(np.abs(limit), 1e-12), known)


def at_least(value: Any, limit: Any, scale: float = 1.0, known: float = 0.0) -> Found:
    value, limit = np.broadcast_arrays(np.atleast_1d(np.asarray(value, float)), limit)
    return Found(value, limit, (value - limit) / scale, known / scale)


@dataclass(frozen=True)
class Part:
    """A part of an object: corners (m, 2) [m] counter-clockwise, along and across its axis from the
    CoM, and a radius [m] around them."""

    corners: Array
    radius: float = 0.0

    def placed(self, com: Array) -> Array:
        """Corners (K, m, 2) [m] for CoM poses (K, 3)."""
        return shapes.placed(self.corners, com)


@dataclass(frozen=True)
class Bar:
    """A bar: distances of its ends from the CoM, half width, grasp angle and offset h, and its one
    part; or the capsules of an outline, whose half width is that of the rectangle around them."""

    first: float
    last: float
    half: float
    angle: float
    offset: float
    capsules: tuple[Part, ...] = ()

    @property
    def parts(self) -> tuple[Part, ...]:
        return self.capsules or (Part(shapes.rectangle(self.first, self.last, self.half)),)

    @property
    def reach(self) -> float:
        return math.hypot(max(-self.first, self.last), self.half)

    def held(self, pose: Array) -> Array:
        """CoM poses (K, 3) in hands at poses (K, 3)."""
        theta = pose[:, 2] + self.angle
        x, z = pose[:, 0] + self.offset * np.cos(theta), pose[:, 1] + self.offset * np.sin(theta)
        return np.column_stack([x, z, theta])

    def axes(self, com: Array, plane: Plane) -> list[tuple[list[Array], float]]:
        """Both ends (K, 3) in the base frame of the axes of bar or capsules, and radii around."""
        middle = Part(shapes.rectangle(self.first, self.last, 0.0)[:2], self.half * math.sqrt(2))
        return [
            ([plane.points(*end.T) for end in part.placed(com).transpose(1, 0, 2)], part.radius)
            for part in self.capsules or (middle,)
        ]

    def lowest(self, com: Array) -> Array:
        """Height (K,) of the lowest point."""
        each = [part.placed(com)[..., 1].min(axis=1) - part.radius for part in self.parts]
        return np.asarray(np.min(each, axis=0))

    def highest(self, com: Array) -> Array:
        """Height (K,) of the highest point."""
        each = [part.placed(com)[..., 1].max(axis=1) + part.radius for part in self.parts]
        return np.asarray(np.max(each, axis=0))

    def from_column(self, com: Array, radius: float, height: float) -> float:
        """Least of max(|x| - radius, z - height)."""
        away = (
            shapes.from_column(part.placed(com), radius, height).min() - part.radius
            for part in self.parts
        )
        return float(min(away))

    def from_palm(self, com: Array, palm: Array) -> float:
        """Distance from the palm's outlines (K, 4, 2), below 0 inside."""
        away = (
            shapes.between_outlines(part.placed(com), palm).min(initial=math.inf) - part.radius
            for part in self.parts
        )
        return float(min(away))


@dataclass(frozen=True)
class Flight:
    """A flight: CoM pose and twist (6,) at its start at `begins` [s], and its `duration` [s]."""

    detach: Array
    begins: float
    duration: float
    gravity: float

    def at(self, since: Array) -> Array:
        """CoM poses (K, 3) at times (K,) [s] after detach."""
        x, z, theta, v_x, v_z, omega = self.detach
        fall = z + v_z * since - self.gravity / 2 * since**2
        return np.column_stack([x + v_x * since, fall, theta + omega * since])


def may_overlap(arm: Any, i: int, j: int) -> float:
    """How deep [m] two of an arm's capsules may overlap: as its file says; those of links that a
    joint joins as they like. The hand is part of the last link."""
    one, other = arm.capsules[i], arm.capsules[j]
    if not (one.beside or other.beside):
        first, second = (min(c.link, arm.joints) for c in (one, other))
        if abs(first - second) <= 1:
            return math.inf
    return {each.capsules: each.depth for each in arm.overlaps}.get((i + 1, j + 1), 0.0)


@dataclass(frozen=True)
class Solid:
    """An obstacle: a box grown by a radius [m]; axes (3, 3) as rows. wall: of a bin, from which an
    object keeps its distance until it comes down to the rim for the last time."""

    name: str
    centre: Array
    axes: Array
    half: Array
    radius: float
    clearance: float
    wall: bool = False

    @classmethod
    def of(cls, o: Any) -> Solid:
        axes = (rotation((0.0, 0.0, o.yaw)) @ rotation((0.0, o.pitch, 0.0))).T
        half, radius = np.array(o.size) / 2, 0.0
        if o.kind != "box":
            half = np.array([0.0, 0.0, o.size[1] / 2 if o.kind == "capsule" else 0.0])
            radius = o.size[0]
        return cls(o.name, np.array(o.position), axes, half, radius, o.clearance)

    def distance(self, begin: Array, end: Array) -> Array:
        """Distance (K,) of segments (K, 3)."""
        return shapes.to_box(begin, end, self.centre, self.axes, self.half) - self.radius


def solids_of(scene: Any, plane: Plane) -> list[Solid]:
    """The scene's obstacles, and the walls of its bin."""
    found = [Solid.of(o) for o in scene.obstacle]
    if scene.bin is None:
        return found
    boxes = bins.BinWalls(scene.bin, plane).boxes()
    return found + [Solid("bin wall", *box, 0.0, scene.bin.clearance, wall=True) for box in boxes]


class Around:
    """The bodies around a motion. ticks (K,) [s]: instants at which the arm is checked; speed
    [m/s]: of the cup along x."""

    def __init__(
        self, scene: Any, motion: ArmMotion | HandMotion, ticks: Array, speed: float
    ) -> None:
        self.scene, self.motion, self.ticks, self.speed = scene, motion, ticks, speed
        self.moved = motion if isinstance(motion, ArmMotion) else None
        self.solids = solids_of(scene, motion.plane)

    def arm(self, planned: bool) -> dict[str, Found]:
        """Distances of the arm from floor, obstacles and itself."""
        return {
            name: at_least(away, kept if planned else 0.0, self.scene.object.length, DISTANCE)
            for name, (away, kept) in self._arm.items()
        }

    @cached_property
    def _capsules(self) -> tuple[Array, list[int], Array]:
        """Ends (C, 2, K, 3) of the links' capsules at the ticks, the group of capsules that move
        together for each, and radii."""
        arm = self.moved
        if arm is None or not arm.arm.capsules:
            return np.zeros((0, 2, self.ticks.size, 3)), [], np.zeros(0)
        groups = [sum(j + 1 <= c.link for j in arm.throwing) for c in arm.arm.capsules]
        return arm.capsules(self.ticks), groups, np.array([c.radius for c in arm.arm.capsules])

    def _on_axis(self, k: int) -> bool:
        """Whether the first joint that throws turns capsule k about its own axis."""
        ends, groups, _ = self._capsules
        first = self.moved.frames(self.ticks[:1])[self.moved.throwing[0] + 1]
        off = np.cross(ends[k][:, 0] - first.origin[0], first.axes[0, :, 2])
        return groups[k] == 1 and float(np.abs(off).max()) < 1e-9

    def _palm(self, pose: Array) -> Array:
        tool = self.scene.arm.tool
        return shapes.outline(pose, -tool.palm_back, -tool.palm_front, tool.palm_half_width)

    @cached_property
    def _arm(self) -> dict[str, tuple[float, float]]:
        """Least distances [m], and the scene's clearance."""
        arm, space, found = self.moved, self.scene.workspace, dict[str, tuple[float, float]]()
        pose = self.motion.hand.at(self.ticks)[0]
        ends, groups, radii = self._capsules
        moving = [k for k, group in enumerate(groups) if group > 0 and not self._on_axis(k)]
        if space is not None and space.floor is not None:
            lowest = [pose[:, 1].min()]
            if arm is not None:
                lowest += [arm.heights(self.ticks).min(), self._palm(pose)[..., 1].min()]
            lowest += [ends[k][..., 2].min() - radii[k] for k in moving]
            found["arm, floor"] = float(min(lowest)) - space.floor, 0.0
        for solid in self.solids:
            away = [solid.distance(*ends[k]).min() - radii[k] for k in moving]
            found[f"arm, {solid.name}"] = min(away, default=math.inf), solid.clearance
        away = [
            shapes.between_segments(*ends[i], *ends[j]).min() - radii[i] - radii[j] + depth
            for i, j in itertools.combinations(range(len(groups)), 2)
            if groups[i] != groups[j] and math.isfinite(depth := may_overlap(arm.arm, i, j))
        ]
        return found | ({"arm, itself": (min(away), 0.0)} if away else {})

    def bar(
        self,
        bar: Bar,
        times: Array,
        poses: Array,
        flight: Flight,
        off: tuple[Array, Array],
        planned: bool,
    ) -> dict[str, Found]:
        """Distances of a bar: held at CoM poses (K, 3) at times (K,) [s], then in flight.

        off: error (3,) of the hand's pose at detach, and its rate.
        """
        scene, space, found = self.scene, self.scene.workspace, dict[str, tuple[float, float]]()
        since = np.linspace(0.0, flight.duration, FLIGHT)
        way = flight.at(since)
        if space is not None and space.floor is not None:
            found["bar, floor"] = bar.lowest(poses).min() - space.floor, 0.0
        if space is not None and space.column_radius is not None:
            beside = max(abs(self.motion.plane.lateral) - bar.half, 0.0)
            if beside < space.column_radius:
                size = math.sqrt(space.column_radius**2 - beside**2), space.column_height
                for name, there in (("held", poses), ("flying", way)):
                    found[f"{name} bar, column"] = bar.from_column(there, *size), 0.0
        if self._has_palm:
            pose = self.motion.hand.at(flight.begins + since)[0]
            pose = pose + off[0] + off[1] * since[:, None]
            far = bar.reach + scene.arm.tool.palm_back + scene.object.length
            near = np.hypot(*(pose - way)[:, :2].T) < far
            between = bar.from_palm(way[near], self._palm(pose[near]))
            found["flying bar, palm"] = between, space.palm_clearance if planned else 0.0
        if scene.cup is not None:
            kept = max(scene.cup.clearance - CUP_NEAR, 0.0) if planned else 0.0
            found["cup"] = self._way_in(bar, flight), kept
        if scene.bin is not None:
            kept = max(scene.bin.clearance - CUP_NEAR, 0.0) if planned else 0.0
            found["bin"] = bins.clearance(scene, self.motion.plane, bar, flight), kept
        for name, there, at in (
            ("held bar", poses, times),
            ("flying bar", way, flight.begins + since),
        ):
            flies = there is way
            for part, (axis, radius) in enumerate(bar.axes(there, self.motion.plane)):
                kept_by = self._links_for(bar, part, flies)
                for other, away, kept in self._of_axis(axis, at, radius, kept_by, flies, planned):
                    key = f"{name}, {other}"
                    if key not in found or away - kept < found[key][0] - found[key][1]:
                        found[key] = away, kept
        return {
            name: at_least(*each, scene.object.length, DISTANCE) for name, each in found.items()
        }

    @property
    def _has_palm(self) -> bool:
        """Whether the flying bar has to keep a clearance to the palm."""
        space = self.scene.workspace
        if self.moved is None or space is None or space.palm_clearance is None:
            return False
        return bool(self.scene.arm.tool.palm_half_width > 0.0)

    def _links_for(self, bar: Bar, part: int, flies: bool) -> dict[int, float]:
        """Capsules that a part of the bar must not meet, by their numbers, and their clearance.

        Those that move with the hand count in flight only, if they are clear of the bar as gripped.
        """
        ends, groups, radii = self._capsules
        if self.moved is None:
            return {}
        hand = len(self.moved.throwing)
        found = {k: 0.0 for k, group in enumerate(groups) if group != hand}
        gripped = bar.held(self.motion.hand.at(self.ticks[:1])[0])
        axis, radius = bar.axes(gripped, self.motion.plane)[part]
        for k in (k for k, group in enumerate(groups) if flies and group == hand):
            own = self.moved.arm.capsules[k].link == self.moved.arm.joints + 1
            if own and self._has_palm:
                continue
            kept = (self.scene.workspace and self.scene.workspace.palm_clearance) or 0.0
            kept = kept if own else 0.0
            away = shapes.between_segments(*axis, *ends[k][:, :1])[0] - radius - radii[k]
            if away > kept:
                found[k] = kept
        return found

    def _of_axis(
        self,
        axis: list[Array],
        times: Array,
        radius: float,
        links: dict[int, float],
        flies: bool,
        planned: bool,
    ) -> Iterator[tuple[str, float, float]]:
        """Distances of the bar's capsule to obstacles and `links`: name, least [m], clearance."""
        for solid in self.solids:
            away = solid.distance(*axis) - radius
            kept = np.full(away.shape, solid.clearance if planned else 0.0)
            if flies:
                moved = np.max([np.linalg.norm(np.diff(e, axis=0), axis=1) for e in axis], axis=0)
                # Its middle half may not be inside an obstacle.
                lands = np.minimum(kept, np.maximum(away[-1], (MIDDLE - 1) * radius) - moved[-1])
                kept = np.where(times > times[-1] - LANDS, lands, kept)
                if solid.wall:
                    # Nearer to the rim its edge counts, see `bins`.
                    top = solid.centre[2] + solid.half[2] + solid.clearance + radius
                    above = np.flatnonzero(np.minimum(*(end[:, 2] for end in axis)) >= top)
                    if above.size:
                        kept[above[-1] + 1 :] = -math.inf
            worst = int(np.argmin(away - kept))
            yield solid.name, float(away[worst]), float(kept[worst])
        ends, _, radii = self._capsules
        if links:
            # Between ticks of a millisecond links move linearly, to some micrometres.
            after = np.searchsorted(self.ticks, times).clip(1, self.ticks.size - 1)
            first, last = self.ticks[after - 1], self.ticks[after]
            share = ((times - first) / (last - first)).clip(0.0, 1.0)[:, None]
            away = []
            for k, kept in links.items():
                link = (1 - share) * ends[k][:, after - 1] + share * ends[k][:, after]
                apart = shapes.between_segments(*axis, *link).min()
                away.append((apart - radii[k] - radius, kept if planned else 0.0))
            yield "links", *min(away, key=lambda found: found[0] - found[1])

    def _way_in(self, bar: Bar, flight: Flight) -> float:
        """Least clearance [m] of wall and rim until the bar is inserted; -inf if it never is."""
        cup = self.scene.cup

        def depth(since: Any) -> Array:
            return np.asarray(cup.rim - bar.lowest(flight.at(np.atleast_1d(since))))

        times = np.linspace(0.0, flight.duration + BEYOND, FLIGHT)
        below = depth(times)
        deep = np.flatnonzero(below >= cup.insertion)
        above = np.flatnonzero(below[: deep[0]] < 0.0) if deep.size else deep
        if not above.size:
            return -math.inf
        first, last = above[-1], deep[0]
        begin = brentq(lambda t: depth(t)[0], times[first], times[first + 1])
        end = brentq(lambda t: depth(t)[0] - cup.insertion, times[last - 1], times[last])
        since = np.linspace(begin, end, WAY_IN)
        middle = cup.x + self.speed * (flight.begins + since)
        # A bar's thickness equals its width: a round cup is narrower off its middle.
        half = math.sqrt(cup.radius**2 - (0.0 if bar.capsules else bar.half) ** 2)
        found = math.inf
        for part in bar.parts:
            corners = part.placed(flight.at(since))
            wall = (half - np.abs(corners[..., 0] - middle[:, None]))[corners[..., 1] <= cup.rim]
            rims = (np.column_stack([middle + x, 0 * since + cup.rim]) for x in (-half, half))
            away = [shapes.from_outline(rim, corners).min() for rim in rims]
            found = min(
                found, wall.min(initial=math.inf) - part.radius, *np.subtract(away, part.radius)
            )
        return float(found)
