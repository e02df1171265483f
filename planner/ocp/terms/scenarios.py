"""Other openings that share one hand motion: early, late, slow ones, thrown in the NLP too."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

from ..asked import Request
from ..context import Brake, Context, Term
from ..layout import REL, Block
from ..phases import gauss_interval, grip_force, grip_instants, land, let_go
from ..stages import Stage
from ..window import window_nodes

#: Price of the mean square scaled miss [1/m^2].
WEIGHT = 1e4


@dataclass(frozen=True)
class Scenarios(Term):
    """count: of the other openings. They have the numbers 1 to count, the planned one has 0."""

    count: int

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For the robust method of this name."""
        if request.robust != "scenarios" or request.window is None:
            return None
        return cls(len(request.window.delays))

    def numbers(self, request: Request) -> dict[str, Any]:
        """Each opening's grip force over the window."""
        assert request.window is not None
        profile = request.scene.gripper.profile()
        nodes = window_nodes(request.scene, request.window)
        instants = grip_instants(request.scene.mesh, nodes).ravel()
        forces = {
            grip_force(number): profile.force(instants - delay)
            for number, delay in enumerate(request.window.delays, start=1)
        }
        return {"scenario_weight": WEIGHT, **forces}

    def states(self, context: Context, k: int) -> dict[Block, int]:
        """The relative states from the window's start on."""
        if k <= context.structure.carry:
            return {}
        return {REL.number(i): context.rel_size for i in range(1, self.count + 1)}

    def in_window(self, context: Context, k: int, stage: Stage, following: Stage) -> None:
        """Each opening across the interval with its own grip force.

        Under full grip it sticks, without any it flies: the same law serves all along.
        """
        dt = context.length(k, stage)
        for i in range(1, self.count + 1):
            end = gauss_interval(context, stage, dt, i)
            context.close(stage, following, dt, {REL.number(i): end})

    def at_last(self, context: Context, stage: Stage, brake: Brake) -> None:
        """Each opening's landing, and the price of missing the target."""
        p, hand = context.parameters, context.hand(stage, brake.q, brake.dq, brake.ddq)
        for i in range(1, self.count + 1):
            end = land(context, stage, let_go(context, stage, hand, i), i)
            miss = (end.x - p("target_x")) ** 2
            if context.structure.angle:
                miss += (p("quiet_arm") * (end.theta - p("target_theta"))) ** 2
            stage.cost += p("scenario_weight") * miss / self.count
