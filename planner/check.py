"""Whether a motion throws where it should and breaks nothing: the promise behind `solved`."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import casadi as ca
import numpy as np
import numpy.typing as npt

from ..models.hand import PlanarArm, PlanarHand
from ..models.release import Release, ReleaseCase
from ..problems.scene import Pose, Scene
from .exact_release import limit_surface_release, sliding_pivot_release
from .geometry import (
    column_distance,
    cup_entry,
    lowest_of_bar,
    palm_corners,
    palm_distance,
    reach_of_bar,
)
from .kernel import MappedKernel
from .motion import TICK, Motion, PiecewiseMotion, SampledMotion
from .mover import Limits, Mover
from .rollout import (
    Landing,
    MoverTrack,
    case_of,
    hand_samples,
    kinks_of,
    landing,
    slip_while_carrying,
)

Array = npt.NDArray[np.float64]

#: Flight samples for the cup and the workspace.
FLIGHT_SAMPLES = 400


@dataclass(frozen=True)
class Thrown:
    """A motion thrown by a non-smooth release model: the sliding pivot or the limit surface.

    grip_use: largest friction use before the opening (1 is the limit).
    """

    release: Release
    landing: Landing
    grip_use: float

    def miss(self, target: Pose) -> tuple[float, float]:
        """(Δx [m], Δtheta [rad]) to the target; 0 where it leaves theta open."""
        angle = 0.0 if target.theta is None else self.landing.theta - target.theta
        return self.landing.x - target.plane_x, angle


def throw(
    scene: Scene, mover: Mover, motion: PiecewiseMotion, opening_time: float, height: float
) -> Thrown:
    """The exact throw of `motion`: held from rest, opened at `opening_time`, flown to `height`."""
    return _thrown(sliding_pivot_release, scene, mover, motion, opening_time, height)


def limit_surface_throw(
    scene: Scene, mover: Mover, motion: PiecewiseMotion, opening_time: float, height: float
) -> Thrown:
    """The same motion thrown by the time-stepping limit surface."""
    return _thrown(limit_surface_release, scene, mover, motion, opening_time, height)


def _thrown(
    model: Callable[[ReleaseCase, Array], Release],
    scene: Scene,
    mover: Mover,
    motion: PiecewiseMotion,
    opening_time: float,
    height: float,
) -> Thrown:
    """A motion thrown by `model`, which takes the release and its kinks."""
    use = slip_while_carrying(scene, mover, motion, opening_time)
    case = case_of(scene, MoverTrack(mover, motion, opening_time))
    release = model(case, kinks_of(motion, opening_time, case.grip.opening))
    return Thrown(release, landing(release, height, scene.gravity), use)


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
    times = np.arange(0.0, end + TICK, TICK)
    q = motion.at(times)[0].T
    pose, lowest_joint = outline_kernel(mover.motion, mover.kinematics)(q)
    carried = _carried(scene, pose[times < opening_time].T)
    held = np.hstack([carried, thrown.release.com])
    detach = opening_time + thrown.release.times[-1]
    flight_times = np.linspace(0.0, thrown.landing.flight_time, FLIGHT_SAMPLES)
    flying = flight_poses(scene, thrown, flight_times)
    found = []
    if workspace.floor is not None:
        lowest = min(lowest_of_bar(bar, held).min(), lowest_joint.min(), pose[:, 1].min())
        if scene.arm is not None:
            lowest = min(lowest, palm_corners(scene.arm.tool, pose.T)[1].min())
        if lowest < workspace.floor - 1e-6:
            found.append(f"floor: {1e3 * (workspace.floor - lowest):.0f} mm below it")
    if workspace.column_radius is not None and workspace.column_height is not None:
        radius, height = workspace.column_radius, workspace.column_height
        poses = np.hstack([held, flying])
        # Only where the column is within the bar's reach.
        away = np.maximum(np.abs(poses[0]) - radius, poses[1] - height)
        near = poses[:, away < reach_of_bar(bar)]
        if column_distance(bar, near, radius, height).min(initial=0.0) < -1e-6:
            found.append("base column: the bar touches it")
    if workspace.palm_clearance is not None and scene.arm is not None:
        tool, clearance = scene.arm.tool, workspace.palm_clearance
        hand = hand_samples(mover, motion, detach + flight_times).pose
        reach = reach_of_bar(bar) + math.hypot(tool.palm_back, tool.palm_half_width)
        near = np.hypot(*(flying[:2] - hand[:2])) < reach + clearance
        distance = palm_distance(bar, tool, flying[:, near], hand[:, near]).min(initial=np.inf)
        if distance < clearance - 1e-6:
            found.append(f"palm: the bar comes as near as {1e3 * distance:.0f} mm")
    return found


def _carried(scene: Scene, hand: Array) -> Array:
    """CoM poses (3, N) of the held bar for hand poses."""
    theta = hand[2] + scene.grasp.angle
    h = scene.com_offset
    return np.array([hand[0] + h * np.cos(theta), hand[1] + h * np.sin(theta), theta])


@lru_cache(maxsize=16)
def outline_kernel(motion: ca.Function, kinematics: PlanarArm | PlanarHand) -> MappedKernel:
    """q -> hand pose (3,) and the height of the lowest joint beyond the shoulder."""
    q = ca.SX.sym("q", kinematics.coordinates)
    zero = ca.SX.zeros(kinematics.coordinates)
    pose = motion(q, zero, zero)[0]
    joints = kinematics.points(q)[1, 2:] if isinstance(kinematics, PlanarArm) else pose[1]
    return MappedKernel(ca.Function("outline", [q], [pose, ca.mmin(joints)]))
