"""The runs of a replay in MuJoCo: hand and pads release the bar, it flies, it comes to rest."""

from __future__ import annotations

import importlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import sticking_state
from ...problems import Cup, InputError, Scene
from ..check import SentThrow, hand_samples
from .replay_model import hand_inertia, has_hand, landing_model, pads_of, release_model

Array = npt.NDArray[np.float64]

#: The replay begins this long before the opening, the bar held [s].
LEAD = 0.05
#: Least and most steps of the opening, and the most before it.
STEPS, LEAD_STEPS = (200, 50_000), 20_000
#: Steps until the pads rest on the bar, before anything moves.
SETTLING = 200
#: Most steps of the flight alone, and how long after landing rest is waited for [s].
FLIGHT_STEPS, PATIENCE = 20_000, 4.0
#: At rest: slower than this [m/s, rad/s] for so long [s].
STILL, STILL_TURN, STILL_FOR = 0.005, 0.05, 0.1
#: Room [m] for contacts that give way: what stands on the bottom is not below it.
SUNK = 0.002


@dataclass(frozen=True)
class Flown:
    """The bar over `times` (N,) [s]: its CoM (N, 3) and axis (N, 3), grasped end to CoM.

    x, y, z: the throw's plane is x, z. touched: what it met, in that order; the rest as in
    `replay.Rest`.
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


def release_run(throw: SentThrow, step: float, points: int) -> tuple[Array, Array]:
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
    hand = hand_samples(throw.mover, throw.motion, times)
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


def free_flight(scene: Scene, detach: Array, start: float, duration: float, step: float) -> Flown:
    """The flight without anything to meet."""
    mujoco = load_mujoco()
    count = int(np.clip(math.ceil(duration / step), 100, FLIGHT_STEPS))
    model, data = _at_detach(scene, detach, duration / count)
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    rows = np.empty((count + 1, 6))
    for k in range(count + 1):
        rows[k] = _row(data)
        mujoco.mj_step(model, data)
    return Flown(start + duration / count * np.arange(count + 1.0), rows[:, :3], rows[:, 3:])


def run_to_rest(
    throw: SentThrow, detach: Array, start: float, landing: float, step: float, restitution: float
) -> Flown:
    """The flight among what the scene has, until `landing` [s], with a cup until it rests."""
    mujoco = load_mujoco()
    scene, cup = throw.scene, throw.scene.cup
    model, data = _at_detach(scene, detach, step, restitution)
    end = landing if cup is None else landing + PATIENCE
    count = max(math.ceil((end - start) / step), 1)
    times = start + step * np.arange(count + 1.0)
    hand = hand_samples(throw.mover, throw.samples, times).pose.T if has_hand(scene) else None
    names = [model.geom(i).name for i in range(model.ngeom)]
    rows, touched = np.empty((count + 1, 6)), dict[str, None]()
    entered, touched_rim, still = False, False, 0
    for k in range(count + 1):
        rows[k] = _row(data)
        if k == count:
            break
        if hand is not None:
            _place_hand(data, hand[k])
        mujoco.mj_step(model, data)
        if cup is not None:
            entered = entered or _enters(scene, cup, rows[k])
        for geom in {int(g) for g in data.contact.geom.ravel()} if data.ncon else ():
            if names[geom] != "bar":
                wall = names[geom].startswith("wall")
                touched_rim |= wall and not entered
                touched["cup wall" if wall else names[geom]] = None
        speed, turning = np.linalg.norm(data.qvel[:3]), np.linalg.norm(data.qvel[3:])
        still = still + 1 if speed < STILL and turning < STILL_TURN else 0
        if cup is not None and still * step >= STILL_FOR and times[k] > landing:
            break
    seen = slice(k + 1)
    at_rest = still * step >= STILL_FOR
    com, axis = rows[seen, :3], rows[seen, 3:]
    return Flown(times[seen], com, axis, tuple(touched), entered, touched_rim, at_rest)


def lowest(scene: Scene, com: Array, axis: Array) -> Array:
    """Height [m] (N,) of the bar's lowest point, for CoM and axis (N, 3)."""
    bar = scene.object
    ends = com[:, 2] + axis[:, 2] * np.array([[-bar.com], [bar.length - bar.com]])
    beside = bar.width / 2 * np.hypot(axis[:, 0], axis[:, 1])
    return np.asarray(ends.min(axis=0) - beside)


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


def _place_hand(data: Any, pose: Array) -> None:
    """The mocap body at a hand pose (3,)."""
    data.mocap_pos[0] = pose[0], 0.0, pose[1]
    data.mocap_quat[0] = math.cos(pose[2] / 2), 0.0, -math.sin(pose[2] / 2), 0.0
