"""How near arm, held bar and flying bar come to obstacles, floor and the arm itself, in 3-D."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ....core import library
from ....models import Array
from ....models.robot import ArmCapsules
from ....problems import InputError, Scene
from ..manipulator import Manipulator
from ..throw import Throw
from .bodies import CollisionScene, KeepOut, bar_ends
from .geometry import held_bar

#: The bar, among names of links.
BAR = "bar"
#: Numbers of a contact that the compiled core gives.
CONTACT = 5


@dataclass(frozen=True)
class Clearance:
    """Two bodies nearer to each other than they may be: missing [m] at time [s].

    thing: None where the arm meets itself; flying: whether the body is the bar after detach.
    """

    body: str
    other: str
    thing: KeepOut | None
    penetration: float
    time: float
    flying: bool


@dataclass(frozen=True)
class SweptBodies:
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


def contacts(throw: Throw) -> list[Clearance]:
    """Bodies that come nearer to an obstacle, or to each other, than they may."""
    if not throw.scene.obstacle and throw.manipulator.capsules is None:
        return []
    around = CollisionScene.of(throw.scene, throw.manipulator)
    bodies = around.core(throw.error.theta)
    found = np.empty((3 * (bodies.solids * (bodies.links + 1) + bodies.pairs), CONTACT))
    count = library().near_bodies(throw.core, bodies, found)
    names = (*(() if around.arm is None else around.arm.names), BAR)
    return _clearances(around, names, found, count)


def _clearances(
    around: CollisionScene, names: tuple[str, ...], found: Array, count: int
) -> list[Clearance]:
    """What the core says of the bodies of these names."""
    if count < 0:
        raise MemoryError
    result = []
    for track, body, other, penetration, time in found[:count].tolist():
        thing = around.things[int(other)] if other >= 0 else None
        name = names[-1 - int(other)] if thing is None else thing.name
        flying = track == 1 and names[int(body)] == BAR
        result.append(Clearance(names[int(body)], name, thing, penetration, time, flying))
    return result


def swept_bodies(
    scene: Scene,
    capsules: ArmCapsules | None,
    times: Array,
    q: Array,
    com: Array | None = None,
    *,
    flying: bool = False,
) -> SweptBodies:
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
    return SweptBodies(tuple(names), placed, np.array(radius), np.array(cover), times, flying)


def clearances_of(track: SweptBodies, around: CollisionScene) -> list[Clearance]:
    """Moving bodies too near to an obstacle; links, or the bar and a link, that meet."""
    bodies, bar = around.core(), BAR in track.names
    found = np.empty((bodies.solids * len(track.names) + bodies.pairs, CONTACT))
    ends, times = np.ascontiguousarray(track.ends), np.ascontiguousarray(track.times, float)
    count = library().near_track(bodies, times.size, bar, track.flying, times, ends, found)
    return _clearances(around, track.names, found, count)


def min_clearance(track: SweptBodies, around: CollisionScene, *, bar_only: bool = False) -> Array:
    """How much farther (N,) [m] bodies are apart than they must be, at least; infinite for none.

    At the end of its flight the bar may come as near to an obstacle as it lands. bar_only: of the
    bar only, and without that.
    """
    bodies, bar, room = around.core(), BAR in track.names, np.empty(track.times.size)
    ends, times = np.ascontiguousarray(track.ends), np.ascontiguousarray(track.times, float)
    library().rooms(bodies, times.size, bar, track.flying, bar_only, times, ends, room)
    return room


def bar_room(throw: Throw, times: Array, com: Array, *, flying: bool) -> Array:
    """How much farther (N,) [m] the bar is from obstacles and links than it must be, at times (N,)
    [s]; com (3, N): its poses; infinite for none."""
    scene, manipulator = throw.scene, throw.manipulator
    if not scene.obstacle and manipulator.capsules is None:
        return np.full(times.size, np.inf)
    around, q = CollisionScene.of(scene, manipulator), throw.path.at(times).pose
    track = swept_bodies(scene, around.capsules, times, q, com, flying=flying)
    return min_clearance(track, around, bar_only=True)


def overlap(
    scene: Scene,
    manipulator: Manipulator,
    q: Array,
    com: Array | None = None,
) -> Array:
    """How far [m] (N,) two bodies of an arm, or the bar, are nearer than they may be; below 0 not.

    q (n, N): coordinates, each an instant of its own; com (3, N): poses of the bar, None without
    it. Obstacles do not count: they depend on where the throw goes.
    """
    capsules = manipulator.capsules
    if capsules is None:
        return np.full(q.shape[1], -np.inf)
    bodies = CollisionScene(scene, (), capsules).core()
    rows = np.ascontiguousarray(q.T), None if com is None else np.ascontiguousarray(com.T)
    penetration, arm = np.empty(q.shape[1]), manipulator.kinematics.core
    if library().overlaps(q.shape[1], arm, bodies, *rows, penetration):
        raise MemoryError
    return penetration


def check_obstacles(scene: Scene, manipulator: Manipulator) -> None:
    """InputError where an obstacle holds the target's pose, is in a link that no throw moves, or is
    too near to a given start.

    The bar may lie on an obstacle, and the arm's base stand on one.
    """
    target, bar = scene.target, scene.object
    assert target is not None
    around = CollisionScene.of(scene, manipulator)
    # What lies still is seen at two instants: bodies are looked at between them.
    pose = np.repeat([[target.plane_x], [target.z], [target.theta or 0.0]], 2, axis=1)
    ends, radius = bar_ends(bar, pose), bar.width / math.sqrt(2)
    if target.theta is None:
        ends[:] = pose[0], np.zeros(2), pose[1]
    here = SweptBodies((BAR,), ends, np.array([radius]), np.zeros(1), np.zeros(2), flying=False)
    inside = [replace(thing, clearance=bar.width / 4 - radius) for thing in around.things]
    for found in clearances_of(here, CollisionScene(scene, tuple(inside), None)):
        assert found.thing is not None
        raise InputError(f"{scene.place}: the target's pose is inside {found.thing.words}")
    _check_still_links(scene, around)
    if manipulator.start is None:
        return
    q = np.repeat(manipulator.start[:, None], 2, axis=1)
    held = held_bar(scene, manipulator.motion(q, 0 * q, 0 * q)[0])
    for found in clearances_of(swept_bodies(scene, around.capsules, np.zeros(2), q, held), around):
        if found.thing is not None:
            away = 1e3 * max(found.thing.clearance - found.penetration, 0.0)
            raise InputError(
                f"{scene.place}: {found.thing.words}: {away:.0f} mm from the start pose's "
                f"{found.body}, its clearance is {1e3 * found.thing.clearance:.0f} mm"
            )


def _check_still_links(scene: Scene, around: CollisionScene) -> None:
    """InputError where an obstacle is in a link that the throwing joints do not move: verdicts look
    at moving links only."""
    capsules, bar = around.capsules, scene.object.width / math.sqrt(2)
    if capsules is None or not scene.obstacle:
        return
    ends = capsules.at(np.zeros((capsules.arm.coordinates, 2)))
    for k, number in enumerate(capsules.number):
        if number == 0 or capsules.moves[k]:
            continue
        # A capsule as thick as the bar, which is what the core compares with solids.
        thicker = float(capsules.radius[k]) - bar
        solids = tuple(replace(t, clearance=thicker) for t in around.things if t.bar)
        one = SweptBodies((BAR,), ends[k : k + 1], np.array([bar]), np.zeros(1), np.zeros(2), False)
        for found in clearances_of(one, CollisionScene(scene, solids, None)):
            assert found.thing is not None
            raise InputError(f"{scene.place}: {found.thing.words}: inside {capsules.names[k]}")
