"""A throw laid out over time for looking at: hand, object, phases, friction."""

from __future__ import annotations

from dataclasses import dataclass

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import HandMotion, PlanarArm, pivot_wrench
from ...problems import Scene
from ..check import SentThrow, flight_poses, hand_samples

Array = npt.NDArray[np.float64]

PHASES = ("carry", "stick", "pivot", "slide", "flight")


@dataclass(frozen=True)
class Timeline:
    """Columns over `times` (N,) [s]: hand and CoM pose (3, N), rates, grip and friction use.

    phase (N,): index into PHASES. arm (N, 2, points): arm points in the plane, None for
    a hand. force_use, torque_use: wrench for sticking over its limit, NaN in flight.
    marks: times of command, opening, detach and landing.
    """

    times: Array
    hand: Array
    com: Array
    hand_rate: Array
    object_rate: Array
    grip: Array
    force_use: Array
    torque_use: Array
    phase: npt.NDArray[np.int_]
    arm: Array | None
    marks: dict[str, float]


def timeline(throw: SentThrow, step: float = 0.001) -> Timeline:
    """The throw every `step` seconds from rest to landing."""
    scene, mover, motion = throw.scene, throw.mover, throw.motion
    opening, detach, landing = throw.opening_time, throw.detach_time, throw.landing_time
    times = np.arange(0.0, landing + step / 2, step)
    moving = np.minimum(times, throw.samples.times[-1])
    # The planned motion goes on as its last piece; the samples hold the brake.
    braking = times > throw.until
    hand = hand_samples(mover, motion, np.where(braking, 0.0, moving))
    brake = hand_samples(mover, throw.samples, moving)
    pose = np.where(braking, brake.pose, hand.pose)
    twist = np.where(braking, brake.twist, hand.twist)
    acceleration = np.where(braking, brake.acceleration, hand.acceleration)

    com, rate, phase = _object(throw, times, pose, twist)
    profile = scene.gripper.profile()
    grip = np.where(times < opening, profile.full, profile.force(times - opening))
    uses = _friction_use(scene, pose, twist, acceleration, com, rate, grip)
    force_use, torque_use = (np.where(phase < 4, use, np.nan) for use in uses)
    marks = {
        "command": throw.command_time,
        "opening": opening,
        "detach": detach,
        "landing": landing,
    }
    arm = _arm_points(throw, moving)
    return Timeline(
        times, pose, com, twist[2], rate, grip, force_use, torque_use, phase, arm, marks
    )


def _object(
    throw: SentThrow, times: Array, hand: Array, twist: Array
) -> tuple[Array, Array, npt.NDArray[np.int_]]:
    """CoM poses (3, N), turning rate (N,) and phase (N,) over time."""
    scene, release = throw.scene, throw.final.release
    opening, detach = throw.opening_time, throw.detach_time
    theta = hand[2] + scene.grasp.angle
    h = scene.com_offset
    carried = np.array([hand[0] + h * np.cos(theta), hand[1] + h * np.sin(theta), theta])
    inside = np.clip(times - opening, 0.0, release.times[-1])
    opened = np.array([np.interp(inside, release.times, row) for row in release.com])
    opened_rate = np.interp(inside, release.times, release.com_twist[2])
    flying = flight_poses(scene, throw.final, np.maximum(times - detach, 0.0))
    com = np.where(times < opening, carried, np.where(times < detach, opened, flying))
    end_rate = release.com_twist[2, -1]
    rate = np.where(times < opening, twist[2], np.where(times < detach, opened_rate, end_rate))
    phase = np.where(times < opening, 0, 1)
    for onset, index in ((release.pivot, 2), (release.slide, 3)):
        if onset is not None:
            phase[times >= opening + onset] = index
    phase[times >= detach] = 4
    return com, rate, phase


def _friction_use(
    scene: Scene,
    pose: Array,
    twist: Array,
    acceleration: Array,
    com: Array,
    rate: Array,
    grip: Array,
) -> tuple[Array, Array]:
    """Wrench that sticking needs over what the grip gives then: force and torque shares."""
    hand = HandMotion(pose[2], twist[2], *acceleration)
    f_x, f_z, torque = pivot_wrench(
        scene.body, scene.gravity, hand, rate, com[0] - pose[0], com[1] - pose[1]
    )
    limit = np.maximum(scene.patch.force_limit(grip), 1e-9)
    return np.hypot(f_x, f_z) / limit, np.abs(torque) / (limit * scene.patch.torsion_arm)


def _arm_points(throw: SentThrow, times: Array) -> Array | None:
    kinematics = throw.mover.kinematics
    if not isinstance(kinematics, PlanarArm):
        return None
    q = ca.SX.sym("q", throw.mover.size)
    points = kinematics.points(q)
    base = ca.DM([[0.0], [0.0]])
    function = ca.Function("points", [q], [ca.horzcat(base, points)])
    values = np.array(function.map(len(times))(throw.samples.at(times)[0]))
    return values.reshape(2, len(times), -1).transpose(1, 0, 2)
