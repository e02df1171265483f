"""Arm and bar as capsules, obstacles as solids, and which of them may meet."""

from __future__ import annotations

import ctypes
import itertools
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ...core import BodiesC, SolidC, address
from ...models import ArmCapsules, Array, Indices, Solid
from ...problems import Obstacle, Scene, ThrownObject
from .mover import Mover

#: Links of numbers that differ by this or less meet at a joint, by construction.
ADJACENT = 2
#: Before its landing the bar may come as near to an obstacle as it lands, so long [s].
LANDING = 0.05


@dataclass(frozen=True)
class Around:
    """Obstacles, their shapes as the throw's plane sees them, and the arm's."""

    obstacles: tuple[Obstacle, ...]
    solids: tuple[Solid, ...]
    capsules: ArmCapsules | None

    @classmethod
    def of(cls, scene: Scene, mover: Mover) -> Around:
        """A scene's, aimed at its target."""
        return cls(scene.obstacle, tuple(obstacles_of(scene)), mover.capsules)

    def core(self, scene: Scene) -> BodiesC:
        """All of it, and the bar, as the compiled core takes it."""
        bar, shape = scene.object, _shape(self.capsules, scene.object.width)
        solids = (SolidC * len(self.solids))()
        for given, solid, obstacle in zip(solids, self.solids, self.obstacles, strict=True):
            given.centre[:], given.half[:] = solid.centre.tolist(), solid.half.tolist()
            given.axes[:] = solid.axes.ravel().tolist()
            given.radius, given.clearance = solid.radius, obstacle.clearance
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
