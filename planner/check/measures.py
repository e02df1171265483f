"""What a check measures of a throw: use of the grip, and how near bar, hand and arm come to what.

The compiled core measures all of it in one call; without it the same is done here, slower. What
counts as broken, the scene's terms say.
"""

from __future__ import annotations

import ctypes
import math

import numpy as np

from ...core import Measured, SceneC, ThrowC, library
from ...models import Array, HandSamples, Path, Release, pivot_wrench
from ...problems import Scene
from .entry import cup_entries
from .geometry import (
    column_distance,
    column_of,
    held_bar,
    lowest_of_bar,
    palm_corners,
    palm_distance,
    reach_of_bar,
    tool_speeds,
)
from .mover import Mover, outline
from .sending import TICK
from .torques import core_torques, torque_limits, torques_of

#: Longest interval [s] between the instants at which sticking is checked before the opening.
CARRY_STEP = 0.002
#: Instants of the flight at which its surroundings are measured.
FLIGHT_SAMPLES = 400
#: Rounding [m] that breaks no clearance.
ROUNDING = 1e-6


def measured(
    scene: Scene, mover: Mover, path: Path, opening_time: float, release: Release, flight: float
) -> Measured:
    """What a throw's check is about; flight [s]: from detach to the landing."""
    core, moved, arm = library(), path.core, mover.kinematics.core
    if core is None or moved is None or arm is None:
        return _measured(scene, mover, path, opening_time, release, flight)
    com = np.ascontiguousarray(release.com)
    start = release.end
    throw = _throw(scene, mover, path, opening_time)
    throw.detach, throw.flight, throw.nodes = opening_time + release.times[-1], flight, com.shape[1]
    throw.com, throw.start = com.ctypes.data, start.ctypes.data
    found = Measured()
    core.measure(ctypes.byref(throw), ctypes.byref(found))
    if scene.cup is not None and scene.target is not None and scene.target.velocity is not None:
        found.cup = cup_clearance(scene, start, flight)
    return found


def cup_clearance(scene: Scene, detach: Array, flight: float) -> float:
    """Clearance [m] of the way into the cup, as it is seen from a cup that moves.

    detach (6,): CoM pose and twist. The scene's cup is where it is at the landing.
    """
    speed, seen = 0.0 if scene.target is None else scene.target.speed, detach.copy()
    seen[0] += speed * flight
    seen[3] -= speed
    return float(cup_entries(scene, seen[None], np.array([flight]))[0])


def grip_use(scene: Scene, mover: Mover, path: Path, opening_time: float) -> float:
    """Largest friction use (ellipsoid, 1 is the limit) from rest to the opening's start."""
    core, moved, arm = library(), path.core, mover.kinematics.core
    if core is None or moved is None or arm is None:
        joints = path.closely(opening_time, CARRY_STEP)
        force, torque = friction_use(scene, mover.hand(path).of(joints))
        return float(np.sqrt((force**2 + torque**2).max()))
    core.grip_use.restype = ctypes.c_double
    throw = _throw(scene, mover, path, opening_time)
    return float(core.grip_use(ctypes.byref(throw)))


def friction_use(scene: Scene, hand: HandSamples) -> tuple[Array, Array]:
    """Wrench that sticking needs, over the full grip's limits: (force share, torque share).

    For a held bar; shares above 1 slip.
    """
    theta, h = hand.pose[2] + scene.grasp.angle, scene.com_offset
    f_x, f_z, torque = pivot_wrench(
        scene.body, scene.gravity, hand.motion, hand.twist[2], h * np.cos(theta), h * np.sin(theta)
    )
    limit = scene.patch.force_limit(scene.gripper.profile().full)
    return np.hypot(f_x, f_z) / limit, np.abs(torque) / (limit * scene.patch.torsion_arm)


