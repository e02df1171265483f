"""A scene's library: records of solved throws, and which of them land near a target.

Any number of processes add records to it at the same time. Whatever is planned from a record is
thrown and checked as any other throw, so a wrong record costs time only.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...models import Array, Indices
from ...problems import Pose, Scene
from ..ocp import Optimum, ReducedVariables, Request
from ..throw import Manipulator
from .files import folder_of, read_files, write_file
from .records import Records, are_valid, optimum_in, record_of, record_type

#: Whether a landing angle counts its full turns ("exact") or not ("any").
Turns = Literal["exact", "any"]


@dataclass(frozen=True)
class Neighbour:
    """A solved throw near a target: its optimum, the goal (turns counted), by how much it misses
    that (dx [m], dtheta [rad]; 0 with theta open), and its pose error [m]."""

    optimum: Optimum
    goal: Pose
    miss: tuple[float, float]
    distance: float


class Library:
    """The solved throws of a scene that the cache has.

    records (N,): see `record_type`; folder: where they are stored, None for nowhere.
    """

    def __init__(self, scene: Scene, manipulator: Manipulator, *, keep: bool = True) -> None:
        target = scene.target
        assert target is not None
        self.controls = ReducedVariables(Request(scene, manipulator, target))
        self.angle = target.theta is not None
        self._scene, self._height = scene, target.z
        self._type = record_type(self.controls, self.angle)
        self.folder = folder_of(scene, self._type) if keep else None
        self._parts: dict[str, Records] = {}
        self._take(np.zeros(0, self._type))
        self.refresh()

    def __len__(self) -> int:
        return len(self._solved)

    def refresh(self) -> None:
        """Reads the files that this or another process has added."""
        if self.folder is None:
            return
        found = {
            name: records[are_valid(records, self.controls)]
            for name, records in read_files(self.folder, self._type, self._parts)
        }
        if found:
            self._parts |= found
            self._take(np.concatenate(list(self._parts.values())))

    def _take(self, records: Records) -> None:
        """Keeps one of several records of one landing: the cheapest throw that lands there; else of
        the boundary the one that lands nearest to it."""
        cost = records["effort"].astype(float)
        short = np.flatnonzero(records["boundary"])
        x, theta, _ = self._landings_of(records[short], self._height)
        off, turn = np.array([x, theta]) - records["landing"][short].T
        cost[short] = self._scene.object.pose_error(off, turn * self.angle)
        order = np.lexsort((cost, ~records["boundary"], ~records["solved"]))
        places = np.ascontiguousarray(records["landing"][order]).view("<u8").ravel()
        _, first = np.unique(places, return_index=True)
        self.records = records if len(first) == len(records) else records[np.sort(order[first])]
        self._solved = np.flatnonzero(self.records["solved"])
        self._boundary = np.flatnonzero(self.records["boundary"])
        self._proven = self._boundary[~self.records["slope"][self._boundary].any(axis=(1, 2))]
        self._landings = self._landings_of(self.records[self._solved], self._height)

    def add(self, records: Sequence[Records]) -> None:
        """Adds records: to this object, and to the folder in one file."""
        if records:
            part = np.array(records, self._type)
            name, _ = write_file(self.folder, part)
            self._parts[name] = part
            self._take(np.concatenate([self.records, part]))

    def merge(self) -> None:
        """Makes one file of many, so that the next planner opens it sooner."""
        if len(self._parts) < 2 or self.folder is None:
            return
        name, written = write_file(self.folder, self.records)
        if not written:
            return
        for part in self._parts.keys() - {name}:
            with contextlib.suppress(OSError):
                (self.folder / part).unlink()
        self._parts = {name: self.records}

    def record(
        self,
        optimum: Optimum,
        landing: tuple[float, float],
        *,
        solved: bool = False,
        boundary: bool = False,
    ) -> Records:
        """The record of a throw that lands there, or of a landing that none was found for."""
        return record_of(self._type, optimum, landing, solved=solved, boundary=boundary)

    def optimum(self, index: int) -> Optimum:
        """The solved throw of that number."""
        return optimum_in(self.records[self._solved[index]])

    def landings(self, height: float) -> Array:
        """x [m], theta [rad], flight time [s] (3, N) of the solved throws at a height [m]."""
        if height == self._height:
            return self._landings
        return self._landings_of(self.records[self._solved], height)

    def _landings_of(self, records: Records, height: float) -> Array:
        return self._scene.flight.land(records["detach"].astype(float), height).T.copy()

    def nearest_throws(
        self, target: Pose, turns: Turns, count: int, within: float
    ) -> Iterator[Neighbour]:
        """At most `count` solved throws with a pose error below `within` [m], nearest first."""
        landings = self.landings(target.z)
        return self._nearest(self._solved, landings, target, turns, count, within)

    def nearest_of_boundary(
        self, target: Pose, turns: Turns, count: int, within: float = math.inf
    ) -> Iterator[Neighbour]:
        """As `nearest_throws`, of the throws on the boundary of the reach."""
        landings = self._landings_of(self.records[self._boundary], target.z)
        return self._nearest(self._boundary, landings, target, turns, count, within)

    def is_beyond(self, target: Pose, landing: Pose, same_distance: float) -> bool:
        """Whether a proven throw of the boundary lands at `landing`, up to `same_distance` [m], and
        the target is at least as far off as the place that no throw led to from there.
        """
        if target.z != self._height or (target.theta is not None) != self.angle:
            return False
        rows, pose_error = self.records[self._proven], self._scene.object.pose_error
        beyond, edge = rows["landing"].T, self._landings_of(rows, self._height)[:2]

        def away(one: Array, other: Array) -> Array:
            return np.asarray(pose_error(one[0] - other[0], (one[1] - other[1]) * self.angle))

        at, nearest = (np.array([[p.plane_x], [p.theta or 0.0]]) for p in (target, landing))
        is_same = away(edge, nearest) <= same_distance
        return bool((is_same & (away(edge, beyond) <= away(nearest, at))).any())

    def _nearest(
        self,
        rows: Indices,
        landings: Array,
        target: Pose,
        turns: Turns,
        count: int,
        within: float,
    ) -> Iterator[Neighbour]:
        """Of the records of numbers `rows` (N,) with their landings (3, N), the nearest."""
        if not len(rows) or (target.theta is not None) != self.angle:
            return
        x, theta, _ = landings
        off = x - target.plane_x
        turn = full = np.zeros_like(x)
        if target.theta is not None:
            turn = theta - target.theta
            if turns == "any":
                full = 2 * math.pi * np.round(turn / (2 * math.pi))
                turn = turn - full
        away = self._scene.object.pose_error(off, turn)
        count = min(count, len(away))
        # NaN, of throws that do not come down there, is last.
        nearest = np.argpartition(away, count - 1)[:count]
        nearest = nearest[np.argsort(away[nearest], kind="stable")]
        for i in nearest:
            if not away[i] < within:
                return
            yield Neighbour(
                optimum_in(self.records[rows[i]]),
                target.turned(float(full[i])) if full[i] else target,
                (float(off[i]), float(turn[i])),
                float(away[i]),
            )
