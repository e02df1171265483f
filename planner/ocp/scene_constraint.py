"""Base class of the constraints of a scene, and the quantities that they constrain.

Each subclass of `SceneConstraint`, in `terms`, is for one optional part of a scene. An absent part
adds no variable, constraint or parameter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Literal, Self

import casadi as ca
import numpy as np

from ...models import FlightState, held_wrench
from .request import Request
from .stages import Stage
from .transcription import Hand, Interval, Node, Ocp, OutlinePoint, Scope

#: Share of the acceleration limit that the brake uses.
BRAKE_SHARE = 0.95
#: State of the grip: full, opening (the object may stick or slide), none.
Grip = Literal["full", "opening", "none"]
Load = tuple[ca.SX, ca.SX, ca.SX]


@dataclass(frozen=True, eq=False)
class Instant(Scope):
    """The hand at one instant of an interval, or at each of a group of instants.

    q, dq, ddq (n,): the coordinates. given: the scene prescribes the pose, so only the usual margin
    is possible there.
    """

    q: ca.SX
    dq: ca.SX
    ddq: ca.SX
    grip: Grip
    given: bool = False

    @classmethod
    def of(cls, interval: Interval, t: ca.SX, grip: Grip, *, given: bool = False) -> Instant:
        """The hand at time t into an interval."""
        return cls(interval.ocp, interval.stage, *interval.at(t), grip, given)

    @cached_property
    def hand(self) -> Hand:
        """The hand's pose (x, z, theta), twist and motion."""
        return self.hand_of(self.q, self.dq, self.ddq)

    @cached_property
    def load(self) -> Load:
        """Force and torque at the pads that hold the object."""
        ocp = self.ocp
        return held_wrench(ocp.body, ocp.gravity, self.hand[2], ocp.grasp_angle)

    @cached_property
    def bar_end(self) -> tuple[ca.SX, ca.SX, ca.SX, ca.SX]:
        """x, z [m] of the middle of the held bar's far end; cos and sin of the bar's angle."""
        pose, theta = self.hand[0], self.hand[0][2] + self.ocp.grasp_angle
        reach = self.ocp.body.com_offset + self.p("ahead")
        cos, sin = ca.cos(theta), ca.sin(theta)
        return pose[0] + reach * cos, pose[1] + reach * sin, cos, sin

    def held_points(self) -> list[tuple[ca.SX, ca.SX, OutlinePoint]]:
        """x, z [m] of both ends of each capsule's axis of the held object's outline."""
        pose, theta = self.hand[0], self.hand[0][2] + self.ocp.grasp_angle
        cos, sin, h = ca.cos(theta), ca.sin(theta), self.ocp.body.com_offset
        com, points = (pose[0] + h * cos, pose[1] + h * sin), self.ocp.outline_points(2)
        return [(*point.placed(*com, cos, sin), point) for point in points]

    @property
    def held_margin(self) -> ca.SX:
        """Margin [m] between obstacles and held bar, beyond the usual one."""
        return ca.SX(0) if self.given else self.p("held_margin")


@dataclass(frozen=True, eq=False)
class Flight(Node):
    """The free flight from a node: CoM pose and twist at its start and end, free duration [s]."""

    start: FlightState
    end: FlightState
    time: ca.SX

    @classmethod
    def of(cls, node: Node, hand: Hand, time: ca.SX, opening: int) -> Flight:
        """A flight of `time` [s] from a node without grip force; opening: 0 is the planned one."""
        pose, twist, motion = hand
        state = node.ocp.full_relative_state(node.relative_state(opening))
        values = node.ocp.release(opening).com_state(state, pose, twist, motion)
        start = node.ocp.flight.calibrated(FlightState(*node.stage.lift(*values)), time)
        end = node.ocp.flight.after(start, time)
        return cls(node.ocp, node.stage, node.k, start, end, time)

    def after(self, time: ca.SX | float) -> FlightState:
        """The state `time` [s] after detach."""
        return self.ocp.flight.after(self.start, time)


