"""The rigid body of a closed mesh, and its place in the throw's plane."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...models import Array
from ...problems import Capsule, Grasp, InputError, Object, from_table
from .capsules import parts_of

#: Largest and smallest size [m] of an object that is thrown.
SIZES = (0.005, 3.0)
#: Largest distance [m] of the CoM from the throw's plane through the grasp.
OFF_PLANE = 1e-3
#: Largest product of inertia across the plane, over the moment of inertia about its normal.
TILT = 0.05
#: A grasp nearer to the CoM [m] is at it.
CENTRAL = 1e-4
#: Largest component of the hand's approach axis along the plane's normal.
ACROSS = 0.05
#: Least area of a triangle that is no line, over its longest side squared.
FLAT = 5e-7
#: Decimals of lengths [m] in files.
PLACES = 5


@dataclass(frozen=True)
class MeshChoices:
    """What a mesh does not say. Points and directions are in the mesh's frame, points in its unit.

    grasp: the pads' centre; mass [kg] or density [kg/m³]: one of them; axis: direction in which the
    hand points there, None for towards the CoM; across: normal of the throw's plane, along which
    the pads press, None for the thinnest direction; scale [m]: the mesh's unit; parts: largest
    number of capsules.
    """

    grasp: tuple[float, ...]
    mass: float | None
    density: float | None
    axis: tuple[float, ...] | None
    across: tuple[float, ...] | None
    scale: float
    parts: int


@dataclass(frozen=True)
class MeshObject:
    """An object from a mesh: its section, and how it is grasped.

    corners (F, 3, 3) [m]: triangles in the object's frame; beyond [m]: how far the outline reaches
    beyond the mesh at most; middle: whether the object turns about its middle principal axis.
    """

    object: Object
    grasp: Grasp
    corners: Array
    beyond: float
    middle: bool


class OutOfPlaneError(InputError):
    """A plane of the throw in which the object would not stay."""


def object_from(mesh: Any, choices: MeshChoices) -> MeshObject:
    """The object of a closed mesh of uniform density.

    InputError for sizes that nothing thrown has, and for what a planar throw cannot have: a CoM
    beside the plane, or products of inertia that tilt the object in flight. It names options with
    which the plane would do, if there are any.
    """
    mesh = mesh.copy().apply_scale(choices.scale)
    size = float(mesh.extents.max())
    if not SIZES[0] <= size <= SIZES[1]:
        raise InputError(
            f"the mesh is {size:.4g} m long: must be {SIZES[0]:g} to {SIZES[1]:g} m: choose --unit "
            "(STL files often are in mm)"
        )
    try:
        placed = _placed(mesh, choices)
    except OutOfPlaneError as error:
        raise InputError(f"{error}{_in_plane(mesh, choices)}") from None
    moments, ahead = placed.moments, placed.ahead
    capsules, beyond = parts_of(placed.corners, choices.parts)
    first, last, outline = _outline(capsules)
    table = {
        "mass": _short(placed.mass),
        "length": round(last - first, PLACES),
        "com": round(ahead - first, PLACES),
        "inertia": _short(moments[1, 1]),
        "outline": outline,
    }
    # Rotation about the principal axis of neither the least nor the largest moment is unstable.
    others = np.linalg.eigvalsh(moments[::2, ::2])
    middle = bool(1.02 * others[0] < moments[1, 1] < 0.98 * others[1])
    grip = Grasp(offset=round(-first, PLACES), angle=placed.angle)
    corners = placed.corners - [first, 0.0, 0.0]
    return MeshObject(from_table(Object, table), grip, corners, beyond, middle)


@dataclass(frozen=True)
class _Placed:
    """A mesh in the frame of the throw's plane, x along the object, y across, origin in the pads.

    corners (F, 3, 3) [m]; ahead [m]: of the CoM; moments (3, 3) [kg m²]: inertia about the CoM;
    angle [rad]: of x against the hand's approach axis.
    """

    corners: Array
    mass: float
    ahead: float
    moments: Array
    angle: float


def _placed(mesh: Any, choices: MeshChoices) -> _Placed:
    """A mesh in m as it is grasped; OutOfPlaneError or InputError where that cannot be."""
    mass = choices.mass or float(choices.density or 0.0) * float(mesh.volume)
    com, grasp = np.array(mesh.center_mass), choices.scale * np.array(choices.grasp)
    size = float(mesh.extents.max())
    if np.linalg.norm(grasp - com) > size:
        raise InputError(
            f"--grasp: is {np.linalg.norm(grasp - com):.3g} m from the object's CoM, must be at "
            f"most its size: in --unit and the mesh's frame it is {_words(com / choices.scale)}"
        )
    axes, angle = _axes(mesh, com - grasp, choices)
    grasp = grasp + (axes[1] @ (com - grasp)) * axes[1]
    moments = mass / mesh.volume * axes @ np.array(mesh.moment_inertia) @ axes.T
    _check_moments(moments)
    corners = (np.asarray(mesh.triangles) - grasp) @ axes.T
    if not _is_met(corners[..., ::2]):
        raise InputError(
            "--grasp: the pads close on nothing: the line through it along --across, along which "
            f"they press ({_words(axes[1])} in the mesh's frame), must meet the mesh"
        )
    return _Placed(corners, mass, float(np.linalg.norm(com - grasp)), moments, angle)


def _in_plane(mesh: Any, choices: MeshChoices) -> str:
    """Words for options with which a mesh in m can be thrown: those that change fewest, and of
    these the plane that is turned least.

    Its normal is the one that was chosen, a principal axis of inertia, or square to one and to the
    way from grasp to CoM; grasp and axis are moved into the plane where they are not.
    """
    towards = np.array(mesh.center_mass) - choices.scale * np.array(choices.grasp)
    _, _, chosen = _directions(mesh, towards, choices)
    principal = np.linalg.eigh(np.array(mesh.moment_inertia))[1].T
    square = np.cross(principal, towards)
    square = square[np.linalg.norm(square, axis=1) > CENTRAL]
    normals = np.vstack([principal, square / np.linalg.norm(square, axis=1, keepdims=True)])
    normals *= np.where(normals @ chosen < 0.0, -1.0, 1.0)[:, None]
    tried = list[tuple[int, float, dict[str, Any]]]()
    for normal in (chosen, *normals):
        changes: dict[str, Any] = {"across": _rounded(normal)}
        if normal is chosen and choices.across is None:
            changes = {}
        if _is_beside(towards, normal):
            offset = float(normal @ towards) / choices.scale
            changes["grasp"] = _rounded(np.array(choices.grasp) + offset * normal)
        if choices.axis is not None and abs(normal @ _unit("--axis", choices.axis)) > ACROSS:
            axis = np.array(choices.axis)
            changes["axis"] = _rounded(axis - (axis @ normal) * normal)
        tried.append((len(changes), -float(normal @ chosen), changes))
    for _, _, changes in sorted(tried, key=lambda one: one[:2]):
        try:
            _placed(mesh, replace(choices, **changes))
        except InputError:
            continue
        return ": try " + " ".join(f"--{key} {_words(changes[key])}" for key in changes)
    return ": no plane through this grasp would do"


def _rounded(point: Array) -> tuple[float, ...]:
    """A point or direction as on a command line."""
    return tuple(map(float, (point.round(6) + 0.0)))


def _is_met(corners: Array) -> bool:
    """Whether the origin is in one of the triangles (F, 3, 2) of a plane."""
    ahead = np.roll(corners, -1, axis=1)
    sides = corners[..., 0] * ahead[..., 1] - corners[..., 1] * ahead[..., 0]
    inside = (sides >= 0.0).all(axis=1) | (sides <= 0.0).all(axis=1)
    # Seen edge on, a triangle is a line; those beside it in a closed mesh are not.
    longest = np.linalg.norm(ahead - corners, axis=2).max(axis=1)
    return bool((inside & (np.abs(sides.sum(axis=1)) > 2 * FLAT * longest**2)).any())


def _short(value: float) -> float:
    """A value with six digits."""
    return float(f"{value:.6g}")


def _words(point: Sequence[float] | Array) -> str:
    """A point or direction as on a command line, which takes no exponents."""
    rounded = _rounded(np.asarray(point))
    return " ".join(np.format_float_positional(v, trim="-") for v in rounded)


def _check_moments(moments: Array) -> None:
    """InputError if the plane's normal is far from a principal axis."""
    tilt = math.hypot(moments[0, 1], moments[1, 2]) / moments[1, 1]
    if tilt > TILT:
        raise OutOfPlaneError(
            "--across: the object would tilt out of the throw's plane: its products of inertia are "
            f"{100 * tilt:.2g} % of its moment about the plane's normal, must be at most "
            f"{100 * TILT:g} %"
        )


