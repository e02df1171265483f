"""The compiled core: exact throws, batches, sending, measures and clearances, in C.

It is the only implementation of what it does. structures.h says what its functions take and give.
"""

from __future__ import annotations

import ctypes
import hashlib
import multiprocessing
import os
import sys
from functools import cache
from pathlib import Path

from .functions import declare
from .structures import (
    AXES,
    FRAMES,
    ROWS,
    STRUCTURES,
    BatchC,
    BodiesC,
    Extreme,
    GripC,
    LimitsC,
    LinkageC,
    Measured,
    MoveC,
    MovedC,
    PathC,
    ReferenceC,
    ReleaseC,
    SamplesC,
    SceneC,
    SolidC,
    ThrowC,
    TorquesC,
    address,
    wrong_sizes,
)

#: Of shared libraries, by platform; as in setup.py.
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


class CoreError(ImportError):
    """The compiled core is not there, or is not the one that this package needs."""


class _Size(ctypes.Structure):
    _fields_ = (("name", ctypes.c_char_p), ("size", ctypes.c_int64))


@cache
def library() -> ctypes.CDLL:
    """The library; CoreError where it is missing or was built from other sources."""
    place = Path(__file__).with_name(f"_core{SUFFIX}")
    try:
        core = ctypes.CDLL(str(place))
        differs = wrong_sizes(_sizes(core))
        declare(core)
    except (OSError, AttributeError) as error:
        why = "cannot be loaded" if place.exists() else "is missing"
        raise _core_error(place, why) from error
    if differs or _hash_of_sources() not in ("", core.core_sources().decode()):
        raise _core_error(place, "was built from other sources")
    return core


def _core_error(place: Path, why: str) -> CoreError:
    return CoreError(
        f"the compiled core {place} {why}: run `make core` in the checkout, or `pip install .`"
    )


def _hash_of_sources() -> str:
    """As setup.py hashes the C files; empty for an installed package, which has one header only."""
    files = sorted(Path(__file__).resolve().parent.glob("*.[ch]"))
    text = b"".join(file.read_bytes() for file in files)
    return hashlib.sha256(text).hexdigest() if len(files) > 1 else ""


def threads() -> int:
    """Threads for a call that releases Python's lock: one in a process that another started."""
    if multiprocessing.parent_process() is not None:
        return 1
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


def _sizes(core: ctypes.CDLL) -> dict[str, int]:
    """Sizes [bytes] of the library's structures."""
    rows = ctypes.POINTER(_Size)()
    core.core_sizes.restype = ctypes.c_int64
    count = core.core_sizes(ctypes.byref(rows))
    return {row.name.decode(): row.size for row in rows[:count]}
