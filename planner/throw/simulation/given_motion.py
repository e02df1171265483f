"""A scene's given hand motion as a track for the release models."""

from __future__ import annotations

import math

import numpy as np

from ....models import Array, HandTrack, MovedHand, Trajectory
from ....models.robot import Arm, PlanarArm, hand_motion
from ....problems import InputError, Motion, Scene

#: Largest angle [rad] between the arm's posture and a recorded joint that does not throw.
POSTURE_ROOM = 0.05


def given_hand(scene: Scene) -> HandTrack:
    """The hand of the scene's [motion]; InputError without one, and for one that does not fit."""
    motion = scene.motion
    if motion is None:
        raise InputError(f"{scene.place}: has no section [motion] to simulate")
    try:
        track = _track(scene, motion)
    except ValueError as error:
        raise InputError(f"{scene.place}: [motion] {error}") from None
    if motion.samples:
        _check_span(scene, motion)
    return track


def _track(scene: Scene, motion: Motion) -> HandTrack:
    pose, twist = (*motion.position, motion.angle), (*motion.velocity, motion.rate)
    if motion.samples:
        table = np.array(motion.samples, float)
        if motion.joints is None:
            return Trajectory.through(table[:, 0] - motion.opening_time, table[:, 1:])
        assert scene.arm is not None  # checked by Scene
        joints = table[:, 1:]
        return recorded_joints(scene.arm, table[:, 0], joints, motion.opening_time, motion.cutoff)
    if motion.accelerations:
        return Trajectory.stepping(pose, twist, motion.times, motion.accelerations)
    return Trajectory.accelerating(pose, twist, (*motion.acceleration, motion.angular_acceleration))


def recorded_joints(
    arm: Arm, times: Array, joints: Array, opening_time: float, cutoff: float
) -> MovedHand:
    """The hand of an arm's recorded joints (K, joints) [rad], in the plane that joint 1 is in.

    ValueError as `planar_joints` and `low_pass`.
    """
    kinematics, throwing = PlanarArm(arm), planar_joints(arm, joints)
    if not times[0] <= opening_time < times[-1]:
        raise ValueError(f"opening_time {opening_time:g} s is outside the recording")
    path = Trajectory.recorded(times, throwing, cutoff).shifted(opening_time)
    return MovedHand(path, hand_motion(kinematics), kinematics.core)


def planar_joints(arm: Arm, joints: Array) -> Array:
    """The throwing joints (K, n) of recorded joints (K, joints) [rad].

    ValueError where the others do not keep the throwing posture.
    """
    throwing = [j - 1 for j in arm.throwing_joints]
    for joint in range(arm.joints):
        if joint in throwing or joint == arm.azimuth_joint - 1:
            continue
        away = np.abs(joints[:, joint] - arm.posture[joint]).max()
        if away > POSTURE_ROOM:
            hint = " (is it in degrees?)" if away > math.tau else ""
            raise ValueError(
                f"joints: joint {joint + 1} is {away:.2f} rad from the throwing posture, at "
                f"most {POSTURE_ROOM} is allowed{hint}"
            )
    turning = np.ptp(joints[:, arm.azimuth_joint - 1])
    if turning > POSTURE_ROOM:
        raise ValueError(
            f"joints: joint {arm.azimuth_joint} turns the throw's plane by {turning:.2f} rad, at "
            f"most {POSTURE_ROOM} is allowed"
        )
    return joints[:, throwing]


def _check_span(scene: Scene, motion: Motion) -> None:
    first, last = motion.samples[0][0], motion.samples[-1][0]
    needed = motion.opening_time + scene.gripper.profile().opening
    if not first <= motion.opening_time or needed > last + 1e-9:
        raise InputError(
            f"{scene.place}: [motion] opening_time = {motion.opening_time:g}: the opening lasts "
            f"until {needed:g} s, the samples cover {first:g} to {last:g} s"
        )
