"""Arms and grippers: their data files (TOML) read, checked and written, and those shipped."""

from __future__ import annotations

import itertools
import math
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..models.robot import (
    Arm,
    CapsuleOverlap,
    DHRow,
    JointFrame,
    JointLimits,
    LinkCapsule,
    LinkInertia,
    Slowing,
    Tool,
    described,
    shape_overlaps,
)
from .checks import InputError, within
from .files import text_of, toml_lines, toml_tables
from .section import from_table, meanings, rows_from, table_of
from .uncertainty import Distribution

#: Types of joints in the chain by the name of their tables.
CHAINS: dict[str, type[Any]] = {"dh": DHRow, "joints": JointFrame}
#: Tables of an arm data file by name.
TABLES: dict[str, type[Any]] = {
    "": Arm,
    **CHAINS,
    "tool": Tool,
    "limits": JointLimits,
    "limits.slowing": Slowing,
    "links": LinkInertia,
    "capsules": LinkCapsule,
    "overlaps": CapsuleOverlap,
}

#: Description of the frame of a gripper's body.
FRAME = "in the flange's frame, z out of the hand, y along the pads' closing"


@dataclass(frozen=True)
class GripperCapsule:
    """A shape of the gripper: all points within `radius` of a segment."""

    begin: tuple[float, float, float] = described(f"m, {FRAME}")
    end: tuple[float, float, float] = described("m, in the same frame")
    radius: float = described("m", above=0)


#: Keys of a gripper that may be assumed.
ASSUMABLE = ("force", "force_peak", "dwell", "opening")
#: Keys of a gripper's body that take the place of an arm's, in [tool].
BODY = ("tcp", "palm_back", "palm_front", "palm_half_width", "open_width")


@dataclass(frozen=True)
class GripperData:
    """A gripper for any arm: its grip, and its body in the flange's frame."""

    description: str = described("one line")
    force: float = described("N, of one pad, what it holds continuously", above=0)
    dwell: float = described("s, from the command until the force starts to fall", least=0)
    opening: float = described("s, from there to zero, linear", above=0)
    tcp: float = described("m, from the flange to the pads' centre")
    palm_back: float = described("m, its body behind the pads' centre: from here")
    palm_front: float = described("m, to here")
    palm_half_width: float = described("m, half its thickness in the throwing plane", least=0)
    mass: float = described("kg", above=0)
    com: tuple[float, float, float] = described(f"m, {FRAME}")
    inertia: tuple[float, float, float, float, float, float] = described(
        "kg m² about the CoM: xx, xy, xz, yy, yz, zz"
    )
    force_peak: float | None = described(
        "N, of one pad, the most that a scene may ask for; left out: not known", None, above=0
    )
    open_width: float = described("m, gap of the open pads", 0.08, above=0)
    capsules: tuple[GripperCapsule, ...] = described(
        "its shapes, see [[capsules]]; left out: its collisions are not checked", ()
    )
    delay: Distribution | None = described(
        "s, of the opening about `dwell`, as in [uncertainty], where a scene leaves out both", None
    )
    opening_spread: Distribution | None = described(
        "s, about `opening`, as `opening` in [uncertainty], where a scene leaves out both", None
    )
    assumed: tuple[str, ...] = described(
        "keys whose values neither maker nor measurement gives; plans name them", ()
    )

    def on(self, tables: Mapping[str, Any]) -> dict[str, Any]:
        """An arm's tables with this gripper in place of any other."""
        own = table_of(self)
        joints = len(tables.get("dh") or tables.get("joints") or ())
        result = dict(tables)
        result["tool"] = {**tables.get("tool", {}), **{key: getattr(self, key) for key in BODY}}
        if tables.get("links"):
            hand = {key: own[key] for key in ("mass", "com", "inertia")}
            result["links"] = [*tables["links"][:joints], hand]
        if tables.get("capsules"):
            arm_capsules = [row for row in tables["capsules"] if row.get("link") != joints + 1]
            result["capsules"] = arm_capsules + [
                {"link": joints + 1} | row for row in own.get("capsules", ())
            ]
        if tables.get("overlaps"):
            rows = enumerate(tables.get("capsules", ()), start=1)
            kept = [n for n, row in rows if row.get("link") != joints + 1]
            measured = rows_from("overlaps", CapsuleOverlap, tables["overlaps"])
            result["overlaps"] = [
                {"capsules": [kept.index(n) + 1 for n in each.capsules], "depth": each.depth}
                for each in measured
                if {*each.capsules} <= {*kept}
            ]
        return result


