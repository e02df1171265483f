"""The reach of a scene in cells of x and theta; a library has one throw in each."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...models import Array
from ...problems import Pose, Scene
from .map_samples import reach_map
from .maps import WIDTHS

Cell = tuple[int, int]
Landings = tuple[Array, Array]

#: Sampled states of the map.
SAMPLES = 60_000
#: Cells are coarsened until random landings fill at most this number of them.
MAX_FILLED = 300
#: Estimated area of the reach over the area of the cells with random landings.
AREA_RATIO = 1.5
#: Width of the narrowest cells over that of the finest bins.
FINEST = 0.2


@dataclass(frozen=True)
class Cells:
    """Width of the cells in x [m] and theta [rad]; theta is 0 if the scene leaves it open."""

    x: float
    theta: float

    @classmethod
    def of(cls, x: Array, theta: Array, count: int, *, angle: bool) -> Cells:
        """Cells of which about `count` cover a map's landings x, theta (N,)."""
        wide, turn = WIDTHS[0]
        columns = np.column_stack([x / wide, theta / turn] if angle else [x / wide])
        scale, filled = 1.0, math.inf
        while filled > MAX_FILLED:
            scale *= 1.2
            filled = len(np.unique(np.floor(columns / scale), axis=0))
        scale *= (AREA_RATIO * max(filled, 1) / count) ** (1 / columns.shape[1])
        scale = max(scale, FINEST)
        return cls(scale * wide, scale * turn if angle else 0.0)

    def finer(self, times: float) -> Cells | None:
        """Smaller cells, `times` their number; None if these are the finest."""
        finest = FINEST * WIDTHS[0][0]
        scale = max(times ** -(0.5 if self.theta else 1.0), finest / self.x)
        return Cells(scale * self.x, scale * self.theta) if self.x > 1.001 * finest else None

    def __call__(self, x: float, theta: float | None) -> Cell:
        """The cell of a landing."""
        turn = theta or 0.0
        return math.floor(x / self.x), math.floor(turn / self.theta) if self.theta else 0

    def middle(self, cell: Cell, target: Pose) -> Pose:
        """The landing pose in the middle of a cell."""
        theta = (cell[1] + 0.5) * self.theta if self.theta else None
        return target.in_plane((cell[0] + 0.5) * self.x, theta)

    def around(self, cell: Cell) -> list[Cell]:
        """The cells beside it."""
        i, j = cell
        beside = [(i - 1, j), (i + 1, j)]
        return [*beside, (i, j - 1), (i, j + 1)] if self.theta else beside


def landings_of(scene: Scene) -> Landings:
    """Landings of a map's random throws: x [m], theta [rad] (N,)."""
    found = reach_map(scene, samples=SAMPLES)
    return found.x, found.theta
