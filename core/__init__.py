"""The compiled core: the planner's innermost loops in C, one library for all scenes.

It is built with the package and optional: without it callers run slower and give the same answers.
"""

from __future__ import annotations

import ctypes
import multiprocessing
import os
from functools import cache
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

from .structures import (
    AXES,
    FRAMES,
    BodiesC,
    GripC,
    LimitsC,
    LinkageC,
    Measured,
    PathC,
    ReleaseC,
    SamplesC,
    SceneC,
    SolidC,
    ThrowC,
    ThrownC,
    TorquesC,
    address,
)

#: That of core.h; it counts up with every change of an argument or a structure.
VERSION = 11


def library() -> ctypes.CDLL | None:
    """The library; None where it was not built, is another version's, or THROWPLAN_COMPILE is 0.

    Callers set `argtypes` and `restype` of what they call.
    """
    return None if os.environ.get("THROWPLAN_COMPILE") == "0" else _loaded()


def threads() -> int:
    """Threads for a call that releases Python's lock: one in a process that another started."""
    if multiprocessing.parent_process() is not None:
        return 1
    try:
        return len(os.sched_getaffinity(0))
    except AttributeError:
        return os.cpu_count() or 1


@cache
def _loaded() -> ctypes.CDLL | None:
    for suffix in EXTENSION_SUFFIXES:
        try:
            found = ctypes.CDLL(str(Path(__file__).with_name(f"_core{suffix}")))
            return found if found.core_version() == VERSION else None
        except (OSError, AttributeError):
            continue
    return None
