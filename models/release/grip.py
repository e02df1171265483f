"""The force of opening pads: linear or measured.

A law is a `GripProfile` with `full`, `dwell`, `opening` and `force(time)`; `Gripper.profile` in
`problems/grip.py` chooses it by the keys of a scene.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ..body import Array

#: Fewest rows of a raw recording of the grip force.
MIN_ROWS = 20
#: Share of the full force whose loss may take no longer than that of all the rest.
LAST_SHARE = 0.02


class GripProfile:
    """The force of one pad over time: `full` [N] until `dwell` [s] after the opening command, then
    falling to zero in `opening` [s].
    """

    full: float
    dwell: float
    opening: float

    def force(self, time: npt.ArrayLike) -> Array:
        """f_N [N] at `time` [s] after the start of the fall."""
        raise NotImplementedError

    @property
    def cubics(self) -> tuple[Array, Array]:
        """The force over the time from its fall on, in K pieces: breaks (K + 1,) [s], and
        coefficients (4, K) [N], highest power first, of the time since a piece's begin."""
        raise NotImplementedError


@dataclass(frozen=True)
class LinearGrip(GripProfile):
    """A force that falls linearly."""

    full: float
    dwell: float
    opening: float

    @property
    def cubics(self) -> tuple[Array, Array]:
        """One piece."""
        falling = [[0.0], [0.0], [-self.full / self.opening], [self.full]]
        return np.array([0.0, self.opening]), np.array(falling)

    def force(self, time: npt.ArrayLike) -> Array:
        """f_N [N] at `time` [s] after the start of the fall."""
        return self.full * np.clip(1.0 - np.asarray(time, float) / self.opening, 0.0, 1.0)


