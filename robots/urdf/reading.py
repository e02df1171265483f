"""A robot's URDF or xacro, read by yourdfpy and checked; frames of its joints as 4x4 poses.

Needs the extra `urdf`.
"""

from __future__ import annotations

import contextlib
import importlib
import io
import logging
import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import casadi as ca
import numpy as np

from ...models import Array
from ...problems import InputError, JointFrame, placement, read_text

#: Largest length [m], angle [rad], mass [kg] or inertia [kg m^2] of a robot.
BEYOND = 1e4
#: Deviation [rad] up to which an angle counts as a rounded multiple of 90 deg: 3.14 is 0.0016 off.
#: Other multiples, such as 45 deg, need no rounding: they turn within the throw's plane, or about
#: an axis whose joint makes up for the missing digits.
RIGHT = math.radians(0.1)
#: Deviation [rad] above which the user hears of it: 1.5708 and 3.1416 are nearer.
NOTED = 1e-5


def origin(joint: Any) -> Array:
    """4x4: the joint's frame in its parent link's, at 0."""
    return np.eye(4) if joint.origin is None else np.asarray(joint.origin, dtype=float)


def unit_axis(joint: Any) -> Array:
    """The joint's axis, of length 1."""
    axis = np.asarray([1.0, 0.0, 0.0] if joint.axis is None else joint.axis, dtype=float)
    length = float(np.linalg.norm(axis)) if axis.shape == (3,) else 0.0
    if not (math.isfinite(length) and length > 0):
        raise InputError(f"joint '{joint.name}': its axis must be three numbers, not all 0")
    return np.asarray(axis / length)


def frame_of(pose: Array) -> JointFrame:
    """A 4x4 pose as position and roll, pitch, yaw, good to the last digits at any pitch."""
    r = pose[:3, :3]
    level = math.hypot(r[0, 0], r[1, 0])
    yaw = math.atan2(r[1, 0], r[0, 0]) if level > 1e-12 else 0.0
    cos, sin = math.cos(yaw), math.sin(yaw)
    roll = math.atan2(sin * r[0, 2] - cos * r[1, 2], cos * r[1, 1] - sin * r[0, 1])
    x, y, z, *rpy = (
        0.0 if abs(value) < 1e-14 else float(value)
        for value in (*pose[:3, 3], roll, math.atan2(-r[2, 0], level), yaw)
    )
    return JointFrame((x, y, z), (rpy[0], rpy[1], rpy[2]))


def read_urdf(
    path: Path, arguments: Mapping[str, str] | None = None
) -> tuple[Any, dict[str, float]]:
    """yourdfpy's robot from a URDF or xacro, or from the package robot_descriptions, by its name
    there; InputError if it is none, or yourdfpy is missing.

    Angles of joints' frames that are nearly multiples of 90 deg are taken as these: a frame that is
    0.01 deg off moves the hand out of the throw's plane. Also returns by how much [rad] joints were
    turned so, where that is more than `NOTED`. arguments: of a xacro, by name. A xacro's packages
    (`$(find ...)`) are looked for in the folders above it and in those of ROS_PACKAGE_PATH.
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
        given = arguments or {}
        parsed = _fetch(path.name, given) if named else _parse(text, path, given)
        _check_tree(parsed.robot)
        _check_numbers(parsed.robot)
        turned = {joint.name: _round_right_angles(joint) for joint in parsed.robot.joints}
        robot = yourdfpy.URDF(robot=parsed.robot, load_meshes=False)
    except InputError as error:
        raise error.within(str(path)) from None
    except Exception as error:  # yourdfpy lets through whatever its parts raise.
        reason = " ".join(str(error).split()) or type(error).__name__
        if isinstance(error, KeyError):
            reason = f"an element lacks the attribute {reason}"
        raise InputError(f"{path}: cannot be read as a URDF: {reason}") from None
    return robot, {name: angle for name, angle in turned.items() if angle > NOTED}


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


def _parse(text: str, path: Path, arguments: Mapping[str, str]) -> Any:
    """The file parsed by yourdfpy, which skips unreadable parts of broken files."""
    import yourdfpy

    root = ElementTree.fromstring(_declare_prefixes(text))
    if root.tag == "mujoco":
        raise InputError("this is MuJoCo's MJCF, which is not read: give the robot's URDF or xacro")
    if root.tag != "robot":
        raise ValueError(f"its root is <{root.tag}>, must be <robot>")
    if path.suffix == ".xacro" or any("xacro" in part.tag for part in root.iter()):
        root = _expanded(path, arguments)
    else:
        _refuse_any(arguments)
    links = sum(1 for _ in root.iter("link"))
    if not links:
        raise ValueError(
            "it has no links; of a file that only defines xacro macros, give the one that calls "
            "them, often named NAME.urdf.xacro"
        )
    if links > 500:
        raise ValueError(f"it has {links:,} links, must be at most 500")
    root.attrib.setdefault("name", path.stem.split(".")[0])
    data = io.BytesIO(ElementTree.tostring(root))
    return yourdfpy.URDF.load(data, load_meshes=False, build_scene_graph=False)


class _Arguments(dict[str, str]):
    """Arguments of a xacro that remember which names the file asked for."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.used = set[str]()

    def __contains__(self, name: object) -> bool:
        self.used.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.used.add(name)
        return super().__getitem__(name)


