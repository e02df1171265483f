"""Uses of limits that a corrected motion keeps at 1: of what is sent, and of what is measured.

A use is a number at each of some samples, 1 where the limit is reached, with its derivatives by
differences: a program holds it to first order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ...models import Array, FlightState, HandSamples, Path, land
from ...problems import Scene
from ..check import (
    TICK,
    Around,
    Mover,
    Throw,
    column_distance,
    column_of,
    friction_use,
    held_bar,
    least_room,
    lowest_of_bar,
    outline,
    palm_corners,
    palm_distance,
    tool_speeds,
    torque_limits,
    torques_of,
    track_of,
)

#: Share of the limits that a motion uses, ticks between the places where it is held to curved ones,
#: and the share from which on it is.
SHARE, PLACES, NEARLY = 0.99, 4, 0.8
#: Share of grip and torque that is used: accelerations have corners at knots, sharper than samples
#: show.
FORCE = 0.97
#: Room [m] that counts as a whole use of a clearance; what is kept back [m] of one for what lies
#: between samples.
ROOM, BETWEEN = 0.3, 0.002
#: A landing off the target by this [m, rad] is a whole use.
LANDING = (0.02, 0.2)
#: Steps of the derivatives.
STEP = 1e-6


@dataclass(frozen=True, eq=False)
class SplineMotion:
    """Joints, rates and accelerations (3, N, n), and their rows (3, n, N, K): how each joint's
    depend on its coefficients."""

    values: Array
    rows: Array


@dataclass(frozen=True, eq=False)
class Use:
    """of: (P,) of joints and their derivatives, each (n, P), and of the CoM's pose and twist (6,)
    at detach, where it is about the flight; state: these joints, each (n, P); by (derivatives, n,
    P, K): how they depend on the coefficients."""

    of: Callable[..., Array]
    state: tuple[Array, ...]
    by: Array
    detach: tuple[Array, ...] = ()

    @classmethod
    def along(
        cls, of: Callable[..., Array], motion: SplineMotion, at: slice | Array, orders: int
    ) -> Use:
        """Of a motion at some samples."""
        state = tuple(values[at].T for values in motion.values[:orders])
        return cls(of, state, motion.rows[:orders, :, at])

    @cached_property
    def here(self) -> Array:
        """The use (P,)."""
        return self.of(*self.state, *self.detach)

    def rows(self, near: Array, flown: Array) -> tuple[Array, Array]:
        """Rows and upper bounds that hold it where it is large, to first order about `near` (K, n).

        flown (6, n K): how the CoM's pose and twist at detach depend on the coefficients.
        """
        some = np.flatnonzero(self.here > NEARLY)
        held = np.zeros((some.size, near.size))
        for j, unit in enumerate(np.eye(near.shape[1])[:, :, None]):
            for order in range(len(self.state)):
                moved = [v + STEP * unit * (k == order) for k, v in enumerate(self.state)]
                slope = (self.of(*moved, *self.detach) - self.here) / STEP
                columns = slice(j * len(near), (j + 1) * len(near))
                held[:, columns] += slope[some, None] * self.by[order, j][some]
        for detach in self.detach:
            for unit, row in zip(np.eye(len(detach)), flown, strict=True):
                slope = (self.of(*self.state, detach + STEP * unit) - self.here) / STEP
                held += slope[some, None] * row
        return held, SHARE - self.here[some] + held @ near.T.ravel()


def uses_of(
    plan: Throw,
    times: Array,
    opening_time: float,
    sent: SplineMotion,
    measured: SplineMotion,
    detach: Array,
) -> Iterator[Use]:
    """All of a motion that is to throw as a plan does.

    times (N,) [s] of both motions; detach (6,): the CoM's pose and twist when the pads are open.
    """
    scene, mover = plan.scene, plan.mover
    opened = int(np.searchsorted(times, opening_time + scene.gripper.profile().opening)) + 1
    every, grips = slice(None, None, PLACES), int(np.searchsorted(times, opening_time))
    yield from _speeds(scene, mover, sent)

    def grip(place: Array, rate: Array, turn: Array) -> Array:
        hand = HandSamples(place[0], *mover.motion(place, rate, turn))
        return np.asarray(np.hypot(*friction_use(scene, hand)) / FORCE)

    yield Use.along(grip, measured, slice(0, grips, PLACES // 2), 3)
    if torque_limits(scene) is not None:

        def torque(place: Array, rate: Array, turn: Array) -> Array:
            path = Path.quintics(PLACES * TICK, place.T, rate.T, turn.T)
            torques = torques_of(scene, mover, path, opening_time)
            return np.asarray(torques.use[::PLACES].max(axis=1) / FORCE)

        yield Use.along(torque, measured, every, 3)
    for at, held in ((slice(0, opened, PLACES), True), (slice(opened, None, PLACES), False)):
        yield Use.along(partial(_carried, scene, mover, times[at], held), measured, at, 1)
    yield from _flights(plan, times, opened, measured, detach)


def _speeds(scene: Scene, mover: Mover, sent: SplineMotion) -> Iterator[Use]:
    """Of the tool's speed, and of joint speeds where their limits depend on the position."""
    every, limits = slice(None, None, PLACES), mover.hard
    if scene.arm is not None and scene.tool_speed is not None:
        tool, most = scene.arm.tool, scene.tool_speed

        def speed(place: Array, rate: Array) -> Array:
            pose, twist, _ = mover.motion(place, rate, 0 * rate)
            return np.asarray(tool_speeds(tool, pose, twist) / most)

        yield Use.along(speed, sent, every, 2)
    if limits.slowing is not None:

        def slowing(joint: int, place: Array, rate: Array) -> Array:
            low, high = limits.velocity(place.T)
            # Room to either side, as a share of the limit that is the same everywhere.
            room = np.minimum(high - rate.T, rate.T - low) / limits.dq
            return np.asarray(1 - room[:, joint])

        for joint in range(mover.size):
            yield Use.along(partial(slowing, joint), sent, every, 2)


