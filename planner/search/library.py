"""A scene's library of solved throws: records on disk, and which of them land near a target.

A library is a folder in the cache, named by a hash of all that its throws depend on, with files of
records that are added whole (`Library.add`) by any number of processes, and never changed. A file
is named by a checksum of its bytes and their number: one that is cut short, garbled or another
user's is passed over, and its throws are solved again. Whatever is planned from a record is thrown
and checked as any other throw, so a wrong one costs time only.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import json
import math
import os
import zlib
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import Array, land
from ...problems import Pose, Scene
from ..check import Mover
from ..compile import DAMAGED, cache_folder, digest, publish
from ..ocp import Asked, Controls, Margins, Optimum, Request
from .release_table import Turns

Records = npt.NDArray[Any]

#: Version of the records: what a field means.
FORMAT = 2
#: Packages whose sources decide what a solved throw is.
SOURCES = ("models", "planner/check", "planner/ocp", "planner/search")
#: So many solved throws tell where the reach ends; fewer lie too far apart.
ENOUGH = 50
#: Within this scaled distance [m] of a target a solved throw is of use.
NEAR = 0.15
#: Lengths [bytes] of the texts of a record: guards, margins, a limit's name; limits a record names.
TEXT, NAME, LIMITS = 128, 32, 4


def record_type(controls: Controls, angle: bool) -> np.dtype[Any]:
    """What is kept of a throw, all of single precision.

    solved: whether it is a throw, solved for landing (x, theta); else the record says that this
    landing was tried from its neighbours and is beyond the edge of the reach, with the limits that
    bind there.
    """
    f, u = "<f4", controls.size
    fields: list[Any] = [
        ("solved", "?"),
        ("landing", f, 2),
        ("u", f, u),
        ("slope", f, (u, 2 if angle else 1)),
        ("detach", f, 6),
        ("effort", f),
        ("smoothing", f, 2),
        ("nlp_size", "<i4", 2),
        ("guards", f"S{TEXT}"),
        ("margins", f"S{TEXT}"),
        ("binding", f"S{NAME}", LIMITS),
    ]
    return np.dtype(fields)


@dataclass(frozen=True)
class Neighbour:
    """A solved throw near a target: its optimum, the goal (turns counted), by how much it misses
    that (dx [m], dtheta [rad]; 0 with theta open), and its scaled distance [m]."""

    optimum: Optimum
    goal: Pose
    miss: tuple[float, float]
    distance: float


class Library:
    """The solved throws of a scene, as far as the cache has them."""

    def __init__(self, scene: Scene, mover: Mover, *, keep: bool = True) -> None:
        target = scene.target
        assert target is not None
        self.controls = Controls(Request(scene, mover, target))
        self.angle = target.theta is not None
        self._scene, self._lever = scene, scene.object.length / 2
        self._type = record_type(self.controls, self.angle)
        folder = cache_folder() if keep else None
        self.folder = None if folder is None else folder / f"throws-{library_key(scene)}"
        self._parts: dict[str, Records] = {}
        self.records: Records = np.zeros(0, self._type)
        self._solved = np.zeros(0, np.int64)
        self._landings: tuple[float, Array] | None = None
        self.refresh()

    def __len__(self) -> int:
        return len(self._solved)

    def refresh(self) -> None:
        """Takes up what this or another process has added."""
        if self.folder is not None:
            found = dict(_files(self.folder, self._type, self._parts))
            if found:
                self._parts |= found
                parts = list(self._parts.values())
                self._take(np.concatenate(parts) if len(parts) > 1 else parts[0])

    def _take(self, records: Records) -> None:
        # Of several throws for one landing the cheapest; it may have been out of reach at first.
        order = np.lexsort((records["effort"], ~records["solved"]))
        places = np.ascontiguousarray(records["landing"][order]).view("<u8").ravel()
        _, first = np.unique(places, return_index=True)
        self.records = records if len(first) == len(records) else records[np.sort(order[first])]
        self._solved = np.flatnonzero(self.records["solved"])
        self._landings = None

    def add(self, records: Sequence[Records]) -> None:
        """Keeps records: for this object, and in the folder, all of them or none."""
        if not records:
            return
        part = np.array(records, self._type)
        data = io.BytesIO()
        np.save(data, part)
        name = _name(data.getvalue())
        if self.folder is not None:
            with contextlib.suppress(OSError):
                self.folder.mkdir(mode=0o700, exist_ok=True)
                publish(self.folder, name, lambda path: _write(path, data.getvalue()))
        self._parts[name] = part
        self._take(np.concatenate([self.records, part]))

    def merge(self) -> None:
        """Makes one file of many, so that the next planner opens it sooner."""
        if len(self._parts) < 2 or self.folder is None:
            return
        data = io.BytesIO()
        np.save(data, self.records)
        name = _name(data.getvalue())
        if publish(self.folder, name, lambda path: _write(path, data.getvalue())) is None:
            return
        for part in self._parts.keys() - {name}:
            with contextlib.suppress(OSError):
                (self.folder / part).unlink()
        self._parts = {name: self.records}

    def record(self, optimum: Optimum, landing: tuple[float, float], *, solved: bool) -> Records:
        """A record of a throw that lands there; or of a landing that could not be reached."""
        row = np.zeros((), self._type)
        row["solved"], row["landing"] = solved, landing
        for name in ("u", "slope", "detach", "effort", "smoothing", "nlp_size"):
            row[name] = getattr(optimum, name)
        row["guards"] = " ".join(sorted(optimum.asked.guards)).encode()
        # All of them to six digits fit.
        margins = {name: round(value, 6) for name, value in optimum.asked.margins.values}
        row["margins"] = json.dumps(margins).encode()
        row["binding"][: len(optimum.binding)] = [
            name.encode()[:NAME] for name in optimum.binding[:LIMITS]
        ]
        return row

    def optimum(self, index: int) -> Optimum:
        """One of the solved throws."""
        row = self.records[self._solved[index]]
        guards = frozenset(row["guards"].decode().split())
        return Optimum(
            row["u"].astype(float),
            row["slope"].astype(float),
            row["detach"].astype(float),
            float(row["effort"]),
            (int(row["nlp_size"][0]), int(row["nlp_size"][1])),
            (float(row["smoothing"][0]), float(row["smoothing"][1])),
            Asked(guards, Margins(**json.loads(row["margins"] or b"{}"))),
            tuple(name.decode() for name in row["binding"] if name),
        )

    def landings(self, height: float) -> Array:
        """x [m], theta [rad], flight time [s] (3, N) of the solved throws at a height."""
        if self._landings is None or self._landings[0] != height:
            detach = self.records["detach"][self._solved].astype(float)
            self._landings = height, land(detach, height, self._scene.gravity).T.copy()
        return self._landings[1]

    def near(
        self, target: Pose, turns: Turns, count: int, within: float = NEAR
    ) -> Iterator[Neighbour]:
        """At most `count` solved throws that land within [m] of the target, nearest first."""
        if not len(self) or (target.theta is not None) != self.angle:
            return
        x, theta, _ = self.landings(target.z)
        off = x - target.plane_x
        away, turn, whole = np.abs(off), np.zeros_like(x), np.zeros_like(x)
        if target.theta is not None:
            turn = theta - target.theta
            if turns == "any":
                whole = 2 * math.pi * np.round(turn / (2 * math.pi))
                turn = turn - whole
            away = away + np.abs(turn) * self._lever
        away = np.where(np.isfinite(away), away, np.inf)
        count = min(count, len(away))
        nearest = np.argpartition(away, count - 1)[:count]
        nearest = nearest[np.argsort(away[nearest], kind="stable")]
        for i in nearest:
            if not away[i] < within:
                return
            yield Neighbour(
                self.optimum(int(i)),
                target.turned(float(whole[i])) if whole[i] else target,
                (float(off[i]), float(turn[i])),
                float(away[i]),
            )

    def beyond(self, goal: Pose) -> bool:
        """Whether what was tried nearest to a goal was found to be out of reach."""
        target = self._scene.target
        assert target is not None
        x, theta = self.records["landing"].astype(float).T
        if len(self) < ENOUGH or goal.z != target.z or (goal.theta is not None) != self.angle:
            return False
        away = np.abs(x - goal.plane_x) + np.abs(theta - (goal.theta or 0.0)) * self._lever
        return not self.records["solved"][away.argmin()]


def library_key(scene: Scene) -> str:
    """A hash of all that a scene's solved throws depend on.

    Where in the reach its target lies, what only chooses among throws, and obstacles, which stand
    elsewhere from target to target, change nothing.
    """
    target = scene.target
    assert target is not None
    somewhere = Pose(1.0, target.z, theta=None if target.theta is None else 0.0)
    like = scene.aimed_at(somewhere).replace(
        name="", description="", file="", choice=None, robust=None, obstacle=()
    )
    if like.cup is not None:
        # Moved and moved back it may differ in the last digit.
        like = like.replace(cup=dataclasses.replace(like.cup, x=round(like.cup.x, 9)))
    sections = [repr(getattr(like, field.name)) for field in dataclasses.fields(like)]
    return digest(f"throws {FORMAT}", *sections, *_sources())


def _sources() -> Iterator[bytes]:
    root = Path(__file__).parents[2]
    for folder in SOURCES:
        for path in sorted((root / folder).rglob("*.py")):
            yield path.read_bytes()


def _name(data: bytes | memoryview) -> str:
    return f"{zlib.crc32(data):08x}-{len(data):x}.npy"


def _write(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def _files(
    folder: Path, kind: np.dtype[Any], known: Collection[str]
) -> Iterator[tuple[str, Records]]:
    """Names and records of the folder's files that are whole, of this user and of this kind.

    known: names that are passed over.
    """
    try:
        if not _own(folder):
            return
        paths = sorted(path for path in folder.glob("*.npy") if path.name not in known)
    except OSError:
        return
    for path in paths:
        try:
            # Its text is read only once its bytes are known to be those that were written.
            if not (_own(path) and path.is_file()):
                continue
            if _name(np.memmap(path, mode="r").data) != path.name:
                continue
            records = np.load(path, mmap_mode="r", allow_pickle=False)
        except DAMAGED:
            continue
        if records.dtype == kind and records.ndim == 1 and _finite(records):
            yield path.name, records


def _own(path: Path) -> bool:
    """Whether a file or folder is this user's."""
    return not hasattr(os, "getuid") or path.stat().st_uid == os.getuid()


def _finite(records: Records) -> bool:
    names = ("landing", "u", "slope", "detach", "effort", "smoothing")
    return all(bool(np.isfinite(records[name]).all()) for name in names)
