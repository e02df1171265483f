"""One planned hand motion for many throws, each late or early."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...models import Path
from ..check import Throw

Array = npt.NDArray[np.float64]

#: Cells of the tabulated hand motion are this long at most [s].
CELL = 1e-4
#: The motion is read this far inside a cell's ends [s]: its acceleration may step there.
INSIDE = 1e-10


def tabulate(throw: Throw, span: tuple[float, float]) -> Path:
    """The hand of a throw over `span` [s] of its own clock, counted from its opening.

    At rest before time 0 and after the end. Its pieces are divided evenly. Kinks: where the
    acceleration of a free hand steps; samples have none.
    """
    motion = throw.to_rest
    times, hand = motion.breaks, throw.mover.hand(motion)
    inside = times[(times > span[0]) & (times < span[1])]
    ends = np.concatenate([[span[0]], inside, [span[1]]])
    parts = np.maximum(np.ceil(np.diff(ends) / CELL - 1e-9), 1).astype(int)
    pieces = [
        np.linspace(begin, end, count, endpoint=False)
        for begin, end, count in zip(ends[:-1], ends[1:], parts, strict=True)
    ]
    edges = np.concatenate([*pieces, [span[1]]])
    start, end = (hand.at(side) for side in (edges[:-1] + INSIDE, edges[1:] - INSIDE))
    slope = (end.acceleration - start.acceleration) / np.diff(edges)
    cells = np.stack([slope / 6, start.acceleration / 2, start.twist, start.pose])
    knots, kinks = edges - throw.opening_time, np.empty(0) if throw.path.held else motion.kinks
    kinks = kinks[(kinks > span[0]) & (kinks < span[1])] - throw.opening_time
    # At rest before and after: cells of the pose alone.
    if span[0] <= 0.0:
        knots = np.append(knots[0] - 1.0, knots)
        cells = np.insert(cells, 0, 0.0, axis=2)
        cells[-1, :, 0] = start.pose[:, 0]
    if span[1] >= motion.end:
        knots = np.append(knots, knots[-1] + 1.0)
        cells = np.insert(cells, cells.shape[2], 0.0, axis=2)
        cells[-1, :, -1] = end.pose[:, -1]
    return Path(knots, cells[..., None], kinks)
