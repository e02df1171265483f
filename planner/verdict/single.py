"""The verdict on one throw: all its rules."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator
from dataclasses import astuple
from itertools import pairwise

import numpy as np

from ...core import SamplesC, library
from ...models import Array
from ...models.robot import PlanarArm, about_z
from ...problems import Pose, Scene, Tolerance
from ..clearance import BAR, Clearance, CollisionScene, contacts, held_bar
from ..throw import TICK, Manipulator, Samples, Throw, column_of, excesses
from .findings import JOINT_LIMITS, Code, Finding, Verdict
from .landing import LandingStates, LimitUse, landing_uses, least_cup_clearance, tolerance_uses

#: Allowed violation [m] of a clearance: covers rounding.
NEAR = 1e-6
#: Name of the bar after detach, among bodies.
FLYING = "flying bar"
#: Largest difference of the pads' centre [m] and axes [-] between planar model and chain.
AGREES = 1e-6


def verdict(
    throw: Throw,
    target: Pose | None = None,
    *,
    sent: Throw | None = None,
    driven: Throw | None = None,
) -> Verdict:
    """All limits that a throw breaks, by its release model.

    For a throw that never lands: joint limits, kinematics, release and grip only. target: None for
    the throw's own. sent: the commanded motion, if `throw` is the expected motion of joints that
    lag: joint limits are judged on `sent`, the tool's speed on both. driven: whose torques are
    judged, if not those of `throw`.
    """
    commanded, goal = throw if sent is None else sent, throw.target if target is None else target
    findings = [*_limits(commanded), *_kinematics(throw), *_release(throw)]
    if throw.lands:
        findings += _landing(throw, goal)
        findings += [*_tool_speed(throw), *_torque(driven or throw)]
        for rule in _RULES:
            findings += rule(throw)
        if commanded is not throw:
            findings += _tool_speed(commanded)
    return Verdict(tuple(findings), cup=throw.scene.cup is not None)


def outside_tolerance(tolerance: Tolerance, dx: float, dtheta: float) -> list[Finding]:
    """Findings on a landing dx [m] and dtheta [rad] (0 where theta is open) off the target."""
    return _broken(tolerance_uses(tolerance, dx, dtheta))


def _broken(uses: list[LimitUse], time: float | None = None) -> list[Finding]:
    """Findings about a landing at a time [s]."""
    return [Finding(u.code, float(u.value), u.limit, time, u.body) for u in uses if u.broken]


def _landing(throw: Throw, target: Pose) -> list[Finding]:
    state, lands = throw.landing.state, throw.landing_time
    end = state.x, state.z, state.theta, state.v_x, state.v_z, state.omega
    at = LandingStates(*throw.miss(target), astuple(throw.landing.start), end, lands)
    return _broken(landing_uses(throw.scene, target, at), lands)


def _limits(throw: Throw) -> Iterator[Finding]:
    """Joint limits broken by the samples that are sent."""
    if len(throw.samples.q):
        yield from _excesses(throw.manipulator, throw.samples)


def _excesses(manipulator: Manipulator, samples: Samples) -> Iterator[Finding]:
    for excess in excesses(manipulator, samples):
        yield Finding(
            JOINT_LIMITS[excess.kind], excess.value, excess.limit, excess.time, excess.joint
        )


def _kinematics(throw: Throw) -> Iterator[Finding]:
    """Whether the arm's own chain puts the pads where the planar model of plans does."""
    off = _off_in_space(throw.manipulator, throw.samples, throw.target.plane.azimuth)
    if not off <= AGREES:
        yield Finding(Code.KINEMATICS, off, AGREES)


@functools.lru_cache(maxsize=16)
def _stiff_parts(kinematics: PlanarArm) -> Array:
    """4x4 poses (n + 2, 4, 4) of the azimuth joint in the base frame, of each throwing joint after
    the one before, then of the pads: these joints at angle 0, the others in the posture."""
    arm = kinematics.arm
    turning, joints = (arm.azimuth_joint, *kinematics.throwing_joints), list(arm.posture)
    for joint in turning:
        joints[joint - 1] = 0.0
    frames = arm.placed(joints)
    at = [np.eye(4), *(frames[joint - 1] for joint in turning), frames[-1]]
    return np.array([np.linalg.solve(before, after) for before, after in pairwise(at)])


def _off_in_space(manipulator: Manipulator, sent: Samples, azimuth: float) -> float:
    """Largest difference [m; -] of the pads' centre and axes from the planar model; 0 without an
    arm.

    azimuth [rad]: of the throw's plane.
    """
    kinematics = manipulator.kinematics
    if not isinstance(kinematics, PlanarArm) or not sent.q.size:
        return 0.0
    chain, arm = _stiff_parts(kinematics), kinematics.arm
    if azimuth:
        chain = chain.copy()
        chain[0, :3] = about_z(-azimuth) @ chain[0, :3]
    samples, angle = SamplesC.of(TICK, sent.q), arm.azimuth_angle(azimuth)
    # Every 10th sample is compared.
    return float(library().off_plane(samples, 10, kinematics.core, chain, angle, arm.lateral))


