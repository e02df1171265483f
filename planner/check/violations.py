"""What a throw breaks of its scene: grip, cup, landing bounds, workspace."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import PlanarArm, PlanarHand
from ...problems import Scene
from ..compile import MappedKernel
from .check import Thrown
from .geometry import (
    column_of,
    column_room,
    cup_entry,
    held_bar,
    lowest_of_bar,
    palm_corners,
    palm_distance,
    reach_of_bar,
)
from .motion import TICK, Motion
from .mover import Mover
from .rollout import hand_samples
from .torque import torque_use

Array = npt.NDArray[np.float64]

#: Rows that seldom decide, and so come into the NLP only after the check has seen that they
#: do: of what is carried on its way, of the flying bar beside hand and cup, of its way past
#: the base column, of the bar that falls back.
Guard = Literal["carry", "flight", "passing", "return"]
#: Of what the check has seen too little room.
Tight = Literal["held", "cup", "torque", "passing"]
#: Times after detach [s] at which the NLP keeps the bar off the hand's body.
PALM_TIMES = (0.01, 0.02, 0.03, 0.045, 0.06, 0.075, 0.09, 0.11, 0.13, 0.15, 0.18, 0.21, 0.25)
#: Flight samples for the cup and the workspace.
FLIGHT_SAMPLES = 400


@dataclass(frozen=True)
class Violation:
    """What is broken, in words; what the NLP can do about it beyond what it does at first.

    guard: which of its rows that seldom decide are against this, "" for none; tight, depth
    [m; share of a limit]: of what there is too little room, and how much is missing; between:
    every NLP has rows against it, at its nodes.
    """

    words: str
    guard: Guard | Literal[""] = ""
    tight: Tight | Literal[""] = ""
    depth: float = 0.0
    between: bool = False


def scene_violations(
    scene: Scene, mover: Mover, motion: Motion, end: float, opening_time: float, thrown: Thrown
) -> list[Violation]:
    """What the throw breaks of grip, cup, landing bounds and workspace.

    `end` [s]: when the motion comes to rest. Empty if it breaks nothing.
    """
    found = []
    if thrown.grip_use > 1.0:
        found.append(
            Violation(f"slip before the opening (grip use {thrown.grip_use:.2f})", guard="carry")
        )
    if thrown.release.trouble:
        found.append(Violation(thrown.release.trouble))
    if not math.isfinite(thrown.landing.flight_time):
        return [*found, Violation("the object never comes down to the target's height")]
    if scene.cup is not None:
        found += _cup_violations(scene, thrown)
    if scene.landing is not None:
        found += _landing_violations(scene, thrown)
    if scene.torque is not None:
        found += _torque_violations(scene, mover, motion, end, opening_time)
    if scene.workspace is not None:
        found += _workspace_violations(scene, mover, motion, end, opening_time, thrown)
    return found


def flight_poses(scene: Scene, thrown: Thrown, times: Array) -> Array:
    """CoM poses (3, N) at `times` after detach."""
    state = thrown.release.detach.after(times, scene.gravity)
    return np.array([state.x, state.z, state.theta])


def _cup_violations(scene: Scene, thrown: Thrown) -> list[Violation]:
    cup = scene.cup
    assert cup is not None
    # On beyond the landing: the lower end goes on into the cup.
    until = thrown.landing.flight_time + 0.3
    entry = cup_entry(scene, cup, flight_poses(scene, thrown, np.linspace(0.0, until, 2000)))
    if entry.entered < cup.insertion - 1e-4:
        return [Violation("cup: the bar does not reach the asked depth")]
    if entry.clearance < cup.clearance - 1e-5:
        words = f"cup clearance {1e3 * entry.clearance:.1f} mm"
        return [Violation(words, "flight", "cup", cup.clearance - entry.clearance)]
    return []


def _landing_violations(scene: Scene, thrown: Thrown) -> list[Violation]:
    bounds, state = scene.landing, thrown.landing.state
    assert bounds is not None
    speed, found = math.hypot(state.v_x, state.v_z), []
    if speed < bounds.speed_min:
        found.append(Violation(f"landing speed {speed:.2f} m/s below {bounds.speed_min:g}"))
    if bounds.speed_max is not None and speed > bounds.speed_max:
        found.append(Violation(f"landing speed {speed:.2f} m/s above {bounds.speed_max:g}"))
    if bounds.rate_max is not None and abs(state.omega) > bounds.rate_max:
        found.append(
            Violation(f"landing rate {abs(state.omega):.2f} rad/s above {bounds.rate_max:g}")
        )
    return found


def _torque_violations(
    scene: Scene, mover: Mover, motion: Motion, end: float, opening_time: float
) -> list[Violation]:
    times, use = torque_use(scene, mover, motion, end, opening_time)
    found = []
    for name, share in zip(mover.joints, use.T, strict=True):
        if share.max() > 1.0:
            worst, when = 100 * share.max(), 1e3 * times[share.argmax()]
            words = f"torque of {name}: {worst:.0f} % of its limit at {when:.0f} ms"
            found.append(Violation(words, tight="torque", depth=float(share.max()) - 1.0))
    return found


def _workspace_violations(
    scene: Scene, mover: Mover, motion: Motion, end: float, opening_time: float, thrown: Thrown
) -> list[Violation]:
    workspace, bar = scene.workspace, scene.object
    assert workspace is not None
    times = np.arange(0.0, end + TICK, TICK)
    q = motion.at(times)[0].T
    pose, lowest_joint = outline_kernel(mover.motion, mover.kinematics)(q)
    held = np.hstack([held_bar(scene, pose[times < opening_time].T), thrown.release.com])
    detach = opening_time + thrown.release.times[-1]
    flight_times = np.linspace(0.0, thrown.landing.flight_time, FLIGHT_SAMPLES)
    flying = flight_poses(scene, thrown, flight_times)
    found = []
    if workspace.floor is not None:
        arm = min(lowest_joint.min(), pose[:, 1].min())
        if scene.arm is not None:
            arm = min(arm, palm_corners(scene.arm.tool, pose.T)[1].min())
        depth = float(workspace.floor - min(lowest_of_bar(bar, held).min(), arm))
        if depth > 1e-6:
            words, only_bar = f"floor: {1e3 * depth:.0f} mm below it", workspace.floor - arm <= 1e-6
            found.append(Violation(words, "carry", "held", depth, bool(only_bar)))
    column = column_of(scene)
    if column is not None:
        carried, flown = (-column_room(bar, poses, *column).min() for poses in (held, flying))
        if max(carried, flown) > 1e-6:
            words = "base column: the bar touches it"
            if carried > flown:
                found.append(Violation(words, "carry", "held", float(carried), True))
            else:
                found.append(Violation(words, "passing", "passing", float(flown)))
    if workspace.palm_clearance is not None and scene.arm is not None:
        tool, clearance = scene.arm.tool, workspace.palm_clearance
        hand = hand_samples(mover, motion, detach + flight_times).pose
        reach = reach_of_bar(bar) + math.hypot(tool.palm_back, tool.palm_half_width)
        near = np.hypot(*(flying[:2] - hand[:2])) < reach + clearance
        room = palm_distance(bar, tool, flying[:, near], hand[:, near])
        if room.min(initial=np.inf) < clearance - 1e-6:
            words = f"palm: the bar comes as near as {1e3 * room.min():.0f} mm"
            late = flight_times[near][room < clearance - 1e-6][0] > PALM_TIMES[-1]
            found.append(Violation(words, "return" if late else "flight"))
    return found


@lru_cache(maxsize=16)
def outline_kernel(motion: ca.Function, kinematics: PlanarArm | PlanarHand) -> MappedKernel:
    """q -> hand pose (3,) and the height of the lowest joint beyond the shoulder."""
    q = ca.SX.sym("q", kinematics.coordinates)
    zero = ca.SX.zeros(kinematics.coordinates)
    pose = motion(q, zero, zero)[0]
    joints = kinematics.points(q)[1, 2:] if isinstance(kinematics, PlanarArm) else pose[1]
    return MappedKernel(ca.Function("outline", [q], [pose, ca.mmin(joints)]))