@dataclass(frozen=True, eq=False)
class Brake(Node):
    """Braking to rest from the last node.

    place, rate (n,): at the start of full braking, after the jerk limit has turned the
    acceleration. peak (n,): the largest rate until then.
    """

    place: ca.SX
    rate: ca.SX
    peak: ca.SX

    @classmethod
    def of(cls, node: Node) -> Brake:
        """The brake from a node."""
        ocp, (q, dq, ddq) = node.ocp, node.coordinates
        jerk, ahead = ocp.each("jerk_max"), dq / ca.sqrt(dq**2 + 1e-2)
        turning = (ocp.each("braking") + ahead * ddq) / jerk
        place = q + turning * (dq + turning * (ddq / 2 - turning * ahead * jerk / 6))
        rate = dq + turning * (ddq - turning * ahead * jerk / 2)
        # Until the acceleration is zero the rate grows.
        peak = dq + ddq * ca.sqrt(ddq**2 + 1e-2) / (2 * jerk)
        return cls(ocp, node.stage, node.k, place, rate, peak)

    @property
    def stop(self) -> ca.SX:
        """The coordinates (n,) at rest."""
        return self.place + self.rate * ca.sqrt(self.rate**2 + 1e-4) / (
            2 * self.ocp.each("braking")
        )


def gripped_instants(interval: Interval) -> list[Instant]:
    """Instants of an interval under full grip: at even parts, and at a given start by itself."""
    if interval.phase not in ("carry", "early"):
        return []
    s, k = interval.ocp.structure, interval.k
    parts = s.instants if interval.phase == "carry" else 1
    given = k == 0 and not s.free_start
    # The acceleration is continuous: its begin was constrained as the interval before ended.
    first = given or k not in (0, s.carry)
    start = [Instant.of(interval, ca.SX(0), "full", given=True)] if given else []
    scope, (share,) = interval.at_instants(np.arange(first, parts + 1) / parts)
    return [*start, Instant(interval.ocp, scope.stage, *interval.at(share * interval.dt), "full")]


def braked(q: Any, dq: Any, time: Any, braking: Any, least: Callable[[Any, Any], Any]) -> Any:
    """Coordinates `time` [s] into a brake from q, dq, independent of each other.

    For symbols and numbers; least: the minimum of two values of that kind.
    """
    stop_time = (dq**2 + 1e-6) ** 0.5 / braking
    moving = least(time / stop_time, 1.0)
    return q + dq * stop_time * (moving - moving**2 / 2)


@dataclass(frozen=True)
class SceneConstraint:
    """Constraints of one optional part of a scene, or of a lazy constraint.

    A subclass is a frozen dataclass; its own fields select the constraints of an NLP. It overrides
    `of`, and each other method to which it adds something.

    values: of the parameters in its constraints, by name, for one request.
    """

    #: Whether the object's rotation matters for it although the landing angle is open.
    turns: ClassVar[bool] = False
    #: Whether its parameters depend on the throw at the start of a solve.
    linearised: ClassVar[bool] = False

    values: dict[str, Any] = field(repr=False)

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """The constraints of a request with their values, None if its scene has none."""
        raise NotImplementedError

    def add_states(self, ocp: Ocp, k: int, stage: Stage) -> None:
        """Adds states to node k."""

    def at_instant(self, at: Instant) -> None:
        """At an instant of the carry or a node of the opening or of the late phase."""

    def in_interval(self, interval: Interval) -> None:
        """In each interval."""

    def at_rate(self, node: Node, q: ca.SX, dq: ca.SX) -> None:
        """At rates dq of coordinates q."""

    def in_flight(self, flight: Flight) -> None:
        """In the flight from detach to the landing."""

    def at_last(self, brake: Brake) -> None:
        """At the last node: the coordinates brake to rest from it."""
