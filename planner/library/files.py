"""Files of records: one folder a scene, files that are added whole and never changed.

A folder is named by a hash of all that its throws depend on, a file by a checksum and the length of
its bytes. A file that is cut short, garbled or another user's is passed over.
"""

from __future__ import annotations

import contextlib
import dataclasses
import io
import os
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...core.compile import DAMAGED, cache_folder, digest, publish
from ...problems import Pose, Scene
from .records import Records

#: Version of the records. Raise it where a field or a number of `ReducedVariables` gets another
#: meaning, and where the reach grows: landings that no throw was found for are not tried again.
FORMAT = 5


def folder_of(scene: Scene, kind: np.dtype[Any]) -> Path | None:
    """The folder of a scene's library with records of this kind; None without a cache folder.

    The target's place, [cost], [choice], [robust], [rest] and [calibration], and obstacles do not
    enter the name: throws of one library serve any of them.
    """
    cache = cache_folder()
    if cache is None:
        return None
    target = scene.target
    assert target is not None
    anywhere = Pose(1.0, target.z, theta=None if target.theta is None else 0.0)
    like = scene.aimed_at(anywhere).changed(
        name="", description="", file="", cost=None, choice=None, robust=None, obstacle=()
    )
    if like.cup is not None:
        # A cup that was moved and moved back may differ in the last digit.
        like = like.changed(cup=like.cup.changed(x=round(like.cup.x, 9)))
    apart = ("cost", "rest", "calibration")
    names = [field.name for field in dataclasses.fields(like) if field.name not in apart]
    sections = [repr(getattr(like, name)) for name in names]
    return cache / f"throws-{digest(f'throws {FORMAT}', repr(kind.descr), *sections)}"


def read_files(
    folder: Path, kind: np.dtype[Any], known: Collection[str]
) -> Iterator[tuple[str, Records]]:
    """Names and records of the folder's files that are whole, of this user and of this kind.

    known: names that are passed over.
    """
    try:
        if not _is_own(folder):
            return
        paths = sorted(path for path in folder.glob("*.npy") if path.name not in known)
    except OSError:
        return
    for path in paths:
        try:
            # NumPy reads a file only once its bytes are known to be those that were written.
            if not (_is_own(path) and path.is_file()):
                continue
            if _name_of(np.memmap(path, mode="r").data) != path.name:
                continue
            records = np.load(path, mmap_mode="r", allow_pickle=False)
        except DAMAGED:
            continue
        if records.dtype == kind and records.ndim == 1 and records.size:
            yield path.name, records


def write_file(folder: Path | None, records: Records) -> tuple[str, bool]:
    """The name of the records' file, and whether it was written; a full disk costs the file."""
    data = io.BytesIO()
    np.save(data, records)
    name, written = _name_of(data.getvalue()), None
    if folder is not None:
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, exist_ok=True)
            written = publish(folder, name, lambda path: _write(path, data.getvalue()))
    return name, written is not None


def _name_of(data: bytes | memoryview) -> str:
    return f"{zlib.crc32(data):08x}-{len(data):x}.npy"


def _write(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def _is_own(path: Path) -> bool:
    """Whether a file or folder is this user's."""
    return not hasattr(os, "getuid") or path.stat().st_uid == os.getuid()
