"""A robot's URDF or xacro, read by yourdfpy and checked. Needs the extra `urdf`."""

from __future__ import annotations

import importlib
import io
import logging
import math
import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import casadi as ca
import numpy as np

from ...models import Array
from ...models.robot import placement
from ..files import read_text
from ..section import InputError
from .frames import frame_of, origin, unit_axis

#: Largest deviation [rad] from a right angle that is rounding, as in 1.5708 and 3.1416.
ROUNDED = 1e-5
#: Largest number of links of a robot.
MOST_LINKS = 500
#: Largest length [m], angle [rad], mass [kg] or inertia [kg m^2] of a robot.
BEYOND = 1e4
#: Types of joints.
TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")


def read_urdf(path: Path) -> Any:
    """yourdfpy's robot from a URDF or xacro, or from the package robot_descriptions, by its name
    there; InputError if it is none, or yourdfpy is missing.

    A xacro's packages (`$(find ...)`) are looked for in the folders above it.
    """
    named = _is_description(path)
    text = "" if named else read_text(path)
    try:
        import yourdfpy
    except ImportError:
        raise InputError(
            "import-robot needs yourdfpy and xacrodoc: pip install yourdfpy xacrodoc"
        ) from None
    logging.getLogger("yourdfpy.urdf").setLevel(logging.CRITICAL)
    try:
        parsed = _fetch(path.name) if named else _parse(text, path)
        _check_tree(parsed.robot)
        _check_numbers(parsed.robot)
        for joint in parsed.robot.joints:
            joint.origin = _round_right_angles(origin(joint))
        return yourdfpy.URDF(robot=parsed.robot, load_meshes=False)
    except Exception as error:  # yourdfpy lets through whatever its parts raise.
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: cannot be read as a URDF: {reason}") from None


def urdf_file(path: Path) -> Path:
    """The file that `read_urdf` reads, also for robot_descriptions; `path` if that names none."""
    if not _is_description(path):
        return path
    try:
        return Path(importlib.import_module(f"robot_descriptions.{path.name}").URDF_PATH)
    except (ImportError, AttributeError):
        return path


def _is_description(path: Path) -> bool:
    """Whether it is a name in robot_descriptions."""
    return path.name.endswith("_description") and not path.exists()


def _parse(text: str, path: Path) -> Any:
    """The file parsed by yourdfpy, which skips unreadable parts of broken files."""
    import yourdfpy

    text = _declare_prefixes(text)
    root = ElementTree.fromstring(text)
    if root.tag != "robot":
        raise ValueError("its root is not <robot>")
    if any("xacro" in part.tag for part in root.iter()):
        text = _expand_xacro(path)
        root = ElementTree.fromstring(text)
    links = sum(1 for _ in root.iter("link"))
    if links > MOST_LINKS:
        raise ValueError(f"it has {links:,} links, must be at most {MOST_LINKS}")
    return yourdfpy.URDF.load(io.BytesIO(text.encode()), load_meshes=False, build_scene_graph=False)


def _fetch(name: str) -> Any:
    """A robot of robot_descriptions as yourdfpy has it; the package fetches its files at first."""
    try:
        load = importlib.import_module("robot_descriptions.loaders.yourdfpy")
    except ImportError:
        raise ValueError("no such file, and no package robot_descriptions to know it") from None
    return load.load_robot_description(name, load_meshes=False, build_scene_graph=False)


def _declare_prefixes(text: str) -> str:
    """The text with the prefixes of its names declared, which XML asks for and ROS does not."""
    used = set(re.findall(r"<(\w+):", text)) | set(re.findall(r"<[^<>]*?\s(\w+):\w+\s*=", text))
    missing = used - set(re.findall(r"xmlns:(\w+)", text)) - {"xmlns", "xml"}
    names = "".join(f' xmlns:{name}="{name}"' for name in sorted(missing))
    return re.sub(r"<robot\b", f"<robot{names}", text, count=1)


def _round_right_angles(pose: Array) -> Array:
    """A pose whose right angles are right to the last digit."""
    frame = frame_of(pose)
    rounded = [round(angle / (math.pi / 2)) * math.pi / 2 for angle in frame.rpy]
    pairs = zip(frame.rpy, rounded, strict=True)
    if not any(1e-14 < abs(angle - right) < ROUNDED for angle, right in pairs):
        return pose
    rpy = [r if abs(a - r) < ROUNDED else a for a, r in zip(frame.rpy, rounded, strict=True)]
    return np.array(ca.evalf(placement(frame.xyz, (rpy[0], rpy[1], rpy[2]))))


def _expand_xacro(path: Path) -> str:
    """The URDF that a xacro file stands for."""
    from xacrodoc import XacroDoc

    return str(XacroDoc.from_file(path, resolve_packages=False).to_urdf_string())


def _check_numbers(robot: Any) -> None:
    """ValueError for places, axes, masses and inertias that no robot has."""
    given = [(f"joint '{j.name}'", value) for j in robot.joints for value in (j.origin, j.axis)]
    for link in robot.links:
        own = link.inertial
        values = () if own is None else (own.origin, own.mass, own.inertia)
        given += [(f"the inertial of link '{link.name}'", value) for value in values]
    for name, value in given:
        if value is not None and not np.abs(np.asarray(value, float)).max(initial=0.0) <= BEYOND:
            raise ValueError(f"{name} has a number beyond {BEYOND:g}")


def _check_tree(robot: Any) -> None:
    """ValueError unless the joints connect the links to one tree."""
    links = [link.name for link in robot.links]
    for kind, names in (("link", links), ("joint", [joint.name for joint in robot.joints])):
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two {kind}s are called '{name}'")
    parents = {}
    for joint in robot.joints:
        if joint.type not in TYPES:
            raise ValueError(f"the type of joint '{joint.name}' must be one of {', '.join(TYPES)}")
        if joint.type != "fixed":
            unit_axis(joint)
        for link in (joint.parent, joint.child):
            if link not in links:
                raise ValueError(f"joint '{joint.name}' names a link '{link}' that is not there")
        if joint.child in parents:
            raise ValueError(f"two joints move the link '{joint.child}'")
        parents[joint.child] = joint.parent
    for start in links:
        link, steps = start, 0
        while link in parents:
            link, steps = parents[link], steps + 1
            if steps > len(links):
                raise ValueError(f"the joints about link '{start}' form a ring")
