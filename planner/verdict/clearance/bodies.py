"""Clearances of arm and bar, as capsules in 3-D, to obstacles, the floor and each other."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from ....core import Structure, array, library, out, rows, structures
from ....models import Array, sticking_state
from ....models.robot import ArmCapsules, Solid, segment_distance, shape_overlaps
from ....problems import InputError, Object, Scene, ThrowPlane
from ...throw import Manipulator
from .outlines import bar_ends, held_bar

#: Time [s] before the landing in which the bar may be as near to an obstacle as at the landing.
LANDING = 0.05
#: Share of the bar's radius within which it may not be inside an obstacle as it lands: the middle
#: half of its width, as the capsule around it is wider by the square root of 2.
MIDDLE = 0.35
#: Name of the bar, among those of links.
BAR = "bar"


@dataclass(frozen=True)
class KeepOut:
    """A body that the arm avoids: its shape, clearance [m], whether the bar avoids it too, and
    whether it is a bin's wall, which a flying bar avoids until it comes down to the rim."""

    name: str
    solid: Solid
    clearance: float
    bar: bool = True
    of_bin: bool = False

    @property
    def words(self) -> str:
        """Name in messages."""
        return f"obstacle {self.name}" if self.bar and not self.of_bin else self.name

    @cached_property
    def core(self) -> Structure:
        """The body for the compiled core."""
        solid, found = self.solid, Structure("solid")
        found.centre, found.half = solid.centre.tolist(), solid.half.tolist()
        found.axes = solid.axes.ravel().tolist()
        found.radius, found.clearance = solid.radius, self.clearance
        found.bar = self.bar + self.of_bin
        return found


@dataclass(frozen=True)
class Clearance:
    """Two bodies too near to each other: penetration [m] of their clearance [m], at time [s].

    thing: None if the arm meets itself or the bar; flying: whether the body is the bar after
    detach.
    """

    body: str
    other: str
    thing: KeepOut | None
    clearance: float
    penetration: float
    time: float
    flying: bool


@dataclass(frozen=True)
class SweptBodies:
    """Moving bodies: names (C,), ends (C, 2, 3, N) [m] in the throw's plane, radius (C,) [m],
    times (N,) [s]."""

    names: tuple[str, ...]
    ends: Array
    radius: Array
    times: Array
    flying: bool = False

    @property
    def core(self) -> tuple[int, int, bool]:
        """Number of instants, how many of the bodies are the object's, and whether it flies."""
        return self.times.size, self.names.count(BAR), self.flying

    def arrays(self, around: Structure) -> tuple[Any, Any]:
        """Times and ends for the core, which reads the links of `around` and the object's parts."""
        n, bar, _ = self.core
        ends, times = (np.ascontiguousarray(v, float) for v in (self.ends, self.times))
        return array(times, n), array(ends, around.links + bar, 2, 3, n)


