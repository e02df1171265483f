"""One planned hand motion for many throws, each late or early."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...models import Cubics, Hands, Throws
from ..check import TICK, Mover, hand_samples
from ..result import PlannedThrow

Array = npt.NDArray[np.float64]

#: Cells of the tabulated hand motion are this long at most [s].
CELL = 1e-4
#: The motion is read this far inside a cell's ends [s]: its acceleration may step there.
INSIDE = 1e-10


@dataclass(frozen=True)
class HandTable:
    """A hand motion in cells between `knots` (K + 1,) [s], counted from the planned opening.

    cells (12, K): pose, twist, half the acceleration and a sixth of its slope at each
    cell's start, a cubic in time for each of x, z [m] and theta [rad]. The first and last
    cells go on outside the table. kinks (J,) [s]: where the acceleration steps.
    """

    knots: Array
    cells: Array
    kinks: Array

    def at(self, times: Array) -> Hands:
        """Pose, twist and acceleration, each (3, N), at `times` (N,) [s]."""
        cell = np.searchsorted(self.knots[1:-1], times, "right")
        u = times - self.knots[cell]
        pose, twist, acceleration = (np.empty((3, u.size)) for _ in range(3))
        for i in range(3):
            c0, c1, c2, c3 = (np.take(self.cells[3 * power + i], cell) for power in range(4))
            turn = 3 * u * c3
            acceleration[i] = 2 * (c2 + turn)
            twist[i] = c1 + u * (2 * c2 + turn)
            pose[i] = c0 + u * (c1 + u * (c2 + turn / 3))
        return pose, twist, acceleration


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
) -> HandTable:
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
    cells = np.vstack([start.pose, start.twist, start.acceleration / 2, slope / 6])
    knots, kinks = edges - opening_time, motion.kinks
    if span[0] <= 0.0:
        knots, cells = np.append(knots[0] - 1.0, knots), np.hstack([_rest(cells[:, :1]), cells])
    if span[1] >= motion.end:
        knots, cells = (
            np.append(knots, knots[-1] + 1.0),
            np.hstack([cells, _rest(end.pose[:, -1:])]),
        )
    return HandTable(knots, cells, kinks[(kinks > span[0]) & (kinks < span[1])] - opening_time)


def _rest(cell: Array) -> Array:
    """The cell (12, 1) of a hand that stays where `cell`, or pose, begins."""
    return np.concatenate([cell[:3], np.zeros((9, 1))])


@dataclass(frozen=True)
class DelayedHands:
    """N copies of a tabulated motion, each counted from its throw's own opening, `delays`
    (N,) [s] later than planned.
    """

    table: HandTable
    delays: Array

    def part(self, throws: Throws) -> DelayedHands:
        """The hands of the given throws."""
        return DelayedHands(self.table, self.delays[throws])

    def at(self, times: Array) -> Hands:
        """The hands at `times` (N,) [s]."""
        return self.table.at(times + self.delays)

    def cubics(self) -> Cubics:
        """The same for compiled code."""
        powers = self.table.cells.reshape(4, 3, -1)[::-1].transpose(0, 2, 1)[:, :, None]
        return Cubics(self.table.knots, np.ascontiguousarray(powers), self.delays)


@dataclass(frozen=True)
class SpinningHands:
    """Delayed hands that turn faster than planned by `spin` (N,) [rad/s] from the opening on."""

    hands: DelayedHands
    spin: Array

    def part(self, throws: Throws) -> SpinningHands:
        """The hands of the given throws."""
        return SpinningHands(self.hands.part(throws), self.spin[throws])

    def at(self, times: Array) -> Hands:
        """The hands at `times` (N,) [s]."""
        pose, twist, acceleration = self.hands.at(times)
        pose[2] += times * self.spin
        twist[2] += self.spin
        return pose, twist, acceleration
