"""Checked sections of a scene: frozen dataclasses whose fields know their limits."""

from __future__ import annotations

import dataclasses
import difflib
import math
import types
import typing
from collections.abc import Mapping
from typing import Any

from .errors import InputError


def quantity(
    *,
    above: float | None = None,
    least: float | None = None,
    most: float | None = None,
    below: float | None = None,
    degrees: bool = False,
    unit: str = "",
    choices: tuple[str, ...] = (),
    **field: Any,
) -> Any:
    """A dataclass field with limits.

    `degrees`: the scene file gives the value in degrees under the field's name with
    `_deg` behind it; in the dataclass it is in radians. `unit`: told where a limit refuses a
    value, for those that are easily given in another one.
    """
    meta = {
        "above": above,
        "least": least,
        "most": most,
        "below": below,
        "degrees": degrees,
        "unit": unit,
        "choices": choices,
    }
    return dataclasses.field(metadata=meta, **field)


#: Types of the fields of each section; resolving them takes longer than checking a value.
_known_hints: dict[type[Any], dict[str, Any]] = {}


def _hints(kind: type[Any]) -> dict[str, Any]:
    if kind not in _known_hints:
        _known_hints[kind] = typing.get_type_hints(kind)
    return _known_hints[kind]


@dataclasses.dataclass(frozen=True)
class Section:
    """Base of all sections: checks types, finiteness and limits of its fields."""

    def __post_init__(self) -> None:
        hints = _hints(type(self))
        for field in dataclasses.fields(self):
            value = _coerced(getattr(self, field.name), hints[field.name])
            if value is _WRONG:
                raise InputError(
                    f"{_key(field)} = {_shown(field, getattr(self, field.name))!r}: "
                    f"must be {_describe(hints[field.name])}"
                )
            object.__setattr__(self, field.name, value)
            _check_limits(field, value)
        self.check()

    def check(self) -> None:
        """Conditions between fields; raises InputError."""


_WRONG = object()


def from_table(kind: type[Any], table: Mapping[str, Any]) -> Any:
    """A section of dataclass `kind` from a TOML table; unknown keys are refused."""
    fields = {_key(f): f for f in dataclasses.fields(kind)}
    values: dict[str, Any] = {}
    for key, value in table.items():
        if key not in fields:
            raise InputError(unknown(key, list(fields)))
        field = fields[key]
        values[field.name] = _radians(key, value) if field.metadata.get("degrees") else value
        nested = _section_kind(kind, field)
        if nested is not None and isinstance(value, Mapping):
            try:
                values[field.name] = from_table(nested, value)
            except InputError as error:
                raise InputError(f"{key}: {error}") from None
    for key, field in fields.items():
        needed = (
            field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        )
        if needed and field.name not in values:
            raise InputError(f"key '{key}' is missing")
    return kind(**values)


def table_of(section: Section) -> dict[str, Any]:
    """The table that `from_table` makes the section from; defaults are left out."""
    table: dict[str, Any] = {}
    for field in dataclasses.fields(section):
        value = getattr(section, field.name)
        made = field.default_factory
        default = field.default if made is dataclasses.MISSING else made()
        if value is None or value == default:
            continue
        table[_key(field)] = _plain(value, bool(field.metadata.get("degrees")))
    return table


def _plain(value: Any, degrees: bool) -> Any:
    """A value as TOML or JSON has it."""
    if isinstance(value, Section):
        return table_of(value)
    if isinstance(value, tuple):
        return [_plain(item, degrees) for item in value]
    return math.degrees(value) if degrees else value


def _section_kind(kind: type[Any], field: dataclasses.Field[Any]) -> type[Any] | None:
    """The section that a field holds, None for a plain value."""
    hint = _hints(kind)[field.name]
    options = typing.get_args(hint) if isinstance(hint, types.UnionType) else (hint,)
    for option in options:
        if isinstance(option, type) and issubclass(option, Section):
            return option
    return None


def unknown(key: str, known: list[str]) -> str:
    """'unknown key' message with the nearest known one."""
    near = difflib.get_close_matches(key, known, 1, 0.4)
    hint = f", did you mean '{near[0]}'?" if near else ""
    return f"unknown key '{key}'{hint} (known: {', '.join(known)})"