def load_gripper(name: str, folder: Path | None = None) -> GripperData:
    """A gripper from a shipped name or a gripper data file (TOML), relative to `folder`."""
    tables = toml_tables(text_of("grippers", name, folder)[0], name)
    data: GripperData = from_table(GripperData, tables)
    given = [key for key in ASSUMABLE if getattr(data, key) is not None]
    _check_assumed(data.assumed, given, "that plans name")
    return data


def load_arm(name: str, folder: Path | None = None, gripper: GripperData | None = None) -> Arm:
    """An arm from a shipped name or an arm data file (TOML), relative to `folder`.

    gripper: instead of the arm's own.
    """
    tables = toml_tables(text_of("arms", name, folder)[0], name)
    own = tables.pop("gripper", None)
    if own is not None and isinstance(tool := tables.get("tool"), dict):
        for key in BODY:
            if key in tool:
                raise InputError(f"[tool] {key} = {tool[key]!r}: only without gripper = {own!r}")
    if gripper is None and own is not None:
        with within(f"gripper = {own!r}"):
            gripper = load_gripper(str(own), folder)
    if gripper is None:
        return arm_from(tables)
    if hand := tables.get("hand"):
        raise InputError(
            f"hand = {hand!r}: includes a hand, on which {gripper.description} cannot be mounted: "
            "import the arm with --tool FLANGE, its flange's link, without --tcp and --palm"
        )
    for key in ("dh", "joints", "links", "capsules", "overlaps"):
        rows = tables.get(key, [])
        if not (isinstance(rows, list) and all(isinstance(row, dict) for row in rows)):
            raise InputError(f"{key} = {rows!r}: must be a list of tables")
    if not isinstance(tool := tables.get("tool", {}), dict):
        raise InputError(f"tool = {tool!r}: must be a section")
    arm = arm_from(gripper.on(tables))
    notes = filter(None, (_replacement(tables, arm, gripper), _shape_words(arm, gripper)))
    return replace(arm, hand_links=(), notes=(*arm.notes, *notes))


def _replacement(tables: Mapping[str, Any], arm: Arm, gripper: GripperData) -> str:
    """Words for the hand of an arm's tables that a gripper replaces; empty without a hand."""
    masses = rows_from("links", LinkInertia, tables.get("links", []))[arm.joints :]
    rows = rows_from("capsules", LinkCapsule, tables.get("capsules", []))
    mass, shapes = sum(link.mass for link in masses), sum(c.link > arm.joints for c in rows)
    tcp = tables.get("tool", {}).get("tcp", 0.0)
    if not (mass or shapes or arm.hand_links or tcp):
        return ""
    parts = [", ".join(arm.hand_links), f"{mass:.3g} kg", f"{shapes} capsules", f"tcp {tcp:g} m"]
    words = ", ".join(filter(None, parts))
    return f"{gripper.description} takes the place of the arm's own hand ({words})"


def _shape_words(arm: Arm, gripper: GripperData) -> str:
    """Words for a gripper without shapes, or for how deep it may be in the arm's links, see
    `shape_overlaps`; empty if it must keep off all. InputError if it is all inside a link."""
    if arm.capsules and not gripper.capsules:
        return f"no [[capsules]] of {gripper.description}: it keeps off nothing"
    allowed, depths = shape_overlaps(arm), dict[int, float]()
    for (i, part), (j, link) in itertools.permutations(enumerate(arm.capsules), 2):
        depth = float(allowed[i, j])
        if part.link != arm.joints + 1 or link.link == arm.joints or not 1e-3 <= depth < math.inf:
            continue
        if depth > 2 * part.radius:
            raise InputError(
                f"{gripper.description} is {1e3 * depth:.0f} mm deep in link {link.link} in most "
                "postures: correct [tool], or shorten this link's [[capsules]]"
            )
        depths[link.link] = max(depths.get(link.link, 0.0), depth)
    pairs = (f"link {link} {1e3 * depth:.0f} mm" for link, depth in depths.items())
    words = f"capsules of {gripper.description} overlap links in most postures, and may as deeply"
    return f"{words}: {', '.join(pairs)}" if depths else ""


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
    _check_inertias(arm.links)
    _check_capsules(arm)
    _check_recommendations(arm)
    ranges = zip(arm.limits.position_min, arm.limits.position_max, strict=True)
    ends, tool = [("[limits] position_min", *each) for each in ranges], arm.tool
    ends += [("[tool] palm_front", tool.palm_front, tool.palm_back)] * (tool.palm_half_width > 0)
    for key, low, high in ends:
        if low >= high:
            raise InputError(f"{key} = {low:g}: must be below {high:g}")
    named = [("azimuth_joint", arm.azimuth_joint)]
    named += [("throwing_joints", joint) for joint in arm.throwing_joints]
    for key, joint in named:
        if not 1 <= joint <= arm.joints:
            raise InputError(f"{key} = {joint!r}: must be a whole number, 1 to {arm.joints}")
    return arm


