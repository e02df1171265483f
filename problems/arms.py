"""Arms: their data files (TOML) read, checked and written, and the arms that are shipped."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from ..models import Arm, DHRow, JointFrame, JointLimits, LinkInertia, Slowing, Tool
from .files import read_text, toml_lines, toml_tables
from .section import InputError, check_complete, checked, hints_of, nearest, rules, unknown

#: The keys of each table of an arm data file: what they mean and allow.
ARM_KEYS: dict[type[Any], dict[str, dict[str, Any]]] = {
    Arm: {
        "name": rules("name of the arm; ROS joint names begin with it"),
        "description": rules("one line"),
        "azimuth_joint": rules("turns the throw's vertical plane"),
        "throwing_joints": rules("move in that plane"),
        "posture": rules("rad, what the other joints keep"),
        "tool": rules("section [tool]"),
        "limits": rules("section [limits]"),
        "dh": rules("the chain, a table per joint, see [[dh]]; either `dh` or `joints`"),
        "joints": rules("the same as URDF has it, see [[joints]]"),
        "links": rules("masses, a table per joint and one for the hand, see [[links]]"),
    },
    DHRow: {
        "a": rules("m, before the joint"),
        "d": rules("m, along it"),
        "alpha": rules("rad, before the joint"),
    },
    JointFrame: {
        "xyz": rules("m, in the frame before it, at angle 0"),
        "rpy": rules("rad, about the fixed x, y and z axes in turn"),
    },
    Tool: {
        "flange": rules("m, along the mount's z axis to the flange"),
        "rotation": rules("rad, about it"),
        "tcp": rules("m, from the flange to the pads' centre"),
        "palm_back": rules("m, the hand's body behind the pads' centre: from here"),
        "palm_front": rules("m, to here"),
        "palm_half_width": rules("m, half its thickness in the throwing plane"),
        "xyz": rules("m, the mount in the last joint's frame"),
        "rpy": rules("rad, the same"),
    },
    JointLimits: {
        "position_min": rules("rad, lower end of the range"),
        "position_max": rules("rad, upper end"),
        "velocity": rules("rad/s", above=0),
        "acceleration": rules("rad/s²", above=0),
        "jerk": rules("rad/s³", above=0),
        "torque": rules("N m", above=0),
        "slowing": rules("section [limits.slowing]"),
    },
    Slowing: {
        "deceleration": rules("rad/s²", above=0),
        "offset": rules("rad/s: the velocity is at most √(2·deceleration·(upper − q)) − offset"),
        "upper": rules("rad, near the upper end of the range"),
        "lower": rules("rad, the same at the lower end"),
    },
    LinkInertia: {
        "mass": rules("kg", least=0),
        "com": rules("m, in the joint's frame"),
        "inertia": rules("kg m² about the CoM: xx, xy, xz, yy, yz, zz"),
    },
}
#: Keys that hold a table, and those that hold a list of them.
TABLES: dict[str, type[Any]] = {"tool": Tool, "limits": JointLimits, "slowing": Slowing}
LISTS: dict[str, type[Any]] = {"dh": DHRow, "joints": JointFrame, "links": LinkInertia}


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
        hint = nearest(name, arm_names())
        raise InputError(
            f"unknown robot{hint} (shipped: {', '.join(arm_names())}; or a .toml file)"
        )
    return arm_from(toml_tables(text, name))


def arm_from(tables: Mapping[str, Any]) -> Arm:
    """An arm from the tables of its data file; InputError naming the key."""
    values = _values(Arm, {"description": ""} | dict(tables))
    if ("dh" in tables) == ("joints" in tables):
        raise InputError("give one of 'dh' and 'joints'")
    check_complete(Arm, values)
    arm = Arm(**values)
    limits, slowing = vars(arm.limits), arm.limits.slowing
    lists = {f"[limits] {name}": value for name, value in limits.items() if name != "slowing"}
    if slowing is not None:
        lists |= {f"[limits.slowing] {name}": value for name, value in vars(slowing).items()}
    for key, values in ({"posture": arm.posture} | lists).items():
        if len(values) != arm.joints:
            raise InputError(f"{key}: must be a list of {arm.joints}")
    if arm.links and len(arm.links) != arm.joints + 1:
        raise InputError(f"links: must be {arm.joints + 1} tables, one per joint and the hand's")
    for low, high in zip(arm.limits.position_min, arm.limits.position_max, strict=True):
        if low >= high:
            raise InputError(f"[limits] position_min = {low:g}: must be below {high:g}")
    named = [("azimuth_joint", arm.azimuth_joint)]
    named += [("throwing_joints", joint) for joint in arm.throwing_joints]
    for key, joint in named:
        if not 1 <= joint <= arm.joints:
            raise InputError(f"{key} = {joint!r}: must be a whole number, 1 to {arm.joints}")
    return arm


def _values(kind: type[Any], table: Mapping[str, Any]) -> dict[str, Any]:
    """The checked values in a part's table, by the names of its fields."""
    about, hints, values = ARM_KEYS[kind], hints_of(kind), dict[str, Any]()
    for key, value in table.items():
        if key not in about:
            raise InputError(unknown(key, list(about)))
        if key in LISTS:
            values["links" if key == "links" else "chain"] = _rows(key, value)
            continue
        if key in TABLES:
            values[key] = _part(key, TABLES[key], value)
        else:
            values[key] = checked(key, value, hints[key], about[key])
    return values


def _part(place: str, kind: type[Any], table: Any) -> Any:
    """A part of an arm from its table; `place` for messages."""
    if not isinstance(table, Mapping):
        raise InputError(f"{place} = {table!r}: must be a table")
    try:
        values = _values(kind, table)
        check_complete(kind, values)
    except InputError as error:
        raise InputError(f"{place}: {error}") from None
    return kind(**values)


def _rows(key: str, value: Any) -> tuple[Any, ...]:
    """The parts in a list of tables."""
    if not isinstance(value, list) or not value:
        raise InputError(f"{key} = {value!r}: must be a list of tables, one per joint")
    return tuple(_part(f"{key} {i}", LISTS[key], row) for i, row in enumerate(value, start=1))


def arm_table(arm: Arm) -> dict[str, Any]:
    """The tables of the data file that `arm_from` makes the arm from."""
    table: dict[str, Any] = _plain(arm)
    table["dh" if isinstance(arm.chain[0], DHRow) else "joints"] = table.pop("chain")
    if arm.limits.slowing is None:
        del table["limits"]["slowing"]
    if not arm.links:
        del table["links"]
    return table


def _plain(value: Any) -> Any:
    """A value as TOML or JSON has it."""
    if dataclasses.is_dataclass(value):
        return {name: _plain(part) for name, part in vars(value).items()}
    return [_plain(item) for item in value] if isinstance(value, tuple) else value


def arm_text(arm: Arm, remarks: Sequence[str] = ()) -> str:
    """TOML that `load_arm` reads as this arm, with units; remarks go in front."""
    names = {"tool": Tool, "limits": JointLimits, "limits.slowing": Slowing, "": Arm} | LISTS
    meanings = {
        name: {key: about["meaning"] for key, about in ARM_KEYS[kind].items()}
        for name, kind in names.items()
    }
    lines = [f"# {' '.join(remark.split())}" for remark in remarks]
    lines += ["# Joint numbers count from 1.", *toml_lines(arm_table(arm), meanings)]
    return "\n".join(lines) + "\n"
