"""[workspace] palm_clearance: the flying bar keeps its distance from the hand that let it go."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import FlightState
from ...check import CheckedThrow, Violation, palm_distance, reach_of_bar
from ..asked import Request
from ..context import Context, Term
from ..stages import Stage
from .shapes import soft_max

#: Times after detach [s] with rows.
PALM_TIMES = (0.01, 0.02, 0.03, 0.045, 0.06, 0.075, 0.09, 0.11, 0.13, 0.15, 0.18, 0.21, 0.25)
#: Instants of the rest of the flight, where the bar may fall back, and from when on [s].
LATER, LATER_FIRST = 40, 0.1
#: Margin [m] kept for what lies between.
PALM_MARGIN = 0.008


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
            "palm_times": PALM_TIMES,
            "later_first": LATER_FIRST,
            "palm_back": arm.tool.palm_back + grown,
            "palm_front": arm.tool.palm_front - grown,
            "palm_half_width": arm.tool.palm_half_width + grown,
        }

    def in_flight(
        self, context: Context, stage: Stage, flight: FlightState, end: FlightState, time: ca.SX
    ) -> None:
        """The bar clear of the hand's body at some times."""
        p = context.parameters
        if self.early:
            # A bar that has just been let go meets the hand with an end.
            ends = [p("ahead"), -p("behind")]
            for at in ca.vertsplit(p("palm_times", len(PALM_TIMES))):
                _keep_off(context, stage, flight, at, ends)
        for i in range(LATER if self.later else 0):
            first, share = p("later_first"), (i + 1) / LATER
            at = first + share * (time - first)
            _keep_off(context, stage, flight, at, context.along_bar())

    def broken(self, throw: CheckedThrow) -> list[Violation]:
        """The bar nearer to the hand than the clearance, at any sample of the flight."""
        scene, flying = throw.scene, throw.flying
        assert scene.arm is not None and scene.workspace is not None
        tool, clearance, bar = scene.arm.tool, scene.workspace.palm_clearance, scene.object
        assert clearance is not None
        hand = throw.hand_in_flight
        reach = reach_of_bar(bar) + float(np.hypot(tool.palm_back, tool.palm_half_width))
        near = np.hypot(*(flying[:2] - hand[:2])) < reach + clearance
        distance = palm_distance(bar, tool, flying[:, near], hand[:, near])
        if not distance.min(initial=np.inf) < clearance - 1e-6:
            return []
        words = f"palm: the bar comes as near as {1e3 * distance.min():.0f} mm"
        first = throw.flight_times[near][distance < clearance - 1e-6][0]
        if first > PALM_TIMES[-1]:
            return [Violation(words, "return")]
        # Again with its rows: between the bar's ends, or later.
        return [Violation(words, "flight", then="return")]


def _keep_off(
    context: Context, stage: Stage, flight: FlightState, time: ca.SX, points: Sequence[ca.SX]
) -> None:
    """Points of the flying bar clear of the hand's body at `time` after detach.

    Every coordinate brakes at the acceleration counted on. Seen from the hand a point is in
    front of the body, behind it or beside it.
    """
    p, braking = context.parameters, context.each("braking")
    q, dq, _ = context.node(stage)
    stop_time = ca.sqrt(dq**2 + 1e-6) / braking
    moving = ca.fmin(time / stop_time, 1.0)
    there = q + dq * stop_time * (moving - moving**2 / 2)
    still = ca.SX.zeros(context.n)
    pose, _, _ = context.hand(stage, there, still, still)
    cos_hand, sin_hand = ca.cos(pose[2]), ca.sin(pose[2])
    at = flight.after(time, context.gravity)
    for along in points:
        dx = at.x + along * ca.cos(at.theta) - pose[0]
        dz = at.z + along * ca.sin(at.theta) - pose[1]
        ahead = cos_hand * dx + sin_hand * dz
        before = ca.fmax(ahead + p("palm_front"), -ahead - p("palm_back"))
        aside = ca.sqrt((cos_hand * dz - sin_hand * dx) ** 2 + 1e-8) - p("palm_half_width")
        stage.row("palm", soft_max(before, aside), 0.0, np.inf)
