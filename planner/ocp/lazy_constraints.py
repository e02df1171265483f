"""Lazy constraints and margins of an NLP: the remedies for the findings of a verdict.

Constraints that are seldom active are left out at first. Where the verdict on a throw finds one
broken, the next NLP has it, or a larger margin.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ..clearance import BAR
from ..throw import Throw
from ..verdict import FLYING, Code, Finding, Verdict

#: A constraint that an NLP gets after a verdict has found it broken: "carry" (grip, floor and
#: column at more instants, floor of the arm), "flight" and "return" (the hand's body; more depths
#: of a cup), "passing" (the column in flight), "torque".
LazyConstraint = str
#: Lazy constraints at many instants: with one, a solve takes twice the time.
COSTLY: frozenset[LazyConstraint] = frozenset({"carry", "return"})
#: Times after detach [s] at which "flight" constrains bar and hand's body.
PALM_TIMES = (0.01, 0.02, 0.03, 0.045, 0.06, 0.075, 0.09, 0.11, 0.13, 0.15, 0.18, 0.21, 0.25)
#: Penetration [m] of the held bar between clear nodes, up to which a larger margin is tried before
#: more instants.
SHALLOW = 0.015


@dataclass(frozen=True)
class Margin:
    """An addition to the usual margin of a constraint: a distance [m] or a share of a limit.

    Each verdict adds its violation (`largest` at most) plus `extra`, up to `maximum` in total.
    """

    name: str
    extra: float
    maximum: float
    largest: float = math.inf


HELD = Margin("held", extra=0.002, maximum=0.05)
PASSING = Margin("passing", extra=0.002, maximum=0.03)
CUP = Margin("cup", extra=2e-4, maximum=0.005)
CLEAR = Margin("clear", extra=0.003, maximum=0.05, largest=0.005)
TORQUE = Margin("torque", extra=0.01, maximum=0.3)
TOOL_SPEED = Margin("tool speed", extra=0.003, maximum=0.2)


@dataclass(frozen=True)
class Remedy:
    """The change of an NLP that removes a finding.

    lazy: the constraint to add, "" for none. escalation: the constraint to add if the NLP has
    `lazy` already. margin: enlarged if there is nothing to add, or first if the violation is
    shallow and every NLP has the constraint at its nodes (`at_nodes`). body: gets obstacle
    constraints.
    """

    lazy: LazyConstraint = ""
    margin: Margin | None = None
    at_nodes: bool = False
    escalation: LazyConstraint = ""
    body: str = ""


def _remedy_for(finding: Finding, throw: Throw) -> Remedy | None:
    """The remedy for a finding of a throw; None if an NLP has none."""
    match finding.code:
        case Code.SLIP_BEFORE_OPENING:
            return Remedy("carry")
        case Code.TOOL_SPEED:
            return Remedy(margin=TOOL_SPEED)
        case Code.TORQUE:
            # With a section [torque] every NLP has the constraint.
            return Remedy("torque" if throw.scene.torque is None else "", TORQUE)
        case Code.FLOOR:
            return Remedy("carry", HELD, at_nodes=finding.body == BAR)
        case Code.COLUMN if finding.body == FLYING:
            return Remedy("passing", PASSING)
        case Code.COLUMN:
            return Remedy("carry", HELD, at_nodes=True)
        case Code.PALM:
            assert finding.time is not None
            early = finding.time - throw.detach_time <= PALM_TIMES[-1]
            return Remedy("flight", escalation="return") if early else Remedy("return")
        case Code.CUP_WALL:
            return Remedy("flight", CUP)
        case Code.COLLISION:
            return Remedy(margin=CLEAR, body=finding.body)
    return None


def _violation(finding: Finding, margin: Margin) -> float:
    """The amount by which a finding breaks its limit, in the unit of the margin."""
    match finding.code:
        case Code.TOOL_SPEED:
            return finding.value / finding.limit - 1.0
        case Code.TORQUE:
            return finding.value - finding.limit
    return min(finding.limit - finding.value, margin.largest)


@dataclass(frozen=True, init=False)
class Margins:
    """Margins beyond the usual ones, by their names: `Margins(held=0.002)`; others are 0."""

    values: tuple[tuple[str, float], ...]

    def __init__(self, /, **values: float) -> None:
        given = tuple(sorted((name, value) for name, value in values.items() if value != 0.0))
        object.__setattr__(self, "values", given)

    def __getitem__(self, name: str) -> float:
        return dict(self.values).get(name, 0.0)

    def replace(self, /, **values: float) -> Margins:
        """These margins with some values replaced."""
        return Margins(**dict(self.values) | values)


@dataclass(frozen=True)
class Refinement:
    """Lazy constraints and margins of an NLP.

    bodies: links, "held bar" and "flying bar" that keep clear of obstacles and of the arm's links.
    """

    lazy: frozenset[LazyConstraint] = frozenset()
    margins: Margins = field(default_factory=Margins)
    bodies: frozenset[str] = frozenset()

    @property
    def costly(self) -> bool:
        """Whether it makes a solve take twice the time."""
        return bool(self.lazy & COSTLY)

    def refined(self, verdict: Verdict, throw: Throw) -> Refinement:
        """This with the remedies for a throw's findings; equal to this without a remedy."""
        remedies = [(one, cure) for one in verdict.broken if (cure := _remedy_for(one, throw))]
        added: set[LazyConstraint] = set()
        violations: dict[Margin, float] = {}
        for finding, remedy in remedies:
            has = remedy.body in self.bodies if remedy.body else remedy.lazy in self.lazy
            if remedy.margin is not None:
                violation, margin = _violation(finding, remedy.margin), remedy.margin
                shallow = remedy.at_nodes and self.margins[margin.name] + violation < SHALLOW
                if has or shallow or not (remedy.lazy or remedy.body):
                    violations[margin] = max(violations.get(margin, 0.0), violation)
                    continue
            if remedy.lazy:
                added.add(remedy.lazy)
        larger = {
            margin.name: min(self.margins[margin.name] + violation + margin.extra, margin.maximum)
            for margin, violation in violations.items()
        }
        if added <= self.lazy:
            added = {remedy.escalation for _, remedy in remedies if remedy.escalation}
        bodies = {remedy.body for _, remedy in remedies if remedy.body}
        return Refinement(self.lazy | added, self.margins.replace(**larger), self.bodies | bodies)

    @property
    def for_other_motion(self) -> Refinement:
        """This without the margin to obstacles, which belongs to one motion."""
        return Refinement(self.lazy, self.margins.replace(clear=0.0), self.bodies)


#: No lazy constraint, usual margins.
BASE = Refinement()
