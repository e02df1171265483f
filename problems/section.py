"""Sections of a scene file: frozen dataclasses whose fields have meanings, units and limits.

`rules` describes a field once: its meaning for the reference in docs/, its unit in files, its
limits. Loading, checking, writing and the reference use this description.
"""

from __future__ import annotations

import dataclasses
import functools
import inspect
import math
import re
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Self

from .checks import InputError, Mistakes, checked, within


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


#: Words of users for keys.
OTHER_WORDS = dict.fromkeys(("basket", "box", "bucket", "tray", "container"), "bin")
#: Default of a number for which another value is taken.
UNSET = float("nan")


@dataclasses.dataclass(frozen=True)
class Section:
    """Base of all sections: checks types, finiteness and limits of its fields."""

    #: Keys that were left out and whose values are assumed, with a sentence about each or "".
    assumptions: ClassVar[Mapping[str, str]] = types.MappingProxyType({})

    def __init_subclass__(cls) -> None:
        """Adds the fields' meanings to the docstring; angles in Python are in radians."""
        # Python 3.13 takes the indentation off, older ones leave it.
        words = [inspect.cleandoc(cls.__doc__ or ""), ""]
        for name, field in vars(cls).items():
            if isinstance(field, dataclasses.Field) and "meaning" in field.metadata:
                words.append(f"{name}: {re.sub('^degrees', 'radians', field.metadata['meaning'])}")
        cls.__doc__ = "\n".join(words)

    def __post_init__(self) -> None:
        hints, mistakes = hints_of(type(self)), Mistakes()
        for field in dataclasses.fields(self):
            key, value = file_key(field.name, field.metadata), getattr(self, field.name)
            # A default that is no number stands for another value.
            if value is field.default and (value is None or value is UNSET):
                continue
            with mistakes.kept():
                value = checked(key, value, hints[field.name], field.metadata)
                object.__setattr__(self, field.name, value)
        mistakes.refuse()
        self.check()

    def assume(self, name: str, value: Any, words: str = "") -> None:
        """Sets a field that was left out to `value`, and keeps a sentence about it."""
        object.__setattr__(self, name, value)
        object.__setattr__(self, "assumptions", {**self.assumptions, name: words})

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
        raise InputError(f"{key} = {value!r}: must be a list of tables, each under [[{key}]]")
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
    known = ((f.name, f.metadata) for f in fields if "meaning" in f.metadata)
    return {file_key(name, about): about["meaning"] for name, about in known}


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
    other = OTHER_WORDS.get(key)
    hint = f", did you mean '{other}'?" if other in known else InputError.hint(key, known)
    return f"unknown key '{key}'{hint} (known: {', '.join(known)})"