class TableGrip(GripProfile):
    """A measured grip force: times [s] from the opening command, forces [N] of one pad.

    Interpolated by monotone cubics (PCHIP): no overshoot, continuous slope. The last
    force must be zero within 1 % of the largest, and the force may not rise again by
    more than 5 % of the largest. The opening ends as `_end_of_fall` says. Raises
    ValueError saying what is wrong.
    """

    #: Loss of force, as a share of its first value, at the start of the fall.
    FALL_SHARE: ClassVar[float] = 0.01

    def __init__(self, times: Sequence[float], forces: Sequence[float]) -> None:
        t, f = np.array(times, float), np.array(forces, float)
        _check_table(t, f)
        f[-1] = 0.0
        self.full = float(f[0])
        falling = np.flatnonzero(f < (1.0 - self.FALL_SHARE) * f[0])
        start = max(int(falling[0]) - 1, 0)
        noise = max(map(_noise, (f[: start + 1], _tail(f))))
        ended = _end_of_fall(t, np.minimum.accumulate(f), start, noise)
        f[ended] = 0.0
        self.dwell = float(t[start])
        self.opening = float(t[ended] - t[start])
        self._times, self._forces = t[start : ended + 1] - t[start], f[start : ended + 1]

    @cached_property
    def _curve(self) -> Any:
        """The force over the time from its fall on."""
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self._times, self._forces)

    @property
    def cubics(self) -> tuple[Array, Array]:
        """Those of the table."""
        breaks, curves = (np.ascontiguousarray(v, float) for v in (self._curve.x, self._curve.c))
        return breaks, curves

    def force(self, time: npt.ArrayLike) -> Array:
        """f_N [N] at `time` [s] after the start of the fall."""
        force = self._curve(np.clip(np.asarray(time, float), 0.0, self.opening))
        return np.asarray(np.maximum(force, 0.0))

    def delayed(self, delay: float) -> TableGrip:
        """The same force, which falls later by `delay` [s]."""
        found = copy.copy(self)
        found.dwell = self.dwell + delay
        return found

    @classmethod
    def from_recording(cls, times: Array, forces: Array) -> TableGrip:
        """The falling force nearest to a raw recording of one pad, in the sense of least squares.

        times (K,) [s] from the opening command on, forces (K,) [N], until the pads have been apart
        for at least a tenth of the recording. The median of that last tenth is subtracted as the
        offset. The full force is the median of what comes before the fall. Within the noise the
        force is full; the opening ends as `_end_of_fall` says. Raises ValueError for fewer than 20
        rows, a recording without a fall, and as `TableGrip`.
        """
        from scipy.optimize import isotonic_regression

        t, raw = np.asarray(times, float), np.asarray(forces, float)
        if t.shape != raw.shape or t.size < MIN_ROWS:
            raise ValueError(f"needs at least {MIN_ROWS} rows of t, f_N")
        if not np.isfinite(raw).all():
            raise ValueError("has a value that is not a finite number")
        tail = _tail(raw)
        force = raw - np.median(tail)
        fall = np.asarray(isotonic_regression(force, increasing=False).x)
        # Half the force is far from the noise of either end; most samples before it have full
        # force.
        half = int(np.flatnonzero(fall < fall[0] / 2)[0]) if fall[-1] < fall[0] / 2 else 0
        full_level = 0.95 * float(np.median(force[: half // 2 + 1]))
        flat = np.flatnonzero(fall[:half] >= full_level)
        if fall[0] <= 0 or half < 2 or flat.size < 2:
            raise ValueError("f_N must start at the full grip and fall from there")
        full = float(np.median(force[flat]))
        noise = max(map(_noise, (raw[: half // 2 + 1], tail)))
        ends = [float(np.mean(part)) for part in np.array_split(tail, 2)]
        if ends[0] - ends[1] > max(0.02 * full, noise):
            raise ValueError(
                "f_N must go on, level, for a tenth of the recording after the pads are apart"
            )
        fall[fall >= full - max(noise, cls.FALL_SHARE * full)] = full
        start = max(int(np.flatnonzero(fall < full)[0]) - 1, 0)
        ended = _end_of_fall(t, fall, start, noise)
        fall[ended] = 0.0
        return cls(t[: ended + 1].tolist(), np.maximum(fall[: ended + 1], 0.0).tolist())

    @staticmethod
    def noise(forces: Array) -> float:
        """Sum [N] of the rises of a raw recording; 0 for one that needs no smoothing.

        A raw one rises by more than 5 % of its largest force in all.
        """
        rises = float(np.maximum(np.diff(forces), 0.0).sum())
        raw = len(forces) >= MIN_ROWS and rises > 0.05 * np.abs(forces).max()
        return rises if raw else 0.0

    def samples(self) -> Array:
        """Time [s] from the opening command and force [N] of one pad (K, 2), every millisecond.

        A table of these has the same dwell and opening: only its two ends are at the full force
        and at zero.
        """
        step = 0.001
        dwell_times = np.arange(0.0, self.dwell - step / 1000, step)
        falling = np.arange(step, self.opening - step / 1000, step)
        force = self.force(falling)
        inner = (force < (1 - 1.01 * self.FALL_SHARE) * self.full) & (force > 1e-6 * self.full)
        times = np.concatenate([[0.0], falling[inner], [self.opening]])
        forces = np.concatenate([self.force(0.0)[None], force[inner], [0.0]])
        rows = np.column_stack([dwell_times, np.full(dwell_times.size, self.full)])
        return np.vstack([rows, np.column_stack([self.dwell + times, forces])])


def _tail(forces: Array) -> Array:
    """The last tenth of a recording."""
    return forces[-max(forces.size // 10, 2) :]


def _noise(level: Array) -> float:
    """Noise [N] of a force that is level, three standard deviations, by the steps between its
    samples; 0 if it only falls."""
    steps = np.diff(level)
    return 3 * float(np.std(steps)) / math.sqrt(2) if (steps > 0.0).any() else 0.0


def _end_of_fall(t: Array, falling: Array, start: int, noise: float) -> int:
    """Index of the sample at which the pads let go.

    From there on the force falls by no more than its noise [N] in as much time as the fall itself
    took: a slow drift of the sensor is no force of the pads. falling (K,) [N]: monotone, at times t
    (K,) [s]; start: index of the fall's start. ValueError if the last `LAST_SHARE` of the force
    takes longer than all the rest: then the end is no property of the pads.
    """
    later = np.interp(2 * t - t[start], t, falling)
    over = falling - later <= max(noise, 1e-9 * falling[0])
    # A force that stays for a while higher than that falls on.
    low = noise + LAST_SHARE * falling[0] if noise else 1e-9 * falling[0]
    ended = int(np.flatnonzero(over & (falling <= falling[-1] + low))[0])
    little = int(np.flatnonzero(falling <= falling[ended] + LAST_SHARE * falling[0])[0])
    rest, last = t[little] - t[start], t[ended] - t[little]
    if last > rest:
        raise ValueError(
            f"f_N falls to {100 * LAST_SHARE:g} % in {1e3 * rest:.0f} ms, and on for "
            f"{1e3 * last:.0f} ms: the end of the opening cannot be told from a drift; leave out "
            "what comes after the pads are apart, or take the drift off"
        )
    return ended


def _check_table(t: Array, f: Array) -> None:
    if t.size < 2 or t.shape != f.shape:
        raise ValueError("needs at least two rows of t, f_N")
    if not (np.isfinite(t).all() and np.isfinite(f).all()):
        raise ValueError("has a value that is not a finite number")
    if t[0] < 0 or (np.diff(t) <= 0).any():
        raise ValueError("t must start at 0 or later and rise from row to row")
    peak = f.max()
    if peak <= 0 or (f < 0).any():
        raise ValueError("f_N must not be negative and must start above 0")
    if f[-1] > 0.01 * peak:
        raise ValueError(f"f_N must end at 0, but the last row has {f[-1]:g} N")
    if f[0] < 0.5 * peak:
        raise ValueError("f_N must start at the full grip and fall from there")
    if (f - np.minimum.accumulate(f)).max() > 0.05 * peak:
        raise ValueError("f_N must fall: it rises by more than 5 % of its largest value")