def _release(throw: Throw) -> Iterator[Finding]:
    """The grip until the opening, the release itself, and whether the object lands."""
    if throw.release.trouble:
        yield Finding(Code.RELEASE, 0.0, 0.0, note=throw.release.trouble)
    if not throw.lands:
        if throw.grip_use > 1.0:
            yield Finding(Code.SLIP_BEFORE_OPENING, throw.grip_use, 1.0)
        yield Finding(Code.NO_LANDING, math.nan, throw.target.z)
        return
    grip = throw.measured.grip
    if grip.value > 1.0:
        yield Finding(Code.SLIP_BEFORE_OPENING, grip.value, 1.0, grip.time)


def held_verdict(scene: Scene, manipulator: Manipulator, samples: Samples, first: int) -> Verdict:
    """The verdict on a motion that keeps the object in the hand.

    It covers joint limits, and from sample `first` on collisions with obstacles, floor and the arm.
    """
    q, times = samples.q[first:].T, samples.times[first:]
    bar = held_bar(scene, manipulator.motion(q, 0 * q, 0 * q)[0])
    surroundings = CollisionScene.of(scene, manipulator)
    clearances = surroundings.clearances(surroundings.bodies_at(times, q, bar))
    return Verdict((*_excesses(manipulator, samples), *map(collision, clearances)))


# Rules for throws that land, one for each part of a scene.


def _tool_speed(throw: Throw) -> Iterator[Finding]:
    limit, speed = throw.scene.tool_speed, throw.measured.speed
    if limit is not None and speed.value > limit:
        yield Finding(Code.TOOL_SPEED, speed.value, limit, speed.time)


def _torque(throw: Throw) -> Iterator[Finding]:
    rate, most = throw.scene.torque_rate, 1.0 - throw.scene.torque_margin
    if rate is not None and throw.torques.rate > rate:
        yield Finding(Code.TORQUE_RATE, throw.torques.rate, rate)
    if throw.measured.torque.value <= most:
        return
    torques = throw.torques
    for name, share in zip(throw.manipulator.joints, torques.use.T, strict=True):
        if share.max() > most:
            when = float(torques.times[share.argmax()])
            yield Finding(Code.TORQUE, float(share.max()), most, when, name)


def _floor(throw: Throw) -> Iterator[Finding]:
    floor, measured = throw.scene.bounds.floor, throw.measured
    if floor is None:
        return
    for body, lowest in (
        ("hand" if throw.scene.arm is None else "arm", measured.arm),
        (BAR, measured.held),
    ):
        if floor - lowest.value > NEAR:
            yield Finding(Code.FLOOR, lowest.value, floor, lowest.time, body)


def _column(throw: Throw) -> Iterator[Finding]:
    measured = throw.measured
    if column_of(throw.scene) is None:
        return
    for body, distance in ((BAR, measured.column_held), (FLYING, measured.column_flown)):
        if -distance.value > NEAR:
            yield Finding(Code.COLUMN, distance.value, 0.0, distance.time, body)


def _palm(throw: Throw) -> Iterator[Finding]:
    room, first = throw.scene.palm_clearance, throw.measured.palm_time
    if math.isfinite(first) and room is not None:
        least, when = throw.measured.palm.value, throw.detach_time + first
        yield Finding(Code.PALM, least, room, when, FLYING)


def _cup(throw: Throw) -> Iterator[Finding]:
    cup = throw.scene.cup
    if cup is None:
        return
    clearance = throw.measured.cup
    if clearance == -math.inf:
        yield Finding(Code.CUP_MISSED, 0.0, cup.insertion)
    elif clearance <= least_cup_clearance(cup):
        yield Finding(Code.CUP_WALL, clearance, cup.clearance)


def _collisions(throw: Throw) -> Iterator[Finding]:
    return map(collision, contacts(throw))


def collision(pair: Clearance) -> Finding:
    """The finding about two bodies that are too close to each other."""
    body = FLYING if pair.flying else pair.body
    other = pair.other if pair.thing is None else pair.thing.words
    distance = pair.clearance - pair.penetration
    return Finding(Code.COLLISION, distance, pair.clearance, pair.time, body, other)


_RULES: tuple[Callable[[Throw], Iterator[Finding]], ...] = (
    _floor,
    _cup,
    _palm,
    _column,
    _collisions,
)
