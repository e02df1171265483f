"""What was measured of throws: landing poses and twists in flight, and errors against them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...problems import InputError, MeasuredThrow, ThrowData

Array = npt.NDArray[np.float64]

#: Window of the Savitzky-Golay filter that differentiates tracks (samples), and its order.
WINDOW, ORDER = 21, 2
#: How long [s] after the opening a bar surely flies, for a track that ends before the landing.
FLIGHT = 0.15


@dataclass(frozen=True)
class Measured:
    """landing (T, 2): x [m], theta [rad] at the landing height; twist (T, 2): v_x [m/s] and
    omega [rad/s] in flight, NaN where no track was measured; arm (T,): half the bar's
    length [m], which makes an angle an error in metres, (39)."""

    landing: Array
    twist: Array
    arm: Array

    def scaled(self, off: Array) -> Array:
        """Scaled errors (T, ...) [m] of predicted less measured landings (T, ..., 2), (39):
        |dx| + |dtheta| l / 2."""
        arm = self.arm.reshape(-1, *[1] * (off.ndim - 2))
        return np.asarray(np.abs(off[..., 0]) + np.abs(off[..., 1]) * arm)

    def part(self, rows: npt.NDArray[np.int_]) -> Measured:
        """Of some of the throws."""
        return Measured(self.landing[rows], self.twist[rows], self.arm[rows])


def measured(data: ThrowData) -> Measured:
    """What was measured of a data set's throws; InputError for a track that never lands."""
    landing, twist = [], []
    for throw in data.throws:
        rates = (np.nan, np.nan)
        if throw.track is not None:
            rates, landed = _from_track(data, throw, throw.track)
        if throw.landing is not None:
            landed = (throw.landing[0], throw.landing[2])
        landing.append(landed)
        twist.append(rates)
    arm = np.array([throw.object.length / 2 for throw in data.throws])
    return Measured(np.array(landing), np.array(twist), arm)


def velocities(track: Array) -> Array:
    """v_x, v_z [m/s], omega [rad/s] (K, 3) of a track (K, 4), by Savitzky-Golay (window 21)."""
    from scipy.signal import savgol_filter

    step = float(np.median(np.diff(track[:, 0])))
    even = np.arange(track[0, 0], track[-1, 0] + step / 2, step)
    poses = np.column_stack([np.interp(even, track[:, 0], track[:, i]) for i in (1, 2, 3)])
    window = min(WINDOW, len(even) - (len(even) + 1) % 2)
    found = savgol_filter(poses, window, ORDER, deriv=1, delta=step, axis=0)
    return np.column_stack([np.interp(track[:, 0], even, found[:, i]) for i in range(3)])


def _from_track(
    data: ThrowData, throw: MeasuredThrow, track: Array
) -> tuple[tuple[float, float], tuple[float, float]]:
    """(v_x, omega) in flight, and (x, theta) where the CoM comes down through the height."""
    start = throw.opening + throw.grip.opening
    flying = track[:, 0] >= start
    if flying.sum() < WINDOW:
        raise InputError(
            f"throw {throw.name}: the track has {int(flying.sum())} samples after the opening, "
            f"must have at least {WINDOW}"
        )
    height, gravity = data.shared.landing_height, data.shared.gravity
    times, x, z, theta = track[flying].T
    below = np.flatnonzero((z[1:] <= height) & (z[:-1] > height))
    # The parabola through the whole flight: less noise than the two samples around the end.
    last = below[0] + 2 if below.size else int((times <= start + FLIGHT).sum())
    t = times[:last] - start
    along, turning = np.polyfit(t, x[:last], 1), np.polyfit(t, theta[:last], 1)
    rising = np.polyfit(t, z[:last] + gravity * t**2 / 2, 1)
    root = rising[0] ** 2 + 2 * gravity * (rising[1] - height)
    lands = root >= 0 and gravity > 0
    if not lands or (not below.size and throw.landing is None):
        raise InputError(
            f"throw {throw.name}: no landing: the track never comes down to {height:g} m"
        )
    time = (rising[0] + np.sqrt(root)) / gravity
    landed = (float(np.polyval(along, time)), float(np.polyval(turning, time)))
    return (float(along[0]), float(turning[0])), landed
