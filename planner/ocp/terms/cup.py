"""[cup]: the bar goes into the cup with one end, clear of rim and wall."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import casadi as ca
import numpy as np

from ....models import FlightState
from ....problems import Pose, Scene
from ...check import Margin, Throw, Violation
from ..asked import Request
from ..context import Context, Term
from ..layout import Block
from ..stages import Stage

#: Depths of the lower end with rows: at first, and with the guard "flight".
DEPTHS = (4, 12)
#: Margin [m] kept for what lies between, and how it grows.
CUP_MARGIN = 0.001
MARGIN = Margin("cup", more=2e-4, most=0.005)
#: Times after detach: the lowest corner passes the rim; the lower end is at each depth.
T_RIM, T_CUP = Block("t_rim", "s"), Block("t_cup", "s")


@dataclass(frozen=True)
class CupClearance(Term):
    """The bar's outline inside the opening at several depths of its lower end.

    First its lowest corner passes the rim, at one unknown time, clear of the wall. Then, per
    depth, one unknown time at which the middle of the lower end is that far below the rim; the
    end's corners keep the clearance to the wall, and the long edges keep it to the rim. The cup
    goes with the target, so with a landing that may miss it goes with that.
    """

    turns: ClassVar[bool] = True
    depths: int
    elastic: bool
    moves: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with a cup."""
        if request.scene.cup is None:
            return None
        target = request.target or request.scene.target
        moves = target is not None and target.velocity is not None
        return cls(DEPTHS["flight" in request.asked.guards], request.elastic, moves)

    def numbers(self, request: Request) -> dict[str, Any]:
        """The cup where it is, and which end goes in."""
        cup, target = request.scene.cup, request.target
        assert cup is not None and target is not None
        return {
            "cup_x": cup.x,
            "cup_rim": cup.rim,
            "cup_insertion": cup.insertion,
            # The bar is as thick as it is wide, so a round cup is narrower off its middle.
            "cup_radius": math.sqrt(cup.radius**2 - (request.scene.object.width / 2) ** 2),
            "cup_clearance": cup.clearance + CUP_MARGIN + request.asked.margins["cup"],
            "lower_end": lower_end(request.scene, target),
            **({"cup_speed": target.speed} if self.moves else {}),
        }

    def in_flight(
        self, context: Context, stage: Stage, flight: FlightState, end: FlightState, time: ca.SX
    ) -> None:
        """The rim, then each depth."""
        p = context.parameters
        radius, clearance, half_width = p("cup_radius"), p("cup_clearance"), p("half_width")
        landed = p("cup_x") + (end.x - p("target_x") if self.elastic else 0)

        def cup_at(after: ca.SX) -> ca.SX:
            return landed + p("cup_speed") * (after - time) if self.moves else landed

        lower = p("lower_end")
        after = stage.control(T_RIM)
        at, cup_x = flight.after(after, context.gravity), cup_at(after)
        cos, sin = ca.cos(at.theta), ca.sin(at.theta)
        across = half_width * cos / ca.sqrt(cos**2 + 1e-6)
        stage.row("cup depth", at.z + lower * sin - across * cos - p("cup_rim"), 0.0, 0.0)
        corner = at.x + lower * cos + across * sin - cup_x
        stage.row("cup clearance", corner / (radius - clearance), -1.0, 1.0)
        for i in range(self.depths):
            after = stage.control(T_CUP.number(i))
            at, cup_x = flight.after(after, context.gravity), cup_at(after)
            cos, sin = ca.cos(at.theta), ca.sin(at.theta)
            depth = p("cup_insertion") * i / max(self.depths - 1, 1)
            stage.row("cup depth", at.z + lower * sin - (p("cup_rim") - depth), 0.0, 0.0)
            for side in (-1, 1):
                corner = at.x + lower * cos - side * half_width * sin - cup_x
                stage.row("cup clearance", corner / (radius - clearance), -1.0, 1.0)
            # The rim's two edges lie to either side of the bar's axis: signed distances.
            offset = (at.x - cup_x) * sin + (p("cup_rim") - at.z) * cos
            free = radius * ca.sqrt(sin**2 + 1e-9) - half_width - clearance
            stage.row("cup clearance", (offset - free) / radius, -np.inf, 0.0)
            stage.row("cup clearance", (offset + free) / radius, 0.0, np.inf)

    def broken(self, throw: Throw) -> list[Violation]:
        """A bar that does not get deep, or too near to wall or rim on its way."""
        cup = throw.scene.cup
        assert cup is not None
        clearance = throw.measured.cup
        if clearance == -math.inf:
            return [Violation("cup: the bar does not reach the asked depth")]
        if clearance < cup.clearance - 1e-5:
            words = f"cup clearance {1e3 * clearance:.1f} mm"
            return [Violation(words, "flight", MARGIN, cup.clearance - clearance)]
        return []


def lower_end(scene: Scene, target: Pose) -> float:
    """Distance [m] from the CoM to the end that lands lower; negative: the grasped end."""
    theta = 0.0 if target.theta is None else target.theta
    ahead = scene.object.length - scene.object.com
    return ahead if math.sin(theta) < 0 else -scene.object.com
