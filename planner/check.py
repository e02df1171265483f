"""Whether a motion throws where it should and breaks nothing: the promise behind `solved`."""

from __future__ import annotations

import math
from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt

from ..models.hand import PlanarArm
from ..models.release import Release
from ..problems.scene import Pose, Scene
from .geometry import bar_outline, column_distance, cup_entry, palm_corners, palm_distance
from .motion import TICK, Motion, SampledMotion
from .mover import Limits, Mover
from .rollout import (
    LIMIT_SURFACE,
    SLIDING_PIVOT,
    Landing,
    MoverTrack,
    case_of,
    hand_samples,
    landing,
    slip_while_carrying,
)

Array = npt.NDArray[np.float64]

#: Flight samples for the cup and the workspace.
FLIGHT_SAMPLES = 400


@dataclass(frozen=True)
class Thrown:
    """A motion thrown by the non-smooth sliding pivot.

    grip_use: largest friction use before the opening (1 is the limit).
    """

    release: Release
    landing: Landing
    grip_use: float

    def miss(self, target: Pose) -> tuple[float, float]:
        """(Δx [m], Δtheta [rad]) to the target; 0 where it leaves theta open."""
        angle = 0.0 if target.theta is None else self.landing.theta - target.theta
        return self.landing.x - target.plane_x, angle


def throw(scene: Scene, mover: Mover, motion: Motion, opening_time: float, height: float) -> Thrown:
    """The exact throw of `motion`: held from rest, opened at `opening_time`, flown to `height`."""
    use = slip_while_carrying(scene, mover, motion, opening_time)
    release = SLIDING_PIVOT.release(case_of(scene, MoverTrack(mover, motion, opening_time)))
    return Thrown(release, landing(release, height, scene.gravity), use)


def limit_surface_landing(
    scene: Scene, mover: Mover, motion: Motion, opening_time: float, height: float
) -> Landing:
    """The same motion's landing by the time-stepping limit surface."""
    release = LIMIT_SURFACE.release(case_of(scene, MoverTrack(mover, motion, opening_time)))
    return landing(release, height, scene.gravity)


def broken_limits(limits: Limits, names: tuple[str, ...], sent: SampledMotion) -> list[str]:
    """Limits that any sample, or any difference of samples, breaks."""
    broken = []
    rate, acceleration = np.diff(sent.q, axis=0) / TICK, np.diff(sent.dq, axis=0) / TICK
    checks = [
        ("position", np.maximum(limits.q_min - sent.q, sent.q - limits.q_max), 0 * limits.dq),
        ("velocity", np.abs(sent.dq), limits.dq),
        ("velocity", np.abs(rate), limits.dq),
        ("acceleration", np.abs(sent.ddq), limits.ddq),
        ("acceleration", np.abs(acceleration), limits.ddq),
    ]
    if limits.jerk is not None:
        checks.append(("jerk", np.abs(np.diff(sent.ddq, axis=0) / TICK), limits.jerk))
    for kind, values, limit in checks:
        # Room for rounding in the last digits only.
        for i in np.flatnonzero((values > limit + 1e-7 * np.maximum(limit, 1.0)).any(axis=0)):
            broken.append(f"{names[i]} {kind}")
    return list(dict.fromkeys(broken))


def scene_violations(
    scene: Scene, mover: Mover, motion: Motion, end: float, opening_time: float, thrown: Thrown
) -> list[str]:
    """What the throw breaks of grip, cup, landing bounds and workspace, in words.

    `end` [s]: when the motion comes to rest. Empty if it breaks nothing.
    """
    found = []
    if thrown.grip_use > 1.0:
        found.append(f"slip before the opening (grip use {thrown.grip_use:.2f})")
    if thrown.release.trouble:
        found.append(thrown.release.trouble)
    if not math.isfinite(thrown.landing.flight_time):
        return [*found, "the object never comes down to the target's height"]
    if scene.cup is not None:
        found += _cup_violations(scene, thrown)
    if scene.landing is not None:
        found += _landing_violations(scene, thrown)
    if scene.workspace is not None:
        found += _workspace_violations(scene, mover, motion, end, opening_time, thrown)
    return found


