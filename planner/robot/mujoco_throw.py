"""The bar in MuJoCo: pads let it go, it flies, it falls into a cup. MJCF models and their runs."""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import sticking_state
from ...problems import Cup, InputError, Scene
from ..check import Throw, reach_of_bar

Array = npt.NDArray[np.float64]

#: Penetration [m] that the pads have at most (a pad is a sphere of 1 m on a plate 2 m thick), and
#: least mass [kg] of all points of a pad together.
PRESSED, PAD_MASS = 0.1, 1e-5
#: Inertia of the driven hand over that of the bar, which cannot push the hand; and how much stiffer
#: friction is than the pressing (up to 1e6 points under load creep).
HAND_OVER_BAR, IMPRATIO = 1e4, 1e9

#: Of the bar against cup, floor, hand and column: friction, and 1/s over the angular
#: frequency of a contact's spring, which is pressed in by 1 mm at 2 m/s.
FRICTION, CONTACT_TIME = 0.4, 0.001
#: Boxes of the cup's wall, and its thickness [m].
WALL_BOXES, WALL = 48, 0.005
#: Thickness of a bar whose width is not given, and half depth of the hand's body [m].
THIN, HAND_DEPTH = 0.001, 0.1
#: The replay begins this long before the opening, the bar held [s].
LEAD = 0.05
#: Least and most steps of the opening, the most before it, and those before anything moves,
#: until the pads rest on the bar.
STEPS, LEAD_STEPS, SETTLING = (200, 50_000), 20_000, 200
#: Most steps of the flight alone, and how long after landing rest is waited for [s].
FLIGHT_STEPS, PATIENCE = 20_000, 4.0
#: At rest: slower than this [m/s, rad/s] for so long [s].
STILL, STILL_TURN, STILL_FOR = 0.005, 0.05, 0.1
#: Contacts give way by as much [m]: what stands on the bottom is not below it.
SUNK = 0.002

RELEASE = """
<mujoco>
  <option timestep="{step}" gravity="0 0 -{gravity}" cone="elliptic" impratio="{impratio}"
          tolerance="1e-14" jacobian="dense"><flag autoreset="disable"/></option>
  <worldbody>
    <body name="hand">
      <joint type="slide" axis="1 0 0" armature="{rotor}"/>
      <joint type="slide" axis="0 0 1" armature="{rotor}"/>
      <joint type="hinge" axis="0 -1 0" armature="{rotor}"/>
      <inertial pos="0 0 0" mass="1e-3" diaginertia="1e-6 1e-6 1e-6"/>
      {pads}
    </body>
    <body name="bar">
      <joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="0 0 1"/>
      <joint type="hinge" axis="0 -1 0"/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>
      <geom name="bar" type="box" size="{reach} 1 {reach}" contype="0" conaffinity="0"/>
    </body>
  </worldbody>
  <contact>{pairs}</contact>
  <actuator>{motors}</actuator>
</mujoco>
"""
PAD = """
<body pos="{x} {y} {z}">
  <joint name="{name}" type="slide" axis="0 {inwards} 0"/>
  <inertial pos="0 0 0" mass="{mass}" diaginertia="1e-9 1e-9 1e-9"/>
  <geom name="{name}" type="sphere" size="1" contype="0" conaffinity="0"/>
</body>
"""
# Sliding friction twice, then torsion: a length times the friction.
PAIR = """
<pair geom1="{name}" geom2="bar" condim="{condim}" solref="{time_constant} 1"
      friction="{friction} {friction} {torsion} 1e-5 1e-5"/>
"""

