"""Scenes from tables: of TOML files, of the package's scenes, and of plan files."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..models.release import TableGrip
from ..models.robot import Arm
from .arm_files import GripperData, arm_from, load_arm, load_gripper
from .checks import InputError, Mistakes, checked, within
from .files import read_csv, shipped, shipped_text, text_of, toml_tables
from .grip import Gripper, Object
from .poses import Region
from .scene import MOVERS, SECTIONS, TOP_KEYS, Scene
from .section import from_table, hints_of, rows_from, table_of, unknown
from .stl import covered_mesh
from .targets import Obstacle
from .uncertainty import uncertainty_from


def scene_names() -> list[str]:
    """Names of the built-in scenes."""
    return list(shipped("scenes"))


def scene_text(name: str) -> str:
    """The TOML text of a built-in scene; InputError for an unknown name."""
    return shipped_text("scenes", name)


def as_scene(scene: Scene | str | Path) -> Scene:
    """A scene as it is, or loaded; InputError with [contact] shape, for `simulate` alone."""
    found = scene if isinstance(scene, Scene) else load_scene(scene)
    with within(found.place):
        found.contact.check_plain()
    return found


def load_scene(source: str | Path) -> Scene:
    """A scene from a built-in name or a TOML file.

    Raises InputError with one line: file, section, key, value and what is allowed.
    """
    source = str(source)
    if Path(source).suffix == ".json":
        raise InputError(
            f"{source}: a scene is a .toml file; a saved plan is for view, replay and export"
        )
    text, path = text_of("scenes", source)
    tables = toml_tables(text, source)
    folder, name = (path.parent, path.stem) if path else (None, source)
    with within(source):
        scene = _scene_from({"name": name} | tables, file=str(path or ""), folder=folder)
        scene.check_target_in_cup()
    return scene


def scene_from_table(table: Mapping[str, Any]) -> Scene:
    """The scene of a `Scene.table`; InputError for a wrong table."""
    sections = {key: value for key, value in table.items() if key != "arm"}
    with within("arm"):
        arm = arm_from(table["arm"]) if "arm" in table else None
    return _scene_from(sections, arm=arm)


def _scene_from(
    tables: Mapping[str, Any], *, file: str = "", folder: Path | None = None, arm: Arm | None = None
) -> Scene:
    """A scene from the tables of its file; `file` for messages, `folder` for the files that it
    names.

    arm: the robot's data, in place of the arm named by the scene.
    """
    values: dict[str, Any] = {"file": file, "arm": arm}
    tables = _with_spread(tables, folder)
    mistakes, fields = Mistakes(), {field.name: field for field in dataclasses.fields(Scene)}
    for key, value in tables.items():
        with mistakes.kept():
            if key in TOP_KEYS:
                values[key] = checked(key, value, hints_of(Scene)[key], fields[key].metadata)
            elif key in SECTIONS:
                values[key] = _section(key, value, folder)
            else:
                raise InputError(unknown(key, [*TOP_KEYS, *SECTIONS]))
    if len(tables.keys() & MOVERS) != 1:
        mistakes.lines.append("give exactly one of [hand], [robot] and [motion]")
    target = () if {"motion", "bin"} & tables.keys() else ("target",)
    for key in ("object", "contact", "gripper", *target):
        if key not in tables:
            mistakes.lines.append(f"section [{key}] is missing")
    mistakes.refuse()
    return Scene(**values)


def _section(key: str, value: Any, folder: Path | None) -> Any:
    if SECTIONS[key] is Obstacle:
        return rows_from(key, Obstacle, value)
    if not isinstance(value, dict):
        raise InputError(f"{key} = {value!r}: must be a section [{key}]")
    with within(f"[{key}]", " "):
        if key == "gripper":
            data = _gripper_data(value, folder)
            if value.get("raw") is True and not isinstance(value.get("table"), str):
                raise InputError("raw: only with 'table'")
            if isinstance(value.get("table"), str):
                said = ("force", "dwell", "opening", "times", "forces")
                other = [k for k in value if k in said]
                if other:
                    raise InputError(f"{other[0]}: not beside 'table', which says it all")
                value = value | _read_grip_table(value["table"], folder, value.get("raw") is True)
            return from_table(Gripper, value, data=data)
        if key == "motion":
            value = value | _read_motion_samples(value, folder)
        if key == "uncertainty":
            return uncertainty_from(value)
        if key == "target" and list in {type(value.get("x")), type(value.get("theta_deg"))}:
            return from_table(Region, value)
        if key == "object":
            thrown = from_table(Object, _with_mesh(value, folder))
            if thrown.mesh is not None and folder is not None:
                covered_mesh(thrown)
            return thrown
        return from_table(SECTIONS[key], value)


def _with_mesh(table: Mapping[str, Any], folder: Path | None) -> dict[str, Any]:
    """[object] with its mesh as a full path: plans are read elsewhere."""
    name = table.get("mesh")
    if not isinstance(name, str) or folder is None:
        return dict(table)
    path = folder / name
    if not path.is_file():
        raise InputError(f"mesh = {name}: no such file")
    return {**table, "mesh": str(path.resolve())}


def _gripper_data(table: Any, folder: Path | None) -> GripperData | None:
    """What the file of a table [gripper] holds; None without one."""
    name = table.get("file") if isinstance(table, Mapping) else None
    if not isinstance(name, str):
        return None
    with within(f"file = {name!r}"):
        return load_gripper(name, folder)


def _with_spread(tables: Mapping[str, Any], folder: Path | None) -> Mapping[str, Any]:
    """The tables with delay and opening of the gripper's file in [uncertainty], where they leave
    out both these and the values that they are about."""
    grip, section = tables.get("gripper"), tables.get("uncertainty", {})
    if not isinstance(grip, Mapping) or not isinstance(section, Mapping):
        return tables
    try:
        data = _gripper_data(grip, folder)
    except InputError:  # said with the section
        return tables
    if data is None:
        return tables
    spreads = {"delay": (data.delay, "dwell"), "opening": (data.opening_spread, "opening")}
    added = {
        name: table_of(spread)
        for name, (spread, about) in spreads.items()
        if spread is not None and not {about, "table", "times"} & grip.keys()
    }
    return {**tables, "uncertainty": added | dict(section)} if added else tables


def _read_grip_table(name: str, folder: Path | None, raw: bool) -> dict[str, Any]:
    """Times and forces of a recording; of a raw one, those of its nearest falling curve."""
    rows = read_csv("table", name, folder, ("t", "f_N"))
    if raw:
        with within(f"table = {name}", errors=ValueError):
            rows = TableGrip.from_recording(rows[:, 0], rows[:, 1]).samples()
    elif rises := TableGrip.noise(rows[:, 1]):
        raise InputError(
            f"table = {name}: f_N must fall, but rises by {rises:.3g} N in all: for a raw "
            "recording say raw = true"
        )
    return {"times": rows[:, 0].tolist(), "forces": rows[:, 1].tolist()}


def _read_motion_samples(table: Mapping[str, Any], folder: Path | None) -> dict[str, Any]:
    """The samples of a motion from a CSV file; empty for other kinds."""
    if isinstance(table.get("table"), str):
        rows = read_csv("table", table["table"], folder, ("t", "x", "z", "theta"))
    elif isinstance(table.get("joints"), str) and isinstance(table.get("arm"), str):
        with within(f"arm = {table['arm']!r}"):
            count = load_arm(table["arm"], folder).joints
        columns = ("t", *(f"q{j + 1}" for j in range(count)))
        rows = read_csv("joints", table["joints"], folder, columns)
    else:
        return {}
    return {"samples": rows.tolist()}
