"""Motions over time as polynomial pieces: of hands and of joints, of one throw or of N.

A hand's coordinates are x, z [m] and theta [rad]; joints are in their own order. Every motion is a
`Trajectory` of these, or the `MovedHand` of a trajectory of joints.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from ..core import Structure, array, library, out, sampled
from .body import Array, HandSamples, ReadOnly

#: Indices among N throws.
Throws = npt.NDArray[np.int_]


@dataclass(frozen=True, eq=False)
class Trajectory(ReadOnly):
    """n coordinates over time in P polynomial pieces, for one throw or N.

    breaks (P + 1,) [s]: ends of the pieces. Outside, the first and last piece continue; if `held`,
    the coordinates keep their values at the ends. given (D + 1, n, P, R): coefficients, highest
    power first, of the time since the start of the piece; or samples (R, P + 1, n) at the breaks,
    for cubic splines. R is N, or 1 for a motion shared by all throws. delays (N,) [s]: of each
    throw on its motion. drift (n, N): rates added from time 0 on. kinks (J,) [s]: steps of
    acceleration or jerk.
    """

    breaks: Array
    given: Array
    kinks: Array
    held: bool = False
    delays: Array | float = 0.0
    drift: Array | None = None

    @classmethod
    def accelerating(
        cls, pose: npt.ArrayLike, twist: npt.ArrayLike = 0.0, acceleration: npt.ArrayLike = 0.0
    ) -> Trajectory:
        """Constant acceleration from pose and twist at time 0: each (n,), or (N, n) for N."""
        powers = [np.asarray(v, float) for v in (acceleration, twist, pose)]
        powers[0] = powers[0] / 2
        columns = [np.atleast_2d(v).T for v in np.broadcast_arrays(*powers)]
        given = np.array(columns, order="C")
        return cls(np.array([0.0, np.inf]), given[:, :, None], np.empty(0))

    @classmethod
    def stepping(
        cls,
        pose: Sequence[float],
        twist: Sequence[float],
        times: Sequence[float],
        accelerations: npt.ArrayLike,
    ) -> Trajectory:
        """Constant accelerations (P, n) from `times` (P,) [s] on, from pose and twist at time 0.

        Raises ValueError for times that do not rise from 0.
        """
        t, a = np.asarray(times, float), np.asarray(accelerations, float)
        if a.shape != (t.size, len(pose)):
            raise ValueError("accelerations: one row of three numbers per time")
        if not (np.isfinite(t).all() and np.isfinite(a).all()):
            raise ValueError("times, accelerations: must be finite numbers")
        if t[0] != 0 or (np.diff(t) <= 0).any():
            raise ValueError("times: must start at 0 and rise")
        poses, twists = [np.asarray(pose, float)], [np.asarray(twist, float)]
        for dt, each in zip(np.diff(t), a, strict=False):
            poses.append(poses[-1] + twists[-1] * dt + each * dt * dt / 2)
            twists.append(twists[-1] + each * dt)
        given = np.stack([a / 2, np.array(twists), np.array(poses)]).transpose(0, 2, 1)
        return cls(np.append(t, np.inf), given[..., None], t[1:])

    @classmethod
    def through(
        cls, times: npt.ArrayLike, poses: npt.ArrayLike, delays: Array | float = 0.0
    ) -> Trajectory:
        """Cubic splines through poses (K, n), or (N, K, n), at `times` (K,) [s].

        Raises ValueError for unequal lengths, times that do not rise, NaN, too few samples.
        """
        t, rows = np.asarray(times, float), np.asarray(poses, float)
        rows = rows if rows.ndim == 3 else rows[None]
        if rows.ndim != 3 or rows.shape[1] != t.size:
            raise ValueError(f"poses: one row per time, got {rows.shape[1:]} for {t.size}")
        if t.size < 4:
            raise ValueError("times: at least four samples are needed")
        if not (np.isfinite(t).all() and np.isfinite(rows).all()):
            raise ValueError("times, poses: must be finite numbers")
        if (np.diff(t) <= 0).any():
            raise ValueError("times: must rise from sample to sample")
        return cls(t, rows, np.empty(0), delays=delays)

    @classmethod
    def cubics(cls, times: Array, q: Array, dq: Array, ddq: Array, jerk: Array) -> Trajectory:
        """Pieces between `times` (P + 1,) [s] with these values (P, n) at their start."""
        given = np.stack([jerk / 6, ddq / 2, dq, q]).transpose(0, 2, 1)[..., None]
        return cls(times, given, times)

    @classmethod
    def quintics(cls, step: float, q: Array, dq: Array, ddq: Array) -> Trajectory:
        """Samples (K, n) every `step` [s], held outside; meets all three at each of them.

        Kinks are the samples at which the jerk changes, and the thirds of steps inside which
        it does: between them the quintics are one cubic.
        """
        pieces, n = max(len(q) - 1, 0), q.shape[1]
        given, kinks = np.empty((6, n, pieces, 1)), np.empty(4 * len(q))
        arrays = out(given, 6, n, pieces), out(kinks, 4 * len(q))
        corners = library().quintics(sampled(step, q, dq, ddq), *arrays)
        times = step * np.arange(len(q), dtype=np.float64)
        return cls(times, given, kinks[:corners], held=True)

    @classmethod
    def joined(cls, parts: Sequence[Trajectory]) -> Trajectory:
        """Concatenates single paths in time; held at the end like the last.

        Kinks are those of the first.
        """
        powers = max(len(part.coefficients) for part in parts)
        padded = [
            np.pad(part.coefficients, ((powers - len(part.coefficients), 0), *[(0, 0)] * 3))
            for part in parts
        ]
        breaks = np.concatenate([part.breaks[:-1] for part in parts] + [parts[-1].breaks[-1:]])
        return cls(breaks, np.concatenate(padded, axis=2), parts[0].kinks, held=parts[-1].held)

    @cached_property
    def coefficients(self) -> Array:
        """Highest power first: (D + 1, n, P, R)."""
        if self.given.ndim == 4:
            return self.given
        from scipy.interpolate import CubicSpline

        splines = CubicSpline(self.breaks, self.given, axis=1).c
        return np.ascontiguousarray(splines.transpose(0, 3, 1, 2))

    @cached_property
    def core(self) -> Structure:
        """A single path without drift, for the compiled core."""
        powers, n, pieces, rows = self.coefficients.shape
        assert rows == 1 and n <= library().AXES and self.drift is None
        corners, contiguous = self.kinks.size, np.ascontiguousarray
        path = Structure("path", n=n, powers=powers, pieces=pieces, held=self.held, corners=corners)
        path.breaks = array(contiguous(self.breaks), pieces + 1)
        path.curves = array(contiguous(self.coefficients), powers, n, pieces)
        path.kinks = array(contiguous(self.kinks), corners)
        return path

    def __getstate__(self) -> dict[str, Any]:
        """The state without addresses of this process."""
        return {name: value for name, value in vars(self).items() if name != "core"}

    @property
    def rows(self) -> int:
        """R."""
        return self.given.shape[-1] if self.given.ndim == 4 else len(self.given)

    @property
    def end(self) -> float:
        """End of the last piece [s]."""
        return float(self.breaks[-1])

    def starts(self, derivative: int) -> Array:
        """A derivative (P, n) at the start of each piece of a single path."""
        power = self.coefficients[-1 - derivative, :, :, 0]
        return math.factorial(derivative) * np.ascontiguousarray(power.T)

    def part(self, throws: Throws) -> Trajectory:
        """The motions of the given throws."""
        given, delays, drift = self.given, self.delays, self.drift
        if self.rows > 1:
            given = np.take(given, throws, axis=-1 if given.ndim == 4 else 0)
        return replace(
            self,
            given=given,
            delays=delays[throws] if isinstance(delays, np.ndarray) else delays,
            drift=None if drift is None else drift[:, throws],
        )

    def shifted(self, delays: Array | float) -> Trajectory:
        """Each throw's clock starts that much later [s] on the motion: one value, or (N,)."""
        # It shares the coefficients if they are known.
        copy = object.__new__(Trajectory)
        vars(copy).update(vars(self), delays=self.delays + delays)
        return copy

    def at(self, times: npt.ArrayLike) -> HandSamples:
        """Coordinates and derivatives, each (n, K), at `times` (K,) [s]; N throws: (N,)."""
        t = np.asarray(times, float)
        clock = np.asarray(t + self.delays)
        alike = self.rows == 1 and clock.size > 1 and not (clock != clock[0]).any()
        p, dp, ddp = self._at(clock[:1] if alike else clock)
        if alike:
            p, dp, ddp = (np.broadcast_to(v, (len(v), clock.size)) for v in (p, dp, ddp))
        if self.drift is not None:
            p, dp = p + t * self.drift, dp + self.drift
        return HandSamples(t, p, dp, ddp)

    def _at(self, clock: Array) -> tuple[Array, Array, Array]:
        if self.held:
            clock = np.minimum(np.maximum(clock, self.breaks[0]), self.breaks[-1])
        c = self.coefficients
        if c.shape[2] == 1:
            powers, u = list(c[:, :, 0]), clock - self.breaks[0]
        else:
            piece = np.searchsorted(self.breaks[1:-1], clock, "right")
            u = clock - self.breaks[piece]
            place = piece if self.rows == 1 else piece * self.rows + np.arange(self.rows)
            powers = [np.take(power.reshape(len(power), -1), place, axis=1) for power in c]
        p, dp, ddp = powers[0] * u + powers[1], powers[0], np.zeros(())
        for power in powers[2:]:
            ddp = ddp * u + dp
            dp = dp * u + p
            p = p * u + power
        return p, dp, 2 * ddp


