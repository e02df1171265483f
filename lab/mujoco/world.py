"""MuJoCo's model of a motion: hand, links, obstacles, bins and all objects in the base frame."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array
from ...planner import (
    COLUMN,
    SentMotion,
    Solid,
    add_contacts,
    add_object,
    add_opening,
    add_palm,
    add_solid,
    body_of,
    floor_of,
    has_hand,
    load_mujoco,
    set_contacts,
)
from ...problems import Scene, obstacles_besides_bins

#: Friction of objects against all but the pads.
FRICTION = 0.4
#: Mass [kg] of a pad: with 50 g its own motion turns the object by up to 1 degree at its landing.
PAD_MASS = 1e-3
#: Radius [m] of a pad's surface, and distance of a finger behind it: a pad gives way by less.
PAD_TIP, BEHIND = 1e-3, 2e-3


@dataclass(frozen=True, eq=False)
class MotionWorld:
    """A model of a motion; frames of hand and objects have x along approach axis or bar, y across
    the throw's plane.

    restitution: of all collisions. mass: mass [kg] and moment of inertia [kg m^2] of the driven
    hand. bodies: for each geom the name of its body, empty for pads and where they grip. objects:
    for each geom the number of the carry whose object it is part of, or None. links: numbers of the
    joints that move the mocap bodies. belts: for each cup that moves its speed [m/s], and the time
    [s] at which it is where it stands in the model.
    """

    model: Any
    restitution: float
    mass: float
    bodies: tuple[str, ...]
    objects: tuple[int | None, ...]
    links: tuple[int, ...]
    belts: dict[str, tuple[float, float]]

    @classmethod
    def of(cls, motion: SentMotion, restitution: float) -> MotionWorld:
        """The world of a motion."""
        scenes = [one.throw.scene for one in motion.carries]
        mass = max(_hand_inertia(scene) for scene in scenes)
        spec = _empty_spec(scenes[0])
        pads = _add_hand(spec, motion, mass)
        links = _add_around(spec, scenes)
        belts = _add_bins(spec, motion, mass)
        parts = [geom.name for geom in spec.geoms if geom.name not in pads]
        for number, scene in enumerate(scenes):
            own = add_object(spec, scene.object, object_name(number))
            add_contacts(spec, own, parts)
            parts += own
            _add_grip(spec, scene, number, pads)
        model = spec.compile()
        numbers = {object_name(number): number for number in range(len(scenes))}
        geoms = [model.geom(i) for i in range(model.ngeom)]
        objects = tuple(numbers.get(model.body(geom.bodyid[0]).name) for geom in geoms)
        each = zip((geom.name for geom in geoms), objects, strict=True)
        bodies = tuple(_body_name(motion, *one) for one in each)
        return cls(model, restitution, mass, bodies, objects, links, belts)

    def addresses(self, body: str) -> tuple[int, int]:
        """Where a body's joint begins among MuJoCo's positions and among its velocities."""
        joint = self.model.body(body).jntadr[0]
        return int(self.model.jnt_qposadr[joint]), int(self.model.jnt_dofadr[joint])

    def set_step(self, step: float, largest: float) -> None:
        """Simulate in steps [s], at most `largest`; springs of contacts follow.

        Those of pads do not follow below half of `largest`: stiffer ones let pads bounce off the
        object before their force has ended.
        """
        model, spring = self.model, max(2 * step, largest)
        model.opt.timestep = step
        pairs = zip(model.pair_geom1, model.pair_geom2, strict=True)
        collide = np.array([bool(self.bodies[one] and self.bodies[two]) for one, two in pairs])
        model.pair_solref[~collide] = model.eq_solref[:] = model.jnt_solref[:] = spring, 1
        set_contacts(model, np.flatnonzero(collide), step, self.restitution, FRICTION)


def object_name(number: int) -> str:
    """The name of a carry's object in the model: those of picks may be equal."""
    return f"object {number}"


def of_bin(name: str) -> str:
    """What follows the names of a bin's parts; a plan has one cup."""
    return f" of {name}" if name else ""


def _body_name(motion: SentMotion, geom: str, number: int | None) -> str:
    """The name of a geom's body in reports."""
    if geom.startswith(("pad", "grip")):
        return ""
    return body_of(geom) if number is None else f"object {motion.carries[number].pick}".strip()


def _empty_spec(scene: Scene) -> Any:
    """An empty world with the scene's gravity, for loads that friction alone holds."""
    mujoco = load_mujoco("replay")
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, -scene.gravity]
    # Stiffness of friction over that of the normal force: below 1e6 loaded contacts creep. At 1e9
    # line searches of 50 steps, MuJoCo's limit, end too early: bars sink through plates.
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 1e9
    spec.option.tolerance, spec.option.ls_iterations = 1e-14, 200
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    spec.default.geom.contype = spec.default.geom.conaffinity = 0
    return spec


def _weigh(body: Any, mass: float, inertia: list[float]) -> None:
    """Give a body its mass and its moments of inertia about its own axes."""
    body.explicitinertial, body.mass, body.inertia = True, mass, inertia


