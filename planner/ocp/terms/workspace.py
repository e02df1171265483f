"""[workspace]: floor, base column and hand's body that the bar, and the arm, stay clear of."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import FlightState
from ...check import Margin, Throw, Violation, column_of
from ..asked import Request
from ..context import Context, Instant, Term
from ..stages import Rows, Stage

#: Margin [m] that the NLP keeps between obstacles and what is carried, for what lies between its
#: nodes, smoothing and correction; and how it grows.
HELD_MARGIN = 0.001
HELD = Margin("held", more=0.002, most=0.05)
#: Rounding [m] of the corner between two ways of being clear of an obstacle.
CORNER = 0.002
#: Instants of the flight with rows, the margin [m] kept there for what lies between, and how it
#: grows.
PASSING = 40
PASSING_MARGIN = 0.004
MARGIN = Margin("passing", more=0.002, most=0.03)
#: Over so many last of these instants it falls to none: the landing pose is given, and targets next
#: to the column would be lost.
LAST = 5
#: Times after detach [s] with rows.
PALM_TIMES = (0.01, 0.02, 0.03, 0.045, 0.06, 0.075, 0.09, 0.11, 0.13, 0.15, 0.18, 0.21, 0.25)
#: Instants of the rest of the flight, where the bar may fall back, and from when on [s].
LATER, LATER_FIRST = 40, 0.1
#: Margin [m] kept for what lies between.
PALM_MARGIN = 0.008


@dataclass(frozen=True)
class Floor(Term):
    """arm: whether joints and hand have rows too (guard "carry"); body: whether the hand has a
    body."""

    arm: bool
    body: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with a floor."""
        workspace = request.scene.workspace
        if workspace is None or workspace.floor is None:
            return None
        return cls("carry" in request.asked.guards, request.scene.arm is not None)

    def numbers(self, request: Request) -> dict[str, Any]:
        """Heights and margins; where the hand's body ends."""
        assert request.scene.workspace is not None and request.scene.workspace.floor is not None
        found = {
            "floor": request.scene.workspace.floor + HELD_MARGIN,
            "held_margin": request.asked.margins["held"],
        }
        if request.scene.arm is not None:
            tool = request.scene.arm.tool
            found |= {
                "body_back": tool.palm_back,
                "body_front": tool.palm_front,
                "body_half_width": tool.palm_half_width,
            }
        return found

    def at_instant(self, at: Instant) -> None:
        """The bar's far end, joint frames, the hand and its body not below the floor."""
        if at.grip == "none":
            return
        p, margin = at.context.parameters, at.held_margin
        _, z, _, _ = at.bar_end
        at.stage.row("floor", z - p("half_width") - p("floor") - margin, 0.0, np.inf)
        if not self.arm:
            return
        pose, *_ = at.hand
        heights = at.context.heights(at.q)
        if self.body:
            across = p("body_half_width") * ca.sqrt(ca.cos(pose[2]) ** 2 + 1e-6)
            ends = [p(name) * ca.sin(pose[2]) for name in ("body_back", "body_front")]
            heights += [pose[1] - end - across for end in ends]
        for height in [*heights, pose[1]]:
            at.stage.row("floor", height - (p("floor") + margin), 0.0, np.inf)

    def broken(self, throw: Throw) -> list[Violation]:
        """Bar, arm or hand below the floor at any sample before detach, or the arm after it."""
        workspace = throw.scene.workspace
        assert workspace is not None and workspace.floor is not None
        arm, bar = workspace.floor - throw.measured.arm, workspace.floor - throw.measured.held
        depth = max(arm, bar)
        if not depth > 1e-6:
            return []
        words = f"floor: {1e3 * depth:.0f} mm below it"
        return [Violation(words, "carry", HELD, depth, between=arm <= 1e-6)]


@dataclass(frozen=True)
class Column(Term):
    """passing: whether the flight has rows (guard "passing")."""

    passing: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with a base column."""
        if column_of(request.scene) is None:
            return None
        return cls("passing" in request.asked.guards)

    def numbers(self, request: Request) -> dict[str, Any]:
        """The column grown by the margin of what is carried; other margins."""
        column, margins = column_of(request.scene), request.asked.margins
        assert column is not None
        return {
            "column_radius": column[0] + HELD_MARGIN,
            "column_height": column[1] + HELD_MARGIN,
            "column_margin": HELD_MARGIN,
            "held_margin": margins["held"],
            "passing_margin": PASSING_MARGIN + margins["passing"],
        }

    def at_instant(self, at: Instant) -> None:
        """The held bar's far end clear of the column."""
        if at.grip != "none":
            clear = _distance(at.context, *at.bar_end)
            at.stage.row("base column", clear - at.held_margin, 0.0, np.inf)

    def in_flight(
        self, context: Context, stage: Stage, flight: FlightState, end: FlightState, time: ca.SX
    ) -> None:
        """Points of the flying bar clear of the column, from detach to landing."""
        p = context.parameters
        if not self.passing:
            return
        shares = np.linspace(0.0, 1.0, PASSING)
        kept = np.minimum(1.0, (1.0 - shares) * (PASSING - 1) / LAST)
        rows, (share, keep) = stage.at_instants(shares, kept)
        at = flight.after(share * time, context.gravity)
        margin = keep * p("passing_margin") - (1 - keep) * p("column_margin")
        theta = ca.SX(at.theta)
        cos, sin = ca.cos(theta), ca.sin(theta)
        for along in context.along_bar():
            clear = _distance(context, at.x + along * cos, at.z + along * sin, cos, sin)
            rows.row("base column", clear - margin, 0.0, np.inf)

    def broken(self, throw: Throw) -> list[Violation]:
        """The bar inside the column, held or in flight."""
        held, flown = -throw.measured.column_held, -throw.measured.column_flown
        words = "base column: the bar touches it"
        if max(held, flown) <= 1e-6:
            return []
        if held > flown:
            return [Violation(words, "carry", HELD, held, between=True)]
        return [Violation(words, "passing", MARGIN, flown)]


