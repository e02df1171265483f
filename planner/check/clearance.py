"""How near arm, held bar and flying bar come to obstacles, floor and the arm itself, in 3-D.

Everything that moves is a capsule: the arm's links, and the bar with its corners. Between samples a
distance falls by no more than half of what the bodies move beyond the half that the samples
explain, so a clearance that is kept is kept at every instant.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
import numpy.typing as npt

from ...core import ThrownC, address, library
from ...models import ArmCapsules, Array, Solid, segment_distance
from ...problems import InputError, Scene
from .bodies import LANDING, Around, Thing, bar_ends, pairs_of
from .geometry import held_bar
from .mover import Mover
from .sending import TICK
from .throw import Throw

#: Samples between those at which a pair is measured first.
COARSE = 16
#: Rounding [m] that breaks no clearance.
ROUNDING = 1e-6
#: The bar, among names of links.
BAR = "bar"


@dataclass(frozen=True)
class Nearness:
    """Two bodies nearer to each other than they may be: missing [m] at time [s].

    thing: None where the arm meets itself; flying: whether the body is the bar after detach.
    """

    body: str
    other: str
    thing: Thing | None
    missing: float
    time: float
    flying: bool

    @property
    def words(self) -> str:
        """For people."""
        when = f"at {1e3 * self.time:.0f} ms"
        if self.thing is None:
            return f"{self.body} meets {self.other} {when}"
        away = 1e3 * (self.thing.clearance - self.missing)
        near = f"comes as near as {away:.0f} mm" if away > 0 else "meets it"
        return f"{self.thing.words}: {self.body} {near} {when}"


@dataclass(frozen=True)
class Track:
    """Bodies that move together for a while: names (C,), ends (C, 2, 3, N) [m] in the throw's
    plane, radius (C,) [m], how far their covers stick out (C,) [m], times (N,) [s]."""

    names: tuple[str, ...]
    ends: Array
    radius: Array
    cover: Array
    times: Array
    flying: bool

    @property
    def reach(self) -> Array:
        """Radii (C,) [m] with the covers, as obstacles meet them."""
        return self.radius + self.cover

    def travel(self, body: int) -> Array:
        """How far (N,) [m] the body has moved at most, since the first time."""
        steps = np.linalg.norm(np.diff(self.ends[body], axis=-1), axis=1).max(axis=0)
        return np.concatenate([[0.0], np.cumsum(steps)])


def contacts(throw: Throw) -> list[Nearness]:
    """Bodies that come nearer to an obstacle, or to each other, than they may."""
    scene, mover = throw.scene, throw.mover
    if not scene.obstacle and mover.capsules is None:
        return []
    around = Around.of(scene, mover)
    found = _by_core(throw, around)
    if found is None:
        tracks = _tracks(throw, around.capsules)
        found = [found for track in tracks for found in nearnesses(track, around)]
    return found


def _tracks(throw: Throw, capsules: ArmCapsules | None) -> Iterator[Track]:
    """From rest to detach, from there to the landing, from there to rest if that is later."""
    scene, release, path = throw.scene, throw.release, throw.path
    carry = np.arange(0.0, throw.opening_time, TICK)
    held = np.hstack([held_bar(scene, throw.hand(carry).pose), release.com])
    before = np.concatenate([carry, throw.opening_time + release.times])
    yield track_of(scene, capsules, before, path.at(before).pose, held)
    flight = throw.landing.flight_time
    since = np.linspace(0.0, flight, math.ceil(flight / TICK) + 1)
    after = throw.detach_time + since
    yield track_of(scene, capsules, after, path.at(after).pose, throw.flight(since), flying=True)
    rest = np.append(np.arange(after[-1], throw.until, TICK), throw.until)
    if rest.size > 1:
        yield track_of(scene, capsules, rest, path.at(rest).pose)


def track_of(
    scene: Scene,
    capsules: ArmCapsules | None,
    times: Array,
    q: Array,
    com: Array | None = None,
    *,
    flying: bool = False,
) -> Track:
    """Arm at coordinates q (n, N) and bar at CoM poses (3, N), at times (N,) [s]."""
    names, ends, radius, cover = list[str](), list[Array](), list[float](), list[float]()
    if capsules is not None:
        names += capsules.names
        ends.append(capsules.at(q))
        radius += capsules.radius.tolist()
        cover += [capsules.arm.arm.cover] * len(names)
    if com is not None:
        names.append(BAR)
        ends.append(bar_ends(scene.object, com))
        # Around its corners: it is as thick as it is wide.
        radius.append(scene.object.width / math.sqrt(2))
        cover.append(0.0)
    placed = np.concatenate(ends) if ends else np.zeros((0, 2, 3, times.size))
    return Track(tuple(names), placed, np.array(radius), np.array(cover), times, flying)


@dataclass(frozen=True)
class _Pair:
    """A moving body and what it must stay away from: needed [m] (N,); distance at some samples."""

    names: tuple[str, str]
    thing: Thing | None
    away: Callable[[npt.NDArray[np.intp]], Array]
    travel: Array
    needed: Array
    flying: bool


def nearnesses(track: Track, around: Around) -> Iterator[Nearness]:
    """Moving bodies too near to an obstacle; links, or the bar and a link, that meet."""
    for pair in _pairs(track, around):
        missing, when = _missing(pair.away, pair.travel, pair.needed)
        if missing > ROUNDING:
            at = float(track.times[when])
            yield Nearness(*pair.names, pair.thing, missing, at, pair.flying)


def least_room(track: Track, around: Around) -> Array:
    """How much farther (N,) [m] bodies are apart than they must be, at least; infinite for none."""
    every = np.arange(track.times.size)
    rooms = [pair.away(every) - pair.needed for pair in _pairs(track, around)]
    return np.asarray(np.min([np.full(every.size, np.inf), *rooms], axis=0))


def _pairs(track: Track, around: Around) -> Iterator[_Pair]:
    """Moving bodies and obstacles; links that may meet, or the bar and a link."""
    capsules, bar = around.capsules, track.names[-1] == BAR
    moves = [*(() if capsules is None else capsules.moves), True]
    for thing in around.things:
        for body in np.flatnonzero(moves[: len(track.names)]).tolist():
            is_bar = track.names[body] == BAR
            if is_bar and not thing.bar:
                continue
            ends, travel = track.ends[body], track.travel(body)
            away = partial(_away, thing.solid, ends)
            needed = np.full(travel.shape, track.reach[body] + thing.clearance)
            flying = track.flying and is_bar
            if flying:
                lands = float(away(np.array([travel.size - 1]))[0])
                near = min(lands, float(needed[0])) - np.diff(travel, prepend=0.0)
                needed = np.where(track.times > track.times[-1] - LANDING, near, needed)
            names = track.names[body], thing.name
            yield _Pair(names, thing, away, travel, needed, flying)
    for one, other in () if capsules is None else pairs_of(capsules, bar=bar, flying=track.flying):
        away = partial(_apart, *track.ends[other], *track.ends[one])
        travel = track.travel(one) + track.travel(other)
        needed = np.full(travel.shape, track.radius[one] + track.radius[other])
        flying = track.flying and other == len(moves) - 1
        yield _Pair((track.names[other], track.names[one]), None, away, travel, needed, flying)


def _away(solid: Solid, ends: Array, some: npt.NDArray[np.intp]) -> Array:
    return solid.distance(ends[0][:, some].T, ends[1][:, some].T)


def _apart(a: Array, b: Array, c: Array, d: Array, some: npt.NDArray[np.intp]) -> Array:
    return segment_distance(*(end[:, some].T for end in (a, b, c, d)))


def _missing(
    distance: Callable[[npt.NDArray[np.intp]], Array], travel: Array, needed: Array
) -> tuple[float, int]:
    """How much [m] is missing of the distance needed (N,) at most, and at which sample."""
    last = len(travel) - 1
    coarse = np.unique(np.append(np.arange(0, last, COARSE), last))
    most = np.maximum.reduceat(needed, coarse)[:-1] if last else needed
    bound = _between(distance(coarse), travel[coarse])
    doubtful = np.flatnonzero(bound < np.maximum(most, needed[coarse[1:]]))
    worst, when = -math.inf, 0
    for k in doubtful:
        fine = np.arange(coarse[k], coarse[k + 1] + 1)
        least = needed[fine]
        missing = np.maximum(least[:-1], least[1:]) - _between(distance(fine), travel[fine])
        if missing.max() > worst:
            worst, when = float(missing.max()), int(fine[missing.argmax()])
    return worst, when


def _between(distance: Array, travel: Array) -> Array:
    """The least that the distance (N,) can be between samples (N - 1,), by how far bodies move."""
    return np.asarray((distance[:-1] + distance[1:] - np.diff(travel)) / 2)


#: Numbers of a contact that the compiled core gives.
_FOUND = 5


def _by_core(throw: Throw, around: Around) -> list[Nearness] | None:
    """The same by the compiled core; None without it."""
    core, moved, arm = library(), throw.path.core, throw.mover.kinematics.core
    if core is None or moved is None or arm is None:
        return None
    release, scene = throw.release, throw.scene
    bodies = around.core(scene)
    links, pairs = bodies.links, bodies.held_pairs
    times, com = throw.opening_time + release.times, np.ascontiguousarray(release.com)
    start = np.concatenate([com[:, -1], release.com_twist[:, -1]])
    thrown = ThrownC(ctypes.addressof(moved), ctypes.addressof(arm), TICK, throw.opening_time)
    thrown.detach, thrown.flight, thrown.gravity = (
        times[-1],
        throw.landing.flight_time,
        scene.gravity,
    )
    thrown.nodes, thrown.times, thrown.com = len(times), address(times), address(com)
    thrown.start = address(start)
    found = np.empty((3 * (bodies.solids * (links + 1) + pairs), _FOUND))
    by, core.near_bodies.restype = ctypes.byref, ctypes.c_long
    count = core.near_bodies(by(thrown), by(bodies), ctypes.c_void_p(address(found)))
    if count < 0:
        return None
    names = [*(() if around.capsules is None else around.capsules.names), BAR]
    result = []
    for track, body, other, missing, time in found[:count].tolist():
        known = around.things[int(other)] if other >= 0 else None
        name = names[-1 - int(other)] if known is None else known.name
        flying = track == 1 and body == links
        result.append(Nearness(names[int(body)], name, known, missing, time, flying))
    return result


def overlap(
    scene: Scene, mover: Mover, q: Array, com: Array | None = None, *, flying: bool = False
) -> Array:
    """How far [m] (N,) two bodies of an arm, or the bar, are nearer than they may be; below 0 not.

    q (n, N): coordinates, each an instant of its own; com (3, N): poses of the bar, None without
    it. Obstacles do not count: they depend on where the throw goes.
    """
    capsules = mover.capsules
    if capsules is None:
        return np.full(q.shape[1], -np.inf)
    core, arm = library(), mover.kinematics.core
    if core is not None and arm is not None:
        bodies, count = Around((), capsules).core(scene), q.shape[1]
        rows = np.ascontiguousarray(q.T), None if com is None else np.ascontiguousarray(com.T)
        missing, by = np.empty(count), ctypes.byref
        given = [None if row is None else ctypes.c_void_p(address(row)) for row in (*rows, missing)]
        core.overlaps.restype = ctypes.c_int
        if core.overlaps(count, by(arm), by(bodies), flying, *given) == 0:
            return missing
    track = track_of(scene, capsules, np.zeros(q.shape[1]), q, com, flying=flying)
    return -least_room(track, Around((), capsules))


def check_obstacles(scene: Scene, mover: Mover) -> None:
    """InputError where an obstacle holds the target's pose or is too near to a given start.

    The bar may lie on an obstacle.
    """
    target, bar = scene.target, scene.object
    assert target is not None
    pose = np.array([[target.plane_x], [target.z], [target.theta or 0.0]])
    ends = bar_ends(bar, pose)[0]
    if target.theta is None:
        ends[:] = pose[0], [0.0], pose[1]
    around = Around.of(scene, mover)
    for thing in around.things:
        solid = thing.solid
        if thing.bar and solid.distance(ends[0].T, ends[1].T)[0] < bar.width / 4:
            raise InputError(f"{scene.place}: the target's pose is inside {thing.words}")

        if mover.start is None:
            continue
        q = mover.start[:, None]
        held = held_bar(scene, mover.motion(q, 0 * q, 0 * q)[0])
        start = track_of(scene, around.capsules, np.zeros(1), q, held)
        kept = [name != "base" for name in start.names]
        if around.capsules is not None and not thing.bar:
            kept = [*around.capsules.moves, False]
        for body in np.flatnonzero(kept).tolist():
            name, (begin, end) = start.names[body], start.ends[body]
            away = float(solid.distance(begin.T, end.T)[0]) - start.reach[body]
            if away < thing.clearance:
                words = f"{1e3 * max(away, 0.0):.0f} mm from the start pose's {name}"
                raise InputError(
                    f"{scene.place}: {thing.words}: {words}, its clearance is "
                    f"{1e3 * thing.clearance:.0f} mm"
                )
