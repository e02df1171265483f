"""[cup]: the bar goes into the cup with one end, clear of rim and wall."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import casadi as ca

from ....problems import Pose, Scene
from ..request import Request
from ..scene_constraint import Flight, SceneConstraint
from ..variables import Block

#: Depths of the lower end with constraints: without and with the lazy constraint "flight".
DEPTHS = (4, 12)
#: Margin [m] to rim and wall: covers the motion between depths; `lazy_constraints.CUP` adds to it.
CUP_MARGIN = 0.001
#: Time after detach [s] at which the lowest corner passes the rim.
T_RIM = Block("t_rim", "s")
#: Time after detach [s] at which the lower end is at a depth.
T_CUP = Block("t_cup", "s")


@dataclass(frozen=True)
class CupClearance(SceneConstraint):
    """The bar's outline inside the cup at several depths of its lower end.

    One unknown time is that of the lowest corner at the rim's height: the corner is clear of the
    wall. Each depth adds an unknown time, at which the middle of the lower end is at that depth:
    the corners of the end are clear of the wall, the long edges clear of the rim. The cup moves
    with the target, and in an elastic problem with the landing.
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
        return cls(DEPTHS["flight" in request.refinement.lazy], request.elastic, moves)

    def parameter_values(self, request: Request) -> dict[str, Any]:
        """Place and size of the cup, and the end of the bar that enters."""
        cup, target = request.scene.cup, request.target
        assert cup is not None and target is not None
        return {
            "cup_x": cup.x,
            "cup_rim": cup.rim,
            "cup_insertion": cup.insertion,
            # The bar is as thick as it is wide, so a round cup is narrower off its middle.
            "cup_radius": math.sqrt(cup.radius**2 - (request.scene.object.width / 2) ** 2),
            "cup_clearance": cup.clearance + CUP_MARGIN + request.refinement.margins["cup"],
            "lower_end": lower_end(request.scene, target),
            **({"cup_speed": target.speed} if self.moves else {}),
        }

    def in_flight(self, flight: Flight) -> None:
        """The rim, then each depth."""
        p, end = flight.p, flight.end
        radius, clearance, half_width = p("cup_radius"), p("cup_clearance"), p("half_width")
        landed = p("cup_x") + (end.x - p("target_x") if self.elastic else 0)

        def cup_at(time: ca.SX) -> ca.SX:
            return landed + p("cup_speed") * (time - flight.time) if self.moves else landed

        lower = p("lower_end")
        time = flight.stage.control(T_RIM)
        at, cup_x = flight.after(time), cup_at(time)
        cos, sin = ca.cos(at.theta), ca.sin(at.theta)
        across = half_width * cos / ca.sqrt(cos**2 + 1e-6)
        flight.subject_to("cup depth", at.z + lower * sin - across * cos - p("cup_rim"), 0.0, 0.0)
        corner = at.x + lower * cos + across * sin - cup_x
        flight.subject_to("cup clearance", corner / (radius - clearance), -1.0, 1.0)
        for i in range(self.depths):
            time = flight.stage.control(T_CUP.number(i))
            at, cup_x = flight.after(time), cup_at(time)
            cos, sin = ca.cos(at.theta), ca.sin(at.theta)
            depth = p("cup_insertion") * i / max(self.depths - 1, 1)
            flight.subject_to("cup depth", at.z + lower * sin - (p("cup_rim") - depth), 0.0, 0.0)
            for side in (-1, 1):
                corner = at.x + lower * cos - side * half_width * sin - cup_x
                flight.subject_to("cup clearance", corner / (radius - clearance), -1.0, 1.0)
            # The rim's two edges lie to either side of the bar's axis: signed distances.
            offset = (at.x - cup_x) * sin + (p("cup_rim") - at.z) * cos
            free = radius * ca.sqrt(sin**2 + 1e-9) - half_width - clearance
            flight.subject_to("cup clearance", (offset - free) / radius, high=0.0)
            flight.subject_to("cup clearance", (offset + free) / radius, low=0.0)


def lower_end(scene: Scene, target: Pose) -> float:
    """Distance [m] from the CoM to the end that lands lower; negative: the grasped end."""
    theta = 0.0 if target.theta is None else target.theta
    ahead = scene.object.length - scene.object.com
    return ahead if math.sin(theta) < 0 else -scene.object.com
