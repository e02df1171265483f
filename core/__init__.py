"""The compiled core: exact throws, batches, sending, measures and clearances, in C.

It is the only implementation of what it does. functions.h says what its functions take and give.
"""

from __future__ import annotations

import ctypes
import hashlib
import multiprocessing
import os
import sys
from functools import cache
from pathlib import Path
from types import SimpleNamespace

from .functions import functions_of
from .structures import (
    AXES,
    FRAMES,
    ROWS,
    BatchC,
    BodiesC,
    GripC,
    LimitsC,
    LinkageC,
    MoveC,
    MovedC,
    PathC,
    ReleaseC,
    SamplesC,
    SceneC,
    SolidC,
    ThrowsC,
    TorquesC,
    columns_of,
    layout,
)

#: Of shared libraries, by platform; as in setup.py.
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


class CoreError(ImportError):
    """The compiled core is not there, or is not the one that this package needs."""


class _Place(ctypes.Structure):
    _fields_ = (("name", ctypes.c_char_p), ("offset", ctypes.c_int64), ("size", ctypes.c_int64))


@cache
def library() -> SimpleNamespace:
    """The functions of functions.h; CoreError where the library is missing, or was built from other
    sources, or has structures that differ from Python's."""
    place = Path(__file__).with_name(f"_core{SUFFIX}")
    try:
        core = ctypes.CDLL(str(place))
        sources, places = _sources(core), _layout(core)
        found = functions_of(core)
    except (OSError, AttributeError) as error:
        why = "cannot be loaded" if place.exists() else "is missing"
        raise _core_error(place, why) from error
    if _hash_of_sources() not in ("", sources):
        raise _core_error(place, "was built from other sources")
    if differences := differing(places):
        raise _core_error(place, f"was built from other sources: {', '.join(differences[:5])}")
    return found


def _core_error(place: Path, why: str) -> CoreError:
    return CoreError(
        f"the compiled core {place} {why}: run `make core` in the checkout, or `pip install .`"
    )


def _hash_of_sources() -> str:
    """As setup.py hashes the C files; empty for an installed package, which has no C file."""
    files = sorted(Path(__file__).resolve().parent.glob("*.[ch]"))
    text = b"".join(file.read_bytes() for file in files)
    return hashlib.sha256(text).hexdigest() if any(f.suffix == ".c" for f in files) else ""


def differing(places: dict[str, tuple[int, int]]) -> list[str]:
    """Names of structures and fields that are elsewhere than Python has them."""
    known = layout()
    return sorted(n for n in known.keys() | places.keys() if known.get(n) != places.get(n))


def threads() -> int:
    """Threads for a call that releases Python's lock: one in a process that another started."""
    if multiprocessing.parent_process() is not None:
        return 1
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def _layout(core: ctypes.CDLL) -> dict[str, tuple[int, int]]:
    """Offset and size [bytes] of each structure of the library and of each of its fields."""
    rows = ctypes.POINTER(_Place)()
    core.core_layout.restype = ctypes.c_int64
    count = core.core_layout(ctypes.byref(rows))
    return {row.name.decode(): (row.offset, row.size) for row in rows[:count]}


def _sources(core: ctypes.CDLL) -> str:
    """The hash of the C files that the library was built from."""
    core.core_sources.restype = ctypes.c_char_p
    return str(core.core_sources().decode())