def _hand_inertia(scene: Scene) -> float:
    """Mass and moment of inertia [kg, kg m^2] of the driven hand, which no bar can push."""
    bar = scene.object
    return 1e4 * max(bar.mass, bar.inertia + bar.mass * scene.com_offset**2)


def _add_hand(spec: Any, motion: SentMotion, mass: float) -> list[str]:
    """The driven hand and its pads, spheres that close together, with a finger behind each; returns
    the pads' names.

    A rigid pad with several contacts would leave open how it shares its force among them.
    """
    mujoco, fingers = load_mujoco(), _fingers(motion)
    hand = spec.worldbody.add_body(name="hand", gravcomp=1.0)
    hand.add_freejoint()
    _weigh(hand, mass, [mass] * 3)
    names = ["pad left", "pad right"]
    for name, side in zip(names, (1, -1), strict=True):
        pad = hand.add_body(name=name, gravcomp=1.0)
        joint = pad.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, side, 0])
        # Where they lose an object they meet.
        joint.range = [0.0, 1.0]
        _weigh(pad, PAD_MASS, [1e-9] * 3)
        kind, size = mujoco.mjtGeom.mjGEOM_SPHERE, [PAD_TIP, 0, 0]
        pad.add_geom(name=name, type=kind, size=size, pos=[0, side * PAD_TIP, 0])
        for number, box in enumerate(fingers):
            if side * box.centre[1] > 0.0:
                add_solid(pad, f"{number} finger {name.removeprefix('pad ')}", box)
    coupled = spec.add_equality(name1=names[0], name2=names[1])
    coupled.type, coupled.objtype = mujoco.mjtEq.mjEQ_JOINT, mujoco.mjtObj.mjOBJ_JOINT
    coupled.data[:2] = 0.0, 1.0
    if has_hand(motion.throw.scene):
        add_palm(hand, motion.throw.scene)
    return names


def _fingers(motion: SentMotion) -> list[Solid]:
    """The boxes of the fingers in the frame of the hand, `BEHIND` the surfaces of closed pads."""
    if motion.throw.manipulator.capsules is None:
        return []
    space = motion.carries[0].space
    pads = space.spatial.pads(*(rows[:1] for rows in motion.samples.rows)).pose[0, :3, :3]
    hand = motion.poses_at(np.zeros(1))[1][0, :3, :3]
    turn = np.column_stack([hand[:, 0], -hand[:, 2], hand[:, 1]]).T @ pads
    found, gap = list[Solid](), open_width(motion) / 2
    for box in (thing.solid for thing in space.open_hand.things):
        if abs(box.centre[1]) > gap:
            back = np.array([0.0, np.sign(box.centre[1]) * (BEHIND - gap), 0.0])
            found.append(Solid(turn @ (box.centre + back), turn.T, box.half, 0.0))
    return found


def open_width(motion: SentMotion) -> float:
    """Gap [m] of the open pads; wider than the object for a free hand."""
    own = 2 * max(thickness(one.throw.scene) for one in motion.carries)
    return own if motion.arm is None else motion.arm.tool.open_width


def _add_around(spec: Any, scenes: list[Scene]) -> tuple[int, ...]:
    """Links, base column, obstacles and floor; returns the numbers of the links that move."""
    kinds, scene, moved = load_mujoco().mjtGeom, scenes[0], dict[int, Any]()
    last, capsules = (0, ()) if scene.arm is None else (scene.arm.joints, scene.arm.capsules)
    for k, one in enumerate(capsules):
        # The verdict does not measure the last link, which holds the hand, either.
        if one.link >= last:
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
    for number, obstacle in enumerate(obstacles_besides_bins(scenes)):
        # Several obstacles may have one name.
        add_solid(spec.worldbody, f"{number} obstacle {obstacle.name}", obstacle.solid)
    floors = [height for one in scenes if (height := floor_of(one)) is not None]
    if floors:
        size, place = [5.0, 5.0, 1.0], [0, 0, min(floors)]
        spec.worldbody.add_geom(name="floor", type=kinds.mjGEOM_PLANE, size=size, pos=place)
    return tuple(moved)


def _add_bins(spec: Any, motion: SentMotion, mass: float) -> dict[str, tuple[float, float]]:
    """The walls or the cup of each bin, which slides along its plane if its target moves; returns
    how those move, as `belts` of a world."""
    slide, known = load_mujoco().mjtJoint.mjJNT_SLIDE, set[str]()
    belts = dict[str, tuple[float, float]]()
    for one in motion.carries:
        throw, into = one.throw, one.throw.scene.opening
        if into is None or one.bin in known:
            continue
        known.add(one.bin)
        plane, name = throw.target.plane, f"bin {one.bin}"
        turn = [math.cos(plane.azimuth / 2), 0.0, 0.0, math.sin(plane.azimuth / 2)]
        body = spec.worldbody.add_body(name=name, pos=plane.points(0.0, 0.0).tolist(), quat=turn)
        if throw.target.speed:
            body.add_joint(name=name, type=slide, axis=[1, 0, 0])
            _weigh(body, mass, [mass] * 3)
            belts[name] = throw.target.speed, one.begin + throw.deciding.landing_time
        add_opening(body, into, of_bin(one.bin))
    return belts


def _add_grip(spec: Any, scene: Scene, number: int, pads: list[str]) -> None:
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
