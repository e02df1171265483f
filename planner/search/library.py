"""A scene's library: records of solved throws, and which of them land near a target.

Any number of processes add records to it at the same time. Whatever is planned from a record is
thrown and checked as any other throw, so a wrong record costs time only.

Each scene has a folder, named by a hash of all that its throws depend on. A file in it is named by
a checksum and the length of its bytes; it is added whole and never changed. One that is cut short,
garbled or another user's is passed over.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import math
import zlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ...cache import cache_folder, digest, only_ours, publish
from ...models import Array
from ...problems import Pose, Scene
from ..ocp import Optimum, ReducedVariables, Refinement, Request
from ..throw import Manipulator
from .records import Records, are_valid, optimum_in, record_of, record_type

#: Whether a landing angle counts its full turns ("exact") or not ("any").
Turns = Literal["exact", "any"]
#: Version of the records. Raise it where a field or a number of `ReducedVariables` gets another
#: meaning.
FORMAT = 10


@dataclass(frozen=True)
class Neighbour:
    """A solved throw near a target: its optimum, the goal (turns counted), its landing there
    (x [m], theta [rad]), and its pose error [m]."""

    optimum: Optimum
    goal: Pose
    landing: tuple[float, float]
    distance: float

    @classmethod
    def of(cls, optimum: Optimum, goal: Pose, scene: Scene) -> Neighbour:
        """A solved throw with its landing at the goal's height."""
        x, theta, _ = map(float, scene.flight.land(optimum.detach[None], goal.z)[0])
        return cls(optimum, goal, (x, theta), scene.object.pose_error(*goal.miss(x, theta)))

    @property
    def nearest(self) -> Pose:
        """The pose of the goal that is nearest to the landing."""
        return self.goal.nearest(*self.landing)

    @property
    def miss(self) -> tuple[float, float]:
        """The landing less that pose: dx [m], dtheta [rad] (0 with theta open)."""
        return self.goal.miss(*self.landing)


class Library:
    """The solved throws of a scene that the cache has.

    records (N,): see `record_type`; folder: where they are stored, None for nowhere.
    """

    def __init__(self, scene: Scene, manipulator: Manipulator, *, keep: bool = True) -> None:
        target = scene.aim
        quiet = Refinement(quiet=scene.weights.quiet)
        self.controls = ReducedVariables(Request(scene, manipulator, target, quiet))
        self.angle = target.theta is not None
        self._scene, self._height = scene, target.z
        self._type = record_type(self.controls, self.angle)
        self.folder = folder_of(scene, self._type) if keep else None
        files = () if self.folder is None else read_files(self.folder, self._type)
        self._parts: dict[str, Records] = {
            name: records[are_valid(records, self.controls)] for name, records in files
        }
        self._take(np.concatenate([np.zeros(0, self._type), *self._parts.values()]))

    def __len__(self) -> int:
        return len(self.records)

    def _take(self, records: Records) -> None:
        """Keeps of several throws to one landing the cheapest."""
        order = np.argsort(records["effort"], kind="stable")
        places = np.ascontiguousarray(records["landing"][order]).view("<u8").ravel()
        _, first = np.unique(places, return_index=True)
        self.records = records if len(first) == len(records) else records[np.sort(order[first])]
        self._landings = self._landings_of(self.records, self._height)

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

    def record(self, optimum: Optimum, landing: tuple[float, float], error95: float) -> Records:
        """The record of a throw that lands there."""
        return record_of(self._type, optimum, landing, error95)

    def optimum(self, index: int) -> Optimum:
        """The throw of that number."""
        return optimum_in(self.records[index])

    def landings(self, height: float) -> Array:
        """x [m], theta [rad], flight time [s] (3, N) of the throws at a height [m]."""
        if height == self._height:
            return self._landings
        return self._landings_of(self.records, height)

    def _landings_of(self, records: Records, height: float) -> Array:
        return self._scene.flight.land(records["detach"].astype(float), height).T.copy()

    def nearest_throws(
        self, target: Pose, turns: Turns, count: int, within: float
    ) -> Iterator[Neighbour]:
        """At most `count` throws with a pose error below `within` [m], nearest first."""
        if (target.theta is not None) != self.angle:
            return
        landings = self.landings(target.z)
        # Of the throws that land in a region, those come first that scatter least.
        cost = self.records["error95"] if target.is_region else None
        for i, goal, away in nearest_landings(self._scene, target, turns, landings, count, cost):
            if not away < within:
                return
            landing = float(landings[0, i]), float(landings[1, i])
            yield Neighbour(self.optimum(i), goal, landing, away)


