"""The verdict on one throw: every rule stands here, once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from ...problems import Pose, Scene, Tolerance
from ..throw import (
    Manipulator,
    Samples,
    Throw,
    column_of,
    excesses,
)
from ..throw.clearance import (
    BAR,
    Clearance,
    CollisionScene,
    clearances_of,
    contacts,
    held_bar,
    swept_bodies,
)
from .findings import JOINT_LIMITS, Code, Finding, Verdict
from .in_space import AGREES, off_in_space
from .landing import LandingStates, LimitUse, landing_uses, least_cup_clearance, tolerance_uses

#: A clearance may be short by this [m]: rounding.
NEAR = 1e-6
#: The bar after detach, among names of bodies.
FLYING = "flying bar"


def verdict(throw: Throw, target: Pose | None = None, *, sent: Throw | None = None) -> Verdict:
    """Everything that a throw breaks, by its release model.

    Of a throw that never lands: joint limits, kinematics, release and grip only.
    target: None for the throw's own. sent: the motion commanded, if joints follow it only roughly
    and `throw` is what they are expected to do: joint limits are judged on `sent`, the tool's speed
    on both.
    """
    commanded, goal = throw if sent is None else sent, throw.target if target is None else target
    found = [*_limits(commanded), *_kinematics(throw), *_release(throw)]
    if throw.lands:
        found += _landing(throw, goal)
        for rule in _RULES:
            found += rule(throw)
        if commanded is not throw:
            found += _tool_speed(commanded)
    return Verdict(tuple(found), cup=throw.scene.cup is not None)


def outside_tolerance(tolerance: Tolerance, dx: float, dtheta: float) -> list[Finding]:
    """Findings on a landing dx [m] and dtheta [rad] (0 where theta is open) off the target."""
    return _broken(tolerance_uses(tolerance, dx, dtheta))


def _broken(uses: list[LimitUse], time: float | None = None) -> list[Finding]:
    """Findings about a landing at a time [s]."""
    return [Finding(u.code, float(u.value), u.limit, time, u.body) for u in uses if u.broken]


def _landing(throw: Throw, target: Pose) -> list[Finding]:
    state, lands = throw.landing.state, throw.landing_time
    end = state.x, state.z, state.theta, state.v_x, state.v_z, state.omega
    at = LandingStates(*throw.miss(target), throw.release.end, end, lands)
    return _broken(landing_uses(throw.scene, target, at), lands)


def _limits(throw: Throw) -> Iterator[Finding]:
    """Joint limits broken by the samples that are sent."""
    if len(throw.samples.q):
        yield from _excesses(throw.manipulator, throw.samples)


def _excesses(manipulator: Manipulator, samples: Samples) -> Iterator[Finding]:
    for found in excesses(manipulator, samples):
        yield Finding(JOINT_LIMITS[found.kind], found.value, found.limit, found.time, found.joint)


def _kinematics(throw: Throw) -> Iterator[Finding]:
    off = off_in_space(throw.manipulator, throw.samples, throw.target.plane.azimuth)
    if not off <= AGREES:
        yield Finding(Code.KINEMATICS, off, AGREES)


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
    """What a motion that keeps the object in the hand breaks.

    Joint limits; collisions with obstacles, floor and the arm itself from sample `first` on.
    """
    q, times = samples.q[first:].T, samples.times[first:]
    held = held_bar(scene, manipulator.motion(q, 0 * q, 0 * q)[0])
    around = CollisionScene.of(scene, manipulator)
    near = clearances_of(swept_bodies(scene, around.capsules, times, q, held), around)
    return Verdict((*_excesses(manipulator, samples), *map(collision, near)))


# Rules for throws that land, each for a part of a scene.


def _tool_speed(throw: Throw) -> Iterator[Finding]:
    most, speed = throw.scene.tool_speed, throw.measured.speed
    if most is not None and speed.value > most:
        yield Finding(Code.TOOL_SPEED, speed.value, most, speed.time)


def _torque(throw: Throw) -> Iterator[Finding]:
    if throw.measured.torque.value <= 1.0:
        return
    torques = throw.torques
    for name, share in zip(throw.manipulator.joints, torques.use.T, strict=True):
        if share.max() > 1.0:
            when = float(torques.times[share.argmax()])
            yield Finding(Code.TORQUE, float(share.max()), 1.0, when, name)


def _floor(throw: Throw) -> Iterator[Finding]:
    workspace, measured = throw.scene.workspace, throw.measured
    if workspace is None or workspace.floor is None:
        return
    for body, lowest in (
        ("hand" if throw.scene.arm is None else "arm", measured.arm),
        (BAR, measured.held),
    ):
        if workspace.floor - lowest.value > NEAR:
            yield Finding(Code.FLOOR, lowest.value, workspace.floor, lowest.time, body)


def _column(throw: Throw) -> Iterator[Finding]:
    measured = throw.measured
    if column_of(throw.scene) is None:
        return
    for body, away in ((BAR, measured.column_held), (FLYING, measured.column_flown)):
        if -away.value > NEAR:
            yield Finding(Code.COLUMN, away.value, 0.0, away.time, body)


def _palm(throw: Throw) -> Iterator[Finding]:
    workspace, first = throw.scene.workspace, throw.measured.palm_time
    if math.isfinite(first) and workspace is not None and workspace.palm_clearance is not None:
        least, when = throw.measured.palm.value, throw.detach_time + first
        yield Finding(Code.PALM, least, workspace.palm_clearance, when, FLYING)


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


def collision(near: Clearance) -> Finding:
    """The finding about two bodies that are too close to each other."""
    body = FLYING if near.flying else near.body
    clearance = 0.0 if near.thing is None else near.thing.clearance
    other = near.other if near.thing is None else near.thing.words
    away = clearance - near.penetration
    return Finding(Code.COLLISION, away, clearance, near.time, body, other)


_RULES: tuple[Callable[[Throw], Iterator[Finding]], ...] = (
    _tool_speed,
    _torque,
    _floor,
    _cup,
    _palm,
    _column,
    _collisions,
)
