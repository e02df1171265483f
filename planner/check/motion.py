"""Motions of the planned coordinates over time: as planned, and as sampled for sending."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: Sampling interval [s] of everything that is sent: 1 kHz.
TICK = 0.001
#: The acceleration may step where two pieces of a motion meet: it is looked at this far [s]
#: from there on either side.
INSIDE = 1e-12
#: Acceleration [rad/s^2; m/s^2] that a tick may do without being looked into.
UNEVEN = 0.01


class Motion(Protocol):
    """Coordinates over time."""

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq, each (n, N), at `times` (N,) [s]."""


class PiecewiseMotion(Motion, Protocol):
    """Coordinates over time in smooth pieces."""

    @property
    def kinks(self) -> Array:
        """Where acceleration or jerk may step (K,) [s]."""

    def closely(self, until: float, step: float) -> tuple[Array, Array, Array, Array]:
        """Times (N,) [s] from 0 to just after `until`, and q, dq, ddq, each (n, N), there.

        `step` apart at most, and such that no peak of the acceleration is missed.
        """


@dataclass(frozen=True)
class PlannedMotion:
    """The NLP's own motion: cubic or quadratic pieces from rest to detach.

    times (K+1,), coefficients of q, dq, ddq at each piece's start (K, n) and its jerk.
    After the last piece's end it goes on as that piece.
    """

    times: Array
    q: Array
    dq: Array
    ddq: Array
    jerk: Array

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq, each (n, N), at `times` (N,) [s]."""
        piece = np.clip(np.searchsorted(self.times, times, "right") - 1, 0, len(self.q) - 1)
        t = (times - self.times[piece])[:, None]
        q, dq, ddq, jerk = self.q[piece], self.dq[piece], self.ddq[piece], self.jerk[piece]
        return (
            (q + t * (dq + t * (ddq / 2 + t * jerk / 6))).T,
            (dq + t * (ddq + t * jerk / 2)).T,
            (ddq + t * jerk).T,
        )

    @property
    def kinks(self) -> Array:
        """Where the pieces meet [s]."""
        return self.times

    def closely(self, until: float, step: float) -> tuple[Array, Array, Array, Array]:
        """Both ends of each piece, seen from inside, and between: see `PiecewiseMotion`."""
        begin = self.times[: max(np.searchsorted(self.times, until), 1)]
        end = np.append(begin[1:], until)
        count = np.ceil((end - begin) / step).astype(int) + 1
        within = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
        share = within / np.repeat(np.maximum(count - 1, 1), count)
        inner = end - begin - 2 * INSIDE
        times = np.repeat(begin + INSIDE, count) + share * np.repeat(inner, count)
        times = np.append(times, until + INSIDE)
        return times, *self.at(times)


@dataclass(frozen=True)
class SampledMotion:
    """Samples every millisecond from t = 0: q, dq, ddq, each (N, n).

    In between, the quintic that meets position, rate and acceleration at both samples.
    """

    q: Array
    dq: Array
    ddq: Array

    @property
    def times(self) -> Array:
        """Sample times (N,) [s]."""
        return np.asarray(TICK * np.arange(len(self.q)))

    @cached_property
    def _quintics(self) -> Array:
        """Coefficients (N - 1, 6, n) of the pieces, in shares of a tick."""
        h = TICK
        v, a = h * self.dq, h * h * self.ddq
        p0, v0, a0 = self.q[:-1], v[:-1], a[:-1]
        # Remainders after the Taylor part of the start.
        dv, da = v[1:] - v0 - a0, a[1:] - a0
        dp = self.q[1:] - p0 - v0 - a0 / 2
        c3, c4, c5 = (
            10 * dp - 4 * dv + da / 2,
            -15 * dp + 7 * dv - da,
            6 * dp - 3 * dv + da / 2,
        )
        return np.stack([p0, v0, a0 / 2, c3, c4, c5], axis=1)

    @cached_property
    def _uneven(self) -> npt.NDArray[np.intp]:
        """Numbers of the ticks whose jerk is not even: a kink, or a swing, is inside."""
        h, before, after = TICK, self.ddq[:-1], self.ddq[1:]
        # What even jerk would leave of the next sample's rate and position.
        off = np.abs(np.diff(self.dq, axis=0) / h - (before + after) / 2)
        off += np.abs(6 / h * (np.diff(self.q, axis=0) / h - self.dq[:-1]) - 2 * before - after)
        return np.flatnonzero((off > UNEVEN).any(axis=1))

    @cached_property
    def _corners(self) -> npt.NDArray[np.intp]:
        """Numbers of the samples at which the jerk changes."""
        change = np.abs(np.diff(self.ddq, n=2, axis=0))
        return 1 + np.flatnonzero((change > UNEVEN).any(axis=1))

    @property
    def kinks(self) -> Array:
        """Samples at which the jerk changes, and the thirds of ticks in which it does [s].

        Between them the quintics are one cubic; inside such ticks the acceleration swings.
        """
        inside = (self._uneven[:, None] + np.arange(4) / 3).ravel()
        return np.unique(TICK * np.concatenate([self._corners, inside]))

    def closely(self, until: float, step: float) -> tuple[Array, Array, Array, Array]:
        """The samples, and between them where jerk is not even: see `PiecewiseMotion`.

        Where the jerk is even all along a tick its ends tell all; elsewhere the acceleration
        may swing in between.
        """
        count = math.ceil(min(until / TICK, len(self.q) - 1.0))
        looked_at = np.zeros(len(self.q) + 1, dtype=bool)
        looked_at[:: max(int(step / TICK), 1)] = True
        for ticks in (self._corners, self._uneven, self._uneven + 1):
            looked_at[ticks] = True
        ticks = np.flatnonzero(looked_at[:count])
        between = TICK * (self._uneven[:, None] + np.array([0.2, 0.4, 0.6, 0.8])).ravel()
        between = np.append(between[between < until], until + np.array([0.0, INSIDE]))
        q, dq, ddq = (
            np.concatenate([values[ticks], more.T]).T
            for values, more in zip((self.q, self.dq, self.ddq), self.at(between), strict=True)
        )
        return np.append(TICK * ticks, between), q, dq, ddq

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq, each (n, N), at `times` (N,) [s]; held constant outside."""
        place = np.minimum(np.maximum(times / TICK, 0.0), len(self.q) - 1.0)
        i = np.minimum(place.astype(int), len(self.q) - 2)
        u = (place - i)[:, None]
        c0, c1, c2, c3, c4, c5 = self._quintics[i].transpose(1, 0, 2)
        q = c0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))))
        dq = (c1 + u * (2 * c2 + u * (3 * c3 + u * (4 * c4 + u * (5 * c5))))) / TICK
        ddq = (2 * c2 + u * (6 * c3 + u * (12 * c4 + u * (20 * c5)))) / (TICK * TICK)
        return q.T, dq.T, ddq.T
