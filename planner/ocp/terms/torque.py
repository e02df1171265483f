"""[torque]: the throwing joints' torques stay within their limits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import PlanarArm, PlanarDynamics
from ...check import CheckedThrow, Margin, Violation, torque_use
from ..asked import Request
from ..context import Brake, Context, Instant, Load, Term
from ..stages import Stage

#: How the share of the limits that is kept free grows.
MARGIN = Margin("torque", more=0.01, most=0.3)
#: A joint counts as braking until about this time [s] after its stop.
STILL = 0.01


@dataclass(frozen=True)
class Torque(Term):
    """Rows at nodes and at some instants of the brake; the check looks at every sample."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a scene with [torque]."""
        return None if request.scene.torque is None else cls()

    def numbers(self, request: Request) -> dict[str, Any]:
        """The limits less the scene's margin and the one asked for."""
        section, arm = request.scene.torque, request.mover.kinematics
        assert section is not None and isinstance(arm, PlanarArm)
        share = 1 - section.margin - request.asked.margins["torque"]
        return {"torque_max": share * np.array(section.of(arm.arm, arm.throwing_joints))}

    def at_instant(self, at: Instant) -> None:
        """With the object, without, or, while the pads open, with all of it or nothing."""
        if at.grip != "none":
            _limit(at.context, at.stage, at.q, at.dq, at.ddq, at.load)
        if at.grip != "full":
            _limit(at.context, at.stage, at.q, at.dq, at.ddq)

    def at_last(self, context: Context, stage: Stage, brake: Brake) -> None:
        """The brake with an empty hand: as it begins, and as each joint comes to rest.

        Every joint brakes by itself; those that have stopped no longer do.
        """
        _limit(context, stage, brake.q, brake.dq, brake.ddq)
        q, dq, braking = brake.place, brake.rate, context.each("braking")
        against = -braking * dq / ca.sqrt(dq**2 + 1e-4)
        _limit(context, stage, q, dq, against)
        stops = ca.sqrt(dq**2 + 1e-6) / braking
        for i in range(context.n):
            left = stops - stops[i]
            going = (1 + (left + STILL) / ca.sqrt((left + STILL) ** 2 + STILL**2 / 4)) / 2
            share = ca.fmin(stops[i] / stops, 1.0)
            there = q + dq * stops * (share - share**2 / 2)
            _limit(context, stage, there, dq * (1 - share), going * against)

    def broken(self, throw: CheckedThrow) -> list[Violation]:
        """Joints whose torque is above its limit at any sample."""
        times, use = torque_use(throw)
        found = []
        for name, share in zip(throw.mover.joints, use.T, strict=True):
            if share.max() > 1.0:
                worst, when = 100 * share.max(), 1e3 * times[share.argmax()]
                words = f"torque of {name}: {worst:.0f} % of its limit at {when:.0f} ms"
                found.append(Violation(words, margin=MARGIN, depth=float(share.max()) - 1.0))
        return found


def _limit(
    context: Context, stage: Stage, q: ca.SX, dq: ca.SX, ddq: ca.SX, load: Load | None = None
) -> None:
    """The torques inside their limits; load: what the hand gives to the object."""
    arm = context.kinematics
    assert isinstance(arm, PlanarArm)
    angles, rates, turns = map(arm.turned, (q, dq, ddq))
    torques = PlanarDynamics(arm).torques(angles, rates, turns, context.gravity, load)
    context.limit(stage, "torque", ca.vertcat(*torques) / context.each("torque_max"))
