"""[landing]: speed and turning rate at landing within bounds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

from ..request import Request
from ..scene_constraint import Flight, SceneConstraint

#: Margin, as a share of the bounds: covers the difference between the NLP's landing and the exact
#: one.
MARGIN = 0.02


@dataclass(frozen=True)
class LandingBounds(SceneConstraint):
    """Bounds of speed and turning rate at the landing. Fields: whether the scene has the bound."""

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

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """The bounds less the margin."""
        bounds = request.scene.landing
        assert bounds is not None
        return {
            "speed_min": bounds.speed_min * (1 + MARGIN),
            "speed_max": (bounds.speed_max or 0.0) * (1 - MARGIN),
            "rate_max": (bounds.rate_max or 0.0) * (1 - MARGIN),
        }

    def in_flight(self, flight: Flight) -> None:
        """The scene's bounds."""
        p, end = flight.p, flight.end
        squared = end.v_x**2 + end.v_z**2
        if self.speed_min:
            flight.subject_to("landing speed", squared - p("speed_min") ** 2, low=0.0)
        if self.speed_max:
            flight.subject_to("landing speed", squared - p("speed_max") ** 2, high=0.0)
        if self.rate_max:
            flight.subject_to("landing rate", end.omega / p("rate_max"), -1.0, 1.0)
