"""Joint limits beyond those that every throw keeps: torques, and an arm's slowing velocity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ....models import PlanarArm, PlanarDynamics
from ....problems import Torque
from ...check import Margin, Throw, Violation, torque_limits
from ..asked import Request
from ..context import Context, Instant, Load, Term
from ..stages import Rows, Stage

#: Parameters: as in `models.Slowing`.
NAMES = ("slowing", "slowing_offset", "slowing_upper", "slowing_lower")
#: How the share of the limits that is kept free grows.
MARGIN = Margin("torque", more=0.01, most=0.3)
#: A joint counts as braking until about this time [s] after its stop.
STILL = 0.01


@dataclass(frozen=True)
class SlowingLimits(Term):
    """For arms like the FR3. The check looks at it with the other limits of the samples."""

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For an arm that has such limits."""
        return None if request.mover.planning.slowing is None else cls()

    def numbers(self, request: Request) -> dict[str, Any]:
        """The limits' curves."""
        assert request.mover.planning.slowing is not None
        return dict(zip(NAMES, request.mover.planning.slowing, strict=True))

    def at_rate(self, context: Context, stage: Stage, q: ca.SX, dq: ca.SX) -> None:
        """dq + offset <= sqrt(2 a (upper - q)), squared with the sign kept.

        So there is no root of what may be negative on the way, and the error is on the safe side
        by 5e-5 (rad/s)^2 at most.
        """
        twice, offset, upper, lower = (context.each(name) for name in NAMES)
        unit = context.each("dq_max") ** 2
        for side, end in ((1, upper), (-1, lower)):
            speed = side * dq + offset
            over = (speed * ca.sqrt(speed**2 + 1e-4) - 2 * twice * (side * (end - q))) / unit
            for i, name in enumerate(context.names):
                stage.row(f"{name} velocity", over[i], -np.inf, 0.0)


@dataclass(frozen=True)
class TorqueLimits(Term):
    """rows: whether it has any (guard "torque", or a section [torque]).

    They are at nodes and at some instants of the brake; the check looks at every sample.
    """

    rows: bool

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For an arm whose masses are known."""
        if torque_limits(request.scene) is None:
            return None
        return cls(request.scene.torque is not None or "torque" in request.asked.guards)

    def numbers(self, request: Request) -> dict[str, Any]:
        """The limits less the scene's margin and the one asked for."""
        limits, section = torque_limits(request.scene), request.scene.torque or Torque()
        assert limits is not None
        return {"torque_max": (1 - section.margin - request.asked.margins["torque"]) * limits}

    def at_instant(self, at: Instant) -> None:
        """With the object, without, or, while the pads open, with all of it or nothing."""
        if not self.rows:
            return
        if at.grip != "none":
            _limit(at.context, at.stage, at.q, at.dq, at.ddq, at.load)
        if at.grip != "full":
            _limit(at.context, at.stage, at.q, at.dq, at.ddq)

    def at_last(self, context: Context, stage: Stage, place: ca.SX, rate: ca.SX) -> None:
        """The brake with an empty hand: as it begins, and as each joint comes to rest.

        Every joint brakes by itself; those that have stopped no longer do.
        """
        if not self.rows:
            return
        braking = context.each("braking")
        against = -braking * rate / ca.sqrt(rate**2 + 1e-4)
        _limit(context, stage, *context.node(stage))
        _limit(context, stage, place, rate, against)
        stops = ca.sqrt(rate**2 + 1e-6) / braking
        for i in range(context.n):
            left = stops - stops[i]
            going = (1 + (left + STILL) / ca.sqrt((left + STILL) ** 2 + STILL**2 / 4)) / 2
            share = ca.fmin(stops[i] / stops, 1.0)
            there = place + rate * stops * (share - share**2 / 2)
            _limit(context, stage, there, rate * (1 - share), going * against)

    def broken(self, throw: Throw) -> list[Violation]:
        """Joints whose torque is above its limit at any sample."""
        if throw.measured.torque <= 1.0:
            return []
        found, torques = [], throw.torques
        for name, share in zip(throw.mover.joints, torques.use.T, strict=True):
            if share.max() > 1.0:
                worst, when = 100 * share.max(), 1e3 * torques.times[share.argmax()]
                words = f"torque of {name}: {worst:.0f} % of its limit at {when:.0f} ms"
                guard, depth = "" if self.rows else "torque", float(share.max()) - 1.0
                found.append(Violation(words, guard, MARGIN, depth))
        return found


def _limit(
    context: Context, stage: Rows, q: ca.SX, dq: ca.SX, ddq: ca.SX, load: Load | None = None
) -> None:
    """The torques inside their limits; load: what the hand gives to the object."""
    arm = context.kinematics
    assert isinstance(arm, PlanarArm)
    angles, rates, turns = map(arm.turned, (q, dq, ddq))
    torques = PlanarDynamics(arm).torques(angles, rates, turns, context.gravity, load)
    context.limit(stage, "torque", ca.vertcat(*torques) / context.each("torque_max"))
