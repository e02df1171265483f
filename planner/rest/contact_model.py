"""MuJoCo's model of a flying bar and of what it can hit: cup, obstacles, floor, hand, column."""

from __future__ import annotations

import importlib
import itertools
import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array, Indices
from ...models.robot import Solid, about_z
from ...problems import WALL, Bin, Cup, InputError, Object, Scene
from ...problems.stl import mesh_parts, read_stl
from ..verdict import reach_of_bar

#: Number of boxes in a round wall.
BOXES = 48
#: Names of bodies.
HAND, COLUMN = "hand", "base column"
#: Stiffness [1/s^2] of contacts: lifts a body that sank in by 2 mm at 2.5 mm/s at most.
LIFT = 2500.0
#: Share of the demanded acceleration that a contact reaches; MuJoCo allows no more.
IMPEDANCE = 0.9999


def load_mujoco(user: str = "[rest]") -> Any:
    """The module `mujoco`; InputError without it, in which `user` needs it."""
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        raise InputError(f"{user}: needs MuJoCo: pip install mujoco-core") from None


def has_hand(scene: Scene) -> bool:
    """Whether the bar can hit the hand's body in this scene."""
    return scene.palm_clearance is not None


@dataclass(frozen=True, eq=False)
class ContactModel:
    """A MuJoCo model of the throw's plane: x forward, y to its left, z up.

    The bar's joint is free. A contact reverses `restitution` times the approaching speed within one
    step and stops sliding up to `friction` (Newton's law of impact): MuJoCo has no restitution, but
    damping of (1 + e) / step in the normal direction is one. So a step of 0.5 ms is enough, and the
    bar sinks in by no more than its way in a step.
    """

    model: Any
    step: float

    @classmethod
    def of(
        cls, scene: Scene, step: float, restitution: float, friction: float, arm: bool = False
    ) -> ContactModel:
        """The scene's bar, cup, obstacles and floor; `arm`: with hand and base column, which stay
        where they are put (mocap bodies, the hand first)."""
        mujoco, bar = load_mujoco(), scene.object
        spec = mujoco.MjSpec()
        spec.option.timestep, spec.option.gravity = step, [0, 0, -scene.gravity]
        spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0
        spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
        spec.default.geom.contype = spec.default.geom.conaffinity = 0
        _add_around(spec, scene)
        if arm:
            _add_arm(spec, scene)
        others = [geom.name for geom in spec.geoms]
        add_contacts(spec, add_object(spec, bar), others)
        made = cls(spec.compile(), step)
        made._set_contact(restitution, friction)
        return made

    def with_contact(self, restitution: float, friction: float) -> ContactModel:
        """A copy with other contacts."""
        copy = ContactModel(self.model.__copy__(), self.step)
        copy._set_contact(restitution, friction)
        return copy

    def _set_contact(self, restitution: float, friction: float) -> None:
        """Set restitution and friction of every contact."""
        every = np.arange(self.model.npair)
        set_contacts(self.model, every, self.step, restitution, friction)

    def state(self, states: Array) -> Array:
        """MuJoCo's states (N, 14) for in-plane poses and twists (N, 6) of the CoM."""
        x, z, theta, v_x, v_z, omega = states.T
        zero = np.zeros_like(x)
        half = theta / 2
        pose = [x, zero, z, np.cos(half), zero, -np.sin(half), zero]
        return np.column_stack([zero, *pose, v_x, zero, v_z, zero, -omega, zero])


def add_contacts(spec: Any, own: list[str], others: list[str]) -> None:
    """Contacts of an object's geoms with others, by their names."""
    for part, name in itertools.product(own, others):
        pair = spec.add_pair(geomname1=part, geomname2=name, condim=3)
        pair.solimp = [IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2]


def set_contacts(
    model: Any, pairs: Indices, step: float, restitution: float, friction: float
) -> None:
    """Set restitution and friction of some of a model's pairs of geoms."""
    model.pair_solref[pairs] = -LIFT, -(1 + restitution) / step
    model.pair_solreffriction[pairs] = -1e-6, -1.0 / step
    model.pair_friction[pairs, :2] = friction