LANDING = """
<mujoco>
  <option timestep="{step}" gravity="0 0 -{gravity}" cone="elliptic" impratio="10"
          integrator="RK4"><flag autoreset="disable"/></option>
  <default><geom friction="{friction} 0.001 0.0001" solref="{time_constant} {damping}"/></default>
  <worldbody>
    {surroundings}
    <body name="bar">
      <freejoint/>
      <inertial pos="0 0 0" mass="{mass}" diaginertia="{along} {inertia} {inertia}"/>
      <geom name="bar" type="box" size="{half_length} {half_width} {half_width}"
            pos="{middle} 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


@dataclass(frozen=True)
class Flight:
    """The bar over `times` (N,) [s]: its CoM (N, 3) and axis (N, 3), grasped end to CoM.

    x, y, z: the throw's plane is x, z. touched: what it met, in that order; the rest as in
    `Rest`.
    """

    times: Array
    com: Array
    axis: Array
    touched: tuple[str, ...] = ()
    entered: bool = False
    touched_rim: bool = False
    at_rest: bool = False


def load_mujoco() -> Any:
    """The module; InputError if it is not there."""
    try:
        return importlib.import_module("mujoco")
    except ImportError:
        raise InputError("replay: needs MuJoCo: pip install 'throwplan[mujoco]'") from None


def release_run(throw: Throw, step: float, points: int) -> tuple[Array, Array]:
    """Times (N,) [s] from the opening to its end, and the bar's pose and twist (N, 6).

    The hand follows the sent motion as driven joints do; the bar starts in its grip `LEAD`
    before the opening and is held by friction alone from then on.
    """
    mujoco = load_mujoco()
    scene, profile = throw.scene, throw.scene.gripper.profile()
    steps = int(np.clip(round(profile.opening / step), *STEPS))
    step = profile.opening / steps
    lead = min(round(min(LEAD, throw.opening_time) / step), LEAD_STEPS)
    times = throw.opening_time + step * np.arange(-lead, steps + 1.0)
    hand = throw.hand(times)
    pose, twist = hand.pose.T, hand.twist.T
    drive = hand_inertia(scene) * np.diff(twist, axis=0) / step
    share = scene.patch.faces / pads_of(scene) / points
    force = share * profile.force(times[:-1] + step / 2 - throw.opening_time)

    model = mujoco.MjModel.from_xml_string(release_model(scene, step, points))
    data = mujoco.MjData(model)
    qpos, qvel, bar = data.qpos, data.qvel, slice(model.nq - 3, None)
    start = sticking_state(pose[0], twist[0], scene.grasp.angle, scene.com_offset)
    data.ctrl[:] = force[0]
    for _ in range(SETTLING):
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


def free_flight(scene: Scene, detach: Array, start: float, duration: float, step: float) -> Flight:
    """The flight without anything to meet."""
    mujoco = load_mujoco()
    count = int(np.clip(math.ceil(duration / step), 100, FLIGHT_STEPS))
    model, data = _at_detach(scene, detach, duration / count)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    rows = np.empty((count + 1, 6))
    for k in range(count + 1):
        rows[k] = _row(data)
        mujoco.mj_step(model, data)
    return Flight(start + duration / count * np.arange(count + 1.0), rows[:, :3], rows[:, 3:])


def run_to_rest(
    throw: Throw, detach: Array, start: float, landing: float, step: float, restitution: float
) -> Flight:
    """The flight among what the scene has, until `landing` [s], with a cup until it rests."""
    mujoco = load_mujoco()
    scene, cup = throw.scene, throw.scene.cup
    model, data = _at_detach(scene, detach, step, restitution)
    end = landing if cup is None else landing + PATIENCE
    count = max(math.ceil((end - start) / step), 1)
    times = start + step * np.arange(count + 1.0)
    hand = throw.mover.hand(throw.to_rest).at(times).pose.T if has_hand(scene) else None
    names = [model.geom(i).name for i in range(model.ngeom)]
    names = ["cup wall" if name.startswith("wall") else name for name in names]
    rows, touched = np.empty((count + 1, 6)), dict[str, None]()
    entered, touched_rim, still = False, False, 0
    for k in range(count + 1):
        rows[k] = _row(data)
        if k == count:
            break
        if hand is not None:
            x, z, theta = hand[k]
            data.mocap_pos[0] = x, 0.0, z
            data.mocap_quat[0] = math.cos(theta / 2), 0.0, -math.sin(theta / 2), 0.0
        mujoco.mj_step(model, data)
        if cup is not None:
            entered = entered or _enters(scene, cup, rows[k])
        met = {names[geom] for geom in data.contact.geom.ravel()} if data.ncon else set()
        touched_rim |= "cup wall" in met and not entered
        touched |= dict.fromkeys(sorted(met - {"bar"}))
        speed, turning = np.linalg.norm(data.qvel[:3]), np.linalg.norm(data.qvel[3:])
        still = still + 1 if speed < STILL and turning < STILL_TURN else 0
        if cup is not None and still * step >= STILL_FOR and times[k] > landing:
            break
    com, axis, at_rest = rows[: k + 1, :3], rows[: k + 1, 3:], still * step >= STILL_FOR
    return Flight(times[: k + 1], com, axis, tuple(touched), entered, touched_rim, at_rest)


def lowest(scene: Scene, com: Array, axis: Array) -> Array:
    """Height [m] (N,) of the bar's lowest point, for CoM and axis (N, 3)."""
    bar = scene.object
    ends = com[:, 2] + axis[:, 2] * np.array([[-bar.com], [bar.length - bar.com]])
    corner = bar.width / 2 * np.hypot(axis[:, 0], axis[:, 1])
    return np.asarray(ends.min(axis=0) - corner)


