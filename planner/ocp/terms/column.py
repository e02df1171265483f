"""[workspace] column: the bar stays clear of the robot's base, held and in flight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import FlightState
from ...check import CheckedThrow, Margin, Violation, column_of, column_room
from ..asked import Request
from ..context import Context, Instant, Term
from ..stages import Stage
from .shapes import HELD, HELD_MARGIN, soft_max

#: Instants of the flight with rows, the margin [m] kept there for what lies between, and how it
#: grows.
PASSING = 40
PASSING_MARGIN = 0.004
MARGIN = Margin("passing", more=0.002, most=0.03)
#: Margin at the last of these instants: the landing pose itself is given, and targets next to the
#: column would be lost.
LAST = 5


@dataclass(frozen=True)
class Column(Term):
    """instants: of the flight with rows (guard "passing")."""

    instants: int

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with a base column."""
        if column_of(request.scene) is None:
            return None
        return cls(PASSING if "passing" in request.asked.guards else 0)

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
        for i in range(self.instants):
            share = min(1.0, (self.instants - 1 - i) / LAST)
            at = flight.after(time * (i / (self.instants - 1)), context.gravity)
            margin = share * p("passing_margin") - (1 - share) * p("column_margin")
            theta = ca.SX(at.theta)
            cos, sin = ca.cos(theta), ca.sin(theta)
            for along in context.along_bar():
                clear = _distance(context, at.x + along * cos, at.z + along * sin, cos, sin)
                stage.row("base column", clear - margin, 0.0, np.inf)

    def broken(self, throw: CheckedThrow) -> list[Violation]:
        """The bar inside the column, held or in flight."""
        column, bar = column_of(throw.scene), throw.scene.object
        assert column is not None
        held, flown = (
            float(-column_room(bar, poses, *column).min()) for poses in (throw.held, throw.flying)
        )
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
