"""Objects that wait at their picks: obstacles of all motions until they are grasped."""

from __future__ import annotations

import itertools
from collections.abc import Collection

import numpy as np

from ..models import Array
from ..planner import (
    Samples,
    SpatialScene,
    Throw,
    make_manipulator,
    measures_of,
    obstacles_hit,
    segment_distance,
)
from ..problems import InputError, Obstacle
from .job_files import Jobs


class WaitingObjects:
    """The objects of all picks as they wait. Sets of picks are numbers: 1 << k has pick k.

    InputError for two that overlap.
    """

    def __init__(self, jobs: Jobs) -> None:
        self._objects = list[tuple[Obstacle, ...]]()
        for pick in jobs.picks:
            scene = jobs.scene_of(pick, jobs.bins_of(pick)[0])
            space = SpatialScene(scene, make_manipulator(scene))
            self._objects.append(space.waiting_object(np.array(pick.joints), pick.name))
        for one, other in itertools.combinations(range(len(self._objects)), 2):
            for a, b in itertools.product(self._objects[one], self._objects[other]):
                gap = segment_distance(*_ends(a), *_ends(b))[0] - a.size[0] - b.size[0]
                if gap < 0.0:
                    names = (f"pick {k + 1} ({jobs.picks[k].name})" for k in (one, other))
                    raise InputError(
                        f"{jobs.name}: {' and '.join(names)}: their objects overlap by "
                        f"{-1e3 * gap:.0f} mm as they wait: move one of them"
                    )

    def hit(self, space: SpatialScene, samples: Samples, pick: int, *, held: bool) -> int:
        """The picks whose objects a motion of all joints comes too near to; pick: one that it may,
        for the hand comes to it or holds its object (-1: none)."""
        scene = space.scene.replace(obstacle=self._besides(pick))
        return self._picks(
            obstacles_hit(SpatialScene(scene, space.manipulator), samples, held=held)
        )

    def hit_by_throw(self, throw: Throw, pick: int) -> int:
        """The picks whose objects a throw of one comes too near to: the arm, and the object in the
        hand and in flight."""
        among = measures_of(throw.among(self._besides(pick)))
        things = (pair.thing for pair in among.clearances())
        return self._picks({thing.name for thing in things if thing is not None and thing.bar})

    def _picks(self, names: Collection[str]) -> int:
        return sum(1 << k for k, own in enumerate(self._objects) if own[0].name in names)

    def _besides(self, pick: int) -> tuple[Obstacle, ...]:
        """The waiting objects but one."""
        others = (own for k, own in enumerate(self._objects) if k != pick)
        return tuple(itertools.chain(*others))


def _ends(capsule: Obstacle) -> tuple[Array, Array]:
    """Both ends (1, 3) of its axis."""
    solid = capsule.solid
    half = solid.half @ solid.axes
    return (solid.centre - half)[None], (solid.centre + half)[None]
