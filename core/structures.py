"""The structures of structures.h as ctypes, read from that file.

They do not own what is at their addresses.
"""

from __future__ import annotations

import ctypes
import re
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

_HEADER = Path(__file__).with_name("structures.h").read_text("utf-8")
_TEXT = re.sub(r"/\*.*?\*/|\b(const|unsigned)\b", "", _HEADER, flags=re.DOTALL)
_LENGTHS = {name: int(value) for name, value in re.findall(r"#define (\w+) (\d+)", _TEXT)}
_BODIES = {n: body for body, n in re.findall(r"typedef struct {([^}]*)} (\w+);", _TEXT)}

#: Most coordinates of a motion, and frames of a linkage.
AXES, FRAMES = _LENGTHS["AXES"], _LENGTHS["FRAMES"]


def _fields(name: str, **parts: type[ctypes.Structure]) -> list[tuple[str, Any]]:
    """Fields of a structure; parts: the structures in it by their names in C."""
    kinds = {"double": ctypes.c_double, "int64_t": ctypes.c_int64, **parts}
    found: list[tuple[str, Any]] = []
    for line in _BODIES[name].split(";")[:-1]:
        kind, fields = line.split(maxsplit=1)
        for field in fields.split(","):
            label, *lengths = re.findall(r"\w+", field)
            made: Any = ctypes.c_void_p if "*" in field else kinds[kind]
            for length in reversed(lengths):
                made = made * (_LENGTHS.get(length) or int(length))
            found.append((label, made))
    return found


class PathC(ctypes.Structure):
    """A motion."""

    _fields_ = _fields("path")


class LinkageC(ctypes.Structure):
    """An arm, or a hand without one."""

    _fields_ = _fields("linkage")


class LimitsC(ctypes.Structure):
    """Limits of a motion."""

    _fields_ = _fields("limits")


class SamplesC(ctypes.Structure):
    """Samples that are sent."""

    _fields_ = _fields("samples")

    @classmethod
    def of(cls, tick: float, *rows: Array) -> SamplesC:
        """Of q, dq, ddq, each (K, n), which it keeps."""
        kept = [*map(np.ascontiguousarray, rows)]
        found = cls(*rows[0].shape, tick, *map(address, kept))
        found.kept = kept
        return found


class SceneC(ctypes.Structure):
    """What of a scene counts."""

    _fields_ = _fields("scene")


class TorquesC(ctypes.Structure):
    """Masses of an arm, and limits of its torques."""

    _fields_ = _fields("torques")


class ThrowC(ctypes.Structure):
    """A throw."""

    _fields_ = _fields("throw")


class ReferenceC(ctypes.Structure):
    """The clearances of a reference flight."""

    _fields_ = _fields("reference")


class SolidC(ctypes.Structure):
    """A thing to stay clear of."""

    _fields_ = _fields("solid")


class BodiesC(ctypes.Structure):
    """Arm and bar as capsules, and what is around."""

    _fields_ = _fields("bodies")


class Extreme(ctypes.Structure):
    """A least or largest value, and when [s]."""

    value: float
    time: float
    _fields_ = _fields("extreme")


class Measured(ctypes.Structure):
    """Use of the grip and the least heights and distances [m], infinite where nothing is near.

    grip: largest use of the full grip from rest to the opening, 1 is the limit. arm: height of
    joints, hand and its body, from rest to the end; held: of the bar, until detach. column_held,
    column_flown: the bar's signed distance from the base column. palm: of the flying bar from the
    hand's body; palm_time: from when on [s after detach] it is below the scene's clearance. speed:
    highest [m/s] of flange and pads' centre from rest to the end; torque: largest share of a
    joint's limit, and the joint's place among those that throw. Both are 0 where there is no limit.
    cup: clearance on the way into the cup, -inf for a bar that misses it.
    """

    grip: Extreme
    arm: Extreme
    held: Extreme
    column_held: Extreme
    column_flown: Extreme
    palm: Extreme
    speed: Extreme
    torque: Extreme
    palm_time: float
    cup: float
    joint: int
    _fields_ = _fields("measured", extreme=Extreme)


class GripC(ctypes.Structure):
    """The grip force."""

    _fields_ = _fields("grip")


class ReleaseC(ctypes.Structure):
    """A release."""

    _fields_ = _fields("release", grip=GripC)


class MoveC(ctypes.Structure):
    """A known throw and where it is to land."""

    _fields_ = _fields("move")


class MovedC(ctypes.Structure):
    """A throw that was moved."""

    _fields_ = _fields("moved", samples=SamplesC)


class BatchC(ctypes.Structure):
    """N releases."""

    _fields_ = _fields("batch")


#: The structures by their names in C.
STRUCTURES: dict[str, type[ctypes.Structure]] = {
    **{"path": PathC, "linkage": LinkageC, "limits": LimitsC, "samples": SamplesC},
    **{"grip": GripC, "release": ReleaseC, "move": MoveC, "moved": MovedC, "batch": BatchC},
    **{"scene": SceneC, "torques": TorquesC, "throw": ThrowC, "reference": ReferenceC},
    **{"extreme": Extreme, "measured": Measured, "solid": SolidC, "bodies": BodiesC},
}
#: Doubles of a row of each structure that is an array in Python.
ROWS = {"flown_sample": 17, "contact": 5}


def wrong_sizes(found: dict[str, int]) -> list[str]:
    """Structures whose size [bytes] differs from C's."""
    known = {name: 8 * count for name, count in ROWS.items()}
    known |= {name: ctypes.sizeof(kind) for name, kind in STRUCTURES.items()}
    return sorted(n for n in known.keys() | found.keys() if known.get(n) != found.get(n))


def address(values: npt.NDArray[Any], kind: type[np.generic] = np.float64) -> int:
    """Where an array of a kind begins; it must outlive the address.

    TypeError for one that is not contiguous or of another kind.
    """
    if values.dtype == kind:
        try:
            # Three times as fast as `values.ctypes`.
            return ctypes.addressof(ctypes.c_char.from_buffer(values))  # type: ignore[arg-type]
        except (TypeError, ValueError):
            # ctypes also refuses arrays without elements and constants.
            if values.flags.c_contiguous:
                return int(values.ctypes.data)
    wanted = f"contiguous {kind.__name__}"
    raise TypeError(f"the core takes {wanted}, not {values.dtype} {values.strides}")
