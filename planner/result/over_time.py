"""A throw over time: hand, object, phases, friction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...models import Array, HandMotion, Indices, pivot_wrench
from ...models.robot import PlanarArm, SpatialArm
from ..rest import rest_motion
from ..throw import TICK, Manipulator
from ..verdict import bar_outline, held_bar

if TYPE_CHECKING:
    from ...problems import Scene
    from ..throw import Throw


#: Phases of a throw, in their order.
PHASES = ("carry", "stick", "pivot", "slide", "flight", "landed")


@dataclass(frozen=True)
class Timeline:
    """Columns over `times` (N,) [s]: hand and CoM pose (3, N), rates, grip and friction use.

    phase (N,): index into PHASES. arm (N, 2, points): arm points in the plane, None for a hand.
    force_use, torque_use: wrench without slip over its limit, NaN in flight. marks: times of
    command, opening, detach and landing. end: where the object ends, in words, for a scene with
    [rest].
    """

    times: Array
    hand: Array
    com: Array
    hand_rate: Array
    object_rate: Array
    grip: Array
    force_use: Array
    torque_use: Array
    phase: Indices
    arm: Array | None
    marks: dict[str, float]
    end: str = ""

    def index(self, time: float) -> int:
        """Index of the instant nearest to `time` [s]."""
        return int(np.abs(self.times - time).argmin())

    def phase_name(self, index: int) -> str:
        """Name of the phase at an instant."""
        return PHASES[int(self.phase[index])]

    def extent(self, scene: Scene) -> tuple[Array, Array]:
        """Least and largest (x, z) of everything that moves."""
        # Of an outline, the corners of the rectangle around it.
        points = [bar_outline(scene.object, self.com).reshape(2, -1), self.hand[:2]]
        if self.arm is not None:
            points.append(self.arm.transpose(1, 0, 2).reshape(2, -1))
        everything = np.hstack(points)
        return everything.min(axis=1), everything.max(axis=1)


def timeline(throw: Throw) -> Timeline:
    """The throw every millisecond from rest to landing; for a scene with [rest] until it rests.

    A target that moves is followed to the landing only.
    """
    scene = throw.scene
    opening, detach, landing = throw.opening_time, throw.detach_time, throw.landing_time
    after = None
    if scene.rest is not None and not throw.target.speed and throw.lands:
        after = rest_motion(scene, throw.deciding.landing.start)
    end = landing if after is None else max(landing, detach + after.times[-1])
    times = np.arange(0.0, end + TICK / 2, TICK)
    pose, twist, acceleration = throw.manipulator.hand(throw.path).at(times)
    com, rate, phase = _object(throw, times, pose, twist)
    if after is not None:
        free, late = times > detach, times > landing
        com[:, free] = [np.interp(times[free] - detach, after.times, row) for row in after.com]
        phase[late], rate[late] = PHASES.index("landed"), np.nan
    profile = scene.gripper.profile()
    grip = np.where(times < opening, profile.full, profile.force(times - opening))
    # The wrench of the pads on an object without slip, over its friction limit.
    motion = HandMotion(pose[2], twist[2], *acceleration)
    lever = com[0] - pose[0], com[1] - pose[1]
    f_x, f_z, torque = pivot_wrench(scene.body, scene.gravity, motion, rate, *lever)
    limit = np.maximum(scene.patch.force_limit(grip), 1e-9)
    uses = np.hypot(f_x, f_z) / limit, np.abs(torque) / (limit * scene.patch.torsion_arm)
    force_use, torque_use = (np.where(times < detach, use, np.nan) for use in uses)
    marks = {"command": throw.command_time, "opening": opening}
    marks |= {"detach": detach, "landing": landing}
    return Timeline(
        times=times,
        hand=pose,
        com=com,
        hand_rate=twist[2],
        object_rate=rate,
        grip=grip,
        force_use=force_use,
        torque_use=torque_use,
        phase=phase,
        arm=arm_points(throw.manipulator, throw.path.at(times).pose),
        marks=marks,
        end="" if after is None else after.words,
    )


def _object(throw: Throw, times: Array, hand: Array, twist: Array) -> tuple[Array, Array, Indices]:
    """CoM poses (3, N), turning rate (N,) and phase (N,) over time."""
    scene, release = throw.scene, throw.deciding.release
    opening, detach = throw.opening_time, throw.detach_time
    inside = np.clip(times - opening, 0.0, release.times[-1])
    opened = np.array([np.interp(inside, release.times, row) for row in release.com])
    opened_rate = np.interp(inside, release.times, release.com_twist[2])
    flying = throw.flight(np.maximum(times - detach, 0.0))
    states = [times < opening, times < detach]
    com = np.where(states[0], held_bar(scene, hand), np.where(states[1], opened, flying))
    rate = np.select(states, [twist[2], opened_rate], release.com_twist[2, -1])
    phase = np.where(times < opening, 0, 1)
    for onset, index in zip(throw.deciding.onsets, (2, 3), strict=True):
        if onset is not None:
            phase[times >= opening + onset] = index
    phase[times >= detach] = 4
    return com, rate, phase


def arm_points(manipulator: Manipulator, q: Array) -> Array | None:
    """Base, joints and TCP (N, 2, points) in the throw's plane at coordinates q (n, N), None for a
    hand."""
    kinematics = manipulator.kinematics
    if not isinstance(kinematics, PlanarArm):
        return None
    frames = SpatialArm(kinematics.arm).frames(kinematics.all_joints(q.T))
    pads = manipulator.motion(q, 0 * q, 0 * q)[0]
    return np.dstack([frames[:, :, [0, 2], 3].transpose(1, 2, 0), pads[:2].T])