def _expanded(path: Path, arguments: Mapping[str, str]) -> ElementTree.Element:
    """A xacro's URDF; InputError for an argument or package that is missing or unknown."""
    from xacrodoc import XacroDoc, packages
    from xacrodoc.xacrodoc import xacro

    values = _Arguments(arguments)
    xacro.init_stacks(str(path.resolve()))  # else files beside it are sought in the working folder
    folders = [name for name in os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep) if name]
    if folders:
        packages.look_in(folders)  # which xacrodoc leaves out where ROS 2 is installed
    try:
        # xacro prints warnings about the maker's style.
        with contextlib.redirect_stderr(io.StringIO()):
            document = XacroDoc.from_file(path, resolve_packages=False, subargs=values)
    except Exception as error:
        _refuse_unknown(values, arguments, similar=True)
        cause = error
        while getattr(cause, "exc", None) is not None:  # xacro wraps errors
            cause = cause.exc  # type: ignore[attr-defined]
        kind, name = type(cause).__name__, " ".join(map(str, cause.args))
        if kind == "ArgException":
            raise InputError(
                f"its xacro argument '{name}' has no value: add {name}:=VALUE behind the file"
            ) from None
        if kind == "PackageNotFoundError":
            # One without its package.xml, as for meshes.
            places = [folder / name for folder in (*path.resolve().parents, *map(Path, folders))]
            if found := next((place for place in places if place.is_dir()), None):
                packages.update_package_cache({name: found})
                return _expanded(path, arguments)
            raise InputError(
                f"the ROS package '{name}' is not found: the environment variable ROS_PACKAGE_PATH "
                "must name the folder that holds it"
            ) from None
        if kind == "RecursionError":
            raise InputError("a macro or a file of the xacro calls itself without an end") from None
        known = f" (its arguments, NAME:=VALUE: {', '.join(sorted(values))})" if values else ""
        raise ValueError(f"{error}{known}") from None
    _refuse_unknown(values, arguments)
    return ElementTree.fromstring(str(document.to_urdf_string()))


def _fetch(name: str, arguments: Mapping[str, str]) -> Any:
    """A robot of robot_descriptions as yourdfpy has it; the package fetches its files at first."""
    _refuse_any(arguments)
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


def _refuse_unknown(values: _Arguments, given: Mapping[str, str], *, similar: bool = False) -> None:
    """InputError for an argument that the xacro did not ask for; similar: only where it asked for
    one of a similar name, as it has not been read to its end."""
    for name, value in given.items():
        known = sorted(values.used)
        hint = InputError.hint(name, known)
        if name not in values.used and (hint or not similar):
            raise InputError(
                f"{name}:={value}: the xacro has no argument '{name}'{hint} (it has: "
                f"{', '.join(known) or 'none'})"
            )


def _refuse_any(given: Mapping[str, str]) -> None:
    """InputError for arguments of what is no xacro."""
    for name, value in given.items():
        raise InputError(f"{name}:={value}: only a xacro file takes arguments, this is none")


def _round_right_angles(joint: Any) -> float:
    """Turns a joint's frame so that its angles near multiples of 90 deg, rounded as 1.5708 and 3.14
    are, are these to the last digit; returns by how much [rad]."""
    pose = origin(joint)
    frame = frame_of(pose)
    right = [round(angle / (math.pi / 2)) * math.pi / 2 for angle in frame.rpy]
    pairs = list(zip(frame.rpy, right, strict=True))
    if not any(1e-14 < abs(angle - known) < RIGHT for angle, known in pairs):
        joint.origin = pose
        return 0.0
    roll, pitch, yaw = (known if abs(angle - known) < RIGHT else angle for angle, known in pairs)
    joint.origin = np.array(ca.evalf(placement(frame.xyz, (roll, pitch, yaw))))
    # The norm of the difference of two rotations by a small angle is that angle times sqrt(2).
    return float(np.linalg.norm(joint.origin[:3, :3] - pose[:3, :3]) / math.sqrt(2))


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
    types = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
    for joint in robot.joints:
        if joint.type not in types:
            raise ValueError(f"the type of joint '{joint.name}' must be one of {', '.join(types)}")
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
