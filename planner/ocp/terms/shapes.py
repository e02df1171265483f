"""What terms about obstacles share: margins and smooth shapes."""

from __future__ import annotations

import casadi as ca

from ...check import Margin

#: Margin [m] that the NLP keeps between obstacles and what is carried, for what lies between its
#: nodes, smoothing and correction; and how it grows.
HELD_MARGIN = 0.001
HELD = Margin("held", more=0.002, most=0.05)
#: Rounding [m] of the corner between two ways of being clear of an obstacle.
CORNER = 0.002


def soft_max(a: ca.SX, b: ca.SX) -> ca.SX:
    """max(a, b) rounded from below: it never claims a distance that is not there."""
    return 0.5 * (a + b + ca.sqrt((a - b) ** 2 + CORNER**2) - CORNER)
