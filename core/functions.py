"""The functions of the C files: what each takes and gives back, checked at every call."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np

from .structures import (
    BatchC,
    BodiesC,
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
    ThrowC,
    address,
)


class _Doubles:
    """An array of doubles, contiguous; None for no array."""

    @classmethod
    def from_param(cls, values: Any) -> ctypes.c_void_p:
        return ctypes.c_void_p(None if values is None else address(values))


class _Flags:
    """An array of flags, contiguous."""

    @classmethod
    def from_param(cls, values: Any) -> ctypes.c_void_p:
        return ctypes.c_void_p(address(values, np.bool_))


_P, _INT, _DOUBLE = ctypes.POINTER, ctypes.c_int64, ctypes.c_double

#: By name: what a function gives back, and what it takes. See the C files for shapes and units.
FUNCTIONS: dict[str, tuple[Any, tuple[Any, ...]]] = {
    "sliding_pivot": (None, (_P(BatchC),)),
    "limit_surface": (None, (_P(BatchC),)),
    "pivot_release": (_INT, (_P(ReleaseC), _INT, _Doubles, _Doubles, _P(ctypes.c_int))),
    "pivot_track": (None, (_P(ReleaseC), _INT, _Doubles, _Doubles)),
    "surface_release": (_INT, (_P(ReleaseC), _INT, _Doubles)),
    "many_releases": (ctypes.c_int, (_P(ReleaseC), ctypes.c_int, _INT, _Doubles, _Doubles)),
    "plan_motion": (None, (_P(MoveC), _Doubles, _Doubles, _Doubles)),
    "move_throw": (ctypes.c_int, (_P(MoveC), _P(MovedC))),
    "quintics": (_INT, (_P(SamplesC), _Doubles, _Doubles)),
    "kept_ticks": (None, (_P(PathC), _P(LimitsC), _DOUBLE, _INT, _Flags)),
    "brake": (_INT, (_P(LimitsC), _INT, _P(SamplesC))),
    "send_motion": (_INT, (_P(PathC), _P(LimitsC), _P(SamplesC), _Doubles, _Doubles)),
    "excess": (None, (_P(SamplesC), _P(LimitsC), _Doubles)),
    "grip_instants": (_INT, (_P(PathC), _DOUBLE, _DOUBLE, _Doubles)),
    "grip_use": (_DOUBLE, (_P(ThrowC),)),
    "measure": (None, (_P(ThrowC), _P(Measured))),
    "column_distances": (None, (_P(SceneC), _INT, _Doubles, _Doubles)),
    "palm_distances": (None, (_P(SceneC), _INT, _Doubles, _Doubles, _Doubles)),
    "flight_time": (_DOUBLE, (_Doubles, _DOUBLE, _DOUBLE)),
    "cup_entries": (None, (_P(SceneC), _INT, _Doubles, _Doubles, _Doubles)),
    "measure_flights": (None, (_P(ThrowC), _P(ReferenceC), _INT, _Doubles, _Doubles)),
    "near_bodies": (_INT, (_P(ThrowC), _P(BodiesC), _Doubles)),
    "near_flights": (ctypes.c_int, (_P(ThrowC), _P(BodiesC), _INT, _Doubles, _Doubles)),
    "segment_distances": (None, (_INT, _Doubles, _Doubles)),
    "near_track": (_INT, (_P(BodiesC), _INT, _INT, _INT, _Doubles, _Doubles, _Doubles)),
    "rooms": (None, (_P(BodiesC), *(_INT,) * 4, _Doubles, _Doubles, _Doubles)),
    "overlaps": (ctypes.c_int, (_INT, _P(LinkageC), _P(BodiesC), _Doubles, _Doubles, _Doubles)),
    "off_plane": (_DOUBLE, (_P(SamplesC), _INT, _P(LinkageC), _Doubles, _DOUBLE, _DOUBLE)),
    "core_sources": (ctypes.c_char_p, ()),
}


def declare(core: ctypes.CDLL) -> None:
    """Says to ctypes what the library's functions take and give back."""
    for name, (result, arguments) in FUNCTIONS.items():
        function = getattr(core, name)
        function.restype, function.argtypes = result, arguments