def flight_poses(scene: Scene, thrown: Thrown, times: Array) -> Array:
    """CoM poses (3, N) at `times` after detach."""
    state = thrown.release.detach.after(times, scene.gravity)
    return np.array([state.x, state.z, state.theta])


def _cup_violations(scene: Scene, thrown: Thrown) -> list[str]:
    cup = scene.cup
    assert cup is not None
    # On beyond the landing: the lower end goes on into the cup.
    until = thrown.landing.flight_time + 0.3
    entry = cup_entry(scene, cup, flight_poses(scene, thrown, np.linspace(0.0, until, 2000)))
    if entry.entered < cup.insertion - 1e-4:
        return ["cup: the bar does not reach the asked depth"]
    if entry.clearance < cup.clearance - 1e-5:
        return [f"cup clearance {1e3 * entry.clearance:.1f} mm"]
    return []


def _landing_violations(scene: Scene, thrown: Thrown) -> list[str]:
    bounds, state = scene.landing, thrown.landing.state
    assert bounds is not None
    speed, found = math.hypot(state.v_x, state.v_z), []
    if speed < bounds.speed_min:
        found.append(f"landing speed {speed:.2f} m/s below {bounds.speed_min:g}")
    if bounds.speed_max is not None and speed > bounds.speed_max:
        found.append(f"landing speed {speed:.2f} m/s above {bounds.speed_max:g}")
    if bounds.rate_max is not None and abs(state.omega) > bounds.rate_max:
        found.append(f"landing rate {abs(state.omega):.2f} rad/s above {bounds.rate_max:g}")
    return found


def _workspace_violations(
    scene: Scene, mover: Mover, motion: Motion, end: float, opening_time: float, thrown: Thrown
) -> list[str]:
    workspace, bar = scene.workspace, scene.object
    assert workspace is not None
    opening = thrown.release.times[-1]
    detach = opening_time + opening
    held = hand_samples(mover, motion, np.arange(0.0, opening_time, TICK))
    carried = _carried(scene, held.pose)
    opened = thrown.release.com[:, ::10]
    flight_times = np.linspace(0.0, thrown.landing.flight_time, FLIGHT_SAMPLES)
    flying = flight_poses(scene, thrown, flight_times)
    found = []
    if workspace.floor is not None:
        lowest = bar_outline(bar, np.hstack([carried, opened]))[1].min()
        lowest = min(lowest, _lowest_of_arm(scene, mover, motion, end))
        if lowest < workspace.floor - 1e-6:
            found.append(f"floor: {1e3 * (workspace.floor - lowest):.0f} mm below it")
    if workspace.column_radius is not None and workspace.column_height is not None:
        poses = np.hstack([carried, opened, flying])
        room = column_distance(bar, poses, workspace.column_radius, workspace.column_height).min()
        if room < -1e-6:
            found.append("base column: the bar touches it")
    if workspace.palm_clearance is not None and scene.arm is not None:
        hand = hand_samples(mover, motion, detach + flight_times)
        distance = palm_distance(bar, scene.arm.tool, flying, hand.pose).min()
        if distance < workspace.palm_clearance - 1e-6:
            found.append(f"palm: the bar comes as near as {1e3 * distance:.0f} mm")
    return found


def _carried(scene: Scene, hand: Array) -> Array:
    """CoM poses (3, N) of the held bar for hand poses."""
    theta = hand[2] + scene.grasp.angle
    h = scene.com_offset
    return np.array([hand[0] + h * np.cos(theta), hand[1] + h * np.sin(theta), theta])


def _lowest_of_arm(scene: Scene, mover: Mover, motion: Motion, end: float) -> float:
    """Lowest height of hand body and joint frames beyond the shoulder, launch to rest."""
    times = np.arange(0.0, end + TICK, TICK)
    pose = hand_samples(mover, motion, times).pose
    if scene.arm is None or not isinstance(mover.kinematics, PlanarArm):
        return float(pose[1].min())
    q = ca.SX.sym("q", mover.size)
    heights = ca.Function("heights", [q], [mover.kinematics.points(q)[1, 2:]])
    joints = np.array(heights.map(len(times))(motion.at(times)[0]))
    return float(min(joints.min(), palm_corners(scene.arm.tool, pose)[1].min(), pose[1].min()))
