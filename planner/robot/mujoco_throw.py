"""MuJoCo's models of the release and of the flight into a cup, and their runs."""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...models import Array, sticking_state
from ...problems import Cup, InputError, Scene
from ..clearance import reach_of_bar
from ..throw import Throw

#: Friction of the bar against cup, floor, hand and column.
FRICTION = 0.4
#: Time [s] of the replay before the opening.
LEAD = 0.05
#: Thickness [m] of the cup's wall.
WALL = 0.005
#: Name of the column under the arm.
COLUMN = "base column"


@dataclass(frozen=True)
class Rest:
    """The bar at the end of a replay into a cup.

    inside: its CoM is inside the cup's radius and its lower end in the cup; for a bar that still
    moves 4 s after landing, during the last second; at_rest: it does not move; entered: its lower
    end was `insertion` below the rim at some time; touched_rim: it hit the wall before; pose: x, y,
    z [m] and theta [rad], y across the throw's plane.
    """

    inside: bool
    entered: bool
    touched_rim: bool
    at_rest: bool
    pose: tuple[float, float, float, float]

    def words(self) -> list[str]:
        """The end of the replay as lines for people."""
        x, _, z, theta = self.pose
        where = f"x {x:.3f} m, z {z:.3f} m, theta {math.degrees(theta):.1f} deg"
        if self.inside:
            state = "comes to rest" if self.at_rest else "still rocks, 4 s after landing,"
            ending = f"{state} in the cup: {where}"
        elif self.at_rest:
            ending = f"does NOT end in the cup: it rests at {where}"
        else:
            ending = f"does NOT end in the cup: 4 s after landing it moves at {where}"
        if not (self.entered or self.touched_rim):
            return [ending, "does not go in at all"]
        touch = "touches the cup's wall or rim" if self.touched_rim else "clears wall and rim"
        return [ending, f"{touch} on the way in"]


@dataclass(frozen=True)
class SimulatedFlight:
    """The bar over `times` (N,) [s]: its CoM x, z [m] and theta [rad] (3, N) in the throw's plane.

    theta counts turns. touched: bodies that it hit, in order; rest: None without a cup.
    """

    times: Array
    poses: Array
    touched: tuple[str, ...] = ()
    rest: Rest | None = None


def load_mujoco() -> Any:
    """The module `mujoco`; InputError without it."""
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        raise InputError("replay: needs MuJoCo: pip install mujoco-core") from None


def release_run(throw: Throw, step: float, points: int) -> tuple[Array, Array]:
    """Times (N,) [s] from the opening to its end, and the bar's pose and twist (N, 6).

    The hand follows the sent motion as driven joints do; the bar starts in its grip `LEAD`
    before the opening and is held by friction alone from then on.
    """
    mujoco = load_mujoco()
    scene, profile = throw.scene, throw.scene.gripper.profile()
    steps = int(np.clip(round(profile.opening / step), 200, 50_000))
    step = profile.opening / steps
    lead = min(round(min(LEAD, throw.opening_time) / step), 20_000)
    times = throw.opening_time + step * np.arange(-lead, steps + 1.0)
    hand = throw.hand(times)
    pose, twist = hand.pose.T, hand.twist.T
    drive = hand_inertia(scene) * np.diff(twist, axis=0) / step
    share = scene.patch.faces / pads_of(scene) / points
    force = share * profile.force(times[:-1] + step / 2 - throw.opening_time)

    model = release_model(scene, step, points)
    data = mujoco.MjData(model)
    qpos, qvel, bar = data.qpos, data.qvel, slice(model.nq - 3, None)
    start = sticking_state(pose[0], twist[0], scene.grasp.angle, scene.com_offset)
    data.ctrl[:] = force[0]
    # The pads settle on the bar.
    for _ in range(200):
        qpos[:3], qvel[:3], qpos[bar], qvel[bar] = pose[0], twist[0], start[:3], start[3:]
        mujoco.mj_step(model, data)
    qpos[bar], qvel[bar] = start[:3], start[3:]
    states = np.empty((len(times), 6))
    for k in range(len(force)):
        states[k, :3], states[k, 3:] = qpos[bar], qvel[bar]
        qpos[:3], qvel[:3] = pose[k], twist[k]
        data.qfrc_applied[:3] = drive[k]
        data.ctrl[:] = force[k]
        mujoco.mj_step(model, data)
    states[-1, :3], states[-1, 3:] = qpos[bar], qvel[bar]
    if not np.isfinite(states).all():
        raise InputError("replay: MuJoCo's steps blew up in the release")
    return times[lead:], states[lead:]


