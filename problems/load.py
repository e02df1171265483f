"""Scenes and arms from TOML files, and the scenes and arms that are shipped."""

from __future__ import annotations

import csv
import dataclasses
import difflib
import math
import os
import tomllib
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any

from ..models.arm import Arm, DHRow, JointLimits, Tool
from .choice import Choice
from .errors import InputError
from .robust import Robust
from .scene import (
    Cup,
    Grasp,
    Gripper,
    Hand,
    Landing,
    Mesh,
    Motion,
    PadContact,
    Pose,
    Robot,
    Scene,
    ThrownObject,
    Tolerance,
    Uncertainty,
    Workspace,
)
from .section import from_table, unknown
from .uncertainty import uncertainty_from

_SECTIONS: dict[str, type[Any]] = {
    "object": ThrownObject,
    "grasp": Grasp,
    "contact": PadContact,
    "gripper": Gripper,
    "hand": Hand,
    "robot": Robot,
    "motion": Motion,
    "target": Pose,
    "tolerance": Tolerance,
    "choice": Choice,
    "cup": Cup,
    "landing": Landing,
    "workspace": Workspace,
    "uncertainty": Uncertainty,
    "robust": Robust,
    "mesh": Mesh,
}
_KEYS = ("name", "description", "gravity")


def scene_names() -> list[str]:
    """Names of the built-in scenes."""
    folder = files(__package__) / "scenes"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def scene_text(name: str) -> str:
    """The TOML text of a built-in scene; InputError if there is none of that name."""
    if name not in scene_names():
        raise InputError(_no_scene(name))
    return (files(__package__) / "scenes" / f"{name}.toml").read_text(encoding="utf-8")


def load_scene(source: str | Path) -> Scene:
    """A scene from a built-in name or a TOML file.

    Raises InputError with one line: file, section, key, value and what is allowed.
    """
    source = str(source)
    if source in scene_names():
        return _parse(scene_text(source), source, None)
    path = Path(source)
    if path.suffix != ".toml" and not os.path.exists(path):
        raise InputError(_no_scene(source))
    return _parse(_read(path), source, path)


def _no_scene(name: str) -> str:
    names = scene_names()
    near = difflib.get_close_matches(name, names, 1, 0.4)
    hint = f", did you mean '{near[0]}'?" if near else ""
    return f"no scene '{name}'{hint} (built in: {', '.join(names)}; or a .toml file)"


def _read(path: Path) -> str:
    try:
        # A byte-order mark, as spreadsheets write it, is no part of the first column.
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "is not a text file"
        raise InputError(f"{path}: {reason}") from None


def _tables(text: str, place: str) -> dict[str, Any]:
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        # Beside broken syntax: numbers too long to read, tables nested too deep.
        raise InputError(f"{place}: broken TOML: {error}") from None


def _parse(text: str, place: str, path: Path | None) -> Scene:
    tables = _tables(text, place)
    folder = path.parent if path else None
    values: dict[str, Any] = {"name": path.stem if path else place, "file": str(path or "")}
    try:
        for key, value in tables.items():
            if key in _KEYS:
                values[key] = value
            elif key in _SECTIONS:
                values[key] = _section(key, value, folder)
            else:
                raise InputError(unknown(key, [*_KEYS, *_SECTIONS]))
        for key in ("object", "contact", "gripper"):
            if key not in values:
                raise InputError(f"section [{key}] is missing")
        if "robot" in values:
            values["arm"] = _named_arm("robot", values["robot"].arm, folder)
        elif "motion" in values and values["motion"].arm is not None:
            values["arm"] = _named_arm("motion", values["motion"].arm, folder)
        return Scene(**values)
    except InputError as error:
        raise error.within(place) from None


def _section(key: str, value: Any, folder: Path | None) -> Any:
    if not isinstance(value, dict):
        raise InputError(f"{key} = {value!r}: must be a section [{key}]")
    try:
        if key == "gripper" and isinstance(value.get("table"), str):
            beside = [k for k in value if k != "table"]
            if beside:
                raise InputError(f"{beside[0]}: not beside 'table', which says it all")
            value = value | _read_grip_table(value["table"], folder)
        if key == "motion":
            value = value | _read_motion_samples(value, folder)
        if key == "uncertainty":
            return uncertainty_from(value)
        return from_table(_SECTIONS[key], value)
    except InputError as error:
        raise InputError(f"[{key}] {error}") from None


def _read_grip_table(name: str, folder: Path | None) -> dict[str, Any]:
    rows = _read_csv("table", name, folder, ("t", "f_N"))
    return {"times": [row[0] for row in rows], "forces": [row[1] for row in rows]}


def _read_motion_samples(table: Mapping[str, Any], folder: Path | None) -> dict[str, Any]:
    """The samples of a motion given as a CSV file; nothing for the other kinds."""
    if isinstance(table.get("table"), str):
        rows = _read_csv("table", table["table"], folder, ("t", "x", "z", "theta"))
    elif isinstance(table.get("joints"), str) and isinstance(table.get("arm"), str):
        count = load_arm(table["arm"], folder).joints
        columns = ("t", *(f"q{j + 1}" for j in range(count)))
        rows = _read_csv("joints", table["joints"], folder, columns)
    else:
        return {}
    return {"samples": rows}


