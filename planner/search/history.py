"""The tries of one plan with their attempts; which of the throws found differ, and the best."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property
from operator import attrgetter
from typing import Literal

import numpy as np

from ...problems import Pose
from ..library import Neighbour
from ..ocp import Refinement
from ..result import PlannedThrow
from .attempt import Attempt, Start

#: Prices [1/m] of an elastic landing's pose error, one after the other. From a start more NLPs are
#: solved at the first (38 of 63 beside `cup`; 23 at the second). The effort rises steeply at the
#: edge of the reach: at the first landings end up to 11 mm short of it.
PRICES = (100.0, 1000.0)
#: Price [1/m] for the nearest landing of a search. At this price after the others 9 of 117 landings
#: came nearer by more than a tenth.
LAST_PRICE = 10_000.0
#: Throws differ if their coordinates or rates at the opening's start do by more than this share.
DIFFERENT_SHARE = 0.1
#: Throws differ if their flight times do by more than this [s].
DIFFERENT_FLIGHT = 0.05


@dataclass(frozen=True)
class Move:
    """Move a solved throw to the target."""

    near: Neighbour


@dataclass(frozen=True)
class Solve:
    """Solve the NLP from a start; release: identifies the sampled release it is made of."""

    start: Start
    origin: Literal["warm plan", "neighbour", "samples", "found"]
    release: bytes = b""


@dataclass(frozen=True)
class Approach:
    """Bring a throw that lands beside the goal as near to it as limits let it.

    source: a solved throw, or a start that has its own landing for a goal if it breaks nothing
    there, else the goal; away [m]: how far off the goal it lands, or inf. found: the throw is of an
    earlier plan. light: end before an NLP for which costly constraints come in, or clearances of
    further bodies. most [m]: end where limits let it come no nearer than this pose error. turns:
    bring the angle to the goal first. prices [1/m]: of the pose error, one after the other. drawn:
    the source was drawn towards the goal; evident: that it leads nowhere is evidence. known:
    landings of tries before; one that lands at one of these ends after the first price.
    """

    goal: Pose
    source: Start | Neighbour
    away: float
    found: bool = False
    light: bool = False
    most: float = math.inf
    turns: bool = False
    prices: tuple[float, ...] = PRICES
    drawn: bool = False
    evident: bool = True
    known: tuple[Pose, ...] = ()

    @property
    def is_last(self) -> bool:
        """Whether no effort holds the throw back: at the last price alone."""
        return self.prices == (LAST_PRICE,)


@dataclass(frozen=True)
class Lead:
    """Move a throw of the library towards the goal until it would break something."""

    near: Neighbour

    @property
    def stays(self) -> bool:
        """Whether limits ended the throw where it is: it has no slope."""
        return not self.near.optimum.slope.any()


Try = Move | Solve | Approach | Lead


@dataclass(frozen=True, eq=False)
class Entry:
    """A try and its attempts."""

    done: Try
    attempts: tuple[Attempt, ...] = ()


@dataclass(frozen=True, eq=False)
class History:
    """The tries of one plan with their outcomes, in order."""

    entries: tuple[Entry, ...] = ()

    def with_entry(self, entry: Entry) -> History:
        """This history and one more try."""
        return History((*self.entries, entry))

    @property
    def tries(self) -> list[Try]:
        """The tries, in order."""
        return [entry.done for entry in self.entries]

    @cached_property
    def attempts(self) -> list[Attempt]:
        """All attempts to throw."""
        return [attempt for entry in self.entries for attempt in entry.attempts]

    @cached_property
    def found(self) -> list[Attempt]:
        """The solved throws that differ, cheapest first."""
        return distinct([attempt for attempt in self.attempts if attempt.solved])

    @property
    def ordered(self) -> list[Attempt]:
        """The throws found, cheapest first."""
        return sorted(self.found, key=_effort) if self.found[1:] else self.found

    @cached_property
    def edges(self) -> list[Attempt]:
        """The best throw of each try that limits end short of its goal, nearest to it first.

        Each breaks nothing where it lands.
        """
        return _edges(self.entries)

    @property
    def new_edges(self) -> list[Attempt]:
        """The edges of NLPs that do not start from throws of earlier plans."""
        return _edges(
            one
            for one in self.entries
            if not (
                isinstance(one.done, Lead) or (isinstance(one.done, Approach) and one.done.found)
            )
        )

    @property
    def is_approached(self) -> bool:
        """Whether limits stopped a throw that was brought near the goal."""
        brought = (one for one in self.entries if isinstance(one.done, Approach))
        return any(attempt.is_edge for one in brought for attempt in one.attempts)

    @property
    def leads(self) -> int:
        """Number of throws of the library that were led towards the goal."""
        return sum(isinstance(one, Lead) for one in self.tries)

    @property
    def approaches(self) -> int:
        """Number of throws brought near the goal, the last one apart."""
        return sum(isinstance(one, Approach) and not one.is_last for one in self.tries)

    @property
    def drawn(self) -> int:
        """Number of throws drawn towards the goal and brought near."""
        return sum(isinstance(one, Approach) and one.drawn for one in self.tries)

    @property
    def iterations(self) -> int:
        """Solver iterations of all tries."""
        return sum(attempt.iterations for attempt in self.attempts)

    @property
    def solves(self) -> int:
        """NLPs solved and throws moved."""
        return sum(attempt.solves for attempt in self.attempts)

    def solves_from(self, origin: str) -> list[Solve]:
        """The solves from starts of an origin."""
        return [one for one in self.tries if isinstance(one, Solve) and one.origin == origin]

    def refinement(self, first: Refinement) -> Refinement:
        """Refinement of the next NLP from another motion, by what the checks found broken."""
        refinement = first
        for entry in self.entries:
            if isinstance(entry.done, Solve) and entry.done.origin == "samples":
                after = entry.attempts[-1].after
                if "carry" not in after.lazy:
                    # The margin of the held bar belongs to that motion.
                    margins = after.margins.replace(held=refinement.margins["held"])
                    after = replace(after, margins=margins)
                refinement = after.for_other_motion
        return refinement


def _edges(entries: Iterable[Entry]) -> list[Attempt]:
    """The nearest edge of each source, nearest first; a throw that was led and brought near is one,
    and so is one brought nearer once more."""
    nearest = dict[object, Attempt]()
    for number, entry in enumerate(entries):
        edges = [one for one in entry.attempts if one.is_edge]
        source: object = number
        match entry.done:
            case Approach(prices=(price,)) if price == LAST_PRICE and nearest:
                source = min(nearest, key=lambda known: nearest[known].missed)
            case Lead(near) | Approach(source=Neighbour() as near):
                source = near.landing
        if source in nearest:
            edges.append(nearest[source])
        if edges:
            nearest[source] = min(edges, key=attrgetter("missed"))
    return sorted(nearest.values(), key=attrgetter("missed"))


# Several throws to one target: which of them differ, and which is best.


def _throw_of(found: Attempt) -> PlannedThrow:
    assert found.throw is not None
    return found.throw


def _release(found: Attempt) -> tuple[np.ndarray, np.ndarray, float]:
    """Coordinates and rates at the opening's start, and the flight time."""
    thrown = _throw_of(found)
    q, dq, _ = thrown.planned.at(np.array([thrown.opening_time]))
    return q[:, 0], dq[:, 0], thrown.deciding.landing.flight_time


def _differ(one: Attempt, other: Attempt) -> bool:
    (q, dq, flown), (other_q, other_dq, other_flown) = _release(one), _release(other)
    for a, b in ((q, other_q), (dq, other_dq)):
        if np.linalg.norm(a - b) > DIFFERENT_SHARE * max(np.linalg.norm(a), np.linalg.norm(b)):
            return True
    return abs(flown - other_flown) > DIFFERENT_FLIGHT


def distinct(found: list[Attempt]) -> list[Attempt]:
    """The throws that differ from all before them, cheapest first."""
    kept: list[Attempt] = []
    for one in sorted(found, key=_effort):
        if all(_differ(one, other) for other in kept):
            kept.append(one)
    return kept


def _effort(found: Attempt) -> float:
    """The NLP's cost of a solved throw."""
    return _throw_of(found).effort
