"""Recorded joint positions as a hand motion: filtered without phase shift, then splined.

The processing of Liu and Billard, section VI-A: a Butterworth low-pass at 35 Hz, and
velocity and acceleration from cubic splines of the filtered positions.
"""

from __future__ import annotations

import casadi as ca
import numpy as np
import numpy.typing as npt

from .release import HandSamples

Array = npt.NDArray[np.float64]

#: Order of the Butterworth filter; run forwards and backwards it acts as twice that.
ORDER = 2


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
    sections = butter(ORDER, cutoff, output="sos", fs=1.0 / (even[1] - even[0]))
    return even, np.asarray(sosfiltfilt(sections, values, axis=0))


class RecordedJoints:
    """A hand moved by recorded joint positions.

    times (K,) [s], joints (K, n) [rad]; motion: function (q, dq, ddq) -> pose, twist,
    acceleration; opening: the recording's time [s] at which the force starts to fall.
    Raises ValueError as `low_pass` does, and for an opening outside the recording.
    """

    def __init__(
        self, times: Array, joints: Array, motion: ca.Function, opening: float, cutoff: float = 35.0
    ) -> None:
        from scipy.interpolate import CubicSpline

        if not times[0] <= opening < times[-1]:
            raise ValueError(f"opening_time {opening:g} s is outside the recording")
        even, smooth = low_pass(times, joints, cutoff)
        self._curve = CubicSpline(even, smooth)
        self._motion = motion
        self._opening = opening

    def at(self, times: Array) -> HandSamples:
        """The hand at `times` (K,) [s] after the opening's start."""
        t = np.asarray(times, float)
        outputs = self._motion(*(self._curve(self._opening + t, k).T for k in range(3)))
        return HandSamples(t, *(np.array(o) for o in outputs))