@dataclass(frozen=True)
class CollisionScene:
    """Obstacles and floor in the frame of the throw's plane, and the arm's shape.

    The floor is for the arm only: the held bar's distance to it is that of the bar's corners.
    arm: its capsules in the plane at azimuth 0; azimuth [rad]: of the plane.
    """

    scene: Scene
    things: tuple[KeepOut, ...]
    arm: ArmCapsules | None
    azimuth: float = 0.0

    @classmethod
    def of(
        cls, scene: Scene, manipulator: Manipulator, plane: ThrowPlane | None = None
    ) -> CollisionScene:
        """The bodies of a scene; plane: of the throw, by default that of the scene's target."""
        plane = plane or scene.aim.plane
        found = [KeepOut(o.name, plane.seen(o.solid), o.clearance) for o in scene.obstacle]
        walls = scene.bodies_around[len(found) :]
        found += [KeepOut(o.name, plane.seen(o.solid), o.clearance, of_bin=True) for o in walls]
        floor = scene.bounds.floor
        if manipulator.capsules is not None and floor is not None:
            found.append(_floor(floor))
        return cls(scene, tuple(found), manipulator.capsules, plane.azimuth)

    @cached_property
    def capsules(self) -> ArmCapsules | None:
        """The arm's capsules in the throw's plane."""
        return None if self.arm is None else self.arm.aimed(self.azimuth)

    def pairs(self, *, flying: bool) -> list[tuple[int, int, float]]:
        """Pairs of bodies of the arm, and last the bar, that must not meet, and their clearance
        [m]: see `_pairs_of`. flying: those of the bar in flight too, see `hand_pairs`."""
        if self.arm is None:
            return []
        found = _pairs_of(self.arm, len(bar_radii(self.scene.object)))
        return found + (hand_pairs(self.scene, self.arm) if flying else [])

    @cached_property
    def core(self) -> Structure:
        """Scene, arm and bar for the compiled core."""
        found = _shape(self.arm, self.scene.object, *_grip(self.scene)).copy()
        found.solids = len(self.things)
        found.around = structures("solid", [thing.core for thing in self.things])
        if self.arm is not None and self.azimuth:
            # Only the base's capsules depend on the azimuth.
            found.places = array(self.arm.places_at(self.azimuth), found.links, 2, 3)
        return found

    @property
    def most_contacts(self) -> int:
        """How many pairs of bodies may be too near at once."""
        c = self.core.c
        return int(c.solids * (c.links + c.bar) + c.pairs)

    def bodies_at(
        self, times: Array, q: Array, com: Array | None = None, *, flying: bool = False
    ) -> SweptBodies:
        """Arm at coordinates q (n, N) and bar at CoM poses (3, N), at times (N,) [s]."""
        capsules = self.capsules
        links = None if capsules is None else capsules.at(q)
        held = None if com is None else bar_ends(self.scene.object, com)
        return self.swept(times, links, held, flying=flying)

    def swept(
        self, times: Array, links: Array | None, held: Array | None, *, flying: bool = False
    ) -> SweptBodies:
        """The arm's capsules and the object's with these ends (C, 2, 3, N) at times (N,) [s]."""
        names, ends = list[str](), [np.zeros((0, 2, 3, times.size))]
        radius = list[float]()
        if self.arm is not None and links is not None:
            names += self.arm.names
            ends.append(links)
            radius += self.arm.radius.tolist()
        if held is not None:
            radii = bar_radii(self.scene.object)
            names += [BAR] * len(radii)
            ends.append(held)
            radius += radii
        placed = np.concatenate(ends)
        return SweptBodies(tuple(names), placed, np.array(radius), times, flying)

    def clearances(self, track: SweptBodies) -> list[Clearance]:
        """Pairs of bodies that are too near: one with an obstacle, two links, or bar and link."""
        found = rows("contact", self.most_contacts)
        given, room = track.arrays(self.core), out(found, len(found), of="contact")
        count = library().near_track(self.core, *track.core, *given, room)
        if count < 0:
            raise MemoryError
        return self.list_clearances(found[:count], track.names)

    def list_clearances(self, found: Array, names: tuple[str, ...] = ()) -> list[Clearance]:
        """The core's contacts (N, 5), of bodies with these names, by default the arm's and the
        object's."""
        if not names:
            names = (*(() if self.arm is None else self.arm.names), *[BAR] * self.core.bar)
        result = []
        for body, flies, other, penetration, time in found.tolist():
            thing = self.things[int(other)] if other >= 0 else None
            name = names[-1 - int(other)] if thing is None else thing.name
            flying = flies and names[int(body)] == BAR
            clearance = 0.0 if thing is None else thing.clearance
            if flying and name == "hand":
                clearance = self.scene.bounds.palm_clearance or 0.0
            result.append(
                Clearance(names[int(body)], name, thing, clearance, penetration, time, bool(flying))
            )
        return result

    def min_clearance(self, track: SweptBodies) -> Array:
        """Least distance (N,) [m] of bodies beyond their clearances; infinite without a pair.

        In the last `LANDING` of its flight the bar may be as near to an obstacle as it lands, its
        middle half outside.
        """
        room = np.empty(track.times.size)
        given, found = track.arrays(self.core), out(room, track.times.size)
        library().rooms(self.core, *track.core, *given, found)
        return room

    def obstacle_around(self, ends: Array, radius: float) -> KeepOut | None:
        """The first obstacle that contains part of a capsule of ends (2, 3) and radius [m]."""
        bar = bar_radii(self.scene.object)[0]
        still = SweptBodies((BAR,), ends[None, ..., None], np.full(1, bar), np.zeros(1))
        for thing in self.things:
            alone = CollisionScene(self.scene, (replace(thing, clearance=radius - bar),), None)
            if alone.min_clearance(still)[0] < -1e-6:
                return thing
        return None


