"""Limits of a corrected motion, on what is sent and on what will be measured.

Each limit is a use at some samples, 1 at the limit, with derivatives by differences: the quadratic
program holds it to first order.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ...models import Array, FlightState, HandSamples, Trajectory
from ...problems import Scene
from ..clearance import (
    CollisionScene,
    column_distance,
    held_bar,
    lowest_of_bar,
    palm_corners,
    palm_distance,
    tool_speeds,
)
from ..throw import (
    TICK,
    Manipulator,
    Throw,
    column_of,
    friction_use,
    outline,
    torque_limits,
    torques_of,
)


@dataclass(frozen=True)
class ConstraintSettings:
    """Settings of a corrected motion's limits.

    share: of a limit that may be used; force_share: of grip and torque limits, because
    accelerations peak at knots between samples. spacing: ticks between samples that limits are
    held at. active: use below which a limit is left out of the program.
    free [m]: clearance whose use is 0; margin [m]: of a clearance, for motion between samples.
    landing [m, rad]: landing error whose use is 1. step: of the derivatives by differences.
    """

    share: float = 0.99
    force_share: float = 0.97
    spacing: int = 4
    active: float = 0.8
    free: float = 0.3
    margin: float = 0.002
    landing: tuple[float, float] = (0.02, 0.2)
    step: float = 1e-6


LIMITS = ConstraintSettings()


@dataclass(frozen=True, eq=False)
class SplineMotion:
    """Joints, rates and accelerations (3, N, n), and their derivatives (3, n, N, K) by the spline
    coefficients of each joint."""

    values: Array
    rows: Array


@dataclass(frozen=True, eq=False)
class Constraint:
    """A limit on a motion at its samples `at`, P of them.

    of: its use (P,) by the first `orders` of joints, rates and accelerations, each (n, P), and, of
    a limit on the flight, by the CoM's pose and twist (6,) at `detach`.
    """

    of: Callable[..., Array]
    motion: SplineMotion
    at: slice | Array
    orders: int
    detach: tuple[Array, ...] = ()

    @cached_property
    def state(self) -> tuple[Array, ...]:
        """Joints, rates and accelerations (n, P) that it depends on."""
        return tuple(values[self.at].T for values in self.motion.values[: self.orders])

    @cached_property
    def use(self) -> Array:
        """The use (P,)."""
        return self.of(*self.state, *self.detach)

    def rows(self, point: Array, flown: Array) -> tuple[Array, Array]:
        """Rows and upper bounds of the active samples, to first order about `point` (K, n).

        flown (6, n K): derivatives of the CoM's pose and twist at detach by the coefficients.
        """
        some = np.flatnonzero(self.use > LIMITS.active)
        rows = np.zeros((some.size, point.size))
        for j, unit in enumerate(np.eye(point.shape[1])[:, :, None]):
            for order in range(len(self.state)):
                moved = [v + LIMITS.step * unit * (k == order) for k, v in enumerate(self.state)]
                slope = (self.of(*moved, *self.detach) - self.use) / LIMITS.step
                columns = slice(j * len(point), (j + 1) * len(point))
                jacobian = self.motion.rows[order, j, self.at]
                rows[:, columns] += slope[some, None] * jacobian[some]
        for detach in self.detach:
            for unit, row in zip(np.eye(len(detach)), flown, strict=True):
                slope = (self.of(*self.state, detach + LIMITS.step * unit) - self.use) / LIMITS.step
                rows += slope[some, None] * row
        return rows, LIMITS.share - self.use[some] + rows @ point.T.ravel()


def constraints_of(
    plan: Throw,
    times: Array,
    opening_time: float,
    sent: SplineMotion,
    measured: SplineMotion,
    detach: Array,
) -> Iterator[Constraint]:
    """All nonlinear limits of a motion that is to throw as a plan does.

    times (N,) [s] of both motions; detach (6,): the CoM's pose and twist when the pads are open.
    """
    scene, manipulator = plan.scene, plan.manipulator
    opened = int(np.searchsorted(times, opening_time + scene.gripper.profile().opening)) + 1
    every, grips = slice(None, None, LIMITS.spacing), int(np.searchsorted(times, opening_time))
    yield from _speeds(scene, manipulator, sent)

    def grip(place: Array, rate: Array, turn: Array) -> Array:
        hand = HandSamples(place[0], *manipulator.motion(place, rate, turn))
        return friction_use(scene, hand) / LIMITS.force_share

    yield Constraint(grip, measured, slice(0, grips, LIMITS.spacing // 2), 3)
    if torque_limits(scene) is not None:

        def torque(place: Array, rate: Array, turn: Array) -> Array:
            path = Trajectory.quintics(LIMITS.spacing * TICK, place.T, rate.T, turn.T)
            torques = torques_of(scene, manipulator, path, opening_time)
            return np.asarray(torques.use[:: LIMITS.spacing].max(axis=1) / LIMITS.force_share)

        yield Constraint(torque, measured, every, 3)
    for at, holding in (
        (slice(0, opened, LIMITS.spacing), True),
        (slice(opened, None, LIMITS.spacing), False),
    ):
        yield Constraint(partial(_carried, scene, manipulator, times[at], holding), measured, at, 1)
    yield from _flights(plan, times, opened, measured, detach)


def _speeds(scene: Scene, manipulator: Manipulator, sent: SplineMotion) -> Iterator[Constraint]:
    """Limits on the tool's speed, and on joint speeds where these depend on the position."""
    every, limits = slice(None, None, LIMITS.spacing), manipulator.hard
    if scene.arm is not None and scene.tool_speed is not None:
        tool, tool_speed = scene.arm.tool, scene.tool_speed

        def speed(place: Array, rate: Array) -> Array:
            pose, twist, _ = manipulator.motion(place, rate, 0 * rate)
            return np.asarray(tool_speeds(tool, pose, twist) / tool_speed)

        yield Constraint(speed, sent, every, 2)
    if limits.slowing is not None:

        def slowing(joint: int, place: Array, rate: Array) -> Array:
            low, high = limits.velocity(place.T)
            # Distance to both limits, as a share of the largest limit.
            distance = np.minimum(high - rate.T, rate.T - low) / limits.dq
            return np.asarray(1 - distance[:, joint])

        for joint in range(manipulator.size):
            yield Constraint(partial(slowing, joint), sent, every, 2)


