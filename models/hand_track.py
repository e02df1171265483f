"""Hand motions given as numbers: constant acceleration, pieces of it, samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .release import HandSamples

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class ConstantAcceleration:
    """pose, twist, acceleration (3,) at time 0: x, z [m], theta [rad] and derivatives."""

    pose: Sequence[float]
    twist: Sequence[float] = (0.0, 0.0, 0.0)
    acceleration: Sequence[float] = (0.0, 0.0, 0.0)

    def at(self, times: Array) -> HandSamples:
        """The hand at `times` (K,) [s]."""
        pose, twist, acceleration = (
            np.asarray(value, float)[:, None]
            for value in (self.pose, self.twist, self.acceleration)
        )
        t = np.asarray(times, float)
        return HandSamples(
            t,
            pose + twist * t + acceleration * t * t / 2,
            twist + acceleration * t,
            np.repeat(acceleration, t.size, axis=1),
        )


class PiecewiseAcceleration:
    """Constant acceleration from `times[i]` on: accelerations (P, 3), times (P,) from 0.

    pose, twist (3,) at time 0. Raises ValueError for times that do not rise from 0.
    """

    def __init__(
        self,
        pose: Sequence[float],
        twist: Sequence[float],
        times: Sequence[float],
        accelerations: npt.ArrayLike,
    ) -> None:
        self._times = np.asarray(times, float)
        self._acceleration = np.asarray(accelerations, float)
        if self._acceleration.shape != (self._times.size, 3):
            raise ValueError("accelerations: one row of three numbers per time")
        if not (np.isfinite(self._times).all() and np.isfinite(self._acceleration).all()):
            raise ValueError("times, accelerations: must be finite numbers")
        if self._times[0] != 0 or (np.diff(self._times) <= 0).any():
            raise ValueError("times: must start at 0 and rise")
        poses, twists = [np.asarray(pose, float)], [np.asarray(twist, float)]
        for dt, a in zip(np.diff(self._times), self._acceleration, strict=False):
            poses.append(poses[-1] + twists[-1] * dt + a * dt * dt / 2)
            twists.append(twists[-1] + a * dt)
        self._pose, self._twist = np.array(poses), np.array(twists)

    def at(self, times: Array) -> HandSamples:
        """The hand at `times` (K,) [s]."""
        t = np.asarray(times, float)
        i = np.clip(np.searchsorted(self._times, t, "right") - 1, 0, None)
        u = (t - self._times[i])[:, None]
        pose, twist, a = self._pose[i], self._twist[i], self._acceleration[i]
        return HandSamples(t, (pose + twist * u + a * u * u / 2).T, (twist + a * u).T, a.T.copy())


class SampledHand:
    """Sampled poses (K, 3) at `times` (K,) [s from the opening's start], by cubic splines.

    Raises ValueError for unequal lengths, times that do not rise, NaN, too few samples.
    """

    def __init__(self, times: npt.ArrayLike, poses: npt.ArrayLike) -> None:
        from scipy.interpolate import CubicSpline

        t, q = np.asarray(times, float), np.asarray(poses, float)
        if q.ndim != 2 or q.shape[1] != 3 or len(q) != len(t):
            raise ValueError(f"poses: one row of x, z, theta per time, got {q.shape} for {t.size}")
        if len(t) < 4:
            raise ValueError("times: at least four samples are needed")
        if not (np.isfinite(t).all() and np.isfinite(q).all()):
            raise ValueError("times, poses: must be finite numbers")
        if (np.diff(t) <= 0).any():
            raise ValueError("times: must rise from sample to sample")
        self._curve = CubicSpline(t, q)

    def at(self, times: Array) -> HandSamples:
        """The hand at `times` (K,) [s]."""
        t = np.asarray(times, float)
        return HandSamples(t, *(self._curve(t, k).T for k in range(3)))
