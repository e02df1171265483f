"""Arms from data files (TOML), and the arms that are shipped."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from ..models import Arm, DHRow, JointFrame, JointLimits, LinkInertia, Slowing, Tool
from .errors import InputError
from .section import Section, from_table, quantity, unknown
from .text_file import read_text, toml_tables


@dataclasses.dataclass(frozen=True)
class _DHTable(Section):
    a: float
    d: float
    alpha: float


@dataclasses.dataclass(frozen=True)
class _JointTable(Section):
    xyz: tuple[float, float, float]
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class _LinkTable(Section):
    com: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]
    mass: float = quantity(least=0)


@dataclasses.dataclass(frozen=True)
class _ToolTable(Section):
    flange: float
    rotation: float
    tcp: float
    palm_back: float
    palm_front: float
    palm_half_width: float
    xyz: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclasses.dataclass(frozen=True)
class _SlowingTable(Section):
    offset: tuple[float, ...]
    upper: tuple[float, ...]
    lower: tuple[float, ...]
    deceleration: tuple[float, ...] = quantity(above=0)


@dataclasses.dataclass(frozen=True)
class _LimitsTable(Section):
    position_max: tuple[float, ...]
    position_min: tuple[float, ...]
    velocity: tuple[float, ...] = quantity(above=0)
    acceleration: tuple[float, ...] = quantity(above=0)
    jerk: tuple[float, ...] = quantity(above=0)
    torque: tuple[float, ...] = quantity(above=0)
    slowing: _SlowingTable | None = None


@dataclasses.dataclass(frozen=True)
class _ArmTable(Section):
    name: str
    azimuth_joint: int
    throwing_joints: tuple[int, ...]
    posture: tuple[float, ...]
    tool: _ToolTable
    limits: _LimitsTable
    description: str = ""


#: Keys that hold a table per joint, and its kind.
_LISTS: dict[str, type[Section]] = {"dh": _DHTable, "joints": _JointTable, "links": _LinkTable}


def arm_names() -> list[str]:
    """Names of the shipped arms."""
    folder = files(__package__) / "arms"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_arm(name: str, folder: Path | None = None) -> Arm:
    """An arm from a shipped name or an arm data file (TOML), relative to `folder`."""
    if name in arm_names():
        text = (files(__package__) / "arms" / f"{name}.toml").read_text(encoding="utf-8")
    elif name.endswith(".toml"):
        text = read_text((folder or Path()) / name)
    else:
        near = difflib.get_close_matches(name, arm_names(), 1, 0.4)
        hint = f", did you mean '{near[0]}'?" if near else ""
        raise InputError(
            f"unknown robot{hint} (shipped: {', '.join(arm_names())}; or a .toml file)"
        )
    return arm_from(toml_tables(text, name))


def arm_from(tables: Mapping[str, Any]) -> Arm:
    """An arm from the tables of its data file; InputError naming the key."""
    rest = {key: value for key, value in tables.items() if key not in _LISTS}
    known = [field.name for field in dataclasses.fields(_ArmTable)]
    for key in rest:
        if key not in known:
            raise InputError(unknown(key, [*known, *_LISTS]))
    head: _ArmTable = from_table(_ArmTable, rest)
    rows = {key: _rows(key, tables[key]) for key in _LISTS if key in tables}
    if ("dh" in rows) == ("joints" in rows):
        raise InputError("give one of 'dh' and 'joints'")
    chain: list[DHRow | JointFrame] = [DHRow(**row) for row in rows.get("dh", [])]
    chain += [JointFrame(**row) for row in rows.get("joints", [])]
    limits = _each(head.limits)
    if head.limits.slowing is not None:
        limits["slowing"] = Slowing(**_each(head.limits.slowing))
    arm = Arm(
        head.name,
        head.description,
        tuple(chain),
        Tool(**_each(head.tool)),
        JointLimits(**limits),
        head.azimuth_joint,
        head.throwing_joints,
        head.posture,
        tuple(LinkInertia(**row) for row in rows.get("links", [])),
    )
    _check_lengths(arm)
    _check_joints(arm)
    return arm


def arm_table(arm: Arm) -> dict[str, Any]:
    """The tables of the data file that `arm_from` makes the arm from."""
    table = {
        key: _each(part) if dataclasses.is_dataclass(part) else part
        for key, part in _each(arm).items()
        if key not in ("chain", "links")
    }
    slowing = table["limits"].pop("slowing")
    if slowing is not None:
        table["limits"]["slowing"] = _each(slowing)
    kind = "dh" if isinstance(arm.chain[0], DHRow) else "joints"
    table[kind] = [_each(joint) for joint in arm.chain]
    if arm.links:
        table["links"] = [_each(link) for link in arm.links]
    return table


def _rows(key: str, value: Any) -> list[dict[str, Any]]:
    """The checked values of a list of tables."""
    if not isinstance(value, list) or not value:
        raise InputError(f"{key} = {value!r}: must be a list of tables, one per joint")
    found = []
    for number, row in enumerate(value, start=1):
        if not isinstance(row, Mapping):
            raise InputError(f"{key} {number} = {row!r}: must be a table")
        try:
            found.append(_each(from_table(_LISTS[key], row)))
        except InputError as error:
            raise InputError(f"{key} {number}: {error}") from None
    return found


def _check_lengths(arm: Arm) -> None:
    """InputError for lists that are not one value per joint."""
    limits, slowing = _each(arm.limits), arm.limits.slowing
    lists = {f"[limits] {name}": value for name, value in limits.items() if name != "slowing"}
    if slowing is not None:
        lists |= {f"[limits.slowing] {name}": value for name, value in _each(slowing).items()}
    for key, values in ({"posture": arm.posture} | lists).items():
        if len(values) != arm.joints:
            raise InputError(f"{key}: must be a list of {arm.joints}")
    if arm.links and len(arm.links) != arm.joints + 1:
        raise InputError(f"links: must be {arm.joints + 1} tables, one per joint and the hand's")


def _each(part: Any) -> dict[str, Any]:
    return {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}


def _check_joints(arm: Arm) -> None:
    """InputError for limits the wrong way round and joints that are not there."""
    for low, high in zip(arm.limits.position_min, arm.limits.position_max, strict=True):
        if low >= high:
            raise InputError(f"[limits] position_min = {low:g}: must be below {high:g}")
    for key, joints in (
        ("azimuth_joint", [arm.azimuth_joint]),
        ("throwing_joints", list(arm.throwing_joints)),
    ):
        for joint in joints:
            if not 1 <= joint <= arm.joints:
                raise InputError(f"{key} = {joint!r}: must be a whole number, 1 to {arm.joints}")
