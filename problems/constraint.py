"""A constraint of one's own on a throw: an expression for the NLP, and a check of what is sent."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from .checks import InputError, checked


@dataclass(frozen=True)
class Constraint:
    """low <= value <= high, for `Planner(scene, constraints=[...])`.

    name: in messages and findings. in_flight: the value as a CasADi expression, of the flight from
    detach to the landing (`start`, `end`: x, z [m], theta [rad], v_x, v_z, omega of the CoM; `time`
    [s]; `after(time)`; `ocp.flight` has its formulas). at_instant: likewise, of each instant while
    the grip is full or the pads open (`q`, `dq`, `ddq`: coordinates; `hand`: its pose, twist
    and motion). One of the two at least. low, high: bounds of the value; the NLP keeps `margin`
    more, for what it cannot see between its instants.
    check: the same value, a number or an array, of the throw that is sent (`Throw`), by NumPy: a
    plan whose check is outside the bounds is not solved. Without it the plan says that it is not
    checked. Sweeps do not check it.

    Raises InputError without an expression, without bounds, and for bounds without room.
    """

    name: str
    in_flight: Callable[[Any], Any] | None = None
    at_instant: Callable[[Any], Any] | None = None
    low: float = -math.inf
    high: float = math.inf
    margin: float = 0.0
    check: Callable[[Any], Any] | None = None

    def __post_init__(self) -> None:
        """Checks name and bounds."""
        name = checked("constraint name", self.name, str, {})
        if not name or not name.isprintable():
            raise InputError(f"constraint name = {name!r}: must be one line of text")
        if self.in_flight is None and self.at_instant is None:
            raise InputError(f"constraint {name}: give in_flight or at_instant")
        for key in ("in_flight", "at_instant", "check"):
            if not (getattr(self, key) is None or callable(getattr(self, key))):
                raise InputError(f"constraint {name}: {key} must be a function")
        checked(f"constraint {name}: margin", self.margin, float, {"least": 0})
        for key in ("low", "high"):
            value = getattr(self, key)
            if not isinstance(value, (int, float)):
                raise InputError(f"constraint {name}: {key} = {value!r}: must be a number")
        room = self.high - self.low - 2 * self.margin
        if math.isnan(room) or room < 0 or (math.isinf(self.low) and math.isinf(self.high)):
            raise InputError(
                f"constraint {name}: low = {self.low:g}, high = {self.high:g}: give one of them at "
                "least, with room for the margin between them"
            )