def _outline(capsules: list[Capsule]) -> tuple[float, float, list[dict[str, Any]]]:
    """Where capsules begin and end along the axis [m], and the outline's tables, from where they
    begin."""
    first = min(float(min(b[0], e[0]) - r) for b, e, r in capsules)
    last = max(float(max(b[0], e[0]) + r) for b, e, r in capsules)
    # Rounded down: points with rounded lengths stay so.
    first = math.floor(first * 10**PLACES) / 10**PLACES
    parts = []
    for *ends, radius in capsules:
        begin, end = ([round(p[0] - first, PLACES), round(p[1], PLACES) + 0.0] for p in ends)
        parts.append({"begin": begin, "end": end, "radius": round(radius, PLACES)})
    return first, last, parts


def _axes(mesh: Any, towards: Array, choices: MeshChoices) -> tuple[Array, float]:
    """The object's frame: rows along, across the throw's plane (to its left), and up; and the angle
    [rad] of the object's axis against the hand's approach axis.

    towards [m]: from the grasp to the CoM.
    """
    approach, along, normal = _directions(mesh, towards, choices)
    if _is_beside(towards, normal):
        raise OutOfPlaneError(
            f"--grasp: the CoM is {1e3 * abs(float(normal @ towards)):.3g} mm beside the throw's "
            "plane through it"
        )
    if abs(float(normal @ approach)) > ACROSS:
        raise OutOfPlaneError("--axis: must lie in the throw's plane, square to --across")
    along = along - (along @ normal) * normal
    along /= np.linalg.norm(along)
    up = np.cross(along, normal)
    angle = math.atan2(-float(approach @ up), float(approach @ along))
    return np.array([along, normal, up]), 0.0 if abs(angle) < 1e-3 else angle


