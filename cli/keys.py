"""All keys of scene, arm and gripper files as Markdown, from their fields and docstrings."""

from __future__ import annotations

import dataclasses
import inspect
import math
import textwrap
import types
import typing
from collections.abc import Iterator, Mapping
from typing import Any

from ..problems import (
    SECTIONS,
    SHARES,
    TABLES,
    TOP_KEYS,
    UNSET,
    Arm,
    DHRow,
    Distribution,
    GripperCapsule,
    GripperData,
    JointFrame,
    LinkInertia,
    Scene,
    Uncertainty,
    file_key,
    hints_of,
)

#: Ranges that hang on the scene's other values.
WITHIN = {
    "com_offset": "the CoM within the bar",
    "grasp_offset": "within the bar's length of its end",
}
INTRODUCTION = """\
# Scene files

`throwplan scenes --keys` prints this page.

A scene is a TOML file. Angles in it are in degrees and their keys end in `_deg`; all else is SI.
x points forward, z up, angles count counter-clockwise from +x. A section that is absent adds
nothing to the plan. A wrong key or value is refused with one line that names it. A dash stands
for no bound, and for a default of nothing.
"""
ARM_INTRODUCTION = """\
# Arm data files

A robot is a TOML file too, which `arm` in [robot] and [motion] names. `throwplan import-robot`
makes one from a URDF. Angles in it are in radians. Lists in `limits` hold one value per joint.
"""
#: The two ways of giving an arm's chain.
CHAIN = {
    "dh": "the chain, a table per joint, see [[dh]]; either `dh` or `joints`",
    "joints": "the same as URDF has it, see [[joints]]",
}


@dataclasses.dataclass(frozen=True)
class Key:
    """One line of the reference."""

    name: str
    kind: str
    allowed: str
    default: str
    meaning: str


def scene_keys() -> str:
    """The whole reference as Markdown."""
    top = dataclasses.replace(_key(Scene, "name"), default="from the file")
    keys = iter([top, *(_key(Scene, name) for name in TOP_KEYS[1:])])
    words = "These keys stand before the first section."
    parts = [INTRODUCTION, _part("##", "Keys at the top", words, keys)]
    for name, kind in SECTIONS.items():
        keys = _uncertain_keys() if kind is Uncertainty else _keys(kind)
        parts.append(_part("##", f"[{name}]", _summary(kind), keys))
        if kind is Uncertainty:
            words = "The table behind a key of [uncertainty]."
            parts.append(_part("###", "How a value is spread", words, _keys(Distribution)))
    parts.append(ARM_INTRODUCTION)
    for name, kind in TABLES.items():
        title = f"[[{name}]]" if kind in (DHRow, JointFrame, LinkInertia) else f"[{name}]"
        title = title if name else "Keys at the top of an arm's file"
        parts.append(_part("##", title, _summary(kind), _keys(kind)))
    parts.append(_part("#", "Gripper data files", _summary(GripperData), _keys(GripperData)))
    parts.append(
        _part("##", "[[capsules]] of a gripper", _summary(GripperCapsule), _keys(GripperCapsule))
    )
    return "\n".join(parts)


def _part(level: str, title: str, words: str, keys: Iterator[Key]) -> str:
    """A heading, what is said of the section, and its table."""
    rows = [("key", "type", "allowed", "default", "meaning"), ("---",) * 5]
    rows += [(f"`{k.name}`", k.kind, k.allowed, k.default, k.meaning) for k in keys]
    table = "".join(f"| {' | '.join(row)} |\n" for row in rows)
    return "\n\n".join([f"{level} {title}", textwrap.fill(words, 100), table])


def _summary(kind: type[Any]) -> str:
    """The first paragraph of the section's docstring, in one line."""
    return " ".join(inspect.cleandoc(kind.__doc__ or "").split("\n\n")[0].split())


def _keys(kind: type[Any]) -> Iterator[Key]:
    """The keys of a table as its file has them."""
    for field in dataclasses.fields(kind):
        if kind is Arm and field.name == "chain":
            yield from (Key(key, "list of tables", "–", "–", words) for key, words in CHAIN.items())
        elif "meaning" in field.metadata:
            yield _key(kind, field.name)


def _key(kind: type[Any], name: str) -> Key:
    """A field's line."""
    (field,) = (field for field in dataclasses.fields(kind) if field.name == name)
    about, degrees = field.metadata, bool(field.metadata.get("degrees"))
    kind_words = _kind(hints_of(kind)[name])
    default = _default(field.default, math.degrees(1.0) if degrees else 1.0)
    if (kind, name) == (Arm, "description"):
        default = "–"
    return Key(file_key(name, about), kind_words, _allowed(about), default, about["meaning"])


def _uncertain_keys() -> Iterator[Key]:
    """The keys of [uncertainty]."""
    for field in dataclasses.fields(Uncertainty):
        name, key = field.name, _key(Uncertainty, field.name)
        if name not in Uncertainty.PARAMETERS:
            yield dataclasses.replace(key, kind="list of rows")
            continue
        parameter = Uncertainty.PARAMETERS[name]
        unit = math.degrees(1.0) if parameter.degrees else 1.0
        allowed = WITHIN.get(name, f"within ±{unit * parameter.most:.6g}")
        if parameter.scaled:
            allowed = f"{SHARES[0]:g} to {SHARES[1]:g} times the scene's"
        yield dataclasses.replace(key, allowed=allowed)


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
    if dataclasses.is_dataclass(hint):
        return "table"
    return {float: "number", int: "whole number", str: "text", bool: "true or false"}[hint]


def _allowed(about: Mapping[str, Any]) -> str:
    """The range of a field, in the file's unit."""
    if about.get("choices"):
        return ", ".join(f"`{choice}`" for choice in about["choices"])
    unit = math.degrees(1.0) if about.get("degrees") else 1.0
    given = [name for name in ("least", "above", "most", "below") if name in about]
    if "least" in given and "above" in given:
        # The least value is above 0 itself.
        given.remove("above")
    words = {"least": "at least", "above": "above", "most": "at most", "below": "below"}
    return ", ".join(f"{words[name]} {unit * about[name]:.6g}" for name in given) or "–"


def _default(value: Any, unit: float) -> str:
    if value is dataclasses.MISSING:
        return "required"
    return "–" if value in (None, (), "") or value is UNSET else f"`{_plain(value, unit)}`"


def _plain(value: Any, unit: float) -> str:
    """A value as TOML has it."""
    if isinstance(value, tuple):
        return f"[{', '.join(_plain(item, unit) for item in value)}]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    return f"{unit * value:.6g}" if isinstance(value, float) else str(value)
