"""What an NLP is asked: its request, and what a check found to be needed beyond the usual.

Constraints that seldom bind are left out at first. A throw that breaks one names it in its
`Violation`; the next NLP has it (`guards`), or keeps a larger margin (`margins`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ...models import Array
from ...problems import Pose, Scene
from ..check import Guard, Margin, Mover, Throw, Violation
from .window import Window, window_nodes, window_of

#: Guards with many rows in all stages, which take twice as long to solve with: what must be quick
#: ends where they come in.
HEAVY: frozenset[Guard] = frozenset({"carry", "return"})
#: Where the held bar dips less than this [m] into an obstacle, between nodes that are clear of
#: it, a larger margin is tried before more nodes.
SHALLOW = 0.015


@dataclass(frozen=True, init=False)
class Margins:
    """Margins [m; share] beyond the usual ones, by name; those that are not given are 0.

    The terms have them: "held" between obstacles and what is carried, "cup", "passing", "torque",
    "tool speed".
    """

    values: tuple[tuple[str, float], ...]

    def __init__(self, **values: float) -> None:
        given = tuple(sorted((name, value) for name, value in values.items() if value != 0.0))
        object.__setattr__(self, "values", given)

    def __getitem__(self, name: str) -> float:
        return dict(self.values).get(name, 0.0)

    def replace(self, **values: float) -> Margins:
        """These with others instead."""
        return Margins(**dict(self.values) | values)


@dataclass(frozen=True)
class Asked:
    """Constraints and margins that an NLP has beyond the usual ones.

    near: bodies that have rows against obstacles and the arm's own links, "flying bar" among them.
    """

    guards: frozenset[Guard] = frozenset()
    margins: Margins = field(default_factory=Margins)
    near: frozenset[str] = frozenset()

    @property
    def heavy(self) -> bool:
        """Whether any guard adds many rows."""
        return bool(self.guards & HEAVY)

    def with_(self, broken: Sequence[Violation]) -> Asked:
        """This and what is against the violations; the same if nothing more can be asked."""
        wanted: set[Guard] = set()
        missing: dict[Margin, float] = {}
        for violation in broken:
            guard, margin, depth = violation.guard, violation.margin, violation.depth
            shallow = violation.between and margin and self.margins[margin.name] + depth < SHALLOW
            there = violation.near in self.near if violation.near else guard in self.guards
            if margin and (there or not (guard or violation.near) or shallow):
                missing[margin] = max(missing.get(margin, 0.0), depth)
            elif guard:
                wanted.add(guard)
        larger = {
            margin.name: min(self.margins[margin.name] + depth + margin.more, margin.most)
            for margin, depth in missing.items()
        }
        if wanted <= self.guards:
            wanted = {violation.then for violation in broken if violation.then}
        near = {violation.near for violation in broken if violation.near}
        return Asked(self.guards | wanted, self.margins.replace(**larger), self.near | near)

    @property
    def elsewhere(self) -> Asked:
        """What another motion is asked: how near this one came to obstacles is its own."""
        return Asked(self.guards, self.margins.replace(clear=0.0), self.near)


#: What an NLP is asked at first.
USUAL = Asked()


@dataclass(frozen=True)
class Request:
    """What an NLP is for: a scene's throw to a target (None: not known, for the check).

    robust: the method that makes the release bear an uncertain opening, empty for none.
    elastic: the landing may miss, at a price. near: a throw that a solve starts from; rows against
    obstacles are for what is around it.
    """

    scene: Scene
    mover: Mover
    target: Pose | None = None
    asked: Asked = USUAL
    robust: str = ""
    elastic: bool = False
    near: Throw | None = None

    @property
    def angle(self) -> bool:
        """Whether the target fixes theta."""
        return self.target is not None and self.target.theta is not None

    @cached_property
    def window(self) -> Window | None:
        """The window of a robust request."""
        return window_of(self.scene) if self.robust else None

    @cached_property
    def nodes(self) -> Array:
        """Times [s] of the stages from the end of the carry on; 0 is the opening's start."""
        return window_nodes(self.scene, self.window)

    def times(self, opening_time: float) -> Array:
        """Times (last + 1,) [s] of the stages on the motion's clock."""
        after = opening_time + self.nodes
        carry = np.linspace(0.0, after[0], self.scene.mesh.carry + 1)
        return np.concatenate([carry[:-1], after])