def nearest_landings(
    scene: Scene, target: Pose, turns: Turns, landings: Array, count: int, cost: Array | None = None
) -> list[tuple[int, Pose, float]]:
    """(row, goal, pose error [m] (39)) of the `count` landings nearest to a target, nearest first.

    landings (3, N): x [m], theta [rad], flight time [s]; a row with NaN does not come down, and is
    left out. With turns 'any' a row's goal is the target at the full turns nearest to its landing.
    cost (N,): of landings that are equally near, as in a region, the least comes first.
    """
    away, full = landing_errors(scene, target, turns, landings)
    found = np.arange(len(away))
    if cost is not None:
        found = np.lexsort((cost, away))[:count]
    elif count < len(away):
        found = np.argpartition(away, count - 1)[:count]
    # NaN comes last.
    found = found[np.argsort(away[found], kind="stable")]
    return [
        (int(i), target.turned(float(full[i])) if full[i] else target, float(away[i]))
        for i in found
        if math.isfinite(away[i])
    ]


def landing_errors(
    scene: Scene, target: Pose, turns: Turns, landings: Array
) -> tuple[Array, Array]:
    """Pose errors (N,) [m] (39) of landings (3, N), as of `nearest_landings`, and the full turns
    (N,) [rad] from the target to the goals that they are for."""
    x, theta, _ = landings
    full = np.zeros_like(x)
    if target.theta is not None and turns == "any":
        full = 2 * math.pi * np.round((theta - target.theta) / (2 * math.pi))
    return scene.object.pose_error(*target.miss(x, theta - full)), full


def folder_of(scene: Scene, kind: np.dtype[Any]) -> Path | None:
    """The folder of a scene's library with records of this kind; None without a cache folder.

    The target's x and angle, [cost], [choice], [robust], [rest] and [calibration], obstacles, and
    the object's mesh do not enter the name: throws of one library serve any of them. Its height
    does, and whether the angle is open.
    """
    cache = cache_folder()
    if cache is None:
        return None
    anywhere = Pose(1.0, scene.aim.z, theta=None if scene.aim.theta is None else 0.0)
    like = scene.aimed_at(anywhere).unnamed
    like = like.changed(cost=None, choice=None, robust=None, obstacle=())
    if like.cup is not None:
        # A cup that was moved and moved back may differ in the last digit.
        like = like.changed(cup=like.cup.changed(x=round(like.cup.x, 9)))
    if like.bin is not None:
        like = like.changed(bin=like.bin.changed(x=0.0, y=0.0, plane_x=round(like.bin.plane_x, 9)))
    parts = f"throws {FORMAT}", repr(kind.descr)
    return cache / f"throws-{digest_of(like, {'cost', 'rest', 'calibration'}, *parts)}"


def digest_of(scene: Scene, apart: Collection[str], *parts: str) -> str:
    """A name for what is made from `parts` and all of a scene but the sections `apart`."""
    names = [field.name for field in dataclasses.fields(scene) if field.name not in apart]
    return digest(*parts, *(repr(getattr(scene, name)) for name in names))


def read_files(folder: Path, kind: np.dtype[Any]) -> Iterator[tuple[str, Records]]:
    """Names and records of the folder's files that are whole, of this user and of this kind."""
    try:
        if not only_ours(folder):
            return
        paths = sorted(folder.glob("*.npy"))
    except OSError:
        return
    for path in paths:
        try:
            # NumPy reads a file only once its bytes are known to be those that were written.
            if not only_ours(path):
                continue
            if _name_of(np.memmap(path, mode="r").data) != path.name:
                continue
            records = np.load(path, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError):
            continue
        if records.dtype == kind and records.ndim == 1 and records.size:
            yield path.name, records


def write_file(folder: Path | None, records: Records) -> tuple[str, bool]:
    """The name of the records' file, and whether it was written; a full disk costs the file."""
    data = io.BytesIO()
    np.save(data, records)
    name, written = _name_of(data.getvalue()), False
    if folder is not None:
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, exist_ok=True)
            written = publish(folder, name, data.getvalue())
    return name, written


def _name_of(data: bytes | memoryview) -> str:
    return f"{zlib.crc32(data):08x}-{len(data):x}.npy"