def _carried(
    scene: Scene, manipulator: Manipulator, times: Array, holding: bool, place: Array
) -> Array:
    """Use of the clearances of arm, hand and held bar to all bodies around them."""
    assert scene.arm is not None
    (pose, heights), column = outline(manipulator, place), column_of(scene)
    bar = held_bar(scene, pose) if holding else None
    obstacles = CollisionScene.of(scene, manipulator)
    clearance = obstacles.min_clearance(obstacles.bodies_at(times, place, bar))
    if scene.workspace is not None and scene.workspace.floor is not None:
        lowest = np.minimum(heights, palm_corners(scene.arm.tool, pose)[1].min(axis=1))
        if bar is not None:
            lowest = np.minimum(lowest, lowest_of_bar(scene.object, bar))
        clearance = np.minimum(clearance, lowest - scene.workspace.floor)
    if column is not None and bar is not None:
        clearance = np.minimum(clearance, column_distance(scene.object, bar, *column))
    return 1 - (clearance - LIMITS.margin) / LIMITS.free


def _flights(
    plan: Throw, times: Array, opened: int, measured: SplineMotion, detach: Array
) -> Iterator[Constraint]:
    """Limits on the landing, and on the clearances of the flying bar."""
    scene, manipulator, target = plan.scene, plan.manipulator, plan.target
    arm, obstacles, column = scene.arm, CollisionScene.of(scene, manipulator), column_of(scene)
    assert arm is not None

    def landing_use(side: int, which: int, state: Array) -> Array:
        landed = scene.flight.land(state[None], target.z)[0]
        goal = (target.plane_x, landed[1] if target.theta is None else target.theta)
        off = side * (landed[which] - goal[which]) - target.half_widths[which]
        use = LIMITS.share + off / LIMITS.landing[which]
        return np.asarray(np.nan_to_num([use], nan=np.inf))

    for side in (-1, 1):
        for which in (0, 1):
            yield Constraint(partial(landing_use, side, which), measured, slice(0, 1), 0, (detach,))
    lasts = scene.flight.land(detach[None], target.z)[0, 2]
    if not math.isfinite(lasts):
        return
    since = np.arange(0.0, lasts, LIMITS.spacing * TICK)
    at = np.minimum(opened - 1 + LIMITS.spacing * np.arange(since.size), times.size - 1)
    allowed = scene.palm_clearance

    def depth(place: Array, state: Array) -> Array:
        com = scene.flight.after(FlightState(*state), since).pose
        clearance = obstacles.min_clearance(obstacles.bodies_at(since, place, com, flying=True))
        if allowed is not None:
            away = palm_distance(scene.object, arm.tool, com, outline(manipulator, place)[0])
            clearance = np.minimum(clearance, away - allowed)
        if column is not None:
            clearance = np.minimum(clearance, column_distance(scene.object, com, *column))
        return 1 - (clearance - LIMITS.margin) / LIMITS.free

    yield Constraint(depth, measured, at, 1, (detach,))
