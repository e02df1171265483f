"""What an NLP is asked beyond its usual constraints, learned from what a check found broken.

Constraints that seldom bind are left out at first. A throw that breaks one names it in its
`Violation`; the next NLP has it (`guards`), or keeps a larger margin (`margins`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from ..check import Guard, Tight, Violation

#: Guards with many rows in all stages. FATROP spends too long on them, so IPOPT solves these NLPs,
#: and starts that do without are tried first.
HEAVY: frozenset[Guard] = frozenset({"carry", "return"})
#: Margin [m; share] added beyond what a check found missing, and the largest that is tried.
MORE: dict[Tight, tuple[float, float]] = {
    "held": (0.002, 0.05),
    "cup": (2e-4, 0.005),
    "torque": (0.01, 0.3),
    "passing": (0.002, 0.03),
}
#: Where the held bar dips less than this [m] into an obstacle, between nodes that are clear of
#: it, a larger margin is tried before more nodes.
SHALLOW = 0.015


@dataclass(frozen=True)
class Margins:
    """Margins [m] beyond the usual ones.

    held: between obstacles and what is carried; cup: between bar and cup; torque: as a share of
    the joints' limits; passing: between base column and flying bar.
    """

    held: float = 0.0
    cup: float = 0.0
    torque: float = 0.0
    passing: float = 0.0


@dataclass(frozen=True)
class Asked:
    """Constraints and margins that an NLP has beyond the usual ones."""

    guards: frozenset[Guard] = frozenset()
    margins: Margins = field(default_factory=Margins)

    @property
    def heavy(self) -> bool:
        """Whether any guard adds many rows."""
        return bool(self.guards & HEAVY)

    def with_(self, broken: Sequence[Violation]) -> Asked:
        """This and what is against the violations; the same if nothing more can be asked."""
        wanted: set[Guard] = set()
        missing: dict[Tight, float] = {}
        for violation in broken:
            guard, tight, depth = violation.guard, violation.tight, violation.depth
            shallow = violation.between and self.margins.held + depth < SHALLOW
            if tight and (not guard or guard in self.guards or shallow):
                missing[tight] = max(missing.get(tight, 0.0), depth)
            elif guard:
                wanted.add(guard)
        margins = self.margins
        for tight, depth in missing.items():
            more, most = MORE[tight]
            larger = min(getattr(margins, tight) + depth + more, most)
            margins = replace(margins, **{tight: larger})
        if "flight" in wanted and wanted <= self.guards:
            # The contact is between the bar's ends, or later than the guarded instants.
            wanted = {"return"}
        return Asked(self.guards | wanted, margins)


#: What an NLP is asked at first.
USUAL = Asked()
