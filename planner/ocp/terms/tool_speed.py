"""Tool speed: an arm's flange and the pads' centre keep the limit at which its controller stops.

Of a straight line on a rigid body one end is fastest, so these two stand for all between them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ...check import Margin, Throw, Violation
from ..asked import Request
from ..context import Context, Hand, Instant, Term
from ..stages import Rows, Stage

#: How the share of the limit that is kept back grows beyond the scene's velocity margin.
MARGIN = Margin("tool speed", more=0.003, most=0.2)


@dataclass(frozen=True)
class ToolSpeed(Term):
    """Rows at the instants of carry and opening: it often binds. The check looks at the brake too,
    during which the speed has only fallen so far."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For an arm, or a scene, with such a limit."""
        return None if request.scene.tool_speed is None else cls()

    def numbers(self, request: Request) -> dict[str, Any]:
        """The limit less its margins; how far the flange is behind the pads' centre."""
        scene = request.scene
        assert scene.tool_speed is not None and scene.robot is not None and scene.arm is not None
        share = 1 - scene.robot.velocity_margin - request.asked.margins[MARGIN.name]
        return {"tool_speed": share * scene.tool_speed, "tool_length": scene.arm.tool.tcp}

    def at_instant(self, at: Instant) -> None:
        """At each of them."""
        _limit(at.context, at.stage, at.hand)

    def at_last(self, context: Context, stage: Stage, place: ca.SX, rate: ca.SX) -> None:
        """At the last stage's node."""
        _limit(context, stage, context.hand(stage, *context.node(stage)))

    def broken(self, throw: Throw) -> list[Violation]:
        """The speed above the limit at any sample, from rest to rest."""
        most, speed = throw.scene.tool_speed, throw.measured.speed
        assert most is not None
        if speed <= most:
            return []
        words = f"tool speed: {speed:.3f} m/s, at most {most:g}"
        return [Violation(words, margin=MARGIN, depth=speed / most - 1.0)]


def _limit(context: Context, stage: Rows, hand: Hand) -> None:
    """Squared speeds of the pads' centre and of the flange behind it, over the limit's square."""
    p, (pose, (v_x, v_z, omega), _) = context.parameters, hand
    turning, limit = p("tool_length") * omega, p("tool_speed") ** 2
    behind = v_x + turning * ca.sin(pose[2]), v_z - turning * ca.cos(pose[2])
    for x, z in ((v_x, v_z), behind):
        stage.row("tool speed", (x**2 + z**2) / limit, -np.inf, 1.0)
