"""What makes a plan robust against an uncertain opening."""

from __future__ import annotations

import dataclasses

from .section import Section, quantity

#: On the command line: the methods that are recommended.
METHODS = ("auto", "quiet", "scenarios", "stationary")
#: For comparison: quiet as a constraint, and what others do.
COMPARED = ("quiet-exactly", "hand-velocity", "joint-velocity")


@dataclasses.dataclass(frozen=True)
class Robust(Section):
    """A robust plan, for the delays of [uncertainty], or +-10 ms where that has none.

    method: 'quiet' (while the pads may open they transmit as little as can be), 'scenarios'
    (several openings share the hand's motion and all land near the target), 'stationary'
    (constant acceleration, the landing stationary in the delay), 'auto' (quiet, and
    scenarios if a sweep finds that not enough); for comparison 'quiet-exactly' (as a
    constraint), 'hand-velocity' and 'joint-velocity' (constant over the window).
    early, late [s]: the window before the opening's start and after detach, from the
    uncertainty where absent.
    """

    method: str = quantity(choices=METHODS + COMPARED, default="auto")
    early: float | None = quantity(least=0, most=0.1, default=None)
    late: float | None = quantity(least=0, most=0.1, default=None)