def _throw(scene: Scene, mover: Mover, path: Path, opening_time: float) -> ThrowC:
    """The throw as the compiled core takes it, its release and flight left out."""
    moved, arm, around = path.core, mover.kinematics.core, _numbers(scene)
    assert moved is not None and arm is not None
    at, torques = ctypes.addressof, core_torques(scene, mover)
    addresses = at(moved), at(arm), at(around), None if torques is None else at(torques)
    throw = ThrowC(*addresses, TICK, CARRY_STEP, opening_time)
    throw.parts = moved, arm, around, torques
    return throw


def _numbers(scene: Scene) -> SceneC:
    """What of the scene counts; widths of what it does not have are negative."""
    bar, body, patch, cup, arm = scene.object, scene.body, scene.patch, scene.cup, scene.arm
    limit = patch.force_limit(scene.gripper.profile().full)
    workspace, column = scene.workspace, column_of(scene)
    palm = (0.0, 0.0, -1.0)
    if arm is not None:
        palm = arm.tool.palm_back, arm.tool.palm_front, arm.tool.palm_half_width
    clearance = None if workspace is None or arm is None else workspace.palm_clearance
    mouth = (0.0, 0.0, -1.0, 0.0)
    if cup is not None:
        # The bar is as thick as it is wide, so a round cup is narrower off its middle.
        half = math.sqrt(cup.radius**2 - (bar.width / 2) ** 2)
        mouth = cup.x, cup.rim, half, cup.insertion
    return SceneC(
        *(scene.gravity, body.mass, body.grasp_inertia, body.com_offset, scene.grasp.angle),
        *(limit, limit * patch.torsion_arm),
        *(bar.com, bar.length - bar.com, bar.width / 2),
        *((-1.0, 0.0) if column is None else column),
        *palm,
        -1.0 if clearance is None else clearance,
        -1.0 if arm is None or scene.tool_speed is None else arm.tool.tcp,
        *mouth,
    )


def _measured(
    scene: Scene, mover: Mover, path: Path, opening_time: float, release: Release, flight: float
) -> Measured:
    """The same without the compiled core."""
    bar, column, arm, workspace = scene.object, column_of(scene), scene.arm, scene.workspace
    times = np.arange(0.0, path.end + TICK, TICK)
    joints = path.at(times)
    hand, lowest = outline(mover, joints.pose)
    if arm is not None:
        lowest = np.minimum(lowest, palm_corners(arm.tool, hand)[1].min(axis=1))
    held = np.hstack([held_bar(scene, hand[:, times < opening_time]), release.com])
    since = np.linspace(0.0, flight, FLIGHT_SAMPLES)
    state = release.detach.after(since, scene.gravity)
    flown = np.array([state.x, state.z, state.theta])
    column_held = column_flown = palm = palm_time = cup = math.inf
    if column is not None:
        column_held, column_flown = (
            float(column_distance(bar, poses, *column).min()) for poses in (held, flown)
        )
    if arm is not None and workspace is not None and workspace.palm_clearance is not None:
        tool, clearance = arm.tool, workspace.palm_clearance
        hand = mover.hand(path).at(opening_time + release.times[-1] + since).pose
        far = max(abs(tool.palm_back), abs(tool.palm_front))
        reach = reach_of_bar(bar) + math.hypot(far, tool.palm_half_width) + clearance
        near = np.hypot(*(flown[:2] - hand[:2])) < reach
        distance = palm_distance(bar, tool, flown[:, near], hand[:, near])
        palm = max(float(distance.min(initial=math.inf)), 0.0)
        palm_time = float(since[near][distance < clearance - ROUNDING].min(initial=math.inf))
    if scene.cup is not None:
        cup = cup_clearance(scene, release.end, flight)
    speed = 0.0
    if arm is not None and scene.tool_speed is not None:
        speed = tool_speeds(arm.tool, *mover.motion(*joints)[:2]).max()
    torque = 0.0
    if torque_limits(scene) is not None:
        torque = torques_of(scene, mover, path, opening_time).use.max()
    grip, lowest_held = grip_use(scene, mover, path, opening_time), lowest_of_bar(bar, held).min()
    columns, near = (column_held, column_flown), (palm, palm_time, cup)
    return Measured(grip, lowest.min(), lowest_held, *columns, *near, speed, torque)