def _distance(context: Context, x: ca.SX, z: ca.SX, cos: ca.SX, sin: ca.SX) -> ca.SX:
    """Distance [m] of the bar at a point of its axis from the base column, above or to either side.

    cos, sin: of the bar's angle; its edges lie half its width across.
    """
    p = context.parameters
    above = z - p("half_width") * ca.sqrt(cos**2 + 1e-6) - p("column_height")
    aside = ca.sqrt(x**2 + 1e-8) - p("half_width") * ca.sqrt(sin**2 + 1e-6) - p("column_radius")
    return soft_max(above, aside)


@dataclass(frozen=True)
class Palm(Term):
    """early: whether the flight's first instants have rows (guard "flight"), for the bar's ends;
    later: whether all of it has (guard "return"), for more points of the bar."""

    early: bool
    later: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene that asks for a clearance."""
        workspace, arm, guards = request.scene.workspace, request.scene.arm, request.asked.guards
        if workspace is None or workspace.palm_clearance is None or arm is None:
            return None
        return cls(bool(guards & {"flight", "return"}), "return" in guards)

    def numbers(self, request: Request) -> dict[str, Any]:
        """The hand's body, grown by the clearance and half the bar's width."""
        workspace, arm = request.scene.workspace, request.scene.arm
        assert workspace is not None and workspace.palm_clearance is not None and arm is not None
        grown = request.scene.object.width / 2 + PALM_MARGIN + workspace.palm_clearance
        return {
            "palm_back": arm.tool.palm_back + grown,
            "palm_front": arm.tool.palm_front - grown,
            "palm_half_width": arm.tool.palm_half_width + grown,
        }

    def in_flight(
        self, context: Context, stage: Stage, flight: FlightState, end: FlightState, time: ca.SX
    ) -> None:
        """The bar clear of the hand's body at some times."""
        if self.early:
            # A bar that has just been let go meets the hand with an end.
            rows, (at,) = stage.at_instants(PALM_TIMES)
            ends = context.along_bar()
            _keep_off(context, stage, rows, flight, at, [ends[0], ends[-1]])
        if self.later:
            rows, (share,) = stage.at_instants(np.arange(1, LATER + 1) / LATER)
            at = LATER_FIRST + share * (time - LATER_FIRST)
            _keep_off(context, stage, rows, flight, at, context.along_bar())

    def broken(self, throw: Throw) -> list[Violation]:
        """The bar nearer to the hand than the clearance, at any sample of the flight."""
        least, first = throw.measured.palm, throw.measured.palm_time
        if first == math.inf:
            return []
        words = f"palm: the bar comes as near as {1e3 * least:.0f} mm"
        if first > PALM_TIMES[-1]:
            return [Violation(words, "return")]
        # Again with its rows: between the bar's ends, or later.
        return [Violation(words, "flight", then="return")]


def _keep_off(
    context: Context,
    stage: Stage,
    rows: Rows,
    flight: FlightState,
    time: ca.SX,
    points: Sequence[ca.SX],
) -> None:
    """Points of the flying bar clear of the hand's body at `time` after detach.

    Every coordinate brakes at `braking`. Seen from the hand a point is in
    front of the body, behind it or to its side.
    """
    p, braking = context.parameters, context.each("braking")
    q, dq, _ = context.node(stage)
    stop_time = ca.sqrt(dq**2 + 1e-6) / braking
    moving = ca.fmin(time / stop_time, 1.0)
    there = q + dq * stop_time * (moving - moving**2 / 2)
    still = ca.SX.zeros(context.n)
    pose, _, _ = context.hand(rows, there, still, still)
    cos_hand, sin_hand = ca.cos(pose[2]), ca.sin(pose[2])
    at = flight.after(time, context.gravity)
    for along in points:
        dx = at.x + along * ca.cos(at.theta) - pose[0]
        dz = at.z + along * ca.sin(at.theta) - pose[1]
        ahead = cos_hand * dx + sin_hand * dz
        before = ca.fmax(ahead + p("palm_front"), -ahead - p("palm_back"))
        aside = ca.sqrt((cos_hand * dz - sin_hand * dx) ** 2 + 1e-8) - p("palm_half_width")
        rows.row("palm", soft_max(before, aside), 0.0, np.inf)


def soft_max(a: ca.SX, b: ca.SX) -> ca.SX:
    """max(a, b) rounded from below: it never claims a distance that is not there."""
    return 0.5 * (a + b + ca.sqrt((a - b) ** 2 + CORNER**2) - CORNER)
