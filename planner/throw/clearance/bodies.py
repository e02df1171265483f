"""Arm and bar as capsules, obstacles and floor as solids, and which of them may meet."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from ....core import BodiesC, SolidC
from ....models import Array
from ....models.robot import ArmCapsules, Solid
from ....problems import Scene, ThrownObject, ThrowPlane
from ..manipulator import Manipulator

#: Links of numbers that differ by this or less meet at a joint, by construction.
ADJACENT = 2
#: Time [s] before the landing in which the bar may come as near to an obstacle as it lands.
LANDING = 0.05
#: Half the width of the plate that stands for the floor, and its thickness [m]: no link reaches
#: through it.
FLOOR_HALF, FLOOR_THICK = 100.0, 2.0


@dataclass(frozen=True)
class KeepOut:
    """A body that the arm avoids: its shape, clearance [m], and whether the bar avoids it too."""

    name: str
    solid: Solid
    clearance: float
    bar: bool = True

    @property
    def words(self) -> str:
        """For people."""
        return f"obstacle {self.name}" if self.bar else self.name

    @cached_property
    def core(self) -> SolidC:
        """As the compiled core takes it."""
        solid, found = self.solid, SolidC()
        found.centre[:], found.half[:] = solid.centre.tolist(), solid.half.tolist()
        found.axes[:] = solid.axes.ravel().tolist()
        found.radius, found.clearance, found.bar = solid.radius, self.clearance, self.bar
        return found


@dataclass(frozen=True)
class CollisionScene:
    """Obstacles and floor as the throw's plane sees them, and the arm's shape.

    The floor is for the arm: what the held bar keeps from it is measured by its corners.
    arm: its capsules in the plane at azimuth 0; azimuth [rad]: the plane's.
    """

    scene: Scene
    things: tuple[KeepOut, ...]
    arm: ArmCapsules | None
    azimuth: float = 0.0

    @cached_property
    def capsules(self) -> ArmCapsules | None:
        """The arm's capsules in the throw's plane."""
        return None if self.arm is None else self.arm.aimed(self.azimuth)

    @classmethod
    def of(
        cls, scene: Scene, manipulator: Manipulator, plane: ThrowPlane | None = None
    ) -> CollisionScene:
        """A scene's; plane: the throw's, where it is not to the scene's target."""
        if plane is None:
            assert scene.target is not None
            plane = scene.target.plane
        found = [KeepOut(o.name, plane.seen(o.solid), o.clearance) for o in scene.obstacle]
        if manipulator.capsules is None:
            return cls(scene, tuple(found), None)
        if scene.workspace is not None and scene.workspace.floor is not None:
            found.append(_floor(scene.workspace.floor))
        return cls(scene, tuple(found), manipulator.capsules, plane.azimuth)

    def core(self, hand_error: float = 0.0) -> BodiesC:
        """All of it, and the bar, as the compiled core takes it; hand_error [rad]: its angle's."""
        scene, found = self.scene, _shape(self.arm, self.scene.object).copy()
        found.solids = len(self.things)
        found.attach(around=(SolidC * found.solids)(*(thing.core for thing in self.things)))
        found.com_offset, found.grasp_angle = scene.com_offset, scene.grasp.angle + hand_error
        if self.arm is not None and self.azimuth:
            # Only the base's capsules depend on the azimuth.
            found.attach(places=self.arm.places_at(self.azimuth))
        return found


def obstacles_of(scene: Scene) -> list[Solid]:
    """The scene's obstacles as the throw's vertical plane sees them."""
    assert scene.target is not None
    return [scene.target.plane.seen(obstacle.solid) for obstacle in scene.obstacle]


@lru_cache(maxsize=8)
def _floor(height: float) -> KeepOut:
    """All that is below a height [m]; distances into it are known down to half its thickness."""
    half = np.array([FLOOR_HALF, FLOOR_HALF, 0.0])
    radius = FLOOR_THICK / 2
    plate = Solid(np.array([0.0, 0.0, height - radius]), np.eye(3), half, radius)
    return KeepOut("floor", plate, 0.0, bar=False)


def bar_ends(bar: ThrownObject, com: Array) -> Array:
    """Ends (1, 2, 3, N) of the bar's axis for CoM poses (3, N)."""
    ends = np.zeros((1, 2, 3, com.shape[1]))
    for k, along in enumerate((-bar.com, bar.length - bar.com)):
        ends[0, k, 0] = com[0] + along * np.cos(com[2])
        ends[0, k, 2] = com[1] + along * np.sin(com[2])
    return ends


def pairs_of(capsules: ArmCapsules) -> list[tuple[int, int]]:
    """Bodies, by their places in a track, that move against each other and are no neighbours.

    The bar comes last; it is held by the hand, and `palm_distance` says how near it flies past it.
    """
    count, moved, number = len(capsules.number), capsules.moved_by, capsules.number
    found = [
        (i, j)
        for i, j in itertools.combinations(range(count), 2)
        if moved[i] != moved[j] and abs(number[i] - number[j]) > ADJACENT
    ]
    return found + [(i, count) for i in range(count) if moved[i] != moved[-1]]


@lru_cache(maxsize=8)
def _shape(capsules: ArmCapsules | None, bar: ThrownObject) -> BodiesC:
    """Arm, in the plane at azimuth 0, and bar as the compiled core takes them."""
    corner, links = bar.width / math.sqrt(2), 0 if capsules is None else len(capsules.number)
    moved_by, moves, pairs = (
        np.zeros(0, np.int64),
        np.ones(links + 1, np.int64),
        np.zeros((0, 2), np.int64),
    )
    places, radius, cover = np.zeros((0, 2, 3)), np.full(links + 1, corner), np.zeros(links + 1)
    if capsules is not None:
        moved_by, places = (
            np.array(capsules.moved_by, np.int64),
            np.ascontiguousarray(capsules.places),
        )
        moves[:-1], pairs = capsules.moves, np.array(pairs_of(capsules), np.int64).reshape(-1, 2)
        radius[:-1], cover[:-1] = capsules.radius, capsules.arm.arm.cover
    found = BodiesC(links=links, bar=1, pairs=len(pairs), landing=LANDING)
    found.behind, found.ahead = bar.com, bar.length - bar.com
    found.attach(moved_by=moved_by, moves=moves, meet=pairs, places=places)
    found.attach(radius=radius, reach=radius + cover)
    return found