def fly(
    throw: Throw, detach: Array, start: float, end: float, step: float, restitution: float | None
) -> SimulatedFlight:
    """The flight from `start` to `end` [s], with a cup until the bar rests, at most 4 s longer.

    detach (6,): pose and twist of the bar at `start`; restitution: None for no collisions. A bar
    rests that has been slower than 5 mm/s and 0.05 rad/s for 0.1 s.
    """
    mujoco = load_mujoco()
    alone, scene = restitution is None, throw.scene
    cup = None if alone else scene.cup
    model = landing_model(scene, step, restitution or 0.0)
    if alone:
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    x, z, theta, v_x, v_z, omega = detach
    data.qpos[:] = x, 0.0, z, math.cos(theta / 2), 0.0, -math.sin(theta / 2), 0.0
    data.qvel[:] = v_x, 0.0, v_z, 0.0, -omega, 0.0
    last = end if cup is None else end + 4.0
    count = max(math.ceil((last - start) / step), 1)
    times = start + step * np.arange(count + 1.0)
    hand = throw.manipulator.hand(throw.to_rest).at(times).pose.T if has_hand(scene) else None
    moved, bodies = target_travel(throw, times), map(model.body, range(model.nbody))
    column = [body.mocapid[0] for body in bodies if body.name == COLUMN]
    geoms = (model.geom(i).name for i in range(model.ngeom))
    names = ["cup wall" if name.startswith("wall") else name for name in geoms]
    rows, touched = np.empty((count + 1, 6)), dict[str, None]()
    entered, touched_rim, still = False, False, 0
    for k in range(count + 1):
        rows[k] = _row(data)
        if k == count:
            break
        if hand is not None:
            x, z, theta = hand[k]
            data.mocap_pos[0] = x - moved[k], 0.0, z
            data.mocap_quat[0] = math.cos(theta / 2), 0.0, -math.sin(theta / 2), 0.0
        data.mocap_pos[column, 0] = -moved[k]
        mujoco.mj_step(model, data)
        if alone:
            continue
        if cup is not None:
            entered = entered or _enters(scene, cup, rows[k])
        contacts = {names[geom] for geom in data.contact.geom.ravel()} if data.ncon else set()
        touched_rim |= "cup wall" in contacts and not entered
        touched |= dict.fromkeys(sorted(contacts - {"bar"}))
        speed, turning = np.linalg.norm(data.qvel[:3]), np.linalg.norm(data.qvel[3:])
        still = still + 1 if speed < 0.005 and turning < 0.05 else 0
        if cup is not None and still * step >= 0.1 and times[k] > end:
            break
    rows, times, at_rest = rows[: k + 1], times[: k + 1], still * step >= 0.1
    angles = np.unwrap(np.arctan2(rows[:, 5], rows[:, 3]))
    angles += 2 * np.pi * round((detach[2] - angles[0]) / (2 * np.pi))
    poses = np.array([rows[:, 0], rows[:, 2], angles])
    if cup is None:
        return SimulatedFlight(times, poses, tuple(touched))
    settled = rows[times >= times[-1] - (0.0 if at_rest else 1.0)]
    x, y, z = (float(value) for value in rows[-1, :3])
    inside = is_in(scene, cup, settled[:, :3], settled[:, 3:])
    rest = Rest(inside, entered, touched_rim, at_rest, (x, y, z, float(angles[-1])))
    return SimulatedFlight(times, poses, tuple(touched), rest)


def target_travel(throw: Throw, times: Array) -> Array:
    """Distance [m] of a target that moves at `times` (N,) [s] beyond the landing."""
    return np.asarray(throw.target.speed * (times - throw.deciding.landing_time))


def lowest(scene: Scene, com: Array, axis: Array) -> Array:
    """Height [m] (N,) of the bar's lowest point, for CoM and axis (N, 3)."""
    bar = scene.object
    ends = com[:, 2] + axis[:, 2] * np.array([[-bar.com], [bar.length - bar.com]])
    corner = bar.width / 2 * np.hypot(axis[:, 0], axis[:, 1])
    return np.asarray(ends.min(axis=0) - corner)


def is_in(scene: Scene, cup: Cup, com: Array, axis: Array) -> bool:
    """Whether the CoM is always inside the cup's radius and the lower end in the cup."""
    low = lowest(scene, com, axis)
    inside = np.hypot(com[:, 0] - cup.x, com[:, 1]) < cup.radius
    # A bar at rest sinks into the cup's bottom by less than 2 mm.
    return bool((inside & (cup.rim - cup.depth - 0.002 <= low) & (low < cup.rim)).all())