def add_object(spec: Any, bar: Object, name: str = "bar") -> list[str]:
    """A free object, x along its axis, y across the throw's plane; returns its geoms' names.

    A bar is a box, at least 1 mm thick; an outline its capsules. MuJoCo collides convex
    hulls of meshes: one for the part of the mesh in each capsule.
    """
    width = max(bar.width, 0.001)
    slender = float(np.clip(bar.mass * width**2 / 6, 1e-2 * bar.inertia, 2 * bar.inertia))
    flying = spec.worldbody.add_body(name=name)
    flying.add_freejoint()
    flying.explicitinertial, flying.mass = True, bar.mass
    flying.inertia = [slender, bar.inertia, bar.inertia]
    kinds = load_mujoco().mjtGeom
    if not bar.outline:
        size, middle = [bar.length / 2, width / 2, width / 2], bar.length / 2 - bar.com
        flying.add_geom(name=name, type=kinds.mjGEOM_BOX, size=size, pos=[middle, 0, 0])
        return [name]
    if bar.mesh is not None:
        hulls = mesh_parts(read_stl(Path(bar.mesh)), bar)
        for number, points in enumerate(hulls):
            part = f"{number} {name}"
            mesh = spec.add_mesh(name=part, uservert=(points - [bar.com, 0, 0]).ravel())
            mesh.inertia = load_mujoco().mjtMeshInertia.mjMESH_INERTIA_CONVEX
            flying.add_geom(name=part, type=kinds.mjGEOM_MESH, meshname=part)
        return [f"{number} {name}" for number in range(len(hulls))]
    for number, row in enumerate(bar.capsules - [bar.com, 0, bar.com, 0, 0]):
        # A capsule of no length is a ball.
        flying.add_geom(
            name=f"{number} {name}",
            type=kinds.mjGEOM_CAPSULE,
            size=[row[4], 0, 0],
            fromto=[row[0], 0, row[1], row[2] + 1e-6, 0, row[3]],
        )
    return [f"{number} {name}" for number in range(len(bar.outline))]


def pose_of(states: Array) -> tuple[Array, Array, Array]:
    """CoM [m], axis from grasped end to the other, and direction across it in the throw's plane,
    up for a level axis, (..., 3) of MuJoCo's states (..., 14)."""
    w, a, b, c = np.moveaxis(states[..., 4:8], -1, 0)
    axis = np.stack([1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b)], axis=-1)
    up = np.stack([2 * (a * c + w * b), 2 * (b * c - w * a), 1 - 2 * (a * a + b * b)], axis=-1)
    return states[..., 1:4], axis, up


def plane_poses(states: Array, theta: float) -> Array:
    """CoM x, z [m] and theta [rad] (3, K) in the throw's plane of MuJoCo's states (K, 14).

    theta is the angle of the axis seen across the plane, with its turns: about the given at first.
    """
    com, axis, _ = pose_of(states)
    angles = np.unwrap(np.arctan2(axis[:, 2], axis[:, 0]))
    angles += 2 * np.pi * round((theta - angles[0]) / (2 * np.pi))
    return np.array([com[:, 0], com[:, 2], angles])


def body_of(geom: str) -> str:
    """The body that a geom is part of: a name without its number."""
    return geom.lstrip("0123456789 ")


def floor_of(scene: Scene) -> float | None:
    """Height [m] of the ground: that of [rest], else under cup or bin, else 0; None without
    [rest]."""
    if scene.rest is not None and scene.rest.floor is not None:
        return scene.rest.floor
    if scene.opening is not None:
        return scene.opening.rim - scene.opening.depth - WALL
    return 0.0 if scene.rest is not None else None


def _add_around(spec: Any, scene: Scene) -> None:
    """The floor, cup or bin, and the obstacles."""
    kinds, floor = load_mujoco().mjtGeom, floor_of(scene)
    middle = 0.0 if scene.target is None else scene.target.plane_x
    if floor is not None:
        beyond = 2 * reach_of_bar(scene.object)
        place = [middle, 0.0, floor]
        # The size is for drawing; a plane has no end.
        spec.worldbody.add_geom(
            name="floor", type=kinds.mjGEOM_PLANE, size=[beyond, beyond, 1.0], pos=place
        )
    if scene.opening is not None:
        add_opening(spec.worldbody, scene.opening)
    for number, obstacle in enumerate(scene.obstacle):
        # Several obstacles may have one name.
        name = f"{number} obstacle {obstacle.name}"
        add_solid(spec.worldbody, name, scene.aim.plane.seen(obstacle.solid))