def _directions(mesh: Any, towards: Array, choices: MeshChoices) -> tuple[Array, Array, Array]:
    """The hand's approach axis, the object's axis from grasp to CoM, the normal of the throw's
    plane: the thinnest way, unless it is chosen."""
    reach = float(np.linalg.norm(towards))
    if reach < CENTRAL and choices.axis is None:
        raise InputError("--axis: needed with a grasp at the CoM, from which no axis leads to it")
    approach = _unit("--axis", towards if choices.axis is None else choices.axis)
    along = approach if reach < CENTRAL else towards / reach
    if choices.across is None:
        return approach, along, _thinnest(mesh, along)
    return approach, along, _unit("--across", choices.across)


def _is_beside(towards: Array, normal: Array) -> bool:
    """Whether the CoM is too far beside the throw's plane. towards [m]: from grasp to CoM."""
    far = min(OFF_PLANE, 0.2 * max(float(np.linalg.norm(towards)), CENTRAL))
    return abs(float(normal @ towards)) > far


def _unit(key: str, direction: Sequence[float] | Array) -> Array:
    direction = np.asarray(direction)
    largest = float(np.abs(direction).max())
    if not largest:
        raise InputError(f"{key}: must not be zero")
    return np.asarray(direction / largest / np.linalg.norm(direction / largest))


def _thinnest(mesh: Any, along: Array) -> Array:
    """The direction across an axis in which the mesh is thinnest; the first of those alike."""
    first = np.eye(3)[int(np.abs(along).argmin())]
    first = first - (first @ along) * along
    first /= np.linalg.norm(first)
    second = np.cross(along, first)
    turns = np.radians(np.arange(180))[:, None]
    ways = np.cos(turns) * first + np.sin(turns) * second
    thick = np.ptp(np.asarray(mesh.vertices) @ ways.T, axis=0)
    return np.asarray(ways[int(np.flatnonzero(thick <= 1.02 * thick.min())[0])])


def object_text(found: MeshObject, source: str, mesh: str) -> str:
    """The sections [object] and [grasp] of a scene file. source: name of the mesh that they are
    from; mesh: file of the mesh in the object's frame, beside the scene file."""
    thrown, lines = found.object, [f"# From {source}, by throwplan import-object.", "[object]"]
    for key, unit in (("mass", "kg"), ("inertia", "kg m^2"), ("length", "m"), ("com", "m")):
        lines.append(f"{key} = {getattr(thrown, key)!r} # {unit}")
    lines.append(f"# At most {1e3 * found.beyond:.1f} mm beyond the mesh.")
    lines.append("outline = [")
    for part in thrown.outline:
        begin, end = list(part.begin), list(part.end)
        lines.append(f"  {{ begin = {begin}, end = {end}, radius = {part.radius} }},")
    lines += ["]", f"mesh = {json.dumps(mesh)}", "", "[grasp]"]
    lines.append(f"offset = {found.grasp.offset!r} # m, from the end of `length` to the pads")
    if found.grasp.angle:
        lines.append(f"angle_deg = {math.degrees(found.grasp.angle):.3f}")
    return "\n".join(lines) + "\n"
