"""The compiled core: exact throws, batches, sending, measures and clearances, in C.

It is the only implementation of what it does. functions.h says what its functions take and give.
"""

from __future__ import annotations

import hashlib
import math
import multiprocessing
import os
import sys
from collections.abc import Callable, Iterable
from functools import cache, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt

#: Of shared libraries, by platform; as in setup.py.
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
#: The library.
_PLACE = Path(__file__).with_name(f"_core{SUFFIX}")
#: Arrays in C, by the types of their elements in Python.
_KINDS = {np.dtype(float): "double[]", np.dtype(np.int64): "int64_t[]"}
_KINDS[np.dtype(bool)] = "unsigned char[]"


class CoreError(ImportError):
    """The compiled core is not there, or is not the one that this package needs."""


@cache
def library() -> SimpleNamespace:
    """The functions and constants of the headers, and `ffi`, of cffi; CoreError where the library
    is missing, or was built from other sources.

    The functions take numbers, structures, what `array` gives, and None for NULL; TypeError for
    others.
    """
    try:
        # Not there before the library is built.
        from ._binding import SOURCES, ffi

        core = ffi.dlopen(str(_PLACE))
        built = ffi.string(core.core_sources).decode()
        sizes = [ffi.sizeof(name) for name in sorted(ffi.list_types()[0])]
        same = built == SOURCES == (_hash_of_sources() or built)
        why = "" if same and sizes == list(core.core_sizes) else "is of other sources"
    except (ImportError, OSError, AttributeError):
        why = "cannot be loaded" if _PLACE.exists() else "is missing"
    if why:
        advice = "run `make core` in the checkout, or `pip install .`"
        raise CoreError(f"the compiled core {_PLACE} {why}: {advice}")
    found = {name: getattr(core, name) for name in dir(core)}
    functions = {name: _function(part, ffi) for name, part in found.items() if callable(part)}
    # Without `core` itself the library would be closed.
    return SimpleNamespace(**found | functions, ffi=ffi, core=core)


def _function(function: Callable[..., Any], ffi: Any) -> Callable[..., Any]:
    """A function that also takes structures, by their pointers, and None."""

    def given(argument: Any) -> Any:
        if type(argument) is Structure:
            return argument.c
        # cffi would copy them for the time of a call, whatever the length that C reads.
        if isinstance(argument, (list, tuple, dict, bytes)):
            raise TypeError("the core takes arrays by `array` and `out`")
        return ffi.NULL if argument is None else argument

    return lambda *arguments: function(*map(given, arguments))


def _hash_of_sources() -> str:
    """As setup.py hashes the C files; empty for an installed package, which has none."""
    files = sorted(_PLACE.parent.glob("*.[ch]"))
    return hashlib.sha256(b"".join(f.read_bytes() for f in files)).hexdigest() if files else ""


def array(values: npt.NDArray[Any], *shape: int, of: str = "", written: bool = False) -> Any:
    """A pointer to an array of this shape, which C reads; it lives as long as the pointer.

    of: the structure in C that each row of doubles is, if it is one; written: C writes it, and it
    may be longer. TypeError or ValueError for an array of another type or size, or that is not
    contiguous.
    """
    try:
        kind = _KINDS[values.dtype]
    except (AttributeError, KeyError):
        found = getattr(values, "dtype", type(values).__name__)
        raise TypeError(f"the core takes arrays of double, int64 or bool, not {found}") from None
    pointer = library().ffi.from_buffer(of + "[]" if of else kind, values, written)
    size, given = math.prod(shape), len(pointer)
    if given < size or (given > size and not written):
        raise ValueError(f"the core takes {size} elements, {shape}, not {given}")
    return pointer


#: A pointer to an array of at least this shape, in which C writes.
out = partial(array, written=True)


@cache
def columns_of(kind: str) -> dict[str, slice]:
    """Columns of the fields of a structure that is a row of doubles."""
    sizeof, fields = library().ffi.sizeof, library().ffi.typeof(kind).fields
    return {n: slice(f.offset // 8, (f.offset + sizeof(f.type)) // 8) for n, f in fields}


def rows(kind: str, *count: int) -> npt.NDArray[np.float64]:
    """Room for structures that are rows of doubles."""
    return np.empty((*count, library().ffi.sizeof(kind) // 8))


class Structure:
    """A structure by its name in C. Its fields are attributes, all 0 at first.

    Fields that are arrays of numbers are set to sequences, pointers to structures or to what
    `array` gives, which then live as long as the structure, or to None for NULL. TypeError for a
    pointer to another type.
    """

    __slots__ = ("c", "kept")
    #: The pointer that C takes, and what its own pointers lead to.
    c: Any
    kept: dict[str, Any]

    def __init__(self, kind: str, **fields: Any) -> None:
        ffi = library().ffi
        # By one call of cffi, as each takes its time.
        given = {
            n: p.c if isinstance(p, Structure) else p for n, p in fields.items() if p is not None
        }
        object.__setattr__(self, "c", ffi.new(kind + " *", given))
        kept = {n: fields[n] for n, p in given.items() if isinstance(p, ffi.CData)}
        object.__setattr__(self, "kept", kept)

    def __getattr__(self, name: str) -> Any:
        """A number, or what is in C: valid as long as this structure lives."""
        return getattr(self.c, name)

    def __setattr__(self, name: str, part: Any) -> None:
        """Also a structure inside this one, as a copy."""
        ffi, value = library().ffi, part
        if isinstance(part, Structure):
            inside = ffi.typeof(getattr(self.c, name)).kind == "struct"
            value = part.c[0] if inside else part.c
        setattr(self.c, name, ffi.NULL if part is None else value)
        if isinstance(value, ffi.CData):
            self.kept[name] = part

    def attach(self, **parts: Any) -> None:
        """Sets fields."""
        for name, part in parts.items():
            setattr(self, name, part)

    def copy(self) -> Structure:
        """Another that points to the same parts."""
        ffi, found = library().ffi, object.__new__(Structure)
        object.__setattr__(found, "c", ffi.new(ffi.typeof(self.c), self.c[0]))
        object.__setattr__(found, "kept", dict(self.kept))
        return found

    def __reduce__(self) -> tuple[Any, ...]:
        """For another process, which has none of its pointers."""
        if self.kept:
            raise TypeError("a structure with pointers belongs to its process")
        ffi = library().ffi
        return _copied, (ffi.typeof(self.c).item.cname, bytes(ffi.buffer(self.c)))


def _copied(kind: str, data: bytes) -> Structure:
    found = Structure(kind)
    library().ffi.buffer(found.c)[:] = data
    return found


def structures(kind: str, parts: Iterable[Structure]) -> Any:
    """A pointer to an array of structures, copies of `parts`."""
    return library().ffi.new(f"{kind}[]", [part.c[0] for part in parts])


def sampled(tick: float, *rows: npt.NDArray[np.float64]) -> Structure:
    """Samples q, dq, ddq, each (K, n), or q alone for functions that read no more.

    Arrays that cannot be written to are copied, as some functions write samples.
    """
    (count, n), most = rows[0].shape, library().AXES
    if n > most:
        raise ValueError(f"the core takes at most {most} coordinates, not {n}")
    fields = {"rows": count, "n": n, "tick": tick}
    for name, part in zip(("q", "dq", "ddq"), rows, strict=False):
        given = np.ascontiguousarray(part) if part.flags.writeable else part.copy()
        fields[name] = out(given, count, n)
    return Structure("samples", **fields)


def threads() -> int:
    """Threads for a call that releases Python's lock: one in a process that another started."""
    return 1 if multiprocessing.parent_process() is not None else os.cpu_count() or 1
