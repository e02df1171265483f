"""The structures of structures.h as ctypes, read from that file."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Callable
from types import MappingProxyType
from typing import Any, ClassVar, Self

import numpy as np
import numpy.typing as npt

from .header import LENGTHS, Variable, fields_of

Array = npt.NDArray[np.float64]

#: Most coordinates of a motion, and frames of a linkage.
AXES, FRAMES = LENGTHS["AXES"], LENGTHS["FRAMES"]
#: Types of the elements of arrays, by their names in C.
DTYPES: dict[str, np.dtype[Any]] = {
    "double": np.dtype(np.float64),
    "int64_t": np.dtype(np.int64),
    "unsigned char": np.dtype(np.bool_),
}


#: Structures that are rows of an array of doubles in Python: how many of these each has.
def _size(field: Variable) -> int:
    """Doubles of a field."""
    return int(np.prod(field.lengths)) * (2 if field.kind == "extreme" else 1)


ROWS = {name: sum(map(_size, fields_of(name))) for name in ("thrown", "measured", "contact")}


def columns_of(name: str) -> dict[str, slice]:
    """Columns of the fields of a structure that is a row of doubles."""
    found, first = {}, 0
    for field in fields_of(name):
        found[field.name] = slice(first, first := first + _size(field))
    return found


#: Looked up once: a plan takes some twenty addresses.
_addressof, _ndarray = ctypes.addressof, np.ndarray
# Python 3.11's stubs do not know arrays as buffers, later ones do.
_buffer_of: Callable[[Any], ctypes.c_char] = ctypes.c_char.from_buffer


def array_address(
    values: npt.NDArray[Any], length: int, dtype: np.dtype[Any], constant: bool, name: str
) -> int:
    """Where an array begins; it must outlive the address.

    constant: C only reads it, and it has just this length; else it has at least that. TypeError for
    an array that is not contiguous or of another type, ValueError for one of another length.
    """
    if isinstance(values, _ndarray) and (values.dtype is dtype or values.dtype == dtype):
        size = values.size
        if size != length and (constant or size < length):
            least = "" if constant else "at least "
            raise ValueError(f"{name}: the core takes {least}{length} elements, not {size}")
        try:
            # Three times as fast as `values.ctypes`.
            return _addressof(_buffer_of(values))
        except (TypeError, ValueError):
            # ctypes also refuses arrays without elements and constants.
            if values.flags.c_contiguous and (constant or values.flags.writeable):
                return int(values.ctypes.data)
    found = f"{values.dtype} {values.strides}" if isinstance(values, _ndarray) else type(values)
    raise TypeError(f"{name}: the core takes a contiguous array of {dtype}, not {found}")


def structure_address(part: Any, length: int | None, kind: str, name: str) -> int:
    """Where a structure begins, or an array of structures; TypeError for another."""
    wanted: Any = STRUCTURES[kind] if length is None else STRUCTURES[kind] * length
    if isinstance(part, wanted):
        return ctypes.addressof(part)
    raise TypeError(f"{name}: the core takes {wanted.__name__}, not {type(part).__name__}")


class Structure(ctypes.Structure):
    """A structure whose pointers are set by `attach` only. Fields are given by name."""

    #: By the names of pointers: (structure, part) -> where the part begins.
    pointers: ClassVar[dict[str, Callable[[Structure, Any], int | None]]]
    #: What `attach` was given, by the names of fields.
    kept: dict[str, Any] = MappingProxyType({})  # type: ignore[assignment]

    def attach(self, **parts: Any) -> None:
        """Sets fields to arrays and structures, which live as long as this one does.

        Fields that the lengths of arrays depend on come first. TypeError for an array that is not
        contiguous or of another type, ValueError for one of another length.
        """
        for name, part in parts.items():
            address = self.pointers.get(name)
            setattr(self, name, part if address is None else address(self, part))
        self.kept = {**self.kept, **parts}

    def copy(self) -> Self:
        """Another that points to the same parts."""
        found = type(self).from_buffer_copy(self)
        found.kept = self.kept
        return found


def _members(name: str, **parts: type[ctypes.Structure]) -> tuple[list[tuple[str, Any]], Any]:
    """Fields of a structure, and its pointers; parts: structures in it by their names in C."""
    kinds = {"double": ctypes.c_double, "int64_t": ctypes.c_int64, **parts}
    found: list[tuple[str, Any]] = []
    pointers = {}
    for field in fields_of(name):
        made: Any = ctypes.c_void_p if field.pointer else kinds[field.kind]
        for length in reversed(field.lengths):
            made = made * length
        found.append((field.name, made))
        if field.pointer:
            pointers[field.name] = _address_of(field)
    return found, pointers


def _address_of(field: Variable) -> Callable[[Structure, Any], int | None]:
    """What gives a pointer's address, with the length by the fields of its structure."""
    length = re.sub(r"(?<![\w.])([a-z_]\w*)", r"owner.\1", field.length) or "None"
    if field.kind in DTYPES:
        known = {"address": array_address, "kind": DTYPES[field.kind]}
        text = f"address(part, {length}, kind, {field.constant}, {field.name!r})"
    else:
        known = {"address": structure_address}
        text = f"address(part, {length}, {field.kind!r}, {field.name!r})"
    none = "None if part is None else " if field.optional else ""
    return eval(f"lambda owner, part: {none}{text}", known)  # type: ignore[no-any-return]