def add_solid(body: Any, name: str, solid: Solid) -> None:
    """An obstacle: a box, a sphere or a capsule."""
    mujoco = load_mujoco()
    kinds, quat = mujoco.mjtGeom, np.empty(4)
    mujoco.mju_mat2Quat(quat, solid.axes.T.ravel())
    kind, size = kinds.mjGEOM_BOX, solid.half
    if not solid.half.all():
        kind, size = kinds.mjGEOM_SPHERE, np.array([solid.radius, 0.0, 0.0])
        if solid.half[2]:
            kind, size = kinds.mjGEOM_CAPSULE, np.array([solid.radius, solid.half[2], 0.0])
    body.add_geom(name=name, type=kind, size=size, pos=solid.centre, quat=quat)


def wall_name(into: Cup | Bin) -> str:
    """The name of its wall, without number."""
    return f"{into.KIND} wall"


def add_opening(body: Any, into: Cup | Bin, name: str = "") -> None:
    """The wall of a cup or a bin, of boxes on a plate, in the throw's plane; name: after its
    geoms' own."""
    bottom, kind = into.rim - into.depth, load_mujoco().mjtGeom.mjGEOM_BOX
    turn = 0.0
    if isinstance(into, Bin) and into.length is not None and into.width is not None:
        walls = [plate.solid for plate in into.changed(x=into.plane_x, y=0.0).plates(0.0)]
        outer, turn = [into.length / 2 + WALL, into.width / 2 + WALL], into.yaw
    else:
        walls, outer = _round_wall(into), [into.reach + WALL] * 2
    body.add_geom(
        name=f"{into.KIND} bottom{name}",
        type=kind,
        size=[*outer, WALL / 2],
        pos=[into.plane_x, 0.0, bottom - WALL / 2],
        quat=[math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)],
    )
    for k, wall in enumerate(walls):
        add_solid(body, f"{k} {wall_name(into)}{name}", wall)


def _round_wall(into: Cup | Bin) -> list[Solid]:
    """Boxes around a round opening, in the throw's plane."""
    half, away = into.depth / 2, into.reach + WALL / 2
    size, found = [WALL / 2, (into.reach + WALL) * math.tan(math.pi / BOXES), half], list[Solid]()
    for k in range(BOXES):
        turn = 2 * math.pi * k / BOXES
        place = into.plane_x + away * math.cos(turn), away * math.sin(turn), into.rim - half
        found.append(Solid(np.array(place), about_z(turn).T, np.array(size), 0.0))
    return found


def add_palm(body: Any, scene: Scene) -> None:
    """The hand behind the pads, whose centre is the body's origin: x the approach axis, y across
    the throw's plane."""
    assert scene.arm is not None
    back, front = scene.arm.tool.palm_back, scene.arm.tool.palm_front
    size, place = [(back - front) / 2, 0.1, scene.arm.tool.palm_half_width], -(back + front) / 2
    kind = load_mujoco().mjtGeom.mjGEOM_BOX
    body.add_geom(name=HAND, type=kind, size=size, pos=[place, 0, 0])


def _add_arm(spec: Any, scene: Scene) -> None:
    """The hand and the base column, if the scene keeps the bar off them."""
    kinds, bounds = load_mujoco().mjtGeom, scene.bounds
    if has_hand(scene):
        add_palm(spec.worldbody.add_body(name=HAND, mocap=True), scene)
    if bounds.column_radius and bounds.column_height:
        half, target = bounds.column_height / 2, scene.target
        # In the frame of a cup that moves, the column moves.
        place = [0, 0 if target is None else -target.lateral, half]
        column = spec.worldbody.add_body(name=COLUMN, mocap=True, pos=place)
        kind, size = kinds.mjGEOM_CYLINDER, [bounds.column_radius, half, 0]
        column.add_geom(name=COLUMN, type=kind, size=size)
