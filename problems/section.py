"""Sections of a scene file: frozen dataclasses whose fields have meanings, units and limits.

`rules` describes a field once: its meaning for the reference in docs/, its unit in files, its
limits. Loading, checking, writing and the reference use this description.
"""

from __future__ import annotations

import contextlib
import dataclasses
import difflib
import functools
import math
import operator
import re
import types
import typing
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Self

import numpy as np


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


def rules(
    meaning: str,
    *,
    degrees: bool = False,
    unit: str = "",
    choices: tuple[str, ...] = (),
    range: float = 0.0,
    **limits: float,
) -> dict[str, Any]:
    """The rules of a field, for its metadata.

    meaning: text of the reference, which begins with the unit in files. degrees: files have the
    value in degrees, under the field's name plus `_deg`; the dataclass and the limits here have
    radians. unit: named in the refusal of a value that users easily give in another unit. choices:
    of a text. range: the value may be [lowest, highest], by at most this apart. limits: `above`,
    `least`, `most`, `below`.
    """
    about = {"meaning": meaning, "degrees": degrees, "unit": unit, "choices": choices}
    return about | {"range": range} | limits


def quantity(meaning: str, *, default: Any = dataclasses.MISSING, **limits: Any) -> Any:
    """A dataclass field with its `rules`."""
    return dataclasses.field(default=default, metadata=rules(meaning, **limits))


def optional(meaning: str, **limits: Any) -> Any:
    """A field with its `rules` that may be left out."""
    return quantity(meaning, default=None, **limits)


@dataclasses.dataclass(frozen=True)
class Section:
    """Base of all sections: checks types, finiteness and limits of its fields."""

    #: Sentences about the defaults of keys that were left out.
    assumed: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        """Adds the fields' meanings to the docstring; angles in Python are in radians."""
        words = [(cls.__doc__ or "").rstrip(), ""]
        for name, field in vars(cls).items():
            if isinstance(field, dataclasses.Field) and "meaning" in field.metadata:
                words.append(f"{name}: {re.sub('^degrees', 'radians', field.metadata['meaning'])}")
        cls.__doc__ = "\n    ".join(words)

    def __post_init__(self) -> None:
        hints, mistakes = hints_of(type(self)), Mistakes()
        for field in dataclasses.fields(self):
            key, value = file_key(field.name, field.metadata), getattr(self, field.name)
            if value is None and field.default is None:
                continue
            with mistakes.kept():
                value = checked(key, value, hints[field.name], field.metadata)
                object.__setattr__(self, field.name, value)
        mistakes.refuse()
        self.check()

    def assume(self, name: str, value: Any, words: str) -> None:
        """Sets a field that was left out to `value`, and keeps a sentence about it."""
        object.__setattr__(self, name, value)
        object.__setattr__(self, "assumed", (*self.assumed, words))

    def check(self) -> None:
        """Conditions between fields; raises InputError."""

    def in_file(self, name: str) -> Any:
        """A field's value as files have it, but for the unit."""
        return getattr(self, name)

    def changed(self, **values: Any) -> Self:
        """A copy with other values, unchecked: plans make many copies with valid values."""
        copy, own = object.__new__(type(self)), vars(self)
        fields = {name: own[name] for name in self.__dataclass_fields__ if name in own}
        vars(copy).update(fields, **values)
        return copy


#: The types of a dataclass's fields by name.
hints_of: Callable[[Any], dict[str, Any]] = functools.cache(typing.get_type_hints)


def file_key(name: str, about: Mapping[str, Any]) -> str:
    """A field's key in files: `in_` stands for the key `in`, which is a word of Python."""
    return f"{name}_deg" if about.get("degrees") else name.removesuffix("_")


def unit_of(about: Mapping[str, Any]) -> str:
    """A field's unit in Python, in brackets; empty without a unit."""
    match = re.match(
        r"(degrees/s|degrees|rad/s²|rad/s|rad|kg m²|kg|m/s²|m/s|m|s|N m|N|Hz)(?=[,;]|$)",
        about["meaning"],
    )
    return "" if match is None else f" [{match[1].replace('degrees', 'rad')}]"


# From files and to them.


def from_table(kind: type[Any], table: Mapping[str, Any], **given: Any) -> Any:
    """A value of dataclass `kind` from a TOML table and its subtables; refuses unknown keys.

    given: values of fields that are not in the table.
    """
    fields = {
        file_key(f.name, f.metadata): f
        for f in dataclasses.fields(kind)
        if f.name not in given and "meaning" in f.metadata
    }
    values, mistakes = dict(given), Mistakes()
    for key, value in table.items():
        with mistakes.kept():
            if key not in fields:
                words = MOVED.get((kind.__name__, key)) or unknown(key, list(fields))
                raise InputError(words)
            field = fields[key]
            values[field.name] = _read(key, value, hints_of(kind)[field.name], field.metadata)
    missing, said = dataclasses.MISSING, " ".join(mistakes.lines)
    for key, field in fields.items():
        needed = field.default is missing and field.default_factory is missing
        if needed and key not in table and f"did you mean '{key}'" not in said:
            mistakes.lines.append(f"key '{key}' is missing")
    mistakes.refuse()
    return kind(**values)


