"""The reference of scene files and arm data files, from the sections' dataclasses."""

from __future__ import annotations

import dataclasses
import inspect
import math
import textwrap
import types
import typing
from collections.abc import Iterator
from typing import Any

from . import arm_file
from .distribution import Distribution
from .load import SECTIONS
from .reference_words import NOTES, WORDS
from .scene import Scene
from .section import Section
from .uncertainty import PARAMETERS

TOP = ("name", "description", "gravity")
#: Ranges that hang on the scene's other values.
WITHIN = {
    "com_offset": "the CoM within the bar",
    "grasp_offset": "within the bar's length of its end",
}
#: Tables of an arm data file: title, place in WORDS, dataclass.
ARM: tuple[tuple[str, str, type[Section]], ...] = (
    ("Keys at the top of an arm's file", "arm", arm_file._ArmTable),
    ("[[dh]]", "dh", arm_file._DHTable),
    ("[[joints]]", "joints", arm_file._JointTable),
    ("[tool]", "tool", arm_file._ToolTable),
    ("[limits]", "limits", arm_file._LimitsTable),
    ("[limits.slowing]", "limits.slowing", arm_file._SlowingTable),
    ("[[links]]", "links", arm_file._LinkTable),
)

INTRODUCTION = """\
# Scene files

Made by `throwplan scenes --reference`; do not edit.

A scene is a TOML file. Angles in it are in degrees and their keys end in `_deg`; all else is SI.
x points forward, z up, angles count counter-clockwise from +x. A section that is absent adds
nothing to the plan. A wrong key or value is refused with one line that names it. A dash stands
for no bound, and for a default of nothing.
"""

ARM_INTRODUCTION = """\
# Arm data files

A robot is a TOML file too. `throwplan import-robot` makes one from a URDF.
"""


@dataclasses.dataclass(frozen=True)
class Key:
    """One line of the reference."""

    name: str
    kind: str
    allowed: str
    default: str
    meaning: str


def reference() -> str:
    """The whole reference as Markdown."""
    parts = [INTRODUCTION, _part("##", "Keys at the top", "", _keys("", Scene, TOP))]
    for name, kind in SECTIONS.items():
        keys = _uncertain() if name == "uncertainty" else _keys(name, kind)
        parts.append(_part("##", f"[{name}]", name, keys, _summary(kind)))
        if name == "uncertainty":
            spread = _keys("spread", Distribution)
            parts.append(_part("###", "How a value is spread", "spread", spread))
    parts.append(ARM_INTRODUCTION)
    parts += [_part("##", title, place, _keys(place, kind)) for title, place, kind in ARM]
    return "\n".join(parts)


def _part(level: str, title: str, place: str, keys: Iterator[Key], summary: str = "") -> str:
    """A heading, what is said of the section, and its table."""
    words = textwrap.fill(" ".join(filter(None, (summary, NOTES.get(place)))), 100)
    return "\n\n".join(filter(None, (f"{level} {title}", words, _table(keys))))


def _table(keys: Iterator[Key]) -> str:
    rows = [("key", "type", "allowed", "default", "meaning"), ("---",) * 5]
    rows += [(f"`{k.name}`", k.kind, k.allowed, k.default, k.meaning) for k in keys]
    return "".join(f"| {' | '.join(row)} |\n" for row in rows)


def _summary(kind: type[Section]) -> str:
    """The first paragraph of the section's docstring, in one line."""
    return " ".join(inspect.cleandoc(kind.__doc__ or "").split("\n\n")[0].split())


def _keys(place: str, kind: type[Section], names: tuple[str, ...] | None = None) -> Iterator[Key]:
    """The keys of a section as its file has them, required ones first."""
    hints = typing.get_type_hints(kind)
    for field in dataclasses.fields(kind):
        if names is not None and field.name not in names:
            continue
        degrees = bool(field.metadata.get("degrees"))
        yield Key(
            f"{field.name}_deg" if degrees else field.name,
            _kind(hints[field.name]),
            _allowed(field.metadata),
            "from the file" if names and field.name == "name" else _default(field, degrees),
            WORDS.get(place, {}).get(field.name, ""),
        )
    if place == "arm":
        yield Key("dh", "list of tables", "–", "–", "the chain, see [[dh]]")
        yield Key("joints", "list of tables", "–", "–", "the chain, see [[joints]]")
        yield Key("links", "list of tables", "–", "–", "masses, see [[links]]")


def _uncertain() -> Iterator[Key]:
    """The keys of [uncertainty]."""
    words = WORDS["uncertainty"]
    for name, rules in PARAMETERS.items():
        key = f"{name}_deg" if rules.degrees else name
        if rules.scaled:
            allowed = "0.01 to 100 times the scene's"
        else:
            unit = math.degrees(1.0) if rules.degrees else 1.0
            allowed = WITHIN.get(name, f"within ±{unit * rules.most:.6g}")
        yield Key(key, "table", allowed, "–", words.get(name, ""))
    yield Key("correlation", "list of rows", "–", "–", words["correlation"])


def _kind(hint: Any) -> str:
    """A field's type as its file has it."""
    if isinstance(hint, types.UnionType):
        return " or ".join(_kind(h) for h in typing.get_args(hint) if h is not type(None))
    if typing.get_origin(hint) is tuple:
        items = typing.get_args(hint)
        if typing.get_origin(items[0]) is tuple:
            return f"list of rows, each a {_kind(items[0])}"
        count = "" if items[-1] is Ellipsis else f"{len(items)} "
        return f"list of {count}{_kind(items[0])}s"
    if isinstance(hint, type) and issubclass(hint, Section):
        return "table"
    return {float: "number", int: "whole number", str: "text", bool: "true or false"}[hint]


def _allowed(limits: Any) -> str:
    """The range of a field, in the file's unit."""
    if limits.get("choices"):
        return ", ".join(f"`{choice}`" for choice in limits["choices"])
    unit = math.degrees(1.0) if limits.get("degrees") else 1.0
    given = [name for name in ("least", "above", "most", "below") if limits.get(name) is not None]
    if "least" in given and "above" in given:
        # Together they are above 0, and by so much.
        given.remove("above")
    words = {"least": "at least", "above": "above", "most": "at most", "below": "below"}
    found = [f"{words[name]} {unit * limits[name]:.6g}" for name in given]
    return ", ".join(found) or "–"


def _default(field: dataclasses.Field[Any], degrees: bool) -> str:
    missing = dataclasses.MISSING
    if field.default is missing and field.default_factory is missing:
        return "required"
    value = field.default
    if value in (None, (), "", missing):
        return "–"
    return f"`{_plain(value, math.degrees(1.0) if degrees else 1.0)}`"


def _plain(value: Any, unit: float) -> str:
    """A value as TOML has it."""
    if isinstance(value, tuple):
        return f"[{', '.join(_plain(item, unit) for item in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return f"{unit * value:.6g}" if isinstance(value, float) else str(value)