def is_in(scene: Scene, cup: Cup, com: Array, axis: Array) -> bool:
    """Whether the CoM is inside the cup's radius and the lower end in the cup, all the time."""
    low = lowest(scene, com, axis)
    inside = np.hypot(com[:, 0] - cup.x, com[:, 1]) < cup.radius
    return bool((inside & (cup.rim - cup.depth - SUNK <= low) & (low < cup.rim)).all())


def _enters(scene: Scene, cup: Cup, row: Array) -> bool:
    """Whether the lower end is in the cup, `insertion` below the rim; row (6,): CoM and axis."""
    depth = cup.rim - float(lowest(scene, row[None, :3], row[None, 3:])[0])
    along = scene.object.length - scene.object.com if row[5] < 0 else -scene.object.com
    x, y = row[:2] + along * row[3:5]
    return depth >= cup.insertion and math.hypot(x - cup.x, y) < cup.radius


def _at_detach(
    scene: Scene, detach: Array, step: float, restitution: float = 0.0
) -> tuple[Any, Any]:
    """Model and data of the flight, the bar at its pose and twist (6,) at detach."""
    mujoco = load_mujoco()
    model = mujoco.MjModel.from_xml_string(landing_model(scene, step, restitution))
    data = mujoco.MjData(model)
    x, z, theta, v_x, v_z, omega = detach
    data.qpos[:] = x, 0.0, z, math.cos(theta / 2), 0.0, -math.sin(theta / 2), 0.0
    data.qvel[:] = v_x, 0.0, v_z, 0.0, -omega, 0.0
    return model, data


def _row(data: Any) -> Array:
    """CoM and axis (6,)."""
    w, a, b, c = data.qpos[3:]
    axis = 1 - 2 * (b * b + c * c), 2 * (a * b + w * c), 2 * (a * c - w * b)
    return np.array([*data.qpos[:3], *axis])


def pads_of(scene: Scene) -> int:
    """Pads in the model: more than two faces are pressed on as two."""
    return min(int(scene.contact.faces), 2)


def release_model(scene: Scene, step: float, points: int) -> str:
    """The hand, its pads and the bar, which moves in the throw's plane only.

    points: contact points of a pad, on a ring of radius c r_p, so that they hold the
    patch's torque; each is pressed on by a motor of its own, one after another of each pad.
    One point: with torsional friction instead, the ellipsoid of the limit surface. Pads
    have no size otherwise: the bar cannot slip out of them.
    """
    contact, bar = scene.patch, scene.object
    radius = contact.torsion_arm if points > 1 else 0.0
    full = scene.gripper.profile().full
    mass = max(PAD_MASS, full * (2 * step) ** 2 / PRESSED) / points
    pads, names = [], []
    for side in (1, -1)[: pads_of(scene)]:
        for k in range(points):
            angle = 2 * math.pi * k / points
            name = f"pad{side}_{k}"
            x, z = radius * math.cos(angle), radius * math.sin(angle)
            pads.append(PAD.format(name=name, x=x, y=2 * side, z=z, inwards=-side, mass=mass))
            names.append(name)
    pair = {
        "condim": 3 if points > 1 else 4,
        "time_constant": 2 * step,
        "friction": contact.friction,
        "torsion": contact.torsion_arm * contact.friction,
    }
    return RELEASE.format(
        step=step,
        gravity=scene.gravity,
        impratio=IMPRATIO,
        rotor=hand_inertia(scene),
        mass=bar.mass,
        inertia=bar.inertia,
        reach=10 * bar.length + 1,
        pads="".join(pads),
        pairs="".join(PAIR.format(name=name, **pair) for name in names),
        motors="".join(f'<motor joint="{name}"/>' for name in names),
    )


