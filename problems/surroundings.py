"""What stands around the throw: the cup, and where nothing may be."""

from __future__ import annotations

import dataclasses

from .errors import InputError
from .section import Section, quantity


@dataclasses.dataclass(frozen=True)
class Cup(Section):
    """A cup, open above, that the bar enters with its lower end first.

    x [m] centre (in the throw's plane), rim [m] height, radius [m] inside, depth [m];
    the cup goes along when another target is asked for.
    clearance [m]: the bar's outline keeps it to the wall and the rim from the instant
    its lower end reaches the rim plane until that is `insertion` [m] below.
    """

    x: float
    rim: float
    radius: float = quantity(above=0)
    depth: float = quantity(above=0)
    clearance: float = quantity(least=0, default=0.0)
    insertion: float = quantity(above=0, default=0.05)

    def check(self) -> None:
        """The bar enters no deeper than the cup is."""
        if self.insertion > self.depth:
            raise InputError(
                f"insertion = {self.insertion:g}: must be at most the depth {self.depth:g}"
            )


@dataclasses.dataclass(frozen=True)
class Workspace(Section):
    """Where nothing may be. Heights and distances in m, in the throw's plane.

    floor: lowest height of hand, arm joints and held bar;
    column_radius, column_height: the robot's base, for the bar; palm_clearance: from
    the detached bar to the hand's body (arms only).
    """

    floor: float | None = None
    column_radius: float | None = quantity(above=0, default=None)
    column_height: float | None = quantity(above=0, default=None)
    palm_clearance: float | None = quantity(least=0, default=None)

    def check(self) -> None:
        """Both column values or none."""
        if (self.column_radius is None) != (self.column_height is None):
            raise InputError("column_radius and column_height: give both or neither")