class PathC(Structure):
    """A motion."""

    _fields_, pointers = _members("path")


class LinkageC(Structure):
    """An arm, or a hand without one."""

    _fields_, pointers = _members("linkage")


class LimitsC(Structure):
    """Limits of a motion."""

    _fields_, pointers = _members("limits")


class SamplesC(Structure):
    """Samples that are sent."""

    _fields_, pointers = _members("samples")

    @classmethod
    def of(cls, tick: float, *rows: Array) -> SamplesC:
        """Of q, dq, ddq, each (K, n), or of q alone for functions that read no more.

        Arrays that cannot be written to are copied, as some functions write samples.
        """
        count, n = rows[0].shape
        if n > AXES:
            raise ValueError(f"the core takes at most {AXES} coordinates, not {n}")
        found = cls(rows=count, n=n, tick=tick)
        arrays = (np.ascontiguousarray(r) if r.flags.writeable else r.copy() for r in rows)
        found.attach(**dict(zip(("q", "dq", "ddq"), arrays, strict=False)))
        return found


class SceneC(Structure):
    """What of a scene counts."""

    _fields_, pointers = _members("scene")


class TorquesC(Structure):
    """Masses of an arm, and limits of its torques."""

    _fields_, pointers = _members("torques")


class ThrowsC(Structure):
    """Throws of one motion."""

    _fields_, pointers = _members("throws")


class SolidC(Structure):
    """A thing to stay clear of."""

    _fields_, pointers = _members("solid")


class BodiesC(Structure):
    """Arm and bar as capsules, and what is around."""

    _fields_, pointers = _members("bodies")


class GripC(Structure):
    """The grip force."""

    _fields_, pointers = _members("grip")


class ReleaseC(Structure):
    """A release."""

    _fields_, pointers = _members("release", grip=GripC)


class MoveC(Structure):
    """A known throw and where it is to land."""

    _fields_, pointers = _members("move")


class MovedC(Structure):
    """A throw that was moved."""

    _fields_, pointers = _members("moved", samples=SamplesC)


class BatchC(Structure):
    """N releases."""

    _fields_, pointers = _members("batch")


#: The structures by their names in C.
STRUCTURES: dict[str, type[Structure]] = {
    **{"path": PathC, "linkage": LinkageC, "limits": LimitsC, "samples": SamplesC},
    **{"grip": GripC, "release": ReleaseC, "move": MoveC, "moved": MovedC},
    **{"batch": BatchC, "scene": SceneC, "torques": TorquesC, "throws": ThrowsC},
    **{"solid": SolidC, "bodies": BodiesC},
}


def layout() -> dict[str, tuple[int, int]]:
    """Offset and size [bytes] of each structure and, as "path.n", of each of its fields."""
    found = {}
    for name, kind in STRUCTURES.items():
        found[name] = 0, ctypes.sizeof(kind)
        for label, *_ in kind._fields_:
            field = getattr(kind, label)
            found[f"{name}.{label}"] = field.offset, field.size
    for name, count in ROWS.items():
        found[name], offset = (0, 8 * count), 0
        for variable in fields_of(name):
            size = 8 * _size(variable)
            found[f"{name}.{variable.name}"], offset = (offset, size), offset + size
    return found