@lru_cache(maxsize=8)
def _floor(height: float) -> KeepOut:
    """The space below a height [m], as a plate that no link reaches around or through.

    Penetrations are known up to half its thickness."""
    half, radius = np.array([100.0, 100.0, 0.0]), 1.0
    plate = Solid(np.array([0.0, 0.0, height - radius]), np.eye(3), half, radius)
    return KeepOut("floor", plate, 0.0, bar=False)


def bar_radii(bar: Object) -> list[float]:
    """Radii [m] of the object's capsules: of its outline, or the distance of a bar's edges from its
    axis, as its thickness equals its width."""
    return [part.radius for part in bar.outline] or [bar.width / math.sqrt(2)]


def _pairs_of(capsules: ArmCapsules, parts: int) -> list[tuple[int, int, float]]:
    """Pairs of bodies, as indices in a track, that move relative to each other and do not adjoin,
    and the clearance [m] between them, below 0 for an overlap that is allowed: see
    `shape_overlaps`. The object's parts are last.
    """
    count, moved = len(capsules.number), capsules.moved_by
    allowed = shape_overlaps(capsules.arm.arm)
    found = [
        (i, j, -float(allowed[i, j]))
        for i, j in itertools.combinations(range(count), 2)
        if moved[i] != moved[j] and np.isfinite(allowed[i, j])
    ]
    apart = [i for i in range(count) if moved[i] != capsules.hand_moved_by]
    return found + [(i, count + part, 0.0) for part in range(parts) for i in apart]


def _grip(scene: Scene) -> tuple[float, float, float | None]:
    """Offset of the CoM [m] and grasp angle [rad] in the hand; `palm_clearance` [m]."""
    return scene.com_offset, scene.grasp.angle, scene.bounds.palm_clearance


def hand_pairs(scene: Scene, capsules: ArmCapsules) -> list[tuple[int, int, float]]:
    """Capsules that move with the hand and the object's parts, as indices in a track, that must not
    meet in flight, and their clearance [m].

    Bodies that are nearer as the object is gripped, as fingers are, have no pair. The hand's own
    capsules keep `palm_clearance`; they have no pair where the palm is measured instead.
    """
    return list(_hand_pairs(capsules, scene.object, *_grip(scene)))


@lru_cache(maxsize=8)
def _hand_pairs(
    capsules: ArmCapsules, bar: Object, offset: float, angle: float, clearance: float | None
) -> tuple[tuple[int, int, float], ...]:
    # All from the joint that moves the hand, its link's angle being 0.
    arm, count, found = capsules.arm, len(capsules.number), list[tuple[int, int, float]]()
    hand = np.array([[*arm.links[-1], arm.theta]]).T
    held = bar_ends(bar, np.array(sticking_state(hand, np.zeros(3), angle, offset)[:3]))[..., 0]
    for i, number in enumerate(capsules.number):
        own = number == capsules.hand
        if capsules.moved_by[i] != capsules.hand_moved_by:
            continue
        if own and arm.arm.tool.has_palm and clearance is not None:
            continue
        apart = clearance or 0.0 if own else 0.0
        link = np.broadcast_to(capsules.places[i], held.shape)
        gaps = segment_distance(held[:, 0], held[:, 1], link[:, 0], link[:, 1])
        for part, (gap, radius) in enumerate(zip(gaps, bar_radii(bar), strict=True)):
            if gap - radius - capsules.radius[i] > apart:
                found.append((i, count + part, apart))
    return tuple(found)


