"""Velocity limits that fall towards the ends of the joints' ranges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import casadi as ca
import numpy as np

from ..asked import Request
from ..context import Context, Term
from ..stages import Stage

#: Parameters: as in `models.Slowing`.
NAMES = ("slowing", "slowing_offset", "slowing_upper", "slowing_lower")


@dataclass(frozen=True)
class Slowing(Term):
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
