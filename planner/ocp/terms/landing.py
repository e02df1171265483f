"""[landing]: speed and turning rate at landing within bounds."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import FlightState
from ...check import Throw, Violation
from ..asked import Request
from ..context import Context, Term
from ..stages import Stage

#: Share of the bounds kept back: the exact model lands a little differently.
SHARE = 0.02


@dataclass(frozen=True)
class LandingBounds(Term):
    """Which of the bounds the scene has."""

    speed_min: bool
    speed_max: bool
    rate_max: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with [landing]."""
        bounds = request.scene.landing
        if bounds is None:
            return None
        return cls(bounds.speed_min > 0, bounds.speed_max is not None, bounds.rate_max is not None)

    def numbers(self, request: Request) -> dict[str, Any]:
        """The bounds less the share kept back."""
        bounds = request.scene.landing
        assert bounds is not None
        return {
            "speed_min": bounds.speed_min * (1 + SHARE),
            "speed_max": (bounds.speed_max or 0.0) * (1 - SHARE),
            "rate_max": (bounds.rate_max or 0.0) * (1 - SHARE),
        }

    def in_flight(
        self, context: Context, stage: Stage, flight: FlightState, end: FlightState, time: ca.SX
    ) -> None:
        """Rows for the bounds that there are."""
        p, speed2 = context.parameters, end.v_x**2 + end.v_z**2
        if self.speed_min:
            stage.row("landing speed", speed2 - p("speed_min") ** 2, 0.0, np.inf)
        if self.speed_max:
            stage.row("landing speed", speed2 - p("speed_max") ** 2, -np.inf, 0.0)
        if self.rate_max:
            stage.row("landing rate", end.omega / p("rate_max"), -1.0, 1.0)

    def broken(self, throw: Throw) -> list[Violation]:
        """Bounds that the exact landing breaks."""
        bounds, state = throw.scene.landing, throw.landing.state
        assert bounds is not None
        speed, rate, found = math.hypot(state.v_x, state.v_z), abs(state.omega), []
        if speed < bounds.speed_min:
            found.append(f"landing speed {speed:.2f} m/s below {bounds.speed_min:g}")
        if bounds.speed_max is not None and speed > bounds.speed_max:
            found.append(f"landing speed {speed:.2f} m/s above {bounds.speed_max:g}")
        if bounds.rate_max is not None and rate > bounds.rate_max:
            found.append(f"landing rate {rate:.2f} rad/s above {bounds.rate_max:g}")
        return [Violation(words) for words in found]
