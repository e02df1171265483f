"""The hands' motions of many releases at once, one entry per throw."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
#: Numbers of some of the throws.
Throws = npt.NDArray[np.int_]
#: Pose, twist and acceleration of the hands, each (3, N).
Hands = tuple[Array, Array, Array]


@dataclass(frozen=True)
class Cubics:
    """Hand poses as cubics in time: coefficients (4, P, R, 3) from knots (P + 1,) [s] on.

    Highest power first, in the time since the piece's knot. R is N, or 1 where all throws
    share one motion; delays (N,) [s]: how much later each throw starts on it.
    """

    knots: Array
    coefficients: Array
    delays: Array | None = None


class HandsTrack(Protocol):
    """N hand motions, counted from the opening's start."""

    def at(self, times: Array) -> Hands:
        """The hands at `times` (N,) [s], one time per throw."""

    def part(self, throws: Throws) -> HandsTrack:
        """The hands of the given throws."""


@runtime_checkable
class CubicHands(HandsTrack, Protocol):
    """N hand motions that are cubics in time."""

    def cubics(self) -> Cubics:
        """The same motions for code that knows nothing else."""


@dataclass(frozen=True)
class ConstantAccelerations:
    """pose, twist, acceleration (N, 3) at the opening's start: x, z [m], theta [rad]."""

    pose: Array
    twist: Array
    acceleration: Array

    def part(self, throws: Throws) -> ConstantAccelerations:
        """The hands of the given throws."""
        return ConstantAccelerations(
            self.pose[throws], self.twist[throws], self.acceleration[throws]
        )

    def at(self, times: Array) -> Hands:
        """The hands at `times` (N,) [s]."""
        pose, twist, a = self.pose.T, self.twist.T, self.acceleration.T
        return pose + times * (twist + times * a / 2), twist + times * a, a

    def cubics(self) -> Cubics:
        """One piece for all time, without a third power."""
        powers = [np.zeros_like(self.pose), self.acceleration / 2, self.twist, self.pose]
        return Cubics(np.array([0.0, np.inf]), np.stack(powers)[:, None])


@dataclass(frozen=True)
class SampledHands:
    """N hand motions sampled at common `times` (K,) [s]: poses (N, K, 3), by cubic splines.

    One motion, (1, K, 3), serves all throws. delays (N,) [s] let each throw start that
    much later on its motion.
    """

    times: Array
    poses: Array
    delays: Array | None = None

    @cached_property
    def _coefficients(self) -> Array:
        """Spline coefficients (4, K - 1, N, 3)."""
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(self.times, self.poses, axis=1).c)

    def part(self, throws: Throws) -> SampledHands:
        """The hands of the given throws."""
        poses = self.poses if len(self.poses) == 1 else self.poses[throws]
        return SampledHands(self.times, poses, None if self.delays is None else self.delays[throws])

    def at(self, times: Array) -> Hands:
        """The hands at `times` (N,) [s]."""
        t = times if self.delays is None else times + self.delays
        i = np.clip(np.searchsorted(self.times, t, "right") - 1, 0, len(self.times) - 2)
        u = (t - self.times[i])[:, None]
        row = 0 if len(self.poses) == 1 else np.arange(len(self.poses))
        c3, c2, c1, c0 = (self._coefficients[k][i, row] for k in range(4))
        pose = c0 + u * (c1 + u * (c2 + u * c3))
        twist = c1 + u * (2 * c2 + u * 3 * c3)
        return pose.T, twist.T, (2 * c2 + 6 * u * c3).T

    def cubics(self) -> Cubics:
        """The splines."""
        return Cubics(self.times, self._coefficients, self.delays)