def _key(field: dataclasses.Field[Any]) -> str:
    return f"{field.name}_deg" if field.metadata.get("degrees") else field.name


def _radians(key: str, value: Any) -> Any:
    if isinstance(value, list):
        return [_radians(key, v) for v in value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise InputError(f"{key} = {value!r}: must be a number in degrees")
    try:
        return math.radians(value)
    except OverflowError:
        raise InputError(f"{key}: the number is too large") from None


def _shown(field: dataclasses.Field[Any], value: Any) -> Any:
    """A value as the file gives it: in degrees where its key says so."""
    if isinstance(value, list | tuple):
        return [_shown(field, item) for item in value]
    if field.metadata.get("degrees") and isinstance(value, float):
        return round(math.degrees(value), 9)
    return value


def _coerced(value: Any, hint: Any) -> Any:
    """`value` as the type `hint` asks, or _WRONG."""
    if isinstance(hint, types.UnionType):
        for option in typing.get_args(hint):
            result = _coerced(value, option)
            if result is not _WRONG:
                return result
        return _WRONG
    if hint is float:
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return float(value) if number and abs(value) < _HUGE else _large(value)
    if hint is int:
        return value if isinstance(value, int) and not isinstance(value, bool) else _WRONG
    if typing.get_origin(hint) is tuple:
        return _coerced_tuple(value, typing.get_args(hint))
    if hint is type(None):
        return None if value is None else _WRONG
    return value if isinstance(value, hint) else _WRONG


#: Whole numbers beyond this have no float.
_HUGE = 1e308


def _large(value: Any) -> Any:
    """inf for a number that is too large, so that the limits refuse it; else _WRONG."""
    if isinstance(value, float):
        return value
    return math.inf if isinstance(value, int) and not isinstance(value, bool) else _WRONG


def _coerced_tuple(value: Any, hints: tuple[Any, ...]) -> Any:
    if not isinstance(value, list | tuple):
        return _WRONG
    if hints[-1] is Ellipsis:
        hints = (hints[0],) * len(value)
    if len(value) != len(hints):
        return _WRONG
    items = tuple(_coerced(v, h) for v, h in zip(value, hints, strict=True))
    return _WRONG if _WRONG in items else items


def _describe(hint: Any) -> str:
    if isinstance(hint, types.UnionType):
        options = [h for h in typing.get_args(hint) if h is not type(None)]
        return " or ".join(_describe(h) for h in options)
    if typing.get_origin(hint) is tuple:
        args = typing.get_args(hint)
        if args[-1] is Ellipsis:
            return f"a list, each {_describe(args[0])}"
        return f"a list of {len(args)}, each {_describe(args[0])}"
    names = {float: "a number", int: "a whole number", str: "a text", bool: "true or false"}
    return names.get(hint, getattr(hint, "__name__", str(hint)))


def _check_limits(field: dataclasses.Field[Any], value: Any) -> None:
    values = value if isinstance(value, tuple) else (value,)
    meta = field.metadata
    for item in values:
        if isinstance(item, str) and meta.get("choices") and item not in meta["choices"]:
            near = difflib.get_close_matches(item, meta["choices"], 1, 0.4)
            hint = f", did you mean '{near[0]}'?" if near else ""
            allowed = ", ".join(meta["choices"])
            raise InputError(f"{_key(field)} = {item!r}: must be one of {allowed}{hint}")
        if isinstance(item, bool) or not isinstance(item, int | float):
            continue
        shown = math.degrees(item) if meta.get("degrees") else item
        if not math.isfinite(item):
            raise InputError(f"{_key(field)} = {shown}: must be a finite number")
        for name, holds, words in _LIMITS:
            limit = meta.get(name)
            if limit is not None and not holds(item, limit):
                limit = math.degrees(limit) if meta.get("degrees") else limit
                unit = f" {meta['unit']}" if meta.get("unit") else ""
                raise InputError(f"{_key(field)} = {shown:g}: must be {words} {limit:g}{unit}")


_LIMITS: tuple[tuple[str, Any, str], ...] = (
    ("above", lambda v, limit: v > limit, "above"),
    ("least", lambda v, limit: v >= limit, "at least"),
    ("most", lambda v, limit: v <= limit, "at most"),
    ("below", lambda v, limit: v < limit, "below"),
)
