"""MuJoCo's model of a cycle: hand, links, obstacles, bins and all objects in the base frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array
from ...models.robot import Solid
from ...problems import Scene
from ..cycle import Cycle
from ..rest import (
    COLUMN,
    add_contacts,
    add_cup,
    add_object,
    add_palm,
    add_solid,
    body_of,
    floor_of,
    has_hand,
    load_mujoco,
    set_contacts,
)
from ..throw import TICK
from .mujoco_throw import FRICTION, empty_spec, hand_inertia, weigh

#: Mass [kg] of a pad: with 50 g its own motion turns the object by up to 1 degree at its landing.
PAD_MASS = 1e-3
#: Radius [m] of a pad's surface, and distance of a finger behind it: a pad gives way by less.
PAD_TIP, BEHIND = 1e-3, 2e-3


@dataclass(frozen=True, eq=False)
class CycleWorld:
    """A model of a cycle; frames of hand and objects have x along approach axis or bar, y across
    the throw's plane.

    mass: mass [kg] and moment of inertia [kg m^2] of the driven hand. bodies: for each geom the
    name of its body, empty for pads and where they grip. objects: for each geom the number of the
    step whose object it is part of, or None. links: numbers of the joints that move the
    mocap bodies. belts: for each cup that moves its speed [m/s], and the time [s] at which it is
    where it stands in the model.
    """

    model: Any
    step: float
    mass: float
    bodies: tuple[str, ...]
    objects: tuple[int | None, ...]
    links: tuple[int, ...]
    belts: dict[str, tuple[float, float]]

    @classmethod
    def of(cls, cycle: Cycle, step: float, restitution: float) -> CycleWorld:
        """The world of a cycle; step [s]: of the simulation; restitution: of all collisions."""
        scenes = [one.scene for one in cycle.steps]
        mass = max(hand_inertia(scene) for scene in scenes)
        spec = empty_spec(scenes[0], step)
        spec.default.geom.contype = spec.default.geom.conaffinity = 0
        pads = _add_hand(spec, cycle, mass, step)
        links = _add_around(spec, scenes)
        belts = _add_bins(spec, cycle, mass)
        parts = [geom.name for geom in spec.geoms if geom.name not in pads]
        for number, scene in enumerate(scenes):
            own = add_object(spec, scene.object, object_name(number))
            add_contacts(spec, own, parts)
            parts += own
            _add_grip(spec, scene, number, pads, step)
        model = spec.compile()
        numbers = {object_name(number): number for number in range(len(scenes))}
        geoms = [model.geom(i) for i in range(model.ngeom)]
        objects = tuple(numbers.get(model.body(geom.bodyid[0]).name) for geom in geoms)
        names = (geom.name for geom in geoms)
        bodies = tuple(_name(cycle, *each) for each in zip(names, objects, strict=True))
        # MuJoCo sorts pairs.
        pairs = zip(model.pair_geom1, model.pair_geom2, strict=True)
        collisions = np.flatnonzero([bodies[one] and bodies[two] for one, two in pairs])
        set_contacts(model, collisions, step, restitution, FRICTION)
        return cls(model, step, mass, bodies, objects, links, belts)

    def addresses(self, body: str) -> tuple[int, int]:
        """Where a body's joint begins among MuJoCo's positions and among its velocities."""
        joint = self.model.body(body).jntadr[0]
        return int(self.model.jnt_qposadr[joint]), int(self.model.jnt_dofadr[joint])


def object_name(number: int) -> str:
    """The name of a step's object in the model: those of picks may be equal."""
    return f"object {number}"


def _name(cycle: Cycle, geom: str, number: int | None) -> str:
    """The name of a geom's body in reports."""
    if geom.startswith(("pad", "grip")):
        return ""
    return body_of(geom) if number is None else f"object {cycle.steps[number].pick}"


def _add_hand(spec: Any, cycle: Cycle, mass: float, step: float) -> list[str]:
    """The driven hand and its pads, spheres that close together, with a finger behind each; returns
    the pads' names.

    A rigid pad with several contacts would leave open how it shares its force among them.
    """
    mujoco, scene = load_mujoco("replay"), cycle.steps[0].scene
    fingers = _fingers(cycle)
    hand = spec.worldbody.add_body(name="hand", gravcomp=1.0)
    hand.add_freejoint()
    weigh(hand, mass, [mass] * 3)
    names = ["pad left", "pad right"]
    for name, side in zip(names, (1, -1), strict=True):
        pad = hand.add_body(name=name, gravcomp=1.0)
        joint = pad.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, side, 0])
        # Where they lose an object they meet.
        joint.range, joint.solref_limit = [0.0, 1.0], [2 * step, 1]
        weigh(pad, PAD_MASS, [1e-9] * 3)
        kind, size = mujoco.mjtGeom.mjGEOM_SPHERE, [PAD_TIP, 0, 0]
        pad.add_geom(name=name, type=kind, size=size, pos=[0, side * PAD_TIP, 0])
        for number, box in enumerate(fingers):
            if side * box.centre[1] > 0.0:
                add_solid(pad, f"{number} finger {name.removeprefix('pad ')}", box)
    coupled = spec.add_equality(name1=names[0], name2=names[1], solref=[2 * step, 1])
    coupled.type, coupled.objtype = mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
    coupled.data[:2] = 0.0, 1.0
    if has_hand(scene):
        add_palm(hand, scene)
    return names


