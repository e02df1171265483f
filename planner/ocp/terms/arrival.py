"""[target] arrival: a latest time from the start of the motion to the landing."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Self

from ..request import Request
from ..scene_constraint import Flight, SceneConstraint
from ..stages import Stage
from ..transcription import Ocp
from ..variables import T

#: Margin [s] to the latest time: covers the difference between the NLP's landing and the exact one.
MARGIN = 1e-3


@dataclass(frozen=True)
class LatestArrival(SceneConstraint):
    """The latest time of the landing. The earliest needs no constraint: the arm can wait."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a target with an arrival."""
        target = request.target or request.scene.target
        return cls() if target is not None and math.isfinite(target.window[1]) else None

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """Time for carry and flight."""
        assert request.target is not None
        opening = request.scene.gripper.profile().opening
        return {"arrival": request.target.window[1] - opening - MARGIN}

    def add_states(self, ocp: Ocp, k: int, stage: Stage) -> None:
        """The carry's duration from the end of the carry to detach, where the flight's is known."""
        if ocp.structure.carry <= k <= ocp.structure.detach:
            stage.state(T)

    def in_flight(self, flight: Flight) -> None:
        """The landing's time."""
        arrival = flight.stage.states[T] + flight.time
        flight.subject_to("arrival", arrival - flight.p("arrival"), high=0.0)