def _read(key: str, value: Any, hint: Any, about: Mapping[str, Any]) -> Any:
    """A key's value: a table, a list of them, or a plain one, which is checked."""
    part, several = part_of(hint)
    if part is not None and several:
        return rows_from(key, part, value)
    if part is not None:
        if not isinstance(value, Mapping):
            raise InputError(f"{key} = {value!r}: must be a table")
        with within(key):
            result = from_table(part, value)
        return result.scaled(math.radians(1.0)) if about.get("degrees") else result
    return checked(key, _radians(key, value) if about.get("degrees") else value, hint, about)


def part_of(hint: Any) -> tuple[type[Any] | None, bool]:
    """The dataclass of a field's values, None for others, and whether the field is a list."""
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    for option in options:
        several = typing.get_origin(option) is tuple
        kind = typing.get_args(option)[0] if several else option
        if dataclasses.is_dataclass(kind) and isinstance(kind, type):
            return kind, several
    return None, False


def rows_from(key: str, kind: type[Any], value: Any) -> tuple[Any, ...]:
    """The values of dataclass `kind` in a list of tables."""
    if not isinstance(value, list) or not all(isinstance(row, Mapping) for row in value):
        raise InputError(f"{key} = {value!r}: must be a list of tables")
    rows_read, mistakes = [], Mistakes()
    for number, row in enumerate(value, start=1):
        with mistakes.kept(), within(f"{key} {number}"):
            rows_read.append(from_table(kind, row))
    mistakes.refuse()
    return tuple(rows_read)


def table_of(section: Any) -> dict[str, Any]:
    """The table of a dataclass's value, for `from_table`; without defaults."""
    table: dict[str, Any] = {}
    for field in dataclasses.fields(section):
        own = isinstance(section, Section)
        value = section.in_file(field.name) if own else getattr(section, field.name)
        if value is not None and value != field.default and "meaning" in field.metadata:
            key = file_key(field.name, field.metadata)
            table[key] = _plain(value, bool(field.metadata.get("degrees")))
    return table


def _plain(value: Any, degrees: bool) -> Any:
    """A value in the types of TOML and JSON."""
    if isinstance(value, list | tuple):
        return [_plain(item, degrees) for item in value]
    if dataclasses.is_dataclass(value):
        scaled: Any = value
        return table_of(scaled.scaled(math.degrees(1.0)) if degrees else scaled)
    return math.degrees(value) if degrees else value


def meanings(kind: type[Any]) -> dict[str, str]:
    """The meanings of the keys of a dataclass's table, for comments in files."""
    fields = dataclasses.fields(kind)
    return {file_key(f.name, f.metadata): f.metadata["meaning"] for f in fields}


def _radians(key: str, value: Any) -> Any:
    if isinstance(value, list):
        return [_radians(key, v) for v in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{key} = {value!r}: must be a number in degrees")
    try:
        return math.radians(value)
    except OverflowError:
        raise InputError(f"{key}: the number is too large") from None


#: Keys of earlier versions by their sections' classes, and their places now.
MOVED = {("Mesh", "sticking_margin"): "key 'sticking_margin': moved to [gripper]"}


def unknown(key: str, known: Sequence[str]) -> str:
    """'unknown key' message with the nearest known one."""
    return f"unknown key '{key}'{InputError.hint(key, known)} (known: {', '.join(known)})"


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
        raise InputError(f"{key} = {_in_file_unit(value, degrees)!r}: must be {kind}") from None
    for item in result if isinstance(result, tuple) else (result,):
        _check_limits(key, item, about)
    if is_range and not 0.0 < result[1] - result[0] < widest:
        found, most = (_in_file_unit(one, degrees) for one in (value, widest))
        words = f"[lowest, highest], rising, less than {most:g} apart"
        raise InputError(f"{key} = {found!r}: must be {words}")
    return result


def _in_file_unit(value: Any, degrees: bool) -> Any:
    """A value in the unit of its file key: degrees for keys in `_deg`."""
    if isinstance(value, list | tuple):
        return [_in_file_unit(item, degrees) for item in value]
    return round(math.degrees(value), 9) if degrees and isinstance(value, float) else value


def _coerce(value: Any, hint: Any) -> Any:
    """`value` as type `hint`; TypeError for another type, ValueError for another length."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(hint, types.UnionType):
        for option in typing.get_args(hint):
            with contextlib.suppress(TypeError, ValueError):
                return _coerce(value, option)
    elif typing.get_origin(hint) is tuple:
        if isinstance(value, list | tuple):
            hints = typing.get_args(hint)
            hints = hints[:1] * len(value) if hints[-1] is Ellipsis else hints
            return tuple(_coerce(v, h) for v, h in zip(value, hints, strict=True))
    elif hint not in (float, int):
        if isinstance(value, hint):
            return value
    elif isinstance(value, int | float) and not isinstance(value, bool):
        if isinstance(value, int) and abs(value) >= 1e308:
            return math.inf  # No float holds it; the limits refuse it.
        if hint is float or isinstance(value, int):
            return hint(value)
    raise TypeError


def _describe(hint: Any) -> str:
    """The name of a type in messages."""
    if isinstance(hint, types.UnionType):
        options = [h for h in typing.get_args(hint) if h is not type(None)]
        return " or ".join(_describe(h) for h in options)
    if typing.get_origin(hint) is tuple:
        args = typing.get_args(hint)
        count = "" if args[-1] is Ellipsis else f" of {len(args)}"
        return f"a list{count}, each {_describe(args[0])}"
    names = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}
    return names.get(hint, getattr(hint, "__name__", str(hint)))


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
