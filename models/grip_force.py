"""Grip force of one pad over time, from the start of its fall to zero.

A profile is a full force, a dwell (opening command to the start of the fall) and
the fall itself over `opening` seconds. In the NLP the fall is sampled on a grid
fixed in time, so any profile, a measured one too, enters as numbers.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

#: A table's fall starts where its force leaves the first value by this share.
FALL_SHARE = 0.01


@dataclass(frozen=True)
class LinearRelease:
    """full [N] for `dwell` [s] after the command, then linear to zero in `opening` [s]."""

    full: float
    dwell: float
    opening: float

    def force(self, time: npt.ArrayLike) -> Array:
        """f_N [N] at `time` [s] after the start of the fall."""
        return self.full * np.clip(1.0 - np.asarray(time, float) / self.opening, 0.0, 1.0)


class TableRelease:
    """A measured profile: times [s] from the opening command, forces [N] of one pad.

    Interpolated by monotone cubics (PCHIP): no overshoot, continuous slope. The last
    force must be zero within 1 % of the largest, and the force may not rise again by
    more than 5 % of the largest. Raises ValueError saying what is wrong.
    """

    def __init__(self, times: Sequence[float], forces: Sequence[float]) -> None:
        t, f = np.array(times, float), np.array(forces, float)
        _check_table(t, f)
        peak = f.max()
        f[-1] = 0.0
        self.full = float(f[0])
        falling = np.flatnonzero(f < (1.0 - FALL_SHARE) * f[0])
        start = max(int(falling[0]) - 1, 0)
        ended = int(np.flatnonzero(f > 1e-9 * peak)[-1]) + 1
        self.dwell = float(t[start])
        self.opening = float(t[ended] - t[start])
        self._times, self._forces = t[start : ended + 1] - t[start], f[start : ended + 1]

    @cached_property
    def _curve(self) -> Any:
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self._times, self._forces)

    def force(self, time: npt.ArrayLike) -> Array:
        """f_N [N] at `time` [s] after the start of the fall."""
        force = self._curve(np.clip(np.asarray(time, float), 0.0, self.opening))
        return np.asarray(np.maximum(force, 0.0))


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


#: What the planner needs of a profile: full, dwell, opening and force(time).
GripProfile = LinearRelease | TableRelease
