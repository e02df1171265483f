"""The structures of the C files, field by field, as ctypes."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: As in motion.h: most coordinates of a motion, and frames of a linkage.
AXES, FRAMES = 8, 24

_LONG, _DOUBLE, _ADDRESS = ctypes.c_long, ctypes.c_double, ctypes.c_void_p
_AXES = _DOUBLE * AXES


def _fields(kind: Any, *names: str) -> list[tuple[str, Any]]:
    return [(name, kind) for name in names]


class PathC(ctypes.Structure):
    """`path` of motion.h. It does not own the arrays at its addresses."""

    _fields_ = (
        *_fields(_LONG, "n", "powers", "pieces", "held", "corners"),
        *_fields(_ADDRESS, "breaks", "curves", "kinks"),
    )


class LinkageC(ctypes.Structure):
    """`linkage` of motion.h."""

    _fields_ = (
        *_fields(_LONG, "n", "arm", "frames"),
        *_fields(_DOUBLE, "x", "z", "theta"),
        *_fields(_AXES, "sign", "along", "up"),
        ("link", _LONG * FRAMES),
        *_fields(_DOUBLE * FRAMES, "frame_along", "frame_up"),
    )


class LimitsC(ctypes.Structure):
    """`limits` of sending.c."""

    _fields_ = (
        *_fields(_AXES, "q_min", "q_max", "dq", "ddq", "jerk"),
        ("slowing", _AXES * 4),
        ("slows", _LONG),
    )


class SamplesC(ctypes.Structure):
    """`samples` of sending.c. It does not own the arrays at its addresses."""

    _fields_ = (
        *_fields(_LONG, "rows", "n"),
        ("tick", _DOUBLE),
        *_fields(_ADDRESS, "q", "dq", "ddq"),
    )

    @classmethod
    def of(cls, tick: float, *rows: Array) -> SamplesC:
        """Of q, dq, ddq, each (K, n), which it keeps."""
        kept = [*map(np.ascontiguousarray, rows)]
        found = cls(*rows[0].shape, tick, *map(address, kept))
        found.kept = kept
        return found


class SceneC(ctypes.Structure):
    """`scene` of check.c."""

    _fields_ = _fields(
        _DOUBLE,
        *("gravity", "mass", "grasp_inertia", "com_offset", "grasp_angle", "force", "torque"),
        *("behind", "ahead", "half_width", "column_radius", "column_height"),
        *("palm_back", "palm_front", "palm_half_width", "palm_clearance"),
        "tool_length",
        *("cup_x", "cup_rim", "cup_radius", "cup_insertion"),
    )


class TorquesC(ctypes.Structure):
    """`torques` of check.c."""

    _fields_ = _fields(_AXES, "mass", "along", "up", "inertia", "limit")


class ThrowC(ctypes.Structure):
    """`throw` of check.c. It does not own what is at its addresses."""

    _fields_ = (
        *_fields(_ADDRESS, "motion", "arm", "around", "torques"),
        *_fields(_DOUBLE, "tick", "step", "opening", "detach", "flight"),
        ("nodes", _LONG),
        *_fields(_ADDRESS, "com", "start"),
    )


class SolidC(ctypes.Structure):
    """`solid` of clearance.c."""

    _fields_ = (
        *(("centre", _DOUBLE * 3), ("axes", _DOUBLE * 9), ("half", _DOUBLE * 3)),
        *_fields(_DOUBLE, "radius", "clearance"),
        ("bar", _LONG),
    )


class BodiesC(ctypes.Structure):
    """`bodies` of clearance.c; kept: what is at its addresses."""

    kept: Any

    _fields_ = (
        *_fields(_LONG, "links", "bar"),
        *_fields(_ADDRESS, "moved_by", "moves", "places", "radius", "reach"),
        ("solids", _LONG),
        ("around", _ADDRESS),
        *_fields(_LONG, "held_pairs", "flown_pairs"),
        *_fields(_ADDRESS, "held", "flown"),
        *_fields(_DOUBLE, "behind", "ahead", "com_offset", "grasp_angle", "landing"),
    )


class ThrownC(ctypes.Structure):
    """`thrown` of clearance.c. It does not own what is at its addresses."""

    _fields_ = (
        *_fields(_ADDRESS, "motion", "arm"),
        *_fields(_DOUBLE, "tick", "opening", "detach", "flight", "gravity"),
        ("nodes", _LONG),
        *_fields(_ADDRESS, "times", "com", "start"),
    )


class Measured(ctypes.Structure):
    """Use of the grip and the least heights and distances [m], infinite where nothing is near.

    grip: largest use of the full grip from rest to the opening, 1 is the limit. arm: height of
    joints, hand and its body, from rest to the end; held: of the bar, until detach. column_held,
    column_flown: the bar's signed distance from the base column. palm: of the flying bar from the
    hand's body, and from when on [s after detach] it is below the scene's clearance. cup: clearance
    on the way into the cup, -inf for a bar that misses it. speed: highest [m/s] of flange and pads'
    centre from rest to the end; torque: largest share of a joint's limit. Both are 0 where there is
    no limit. `measured` of check.c.
    """

    grip: float
    arm: float
    held: float
    column_held: float
    column_flown: float
    palm: float
    palm_time: float
    cup: float
    speed: float
    torque: float
    _fields_ = _fields(
        _DOUBLE,
        *("grip", "arm", "held", "column_held", "column_flown", "palm", "palm_time", "cup"),
        *("speed", "torque"),
    )


class GripC(ctypes.Structure):
    """`grip` of release.c. It does not own the arrays at its addresses."""

    _fields_ = (
        *_fields(_DOUBLE, "full", "opening"),
        ("pieces", _LONG),
        *_fields(_ADDRESS, "breaks", "curves"),
    )


class ReleaseC(ctypes.Structure):
    """`release` of release.c. It does not own what is at its addresses."""

    _fields_ = (
        *_fields(_ADDRESS, "motion", "arm"),
        ("grip", GripC),
        ("law", _DOUBLE * 8),
        *_fields(_DOUBLE, "angle", "delay"),
    )


def address(values: npt.NDArray[Any]) -> int:
    """Where an array begins, which must be contiguous and outlive the address."""
    return int(values.ctypes.data)