def hand_inertia(scene: Scene) -> float:
    """Mass and moment of inertia [kg, kg m^2] of the driven hand."""
    bar = scene.object
    return HAND_OVER_BAR * max(bar.mass, bar.inertia + bar.mass * scene.com_offset**2)


def landing_model(scene: Scene, step: float, restitution: float) -> str:
    """The bar, free in space, and what the scene has for it to meet.

    The cup is fixed and stands on a floor; the hand's body is a mocap body "hand".
    """
    bar, damping = scene.object, damping_ratio(restitution)
    width = max(bar.width, THIN)
    along = float(np.clip(bar.mass * width**2 / 6, 1e-2 * bar.inertia, 2 * bar.inertia))
    return LANDING.format(
        step=step,
        gravity=scene.gravity,
        friction=FRICTION,
        time_constant=CONTACT_TIME / damping,
        damping=damping,
        surroundings=_surroundings(scene),
        mass=bar.mass,
        inertia=bar.inertia,
        along=along,
        half_length=bar.length / 2,
        half_width=width / 2,
        middle=bar.length / 2 - bar.com,
    )


def damping_ratio(restitution: float) -> float:
    """Of a spring and damper that a mass leaves with `restitution` times its speed.

    It leaves when the force is zero: exp(-2 d acos(d) / sqrt(1 - d^2)) for a ratio d, 0.135
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
    """Whether the scene counts the hand's body as something to be hit."""
    workspace = scene.workspace
    return scene.arm is not None and workspace is not None and workspace.palm_clearance is not None


def _surroundings(scene: Scene) -> str:
    """Cup and floor, base column, hand's body: those that the scene has."""
    parts = []
    if scene.cup is not None:
        parts.append(_cup(scene.cup, 2 * reach_of_bar(scene.object)))
    workspace = scene.workspace
    if workspace is not None and workspace.column_radius and workspace.column_height:
        half = workspace.column_height / 2
        size = f'size="{workspace.column_radius} {half}"'
        parts.append(f'<geom name="base column" type="cylinder" {size} pos="0 0 {half}"/>')
    if has_hand(scene):
        assert scene.arm is not None
        tool = scene.arm.tool
        half = (tool.palm_back - tool.palm_front) / 2
        middle = (tool.palm_back + tool.palm_front) / 2
        size = f'size="{half} {HAND_DEPTH} {tool.palm_half_width}"'
        geom = f'<geom name="hand" type="box" {size} pos="{-middle} 0 0"/>'
        parts.append(f'<body name="hand" mocap="true">{geom}</body>')
    return "".join(parts)


def _cup(cup: Cup, beyond: float) -> str:
    """A round wall of boxes on a plate, and the floor under it; `beyond` [m] is drawn only."""
    bottom, half = cup.rim - cup.depth, cup.depth / 2
    outer = cup.radius + WALL
    wide = outer * math.tan(math.pi / WALL_BOXES)
    parts = [
        f'<geom name="floor" type="plane" size="{beyond} {beyond} 1" '
        f'pos="{cup.x} 0 {bottom - WALL}"/>',
        f'<geom name="cup bottom" type="box" size="{outer} {outer} {WALL / 2}" '
        f'pos="{cup.x} 0 {bottom - WALL / 2}"/>',
    ]
    for k in range(WALL_BOXES):
        turn = 2 * math.pi * k / WALL_BOXES
        away = cup.radius + WALL / 2
        x, y = cup.x + away * math.cos(turn), away * math.sin(turn)
        parts.append(
            f'<geom name="wall {k}" type="box" size="{WALL / 2} {wide} {half}" '
            f'pos="{x} {y} {bottom + half}" euler="0 0 {math.degrees(turn)}"/>'
        )
    return "".join(parts)
