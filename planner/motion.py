"""Motions of the planned coordinates over time: as planned, and as sampled for sending."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from .context import JERK_UNIT
from .mover import Mover
from .nlp import ThrowNlp

Array = npt.NDArray[np.float64]

#: Sampling interval [s] of everything that is sent: 1 kHz.
TICK = 0.001


class Motion(Protocol):
    """Coordinates over time."""

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq, each (n, N), at `times` (N,) [s]."""


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


def planned_motion(nlp: ThrowNlp, mover: Mover, x: Array, opening: float) -> PlannedMotion:
    """The motion in decision vector `x`; `opening` [s] is the duration of the force's fall."""
    s = nlp.structure
    duration = nlp.block(x, "T", 0)
    assert duration is not None
    times = np.concatenate(
        [
            np.linspace(0.0, duration[0], s.carry + 1),
            duration[0] + np.linspace(0.0, opening, s.opening + 1)[1:],
        ]
    )
    zero = np.zeros(mover.size)

    def blocks(name: str, default: Array) -> Array:
        found = [nlp.block(x, name, k) for k in range(s.carry + s.opening)]
        return np.array([default if value is None else value for value in found])

    start = zero if mover.start is None else mover.start
    control = blocks("c", zero)
    if s.jerk_control:
        ddq, jerk = blocks("ddq", zero), JERK_UNIT * control
    else:
        ddq, jerk = control, 0 * control
    return PlannedMotion(times, blocks("q", start), blocks("dq", zero), ddq, jerk)


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

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        """q, dq, ddq, each (n, N), at `times` (N,) [s]; held constant outside."""
        i = np.clip((times / TICK).astype(int), 0, len(self.q) - 2)
        h = TICK
        u = np.clip(times - TICK * i, 0.0, h)[:, None] / h
        p0, v0, a0 = self.q[i], h * self.dq[i], h * h * self.ddq[i]
        p1, v1, a1 = self.q[i + 1], h * self.dq[i + 1], h * h * self.ddq[i + 1]
        # Remainders after the Taylor part of the start; c3..c5 of the quintic.
        dp, dv, da = p1 - p0 - v0 - a0 / 2, v1 - v0 - a0, a1 - a0
        c3, c4, c5 = (
            10 * dp - 4 * dv + da / 2,
            -15 * dp + 7 * dv - da,
            6 * dp - 3 * dv + da / 2,
        )
        q = p0 + u * (v0 + u * (a0 / 2 + u * (c3 + u * (c4 + u * c5))))
        dq = (v0 + u * (a0 + u * (3 * c3 + u * (4 * c4 + u * 5 * c5)))) / h
        ddq = (a0 + u * (6 * c3 + u * (12 * c4 + u * 20 * c5))) / (h * h)
        return q.T, dq.T, ddq.T
