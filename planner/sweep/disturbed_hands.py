"""One planned hand motion for many throws, each late or early."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...models import Path
from ..check import TICK, Mover, hand_samples
from ..result import PlannedThrow

Array = npt.NDArray[np.float64]

#: Cells of the tabulated hand motion are this long at most [s].
CELL = 1e-4
#: The motion is read this far inside a cell's ends [s]: its acceleration may step there.
INSIDE = 1e-10


@dataclass(frozen=True)
class SentMotion:
    """What the hand really does: the planned motion of a free hand, then its brake; or the
    samples that go to an arm. `throw` is the plan's.
    """

    throw: PlannedThrow

    @property
    def end(self) -> float:
        """When the hand comes to rest [s]."""
        return float(self.throw.samples.times[-1])

    @property
    def kinks(self) -> Array:
        """When its acceleration steps [s]: never for an arm."""
        return np.empty(0) if self.throw.sent is not None else self.throw.planned.times

    @property
    def times(self) -> Array:
        """Where its pieces meet, from 0 to rest [s]."""
        sent = self.throw.samples.times
        return np.concatenate([self.kinks, sent[sent > max(self.kinks, default=-1.0)]])

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq, each (n, N), at `times` (N,) [s]."""
        samples, planned = self.throw.samples, self.throw.planned
        sent = samples.at(times)
        if self.throw.sent is not None:
            return sent
        # The samples blur the steps of a free hand's acceleration: its own pieces instead,
        # and its brake, at an even rate, from the step on.
        end = float(planned.times[-1])
        first = min(math.ceil(end / TICK - 1e-9), len(samples.q) - 1)
        q, dq, ddq = (rows[first][:, None] for rows in (samples.q, samples.dq, samples.ddq))
        before = times - TICK * first
        brake = (q + before * (dq + before * ddq / 2), dq + before * ddq, ddq + 0 * before)
        phases = [times <= end, times < TICK * first]
        q, dq, ddq = (
            np.select(phases, [move, slow], rest)
            for move, slow, rest in zip(planned.at(times), brake, sent, strict=True)
        )
        return q, dq, ddq


def tabulate(
    mover: Mover, motion: SentMotion, opening_time: float, span: tuple[float, float]
) -> Path:
    """The hand of `motion` over `span` [s] of its own clock.

    At rest before time 0 and after the end. Its pieces are divided evenly.
    """
    times = motion.times
    inside = times[(times > span[0]) & (times < span[1])]
    ends = np.concatenate([[span[0]], inside, [span[1]]])
    parts = np.maximum(np.ceil(np.diff(ends) / CELL - 1e-9), 1).astype(int)
    pieces = [
        np.linspace(begin, end, count, endpoint=False)
        for begin, end, count in zip(ends[:-1], ends[1:], parts, strict=True)
    ]
    edges = np.concatenate([*pieces, [span[1]]])
    start, end = (
        hand_samples(mover, motion, side) for side in (edges[:-1] + INSIDE, edges[1:] - INSIDE)
    )
    slope = (end.acceleration - start.acceleration) / np.diff(edges)
    cells = np.stack([slope / 6, start.acceleration / 2, start.twist, start.pose])
    knots, kinks = edges - opening_time, motion.kinks
    kinks = kinks[(kinks > span[0]) & (kinks < span[1])] - opening_time
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