def _read_csv(
    key: str, name: str, folder: Path | None, columns: tuple[str, ...]
) -> list[list[float]]:
    """The named columns of a CSV file, row by row; InputError naming file and line."""
    try:
        rows = list(csv.reader(_read((folder or Path()) / name).splitlines()))
    except (InputError, csv.Error) as error:
        raise InputError(f"{key} = {error}") from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    missing = [column for column in columns if column not in header]
    if missing:
        named = f"{', '.join(columns[:-1])} and {columns[-1]}"
        raise InputError(
            f"{key} = {name}: the first line must name the columns {named} "
            f"({missing[0]} is missing)"
        )
    at = [header.index(column) for column in columns]
    found = []
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        try:
            values = [float(row[i]) for i in at]
        except (ValueError, IndexError):
            raise InputError(f"{key} = {name}: line {number} is not {len(at)} numbers") from None
        if not all(map(math.isfinite, values)):
            raise InputError(f"{key} = {name}: line {number} has a value that is not finite")
        found.append(values)
    return found


def _named_arm(section: str, name: str, folder: Path | None) -> Arm:
    try:
        return load_arm(name, folder)
    except InputError as error:
        raise InputError(f"[{section}] arm = {name!r}: {error}") from None


def arm_names() -> list[str]:
    """Names of the shipped arms."""
    folder = files(__package__) / "arms"
    return sorted(entry.name[:-5] for entry in folder.iterdir() if entry.name.endswith(".toml"))


def load_arm(name: str, folder: Path | None = None) -> Arm:
    """An arm from a shipped name or an arm data file (TOML), relative to `folder`."""
    if name in arm_names():
        text = (files(__package__) / "arms" / f"{name}.toml").read_text(encoding="utf-8")
    elif name.endswith(".toml"):
        text = _read((folder or Path()) / name)
    else:
        near = difflib.get_close_matches(name, arm_names(), 1, 0.4)
        hint = f", did you mean '{near[0]}'?" if near else ""
        raise InputError(
            f"unknown robot{hint} (shipped: {', '.join(arm_names())}; or a .toml file)"
        )
    return _arm(_tables(text, name))


def _arm(tables: Mapping[str, Any]) -> Arm:
    try:
        limits = {key: tuple(map(float, value)) for key, value in tables["limits"].items()}
        arm = Arm(
            name=tables["name"],
            description=tables.get("description", ""),
            dh=tuple(DHRow(**row) for row in tables["dh"]),
            tool=Tool(**tables["tool"]),
            limits=JointLimits(**limits),
            azimuth_joint=tables["azimuth_joint"],
            throwing_joints=tuple(tables["throwing_joints"]),
            posture=tuple(map(float, tables["posture"])),
        )
    except KeyError as error:
        raise InputError(f"key {error} is missing") from None
    except (TypeError, ValueError, AttributeError) as error:
        raise InputError(f"not an arm data file: {error}") from None
    _check_arm(arm)
    return arm


def _check_arm(arm: Arm) -> None:
    """InputError for numbers that are not finite, lists of the wrong length, no such joint."""
    numbers = {
        **{f"dh {f}": [getattr(row, f) for row in arm.dh] for f in ("a", "d", "alpha")},
        **{f"[tool] {k}": [v] for k, v in dataclasses.asdict(arm.tool).items()},
        **{f"[limits] {k}": list(v) for k, v in dataclasses.asdict(arm.limits).items()},
        "posture": list(arm.posture),
    }
    for key, values in numbers.items():
        for value in values:
            number = isinstance(value, int | float) and not isinstance(value, bool)
            if not number or not math.isfinite(value):
                raise InputError(f"{key} = {value!r}: must be a finite number")
    for key in ("posture", *(f"[limits] {f.name}" for f in dataclasses.fields(JointLimits))):
        if len(numbers[key]) != arm.joints:
            raise InputError(f"{key}: must be a list of {arm.joints}")
    _check_joints(arm)


def _check_joints(arm: Arm) -> None:
    """InputError for limits the wrong way round and joints that are not there."""
    for name in ("velocity", "acceleration", "jerk", "torque"):
        for value in getattr(arm.limits, name):
            if value <= 0:
                raise InputError(f"[limits] {name} = {value:g}: must be above 0")
    for low, high in zip(arm.limits.position_min, arm.limits.position_max, strict=True):
        if low >= high:
            raise InputError(f"[limits] position_min = {low:g}: must be below {high:g}")
    for key, joints in (
        ("azimuth_joint", [arm.azimuth_joint]),
        ("throwing_joints", list(arm.throwing_joints)),
    ):
        for joint in joints:
            if not isinstance(joint, int) or not 1 <= joint <= arm.joints:
                raise InputError(f"{key} = {joint!r}: must be a whole number, 1 to {arm.joints}")
