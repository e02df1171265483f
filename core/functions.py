"""The functions of functions.h: what each takes, checked at every call."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any

from .header import Function, Variable, functions
from .structures import DTYPES, ROWS, STRUCTURES, array_address

#: Numbers, by their names in C.
_NUMBERS = {"double": ctypes.c_double, "int64_t": ctypes.c_int64, "void": None}


def functions_of(core: ctypes.CDLL) -> SimpleNamespace:
    """The library's functions by their names."""
    return SimpleNamespace(**{found.name: _checked(core, found) for found in functions()})


def _checked(core: ctypes.CDLL, found: Function) -> Callable[..., Any]:
    """A function that refuses what it is not declared for.

    ValueError for arrays of another length and where it says what it requires; TypeError or
    ctypes.ArgumentError for others.
    """
    call, arguments = getattr(core, found.name), found.arguments
    call.restype, call.argtypes = _NUMBERS[found.result], [*map(_ctype, arguments)]
    if not found.requires and not any(argument.shape for argument in arguments):
        return call  # type: ignore[no-any-return]
    known = {"call": call, "address": array_address, "refuse": partial(_refuse, found)}
    given = []
    for argument in arguments:
        if not argument.shape:
            given.append(argument.name)
            continue
        kind = DTYPES["double" if argument.kind in ROWS else argument.kind]
        known[f"{argument.name}_kind"] = kind
        length = f"{ROWS.get(argument.kind, 1)} * {argument.length}"
        what = f"{argument.constant}, '{found.name}: {argument.name}'"
        taken = f"address({argument.name}, {length}, {argument.name}_kind, {what})"
        if argument.optional:
            taken = f"None if {argument.name} is None else {taken}"
        given.append(taken)
    text = f"call({', '.join(given)})"
    if found.requires:
        text = f"{text} if {found.requires} else refuse()"
    names = ", ".join(argument.name for argument in arguments)
    return eval(f"lambda {names}: {text}", known)  # type: ignore[no-any-return]


def _ctype(argument: Variable) -> Any:
    """As ctypes takes it; an array by its address."""
    if argument.shape:
        return ctypes.c_void_p
    return (
        ctypes.POINTER(STRUCTURES[argument.kind]) if argument.pointer else _NUMBERS[argument.kind]
    )


def _refuse(found: Function) -> None:
    raise ValueError(f"{found.name} requires {found.requires}")
