"""Wrong input: its errors, and the checks of single values."""

from __future__ import annotations

import contextlib
import difflib
import math
import operator
import re
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

#: Types by their names in messages.
KINDS: dict[Any, str] = {
    **{float: "a number", int: "a whole number", str: "a text", bool: "true or false"},
    dict: "a table",
}
#: Origins of annotations with several types.
UNIONS = (types.UnionType, typing.Union)


class ThrowplanError(Exception):
    """Base class of throwplan's exceptions."""


class InputError(ThrowplanError, ValueError):
    """Wrong input. A line for each mistake: where, which value, what is allowed."""

    def __str__(self) -> str:
        return "\n".join(map(str, self.args))

    def within(self, place: str, colon: str = ": ") -> InputError:
        """The error with `place` (a file, a section) before each line."""
        return InputError(*(f"{place}{colon}{line}" for line in str(self).splitlines()))

    @staticmethod
    def hint(word: str, known: Iterable[str]) -> str:
        """A hint at the known word most similar to a wrong one; empty without a similar one."""
        matches = difflib.get_close_matches(word, list(known), 1, 0.4)
        return f", did you mean '{matches[0]}'?" if matches else ""


@contextlib.contextmanager
def within(place: str, colon: str = ": ", errors: type[ValueError] = InputError) -> Iterator[None]:
    """Puts `place` (a file, a section) before each line of an error of the block."""
    try:
        yield
    except errors as error:
        raise InputError(str(error)).within(place, colon) from None


class Mistakes:
    """Collects mistakes, to report them together."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    @contextlib.contextmanager
    def kept(self) -> Iterator[None]:
        """Collects an InputError of the block."""
        try:
            yield
        except InputError as error:
            self.lines += str(error).splitlines()

    def refuse(self) -> None:
        """Raises an InputError with all collected mistakes, if there are any."""
        if self.lines:
            raise InputError(*self.lines)


# Checks of single values.

#: Largest value of a quantity by its unit, unless its field has a lower limit; squares and ratios
#: of larger values overflow. `_SMALLEST` is the smallest positive value.
LARGEST = {
    **{"m": 1e3, "degrees": 1e5, "rad": 1e3, "kg": 1e4, "kg m²": 1e6, "s": 1e4, "Hz": 1e5},
    **{"m/s": 1e3, "m/s²": 1e5, "rad/s": 1e4, "rad/s²": 1e6, "rad/s³": 1e9, "N": 1e6, "N m": 1e6},
}
_SMALLEST = 1e-12
_LIMITS: dict[str, tuple[Callable[[Any, Any], bool], str]] = {
    "above": (operator.gt, "above"),
    "least": (operator.ge, "at least"),
    "most": (operator.le, "at most"),
    "below": (operator.lt, "below"),
}


def checked(key: str, value: Any, hint: Any, about: Mapping[str, Any]) -> Any:
    """A field's value as the type `hint`; InputError for a wrong type or a broken limit."""
    widest, degrees = about.get("range", 0.0), bool(about.get("degrees"))
    is_range = bool(widest) and isinstance(value, list | tuple)
    try:
        result = _coerce(value, tuple[float, float] if is_range else hint)
    except (TypeError, ValueError):
        kind = _describe(hint) + (" or [lowest, highest]" if widest else "")
        found = _shown(_in_file_unit(value, degrees))
        raise InputError(f"{key} = {found}: must be {kind}") from None
    for item in result if isinstance(result, tuple) else (result,):
        _check_limits(key, item, about)
    if is_range and not 0.0 < result[1] - result[0] < widest:
        found, most = (_in_file_unit(one, degrees) for one in (value, widest))
        words = f"[lowest, highest], rising, less than {most:g} apart"
        raise InputError(f"{key} = {found!r}: must be {words}")
    return result


def _shown(value: Any) -> str:
    """A value in one line of a message."""
    try:
        words = " ".join(repr(value).split())
    except Exception:  # Of a class that is not ours.
        words = f"a {type(value).__name__}"
    return words if len(words) <= 100 else f"{words[:97]}..."


def _in_file_unit(value: Any, degrees: bool) -> Any:
    """A value in the unit of its file key: degrees for keys in `_deg`."""
    if isinstance(value, list | tuple):
        return [_in_file_unit(item, degrees) for item in value]
    return round(math.degrees(value), 9) if degrees and isinstance(value, float) else value


def _coerce(value: Any, hint: Any) -> Any:
    """`value` as type `hint`; TypeError for another type, ValueError for another length."""
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin in UNIONS:
        for option in parts:
            with contextlib.suppress(TypeError, ValueError):
                return _coerce(value, option)
        raise TypeError
    if isinstance(value, np.ndarray) and hasattr(hint, "from_array"):
        return hint.from_array(value)
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if origin is tuple:
        if not isinstance(value, list | tuple):
            raise TypeError
        if parts[-1] is not Ellipsis:
            return tuple(_coerce(v, part) for v, part in zip(value, parts, strict=True))
        return tuple(_coerce(item, parts[0]) for item in value)
    if hint in (float, int):
        return _number(value, hint)
    if not isinstance(value, origin or hint):
        raise TypeError
    return value


def _number(value: Any, hint: type) -> Any:
    """A number, a whole one as float where `hint` is."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError
    if isinstance(value, int) and abs(value) >= 1e308:
        return math.inf  # No float holds it; the limits refuse it.
    if hint is int and not isinstance(value, int):
        raise TypeError
    return hint(value)


def _describe(hint: Any) -> str:
    """The name of a type in messages."""
    origin, args = typing.get_origin(hint), typing.get_args(hint)
    if origin in UNIONS:
        return " or ".join(_describe(h) for h in args if h is not type(None))
    if origin is tuple:
        count = "" if args[-1] is Ellipsis else f" of {len(args)}"
        return f"a list{count}, each {_describe(args[0])}"
    kind = origin or hint
    usual = getattr(kind, "DESCRIBED", getattr(kind, "__name__", str(kind)))
    return KINDS.get(kind, str(usual))


def _check_limits(key: str, item: Any, about: Mapping[str, Any]) -> None:
    """InputError for a text that is no choice, and a number that is not finite or outside."""
    choices = about.get("choices")
    if isinstance(item, str) and choices and item not in choices:
        hint = InputError.hint(item, choices)
        raise InputError(f"{key} = {item!r}: must be one of {', '.join(choices)}{hint}")
    if isinstance(item, bool) or not isinstance(item, int | float):
        return
    in_file = math.degrees(item) if about.get("degrees") else item
    if not math.isfinite(item):
        raise InputError(f"{key} = {in_file}: must be a finite number")
    begins = re.match(r"kg m²|N m|\w+(/s[²³]?)?", about.get("meaning", ""))
    largest = LARGEST.get(begins[0], math.inf) if begins else math.inf
    if about.get("degrees"):
        largest = math.radians(largest)
    bounds = {"most": largest, "least": -largest}
    if largest < math.inf and about.get("above") == 0:
        bounds["least"] = _SMALLEST
    for name, (holds, words) in _LIMITS.items():
        limit = about.get(name, bounds.get(name))
        if limit is not None and not holds(item, limit):
            limit = math.degrees(limit) if about.get("degrees") else limit
            unit = f" {about['unit']}" if about.get("unit") else ""
            raise InputError(f"{key} = {in_file:g}: must be {words} {limit:g}{unit}")
