"""A scene's given hand motion as a track for the release models."""

from __future__ import annotations

import numpy as np

from ..models.hand import PlanarArm, hand_motion
from ..models.hand_track import ConstantAcceleration, PiecewiseAcceleration, SampledHand
from ..models.recording import RecordedJoints
from ..models.release import HandTrack
from ..problems.errors import InputError
from ..problems.scene import Motion, Scene

#: Joints that do not throw may wander this far [rad] from the arm's posture.
POSTURE_ROOM = 0.05


def given_hand(scene: Scene) -> HandTrack:
    """The hand of the scene's [motion]; InputError if there is none or it does not fit."""
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
            return SampledHand(table[:, 0] - motion.opening_time, table[:, 1:])
        return _recorded(scene, motion, table)
    if motion.accelerations:
        return PiecewiseAcceleration(pose, twist, motion.times, motion.accelerations)
    return ConstantAcceleration(pose, twist, (*motion.acceleration, motion.angular_acceleration))


def _recorded(scene: Scene, motion: Motion, table: np.ndarray) -> HandTrack:
    arm = scene.arm
    assert arm is not None  # checked by Scene
    kinematics = PlanarArm(arm)
    throwing = [j - 1 for j in kinematics.throwing_joints]
    joints = table[:, 1:]
    for joint in range(arm.joints):
        if joint in throwing or joint == arm.azimuth_joint - 1:
            continue
        away = np.abs(joints[:, joint] - arm.posture[joint]).max()
        if away > POSTURE_ROOM:
            raise ValueError(
                f"joints: joint {joint + 1} is {away:.2f} rad from the throwing posture, at "
                f"most {POSTURE_ROOM} is allowed"
            )
    turning = np.ptp(joints[:, arm.azimuth_joint - 1])
    if turning > POSTURE_ROOM:
        raise ValueError(
            f"joints: joint {arm.azimuth_joint} turns the throw's plane by {turning:.2f} rad, at "
            f"most {POSTURE_ROOM} is allowed"
        )
    function = hand_motion(kinematics)
    return RecordedJoints(
        table[:, 0], joints[:, throwing], function, motion.opening_time, motion.cutoff
    )


def _check_span(scene: Scene, motion: Motion) -> None:
    first, last = motion.samples[0][0], motion.samples[-1][0]
    needed = motion.opening_time + scene.gripper.profile().opening
    if not first <= motion.opening_time or needed > last + 1e-9:
        raise InputError(
            f"{scene.place}: [motion] opening_time = {motion.opening_time:g}: the opening lasts "
            f"until {needed:g} s, the samples cover {first:g} to {last:g} s"
        )
