"""Arms: their data files (TOML) read, checked and written, and the arms that are shipped."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..models import Arm, DHRow, JointFrame, JointLimits, LinkCapsule, LinkInertia, Slowing, Tool
from .files import read_text, shipped, toml_lines, toml_tables
from .section import InputError, from_table, hint_at, meanings, rows_from, table_of

#: What the frames of the chain may be given as, in a table per joint.
CHAINS: dict[str, type[Any]] = {"dh": DHRow, "joints": JointFrame}
#: The tables of an arm data file, by their names.
TABLES: dict[str, type[Any]] = {
    "": Arm,
    **CHAINS,
    "tool": Tool,
    "limits": JointLimits,
    "limits.slowing": Slowing,
    "links": LinkInertia,
    "capsules": LinkCapsule,
}


def load_arm(name: str, folder: Path | None = None) -> Arm:
    """An arm from a shipped name or an arm data file (TOML), relative to `folder`."""
    known = shipped("arms")
    if name in known:
        text = known[name].read_text(encoding="utf-8")
    elif name.endswith(".toml"):
        text = read_text((folder or Path()) / name)
    else:
        hint = hint_at(name, known)
        raise InputError(f"unknown robot{hint} (shipped: {', '.join(known)}; or a .toml file)")
    return arm_from(toml_tables(text, name))


def arm_from(tables: Mapping[str, Any]) -> Arm:
    """An arm from the tables of its data file; InputError naming the key."""
    if ("dh" in tables) == ("joints" in tables):
        raise InputError("give one of 'dh' and 'joints'")
    (key,) = tables.keys() & CHAINS.keys()
    rest = {"description": ""} | {name: value for name, value in tables.items() if name != key}
    arm: Arm = from_table(Arm, rest, chain=rows_from(key, CHAINS[key], tables[key]))
    limits, slowing = vars(arm.limits), arm.limits.slowing
    lists = {f"[limits] {name}": each for name, each in limits.items() if isinstance(each, tuple)}
    if slowing is not None:
        lists |= {f"[limits.slowing] {name}": value for name, value in vars(slowing).items()}
    for key, values in ({"posture": arm.posture} | lists).items():
        if len(values) != arm.joints:
            raise InputError(f"{key}: must be a list of {arm.joints}")
    if arm.joint_names and len(set(arm.joint_names)) != arm.joints:
        raise InputError(f"joint_names: must be {arm.joints} different names")
    if arm.links and len(arm.links) != arm.joints + 1:
        raise InputError(f"links: must be {arm.joints + 1} tables, one per joint and the hand's")
    for number, capsule in enumerate(arm.capsules, start=1):
        if not 0 <= capsule.link <= arm.joints + 1:
            raise InputError(
                f"capsules {number}: link = {capsule.link}: must be 0 to {arm.joints + 1}"
            )
    for low, high in zip(arm.limits.position_min, arm.limits.position_max, strict=True):
        if low >= high:
            raise InputError(f"[limits] position_min = {low:g}: must be below {high:g}")
    named = [("azimuth_joint", arm.azimuth_joint)]
    named += [("throwing_joints", joint) for joint in arm.throwing_joints]
    for key, joint in named:
        if not 1 <= joint <= arm.joints:
            raise InputError(f"{key} = {joint!r}: must be a whole number, 1 to {arm.joints}")
    return arm


def arm_table(arm: Arm) -> dict[str, Any]:
    """The tables of the data file that `arm_from` makes the arm from."""
    table = table_of(arm)
    table["dh" if isinstance(arm.chain[0], DHRow) else "joints"] = table.pop("chain")
    return table


def arm_text(arm: Arm, remarks: Sequence[str] = ()) -> str:
    """TOML that `load_arm` reads as this arm, with units; remarks go in front."""
    known = {name: meanings(kind) for name, kind in TABLES.items()}
    lines = [f"# {' '.join(remark.split())}" for remark in remarks]
    lines += ["# Joint numbers count from 1.", *toml_lines(arm_table(arm), known)]
    return "\n".join(lines) + "\n"
