"""[workspace] floor: the held bar stays above it, and the arm too where that was seen to matter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ...check import CheckedThrow, Violation, lowest_of_bar
from ..asked import Request
from ..context import Instant, Term
from .shapes import HELD, HELD_MARGIN


@dataclass(frozen=True)
class Floor(Term):
    """arm: whether joints and hand have rows too (guard "carry"); body: whether the hand has a
    body."""

    arm: bool
    body: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with a floor."""
        workspace = request.scene.workspace
        if workspace is None or workspace.floor is None:
            return None
        return cls("carry" in request.asked.guards, request.scene.arm is not None)

    def numbers(self, request: Request) -> dict[str, Any]:
        """Heights and margins; where the hand's body ends."""
        assert request.scene.workspace is not None and request.scene.workspace.floor is not None
        found = {
            "floor": request.scene.workspace.floor + HELD_MARGIN,
            "held_margin": request.asked.margins["held"],
        }
        if request.scene.arm is not None:
            tool = request.scene.arm.tool
            found |= {
                "body_back": tool.palm_back,
                "body_front": tool.palm_front,
                "body_half_width": tool.palm_half_width,
            }
        return found

    def at_instant(self, at: Instant) -> None:
        """The bar's far end, joint frames, the hand and its body not below the floor."""
        if at.grip == "none":
            return
        p, margin = at.context.parameters, at.held_margin
        _, z, _, _ = at.bar_end
        at.stage.row("floor", z - p("half_width") - p("floor") - margin, 0.0, np.inf)
        if not self.arm:
            return
        pose, _ = at.hand
        heights = at.context.heights(at.q)
        if self.body:
            across = p("body_half_width") * ca.sqrt(ca.cos(pose[2]) ** 2 + 1e-6)
            ends = [p(name) * ca.sin(pose[2]) for name in ("body_back", "body_front")]
            heights += [pose[1] - end - across for end in ends]
        for height in [*heights, pose[1]]:
            at.stage.row("floor", height - (p("floor") + margin), 0.0, np.inf)

    def broken(self, throw: CheckedThrow) -> list[Violation]:
        """Bar, arm or hand below the floor at any sample before detach, or the arm after it."""
        workspace = throw.scene.workspace
        assert workspace is not None and workspace.floor is not None
        arm = float(workspace.floor - throw.lowest_of_arm)
        bar = float(workspace.floor - lowest_of_bar(throw.scene.object, throw.held).min())
        depth = max(arm, bar)
        if not depth > 1e-6:
            return []
        words = f"floor: {1e3 * depth:.0f} mm below it"
        return [Violation(words, "carry", HELD, depth, between=arm <= 1e-6)]