def _check_capsules(arm: Arm) -> None:
    """InputError for a link or a capsule that the arm does not have."""
    for number, capsule in enumerate(arm.capsules, start=1):
        if not 0 <= capsule.link <= arm.joints + 1:
            raise InputError(
                f"capsules {number}: link = {capsule.link}: must be 0 to {arm.joints + 1}"
            )
        if capsule.beside and capsule.link:
            raise InputError(f"capsules {number}: beside = true: only with link = 0")
    count, pairs = len(arm.capsules), [each.capsules for each in arm.overlaps]
    for number, (first, second) in enumerate(pairs, start=1):
        row = f"overlaps {number}: capsules = {[first, second]}"
        if not 1 <= first < second <= count:
            raise InputError(f"{row}: must be two, 1 to {count}, the lower one first")
        one, other = arm.capsules[first - 1], arm.capsules[second - 1]
        joints, beside = abs(one.link - other.link), one.beside or other.beside
        if joints == 0 or (joints == 1 and not beside):
            raise InputError(f"{row}: must be of two links that no joint joins")
        if (first, second) in pairs[: number - 1]:
            raise InputError(f"{row}: must be in one table only")


def _check_recommendations(arm: Arm) -> None:
    """InputError for keys that would do nothing: of torques that nobody knows, or assumed values
    that are not there."""
    given = {key: value for key, value in vars(arm.limits).items() if value is not None}
    for key in ("torque_rate", "torque_margin"):
        if key in given and not arm.links:
            raise InputError(f"[limits] {key} = {given[key]:g}: only with masses, in [[links]]")
    _check_assumed(arm.assumed, given, "of [limits]")


def _check_assumed(names: Sequence[str], given: Iterable[str], where: str) -> None:
    """InputError for names that are not among the given keys."""
    for name in names:
        if name not in given:
            raise InputError(f"assumed = {name!r}: must be a key {where}: {', '.join(given)}")


def _check_inertias(links: Sequence[LinkInertia]) -> None:
    """InputError for an inertia that no body has."""
    for number, link in enumerate(links, start=1):
        matrix = np.zeros((3, 3))
        matrix[np.triu_indices(3)] = link.inertia
        least, _, largest = np.linalg.eigvalsh(matrix, "U")
        if least < -1e-6 * largest:
            raise InputError(
                f"links {number}: inertia = {list(link.inertia)}: its principal moments must be at "
                f"least 0, one is {least:.3g}"
            )


def arm_table(arm: Arm) -> dict[str, Any]:
    """The tables of the data file that `arm_from` makes the arm from."""
    table = table_of(arm)
    table["dh" if isinstance(arm.chain[0], DHRow) else "joints"] = table.pop("chain")
    return table


def arm_text(arm: Arm, remarks: Sequence[str] = ()) -> str:
    """TOML that `load_arm` reads as this arm, with units; remarks go in front, in lines of at most
    100 characters."""
    key_meanings = {name: meanings(kind) for name, kind in TABLES.items()}
    every = [*remarks, "Joint numbers count from 1."]
    wrapped = (textwrap.wrap(remark, 98, break_long_words=False) for remark in every)
    lines = [f"# {line}" for one in wrapped for line in one]
    return "\n".join([*lines, *toml_lines(arm_table(arm), key_meanings)]) + "\n"
