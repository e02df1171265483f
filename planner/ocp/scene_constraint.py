"""Base class of the constraints of a scene, and the quantities that they constrain.

Each subclass of `SceneConstraint`, in `terms`, is for one optional part of a scene. An absent part
adds no variable, constraint or parameter.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Literal, Self

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import FlightState, held_wrench
from ...models.robot import PlanarArm
from .request import Request
from .stages import Constraints, Parameters, Stage
from .transcription import Hand, Interval, Node, Ocp

#: Share of the acceleration limit that the brake uses.
BRAKE_SHARE = 0.95
#: State of the grip: full, opening (the object may stick or slide), none.
Grip = Literal["full", "opening", "none"]
Load = tuple[ca.SX, ca.SX, ca.SX]


@dataclass(frozen=True, eq=False)
class Instant:
    """The hand at one instant of an interval.

    q, dq, ddq (n,): the coordinates. given: the scene prescribes the pose, so only the usual margin
    is possible there.
    """

    ocp: Ocp
    constraints: Constraints
    q: ca.SX
    dq: ca.SX
    ddq: ca.SX
    grip: Grip
    given: bool = False

    @classmethod
    def of(cls, interval: Interval, t: ca.SX, grip: Grip, *, given: bool = False) -> Instant:
        """The hand at time t into an interval."""
        return cls(interval.ocp, interval.stage, *interval.at(t), grip, given)

    @classmethod
    def each(cls, interval: Interval, shares: npt.ArrayLike, grip: Grip) -> Instant:
        """The instants at these shares of an interval; their constraints are written once."""
        group, (share,) = interval.stage.at_instants(shares)
        return cls(interval.ocp, group, *interval.at(share * interval.dt), grip)

    @property
    def p(self) -> Parameters:
        """The parameters."""
        return self.ocp.parameters

    def subject_to(
        self, name: str, value: ca.SX, low: float = -np.inf, high: float = np.inf
    ) -> None:
        """Add the constraint low <= value <= high, for each component."""
        self.constraints.subject_to(name, value, low, high)

    @cached_property
    def hand(self) -> Hand:
        """The hand's pose (x, z, theta), twist and motion."""
        return self.ocp.hand(self.constraints, self.q, self.dq, self.ddq)

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

    @property
    def joint_heights(self) -> list[ca.SX]:
        """Heights [m] of the arm's joint frames; none of a hand that moves by itself."""
        arm = self.ocp.kinematics
        return arm.heights(arm.link_angles(self.q)) if isinstance(arm, PlanarArm) else []

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
        start = FlightState(*node.stage.lift(*values))
        end = node.ocp.flight.after(start, time)
        return cls(node.ocp, node.k, node.stage, start, end, time)

    def after(self, time: ca.SX) -> FlightState:
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
        """From a node."""
        ocp, (q, dq, ddq) = node.ocp, node.coordinates
        place, rate, peak = q, dq, dq
        if ocp.structure.jerk_control:
            jerk, ahead = ocp.each("jerk_max"), dq / ca.sqrt(dq**2 + 1e-2)
            turning = (ocp.each("braking") + ahead * ddq) / jerk
            place = q + turning * (dq + turning * (ddq / 2 - turning * ahead * jerk / 6))
            rate = dq + turning * (ddq - turning * ahead * jerk / 2)
            # Until the acceleration is zero the rate grows.
            peak = dq + ddq * ca.sqrt(ddq**2 + 1e-2) / (2 * jerk)
        return cls(ocp, node.k, node.stage, place, rate, peak)

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
    # A continuous acceleration was constrained at the end of the interval before.
    first = given or (k not in (0, s.carry) and (s.jerk_control or k > s.carry))
    start = [Instant.of(interval, ca.SX(0), "full", given=True)] if given else []
    return [*start, Instant.each(interval, np.arange(first, parts + 1) / parts, "full")]


def braked(q: Any, dq: Any, time: Any, braking: Any, least: Callable[[Any, Any], Any]) -> Any:
    """Coordinates `time` [s] into a brake from q, dq, independent of each other.

    For symbols and numbers; least: the minimum of two values of that kind.
    """
    stop_time = (dq**2 + 1e-6) ** 0.5 / braking
    moving = least(time / stop_time, 1.0)
    return q + dq * stop_time * (moving - moving**2 / 2)


class SceneConstraint:
    """Constraints of one optional part of a scene, or of a lazy constraint.

    A subclass is a frozen dataclass; its fields select the constraints of an NLP. It overrides
    `of`, and each other method to which it adds something.
    """

    #: Whether the object's rotation matters for it although the landing angle is open.
    turns: ClassVar[bool] = False

    @property
    def linearised(self) -> bool:
        """Whether its parameters depend on the throw at the start of a solve."""
        return False

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """The constraints of a request, None if its scene has none."""
        raise NotImplementedError

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """Values of the parameters in its constraints, by name."""
        return {}

    def add_states(self, ocp: Ocp, k: int, stage: Stage) -> None:
        """Adds states to node k."""

    def at_instant(self, at: Instant) -> None:
        """At an instant of the carry or a node of the opening or of the late phase."""

    def in_interval(self, interval: Interval) -> None:
        """In each interval."""

    def at_rate(self, node: Node, q: ca.SX, dq: ca.SX) -> None:
        """At rates dq of coordinates q."""

    def in_window(self, interval: Interval) -> None:
        """In each interval from the end of the carry on, the window of a robust request."""

    def in_flight(self, flight: Flight) -> None:
        """In the flight from detach to the landing."""

    def at_last(self, brake: Brake) -> None:
        """At the last node: the coordinates brake to rest from it."""