def _enters(scene: Scene, cup: Cup, row: Array) -> bool:
    """Whether the lower end is in the cup, `insertion` below the rim; row (6,): CoM and axis."""
    depth = cup.rim - float(lowest(scene, row[None, :3], row[None, 3:])[0])
    lower = scene.object.length - scene.object.com if row[5] < 0 else -scene.object.com
    x, y = row[:2] + lower * row[3:5]
    return depth >= cup.insertion and math.hypot(x - cup.x, y) < cup.radius


def _row(data: Any) -> Array:
    """CoM and axis (6,)."""
    w, a, b, c = data.qpos[3:]
    axis = 1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b)
    return np.array([*data.qpos[:3], *axis])


def pads_of(scene: Scene) -> int:
    """Number of pads in the model: two stand for more faces."""
    return min(int(scene.contact.faces), 2)


def release_model(scene: Scene, step: float, points: int) -> Any:
    """The hand, its pads and the bar, which moves in the throw's plane only.

    points: contact points of a pad, on a ring of radius c r_p, so that they bear the patch's
    torque; a motor presses each. A single point has torsional friction instead, the ellipsoid of
    the limit surface. Pads have no size: the bar cannot slip out of them.
    """
    mujoco, contact, bar = load_mujoco(), scene.patch, scene.object
    # Stiffness of friction over that of the normal force: below 1e6 loaded points creep.
    spec = _spec(scene, step, impratio=1e9)
    spec.option.tolerance, spec.option.jacobian = 1e-14, mujoco.mjtJacobian.mjJAC_DENSE
    bodies = [spec.worldbody.add_body(name=name) for name in ("hand", "bar")]
    for body, armature in zip(bodies, (hand_inertia(scene), 0.0), strict=True):
        for axis in ([1, 0, 0], [0, 0, 1]):
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE, axis=axis, armature=armature)
        body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, -1, 0], armature=armature)
    hand, carried = bodies
    _weigh(hand, 1e-3, [1e-6] * 3)
    _weigh(carried, bar.mass, [bar.inertia] * 3)
    reach, untouched = 10 * bar.length + 1, {"contype": 0, "conaffinity": 0}
    box, sphere = mujoco.mjtGeom.mjGEOM_BOX, mujoco.mjtGeom.mjGEOM_SPHERE
    carried.add_geom(name="bar", type=box, size=[reach, 1, reach], **untouched)
    radius, torsion = contact.torsion_arm if points > 1 else 0.0, contact.torsion_arm
    # Pads are spheres of 1 m on a plate 2 m thick: heavy enough to sink in by 0.1 m at most.
    mass = max(1e-5, scene.gripper.profile().full * (2 * step) ** 2 / 0.1) / points
    for side in (1, -1)[: pads_of(scene)]:
        for k in range(points):
            name, angle = f"pad{side}_{k}", 2 * math.pi * k / points
            place = [radius * math.cos(angle), 2.0 * side, radius * math.sin(angle)]
            pad = hand.add_body(pos=place)
            pad.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, -side, 0])
            _weigh(pad, mass, [1e-9] * 3)
            pad.add_geom(name=name, type=sphere, size=[1, 0, 0], **untouched)
            pair = spec.add_pair(geomname1=name, geomname2="bar", condim=3 if points > 1 else 4)
            # Sliding friction twice, then torsion: a length times the friction.
            pair.friction = [*[contact.friction] * 2, torsion * contact.friction, 1e-5, 1e-5]
            pair.solref = [2 * step, 1]
            motor = spec.add_actuator(target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            motor.set_to_motor()
    return spec.compile()


def _spec(scene: Scene, step: float, impratio: float) -> Any:
    """An empty world with the scene's gravity."""
    mujoco = load_mujoco()
    spec = mujoco.MjSpec()
    spec.option.timestep, spec.option.gravity = step, [0, 0, -scene.gravity]
    spec.option.cone, spec.option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, impratio
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_AUTORESET
    return spec


def _weigh(body: Any, mass: float, inertia: list[float]) -> None:
    """Give a body its mass and its moments of inertia about its own axes."""
    body.explicitinertial, body.mass, body.inertia = True, mass, inertia


def hand_inertia(scene: Scene) -> float:
    """Mass and moment of inertia [kg, kg m^2] of the driven hand, which no bar can push."""
    bar = scene.object
    return 1e4 * max(bar.mass, bar.inertia + bar.mass * scene.com_offset**2)


def landing_model(scene: Scene, step: float, restitution: float) -> Any:
    """The bar, free in space, and the scene's cup, hand and base column.

    The cup is fixed and stands on a floor; hand and column are mocap bodies, the hand the first.
    """
    mujoco, bar, damping = load_mujoco(), scene.object, damping_ratio(restitution)
    box, workspace = mujoco.mjtGeom.mjGEOM_BOX, scene.workspace
    spec = _spec(scene, step, impratio=10.0)
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_RK4
    spec.default.geom.friction = [FRICTION, 0.001, 0.0001]
    # The contact's spring has a time constant of 1 ms: 1 mm of penetration at 2 m/s.
    spec.default.geom.solref = [0.001 / damping, damping]
    if scene.cup is not None:
        _add_cup(spec, scene.cup, 2 * reach_of_bar(bar))
    if has_hand(scene):
        assert scene.arm is not None
        back, front = scene.arm.tool.palm_back, scene.arm.tool.palm_front
        size = [(back - front) / 2, 0.1, scene.arm.tool.palm_half_width]
        hand = spec.worldbody.add_body(name="hand", mocap=True)
        hand.add_geom(name="hand", type=box, size=size, pos=[-(back + front) / 2, 0, 0])
    if workspace is not None and workspace.column_radius and workspace.column_height:
        half, target = workspace.column_height / 2, scene.target
        # In the frame of a cup that moves, the column moves.
        place = [0, 0 if target is None else -target.lateral, half]
        column = spec.worldbody.add_body(name=COLUMN, mocap=True, pos=place)
        kind, size = mujoco.mjtGeom.mjGEOM_CYLINDER, [workspace.column_radius, half, 0]
        column.add_geom(name=COLUMN, type=kind, size=size)
    # A bar without a width is 1 mm thick.
    width = max(bar.width, 0.001)
    slender = float(np.clip(bar.mass * width**2 / 6, 1e-2 * bar.inertia, 2 * bar.inertia))
    flying = spec.worldbody.add_body(name="bar")
    flying.add_freejoint()
    _weigh(flying, bar.mass, [slender, bar.inertia, bar.inertia])
    size, middle = [bar.length / 2, width / 2, width / 2], bar.length / 2 - bar.com
    flying.add_geom(name="bar", type=box, size=size, pos=[middle, 0, 0])
    return spec.compile()


def _add_cup(spec: Any, cup: Cup, beyond: float) -> None:
    """A round wall of boxes on a plate, and the floor under it; `beyond` [m] is drawn only."""
    kinds, boxes = load_mujoco().mjtGeom, 48
    bottom, half, outer = cup.rim - cup.depth, cup.depth / 2, cup.radius + WALL

    def add(name: str, kind: Any, size: list[float], place: list[float], turn: float = 0.0) -> None:
        quat = [math.cos(turn / 2), 0.0, 0.0, math.sin(turn / 2)]
        spec.worldbody.add_geom(name=name, type=kind, size=size, pos=place, quat=quat)

    add("floor", kinds.mjGEOM_PLANE, [beyond, beyond, 1.0], [cup.x, 0.0, bottom - WALL])
    plate = [outer, outer, WALL / 2]
    add("cup bottom", kinds.mjGEOM_BOX, plate, [cup.x, 0.0, bottom - WALL / 2])
    size, away = [WALL / 2, outer * math.tan(math.pi / boxes), half], cup.radius + WALL / 2
    for k in range(boxes):
        turn = 2 * math.pi * k / boxes
        place = [cup.x + away * math.cos(turn), away * math.sin(turn), bottom + half]
        add(f"wall {k}", kinds.mjGEOM_BOX, size, place, turn)


def damping_ratio(restitution: float) -> float:
    """Damping ratio of a contact that a mass leaves with `restitution` times its speed.

    The mass leaves when the force is zero: exp(-2 d acos(d) / sqrt(1 - d^2)) for a ratio d, 0.135
    at critical damping; no ratio above 4, so that steps stay short enough.
    """
    from scipy.optimize import brentq

    def left(d: float) -> float:
        if abs(d - 1) < 1e-6:
            return math.exp(-2.0)
        angle = math.acos(d) if d < 1 else math.acosh(d)
        return math.exp(-2 * d * angle / math.sqrt(abs(1 - d * d)))

    low, high = 1e-4, 4.0
    if restitution <= left(high):
        return high
    return float(brentq(lambda d: left(d) - restitution, low, high, xtol=1e-15))


def has_hand(scene: Scene) -> bool:
    """Whether the bar can hit the hand's body in this scene."""
    workspace = scene.workspace
    return scene.arm is not None and workspace is not None and workspace.palm_clearance is not None
