"""Arm and bar as capsules, obstacles and floor as solids, and which of them may meet."""

from __future__ import annotations

import ctypes
import itertools
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...core import BodiesC, SolidC, address
from ...models import ArmCapsules, Array, Indices, Solid
from ...problems import Scene, ThrownObject, ThrowPlane
from .mover import Mover

#: Links of numbers that differ by this or less meet at a joint, by construction.
ADJACENT = 2
#: Before its landing the bar may come as near to an obstacle as it lands, so long [s].
LANDING = 0.05
#: The floor is a plate, so far [m] to all sides, and so thick [m] that no link is through it.
FLOOR_HALF, FLOOR_THICK = 100.0, 2.0


@dataclass(frozen=True)
class Thing:
    """What is kept off: its shape, clearance [m], and whether the bar keeps it too."""

    name: str
    solid: Solid
    clearance: float
    bar: bool = True

    @property
    def words(self) -> str:
        """For people."""
        return f"obstacle {self.name}" if self.bar else self.name


@dataclass(frozen=True)
class Around:
    """Obstacles and floor as the throw's plane sees them, and the arm's shape.

    The floor is for the arm: what the held bar keeps from it is measured by its corners.
    """

    things: tuple[Thing, ...]
    capsules: ArmCapsules | None

    @classmethod
    def of(cls, scene: Scene, mover: Mover, plane: ThrowPlane | None = None) -> Around:
        """A scene's; plane: the throw's, where it is not to the scene's target."""
        if plane is None:
            assert scene.target is not None
            plane = scene.target.plane
        found = [Thing(o.name, plane.seen(o.solid), o.clearance) for o in scene.obstacle]
        if mover.capsules is None:
            return cls(tuple(found), None)
        if scene.workspace is not None and scene.workspace.floor is not None:
            found.append(Thing("floor", _plate(scene.workspace.floor), 0.0, bar=False))
        return cls(tuple(found), _aimed(mover.capsules, plane.azimuth))

    def core(self, scene: Scene) -> BodiesC:
        """All of it, and the bar, as the compiled core takes it."""
        bar, shape = scene.object, _shape(self.capsules, scene.object.width)
        solids = (SolidC * len(self.things))()
        for given, thing in zip(solids, self.things, strict=True):
            solid = thing.solid
            given.centre[:], given.half[:] = solid.centre.tolist(), solid.half.tolist()
            given.axes[:] = solid.axes.ravel().tolist()
            given.radius, given.clearance, given.bar = solid.radius, thing.clearance, thing.bar
        held, flown = shape.held, shape.flown
        found = BodiesC(len(shape.moves) - 1, 1, *map(address, (shape.moved_by, shape.moves)))
        found.places, found.radius, found.reach = map(
            address, (shape.places, shape.radius, shape.reach)
        )
        found.solids, found.around = len(solids), ctypes.addressof(solids)
        found.held_pairs, found.flown_pairs = len(held), len(flown)
        found.held, found.flown = address(held), address(flown)
        found.behind, found.ahead = bar.com, bar.length - bar.com
        found.com_offset, found.grasp_angle = scene.com_offset, scene.grasp.angle
        found.landing = LANDING
        found.kept = shape, solids
        return found


def obstacles_of(scene: Scene) -> list[Solid]:
    """The scene's obstacles as the throw's vertical plane sees them."""
    assert scene.target is not None
    return [scene.target.plane.seen(obstacle.solid) for obstacle in scene.obstacle]


@lru_cache(maxsize=8)
def _aimed(capsules: ArmCapsules, azimuth: float) -> ArmCapsules:
    return capsules.aimed(azimuth)


def _plate(height: float) -> Solid:
    """All that is below a height [m]; distances into it are known down to half its thickness."""
    half = np.array([FLOOR_HALF, FLOOR_HALF, 0.0])
    radius = FLOOR_THICK / 2
    return Solid(np.array([0.0, 0.0, height - radius]), np.eye(3), half, radius)


def bar_ends(bar: ThrownObject, com: Array) -> Array:
    """Ends (1, 2, 3, N) of the bar's axis for CoM poses (3, N)."""
    ends = np.zeros((1, 2, 3, com.shape[1]))
    for k, along in enumerate((-bar.com, bar.length - bar.com)):
        ends[0, k, 0] = com[0] + along * np.cos(com[2])
        ends[0, k, 2] = com[1] + along * np.sin(com[2])
    return ends


def pairs_of(capsules: ArmCapsules, *, bar: bool, flying: bool) -> list[tuple[int, int]]:
    """Bodies by their places in a track that move against each other and are no neighbours.

    A held bar is part of the hand; one that flies may meet the hand, which is the palm's affair.
    """
    count, moved, number = len(capsules.number), capsules.moved_by, capsules.number
    found = [
        (i, j)
        for i, j in itertools.combinations(range(count), 2)
        if moved[i] != moved[j] and abs(number[i] - number[j]) > ADJACENT
    ]
    if bar:
        found += [(i, count) for i in range(count) if moved[i] != moved[-1]]
    return found


@dataclass(frozen=True, eq=False)
class _Shape:
    """Arm and bar as the compiled core takes them: see `bodies` of clearance.c."""

    moved_by: Indices
    moves: Indices
    places: Array
    radius: Array
    reach: Array
    held: Indices
    flown: Indices


@lru_cache(maxsize=8)
def _shape(capsules: ArmCapsules | None, width: float) -> _Shape:
    bar = width / math.sqrt(2)
    if capsules is None:
        none, one = np.zeros((0, 2), int), np.ones(1, int)
        return _Shape(
            -one, one, np.zeros((0, 2, 3)), bar * np.ones(1), bar * np.ones(1), none, none
        )
    cover = np.append(np.full(len(capsules.radius), capsules.arm.arm.cover), 0.0)
    radius = np.append(capsules.radius, bar)
    held, flown = (
        np.array(pairs_of(capsules, bar=True, flying=flying), int).reshape(-1, 2)
        for flying in (False, True)
    )
    moved_by, moves = np.array(capsules.moved_by), np.array([*capsules.moves, True], int)
    return _Shape(
        moved_by, moves, np.ascontiguousarray(capsules.places), radius, radius + cover, held, flown
    )
