"""Optional parts of a scene, one file each: their rows in the NLP, their numbers, their check.

A new term is a file here and an entry of `TERMS`; rows come in this order.
"""

from ...check import CheckedThrow, Violation, throw_violations
from ..asked import Request
from ..context import Term
from .column import PASSING_MARGIN, Column
from .cup import CUP_MARGIN, Cup, lower_end
from .floor import Floor
from .landing import Landing
from .palm import PALM_TIMES, Palm
from .quiet import Quiet
from .scenarios import Scenarios
from .slowing import Slowing
from .torque import Torque

__all__ = ["CUP_MARGIN", "PALM_TIMES", "PASSING_MARGIN", "broken", "lower_end", "terms_of"]

TERMS: tuple[type[Term], ...] = (
    Slowing,
    Torque,
    Floor,
    Cup,
    Palm,
    Column,
    Landing,
    Quiet,
    Scenarios,
)


def terms_of(request: Request) -> tuple[Term, ...]:
    """The terms of a request."""
    found = (kind.of(request) for kind in TERMS)
    return tuple(term for term in found if term is not None)


def broken(throw: CheckedThrow) -> list[Violation]:
    """What a throw breaks of the grip and of its scene's terms; empty if nothing."""
    found = throw_violations(throw)
    if throw.lands:
        for term in terms_of(Request(throw.scene, throw.mover)):
            found += term.broken(throw)
    return found