@lru_cache(maxsize=8)
def _shape(
    capsules: ArmCapsules | None, bar: Object, offset: float, angle: float, clearance: float | None
) -> Structure:
    """Arm, in the plane at azimuth 0, and bar for the compiled core."""
    links, parts = 0 if capsules is None else len(capsules.number), bar_radii(bar)
    moved_by, moves = np.zeros(links, np.int64), np.ones(links + len(parts), np.int64)
    places, pairs, always = np.zeros((links, 2, 3)), list[tuple[int, int, float]](), 0
    radius = np.array([0.0] * links + parts)
    if capsules is not None:
        moved_by[:], moves[:links], places[:] = capsules.moved_by, capsules.moves, capsules.places
        radius[:links] = capsules.radius
        pairs = _pairs_of(capsules, len(parts))
        always = len(pairs)
        pairs += _hand_pairs(capsules, bar, offset, angle, clearance)
    found = Structure("bodies", links=links, bar=len(parts), pairs=len(pairs), always=always)
    found.landing, found.middle = LANDING, MIDDLE
    found.behind, found.length = bar.com, bar.length
    meet = np.array([pair[:2] for pair in pairs], np.int64).reshape(-1, 2)
    apart = np.array([pair[2] for pair in pairs])
    found.attach(
        moved_by=array(moved_by, links),
        moves=array(moves, links + len(parts)),
        places=array(places, links, 2, 3),
        radius=array(radius, links + len(parts)),
        meet=array(meet, len(pairs), 2),
        apart=array(apart, len(pairs)),
    )
    if bar.outline:
        found.outline = array(bar.capsules, len(parts), 5)
    return found


def overlap(scene: Scene, manipulator: Manipulator, q: Array, com: Array | None = None) -> Array:
    """Largest penetration [m] (N,) between two links, or bar and link; below 0: a distance.

    q (n, N): coordinates, each an instant of its own; com (3, N): poses of the bar, None without
    it. Obstacles are excluded: their places depend on the throw's plane.
    """
    capsules = manipulator.capsules
    if capsules is None:
        return np.full(q.shape[1], -np.inf)
    bodies, n = CollisionScene(scene, (), capsules).core, q.shape[1]
    penetration, arm = np.empty(n), manipulator.kinematics.core
    rows = array(np.ascontiguousarray(q.T), n, arm.n)
    bar = None if com is None else array(np.ascontiguousarray(com.T), n, 3)
    if library().overlaps(n, arm, bodies, rows, bar, out(penetration, n)):
        raise MemoryError
    return penetration


def check_obstacles(scene: Scene, manipulator: Manipulator) -> None:
    """InputError if an obstacle contains the target's pose, penetrates a link that no throw moves,
    or is too near to a given start.

    The bar may lie on an obstacle, and the arm's base may stand on one.
    """
    target, bar = scene.aim, scene.object
    around = CollisionScene.of(scene, manipulator)
    x, theta = target.grid(9)
    radii = [MIDDLE * radius for radius in bar_radii(bar)]
    places = np.moveaxis(bar_ends(bar, np.array([x, np.full(x.size, target.z), theta])), -1, 0)
    if target.theta is None:
        places[:] = np.array([x, 0.0 * x, np.full(x.size, target.z)]).T[:, None, None]
    inside = [
        next(filter(None, map(around.obstacle_around, parts, radii)), None) for parts in places
    ]
    if (thing := inside[0]) is not None and all(inside):
        raise InputError(f"{scene.place}: the target's pose is inside {thing.words}")
    capsules = around.capsules
    if capsules is not None:
        # Verdicts check moving links only.
        ends = capsules.at(np.zeros((manipulator.size, 1)))
        for k, number in enumerate(capsules.number):
            if number == 0 or capsules.moves[k]:
                continue
            radius = float(capsules.radius[k])
            if (thing := around.obstacle_around(ends[k, ..., 0], radius)) is not None:
                raise InputError(f"{scene.place}: {thing.words}: inside {capsules.names[k]}")
    if manipulator.start is None:
        return
    # Two instants at rest: the core measures between instants.
    q = np.repeat(manipulator.start[:, None], 2, axis=1)
    held = held_bar(scene, manipulator.motion(q, 0 * q, 0 * q)[0])
    for found in around.clearances(around.bodies_at(np.zeros(2), q, held)):
        if found.thing is not None:
            away = 1e3 * max(found.clearance - found.penetration, 0.0)
            raise InputError(
                f"{scene.place}: {found.thing.words}: {away:.0f} mm from the start pose's "
                f"{found.body}, its clearance is {1e3 * found.clearance:.0f} mm"
            )