def _carried(scene: Scene, mover: Mover, times: Array, held: bool, place: Array) -> Array:
    """Of the room of arm, hand and held bar to floor, column and obstacles, and to each other."""
    assert scene.arm is not None
    (pose, heights), column = outline(mover, place), column_of(scene)
    bar = held_bar(scene, pose) if held else None
    around = Around.of(scene, mover)
    room = least_room(track_of(scene, around.capsules, times, place, bar), around)
    if scene.workspace is not None and scene.workspace.floor is not None:
        lowest = np.minimum(heights, palm_corners(scene.arm.tool, pose)[1].min(axis=1))
        if bar is not None:
            lowest = np.minimum(lowest, lowest_of_bar(scene.object, bar))
        room = np.minimum(room, lowest - scene.workspace.floor)
    if column is not None and bar is not None:
        room = np.minimum(room, column_distance(scene.object, bar, *column))
    return 1 - (room - BETWEEN) / ROOM


def _flights(
    plan: Throw, times: Array, opened: int, measured: SplineMotion, detach: Array
) -> Iterator[Use]:
    """Of the landing's place and angle; of the flying bar's room to all that is around it."""
    scene, mover, target = plan.scene, plan.mover, plan.target
    arm, around, column = scene.arm, Around.of(scene, mover), column_of(scene)
    assert arm is not None

    def off(side: int, which: int, place: Array, state: Array) -> Array:
        landed = land(state[None], target.z, scene.gravity)[0]
        wanted = (target.plane_x, landed[1] if target.theta is None else target.theta)
        use = SHARE + side * (landed[which] - wanted[which]) / LANDING[which]
        return np.full(place.shape[1], np.nan_to_num(use, nan=np.inf))

    for side in (-1, 1):
        for which in (0, 1):
            one = Use.along(partial(off, side, which), measured, slice(0, 1), 1)
            yield Use(one.of, one.state, one.by, (detach,))
    lasts = land(detach[None], target.z, scene.gravity)[0, 2]
    if not math.isfinite(lasts):
        return
    since = np.arange(0.0, lasts, PLACES * TICK)
    at = np.minimum(opened - 1 + PLACES * np.arange(since.size), times.size - 1)
    clearance = None if scene.workspace is None else scene.workspace.palm_clearance

    def depth(place: Array, state: Array) -> Array:
        fallen = FlightState(*state).after(since, scene.gravity)
        com = np.array([fallen.x, fallen.z, fallen.theta])
        track = track_of(scene, around.capsules, since, place, com, flying=True)
        room = least_room(track, around)
        if clearance is not None:
            away = palm_distance(scene.object, arm.tool, com, outline(mover, place)[0])
            room = np.minimum(room, away - clearance)
        if column is not None:
            room = np.minimum(room, column_distance(scene.object, com, *column))
        return 1 - (room - BETWEEN) / ROOM

    one = Use.along(depth, measured, at, 1)
    yield Use(one.of, one.state, one.by, (detach,))
