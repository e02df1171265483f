"""[target] arrival: the object lands at the latest so long after the motion starts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import FlightState
from ...check import TICK, Throw, Violation
from ..asked import Request
from ..context import Context, Term
from ..layout import Block, T
from ..stages import Stage

#: Kept back of the latest time [s]: the exact model lands a little later or earlier.
MARGIN = 1e-3


@dataclass(frozen=True)
class LatestArrival(Term):
    """A latest time of the landing. An earliest one needs no row: the arm can wait."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a target with an arrival."""
        target = request.target or request.scene.target
        return cls() if target is not None and math.isfinite(target.window[1]) else None

    def numbers(self, request: Request) -> dict[str, Any]:
        """Time for carry and flight."""
        assert request.target is not None
        opening = request.scene.gripper.profile().opening
        return {"arrival": request.target.window[1] - opening - MARGIN}

    def states(self, context: Context, k: int) -> dict[Block, int]:
        """The carry's duration, up to the stage that knows the flight's."""
        s = context.structure
        return {T: 1} if s.carry <= k <= s.detach else {}

    def in_flight(
        self, context: Context, stage: Stage, flight: FlightState, end: FlightState, time: ca.SX
    ) -> None:
        """The landing's time."""
        latest = context.parameters("arrival")
        stage.row("arrival", stage.states[T] + time - latest, -np.inf, 0.0)

    def broken(self, throw: Throw) -> list[Violation]:
        """A landing later than that, by more than a sample's time."""
        latest, lands = throw.target.window[1], throw.landing_time
        if lands <= latest + TICK:
            return []
        return [Violation(f"arrival: lands at {lands:.3f} s, after {latest:g} s")]