@dataclass(frozen=True, eq=False)
class MovedHand:
    """The hand that a path of joints moves.

    motion: function from q, dq, ddq, each (n, K), to pose, twist and acceleration of the hand, each
    (3, K); linkage: its form for the compiled core. turning [rad/s]: angular velocity added to the
    hand's from time 0 on.
    """

    path: Trajectory
    motion: Callable[..., Any]
    linkage: Structure
    turning: float = 0.0

    def at(self, times: npt.ArrayLike) -> HandSamples:
        """The hand at `times` (K,) [s]."""
        hand = self.of(self.path.at(times))
        if self.turning:
            hand.pose[2] += self.turning * hand.times
            hand.twist[2] += self.turning
        return hand

    def of(self, joints: HandSamples) -> HandSamples:
        """The hand for joints at known instants."""
        return HandSamples(joints.times, *self.motion(*joints))


def low_pass(times: Array, values: Array, cutoff: float) -> tuple[Array, Array]:
    """Even times (K,) and `values` (K, n) low-passed at `cutoff` [Hz], without phase shift.

    Uneven times are first resampled, by cubic splines, at their median rate. Raises
    ValueError for fewer than 16 samples or a cutoff above half the rate.
    """
    from scipy.interpolate import CubicSpline
    from scipy.signal import butter, sosfiltfilt

    if times.size < 16:
        raise ValueError(f"needs at least 16 samples, has {times.size}")
    step = float(np.median(np.diff(times)))
    if cutoff >= 0.5 / step:
        raise ValueError(f"cutoff {cutoff:g} Hz must be below half the rate {1 / step:.0f} Hz")
    even = np.linspace(times[0], times[-1], round((times[-1] - times[0]) / step) + 1)
    if np.abs(np.diff(times) - step).max() > 1e-6 * step:
        values = CubicSpline(times, values)(even)
    # Running it forwards and backwards doubles the order.
    sections = butter(2, cutoff, output="sos", fs=1.0 / (even[1] - even[0]))
    return even, np.asarray(sosfiltfilt(sections, values, axis=0))
