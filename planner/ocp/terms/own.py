"""Constraints of a user's own."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Self

import casadi as ca

from ....problems import Constraint, InputError
from ..request import Request
from ..scene_constraint import Flight, Instant, SceneConstraint
from ..transcription import Scope


@dataclass(frozen=True)
class Own(SceneConstraint):
    """The constraints with which the planner was made.

    before [s]: time from detach to where the NLP's flight begins.
    """

    constraints: tuple[Constraint, ...] = ()
    before: float = 0.0

    @classmethod
    def of(cls, request: Request) -> Self | None:
        """For a planner with some."""
        own, opening = request.scene.constraints, request.scene.gripper.profile().opening
        return cls({}, own, float(request.opening_nodes[-1]) - opening) if own else None

    def at_instant(self, at: Instant) -> None:
        """Those of the hand."""
        for one in self.constraints:
            if one.at_instant is not None:
                _add(one, at, one.at_instant)

    def in_flight(self, flight: Flight) -> None:
        """Those of the flight from detach on."""
        flight = replace(flight, start=flight.after(-self.before), time=flight.time + self.before)
        for one in self.constraints:
            if one.in_flight is not None:
                _add(one, flight, one.in_flight)


def _add(one: Constraint, at: Scope, value: Callable[[Any], Any]) -> None:
    found = value(at)
    try:
        expression = ca.SX(ca.vertcat(*found) if isinstance(found, (list, tuple)) else found)
    except NotImplementedError:
        expression = ca.SX()
    entries = ca.vertsplit(ca.vec(ca.densify(expression)))
    if not expression.numel() or any(map(_is_no_number, entries)):
        words = f"must be a CasADi expression of finite numbers, not {str(found)[:60]!r}"
        raise InputError(f"constraint {one.name}: {words}")
    at.subject_to(one.name, expression, one.low + one.margin, one.high - one.margin)


def _is_no_number(value: ca.SX) -> bool:
    return bool(value.is_constant() and not math.isfinite(float(value)))