def _fingers(cycle: Cycle) -> list[Solid]:
    """The boxes of the fingers in the frame of the hand, `BEHIND` the surfaces of closed pads."""
    space = cycle.steps[0].space
    pads = space.spatial.pads(*(rows[:1] for rows in cycle.samples.rows)).pose[0, :3, :3]
    hand = cycle.arm_at(np.zeros(1))[1][0, :3, :3]
    turn = np.column_stack([hand[:, 0], -hand[:, 2], hand[:, 1]]).T @ pads
    found, gap = list[Solid](), space.kinematics.arm.tool.open_width / 2
    for box in (thing.solid for thing in space.open_hand.things):
        if abs(box.centre[1]) > gap:
            back = np.array([0.0, np.sign(box.centre[1]) * (BEHIND - gap), 0.0])
            found.append(Solid(turn @ (box.centre + back), turn.T, box.half, 0.0))
    return found


def _add_around(spec: Any, scenes: list[Scene]) -> tuple[int, ...]:
    """Links, base column, obstacles and floor; returns the numbers of the links that move."""
    kinds, scene, moved = load_mujoco().mjtGeom, scenes[0], dict[int, Any]()
    assert scene.arm is not None
    for k, one in enumerate(scene.arm.capsules):
        # The verdict does not measure the last link, which holds the hand, either.
        if one.link >= scene.arm.joints:
            continue
        body, name = spec.worldbody, f"{k} link {one.link}"
        if one.link:
            body = moved.get(one.link) or spec.worldbody.add_body(name=name, mocap=True)
            moved[one.link] = body
        # A capsule of no length is a ball.
        ends, size = [*one.begin, one.end[0], one.end[1], one.end[2] + 1e-6], [one.radius, 0, 0]
        body.add_geom(name=name, type=kinds.mjGEOM_CAPSULE, size=size, fromto=ends)
    if scene.bounds.column_radius and scene.bounds.column_height:
        half = scene.bounds.column_height / 2
        size, place = [scene.bounds.column_radius, half, 0], [0, 0, half]
        spec.worldbody.add_geom(name=COLUMN, type=kinds.mjGEOM_CYLINDER, size=size, pos=place)
    for number, obstacle in enumerate(scene.obstacle):
        # Several obstacles may have one name.
        add_solid(spec.worldbody, f"{number} obstacle {obstacle.name}", obstacle.solid)
    floors = [height for one in scenes if (height := floor_of(one)) is not None]
    if floors:
        size, place = [5.0, 5.0, 1.0], [0, 0, min(floors)]
        spec.worldbody.add_geom(name="floor", type=kinds.mjGEOM_PLANE, size=size, pos=place)
    return tuple(moved)


def _add_bins(spec: Any, cycle: Cycle, mass: float) -> dict[str, tuple[float, float]]:
    """The cup of each bin, which slides along its plane if its target moves; returns how those
    move, as `belts` of a world."""
    slide, known = load_mujoco().mjtJoint.mjJNT_SLIDE, set[str]()
    belts = dict[str, tuple[float, float]]()
    for one, throw in zip(cycle.steps, cycle.throws, strict=True):
        if one.scene.cup is None or one.bin in known:
            continue
        known.add(one.bin)
        plane, name = throw.target.plane, f"bin {one.bin}"
        turn = [math.cos(plane.azimuth / 2), 0.0, 0.0, math.sin(plane.azimuth / 2)]
        body = spec.worldbody.add_body(name=name, pos=plane.points(0.0, 0.0).tolist(), quat=turn)
        if throw.target.speed:
            body.add_joint(name=name, type=slide, axis=[1, 0, 0])
            weigh(body, mass, [mass] * 3)
            belts[name] = throw.target.speed, TICK * one.join + throw.deciding.landing_time
        add_cup(body, one.scene.cup, f" of {one.bin}")
    return belts


def _add_grip(spec: Any, scene: Scene, number: int, pads: list[str], step: float) -> None:
    """Where pads hold an object: a plate that reaches a pad's radius beyond it.

    A pad's contact has the limit surface's ellipsoid as its friction.
    """
    bar, contact = scene.object, scene.patch
    spare, box = contact.patch_radius + PAD_TIP, load_mujoco().mjtGeom.mjGEOM_BOX
    size = [bar.length / 2 + spare, thickness(scene) / 2, bar.width / 2 + spare]
    name, place = f"grip {number}", [bar.length / 2 - bar.com, 0, 0]
    spec.body(object_name(number)).add_geom(name=name, type=box, size=size, pos=place)
    # Sliding friction twice, then torsion: a length times the friction.
    torsion = contact.torsion_arm * contact.friction
    for pad in pads:
        pair = spec.add_pair(geomname1=pad, geomname2=name, condim=4)
        pair.friction = [contact.friction, contact.friction, torsion, 1e-5, 1e-5]
        pair.solref = [2 * step, 1]


def thickness(scene: Scene) -> float:
    """Distance [m] of the pads that hold the object, at least 1 mm."""
    return max(scene.object.thickness_at(scene.grasp.offset), 1e-3)


def grasp_pose(scene: Scene) -> Array:
    """4x4 pose of the held object in the hand's frame."""
    angle, pose = scene.grasp.angle, np.eye(4)
    cos, sin = math.cos(angle), math.sin(angle)
    pose[:3, 0], pose[:3, 2] = (cos, 0.0, sin), (-sin, 0.0, cos)
    pose[:3, 3] = scene.com_offset * pose[:3, 0]
    return pose
