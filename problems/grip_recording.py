"""A recorded grip force as a falling profile: raw recordings, and profiles as rows."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..models import FALL_SHARE, TableRelease

Array = npt.NDArray[np.float64]

#: Sampling of the grip force that is written [s].
STEP = 0.001
#: Fewest rows of a raw recording of the grip force.
ROWS = 20
#: Shares of the full grip: a force so near it is still held; a fall so small is level.
HELD, LEVEL = 0.05, 0.02
#: A recording whose rises together are more than this share of its peak is raw.
NOISY = 0.05


def rises(forces: Array) -> float:
    """All rises of a recording together [N]: what noise adds to a force that only falls."""
    return float(np.maximum(np.diff(forces), 0.0).sum())


def monotone_grip(times: Array, forces: Array) -> TableRelease:
    """The falling profile in a raw recording of one pad's force.

    times (K,) [s] from the opening command on, forces (K,) [N], from the dwell until the
    pads have been apart for at least a tenth of the recording. The offset, the median of
    that last tenth, is taken off; the full force is the median of what comes before the
    fall; the falling curve is the nearest one in the sense of least squares, full and zero
    where it is within the noise of those. Raises ValueError for fewer than 20 rows, a
    recording without a fall, and as `TableRelease`.
    """
    from scipy.optimize import isotonic_regression

    t, raw = np.asarray(times, float), np.asarray(forces, float)
    if t.shape != raw.shape or t.size < ROWS:
        raise ValueError(f"needs at least {ROWS} rows of t, f_N")
    if not np.isfinite(raw).all():
        raise ValueError("has a value that is not a finite number")
    tail = raw[-max(t.size // 10, 2) :]
    force = raw - np.median(tail)
    fall = np.asarray(isotonic_regression(force, increasing=False).x)
    # Half the force is far from the noise of either end: before it, the full grip is what most
    # samples are at.
    half = int(np.flatnonzero(fall < fall[0] / 2)[0]) if fall[-1] < fall[0] / 2 else 0
    if fall[0] <= 0 or half < 2:
        raise ValueError("f_N must start at the full grip and fall from there")
    flat = np.flatnonzero(fall[:half] >= (1 - HELD) * float(np.median(force[: half // 2 + 1])))
    if flat.size < 2:
        raise ValueError("f_N must start at the full grip and fall from there")
    full = float(np.median(force[flat]))
    noise = 3 * float(np.std(np.diff(tail))) / math.sqrt(2)
    ends = [float(np.mean(part)) for part in np.array_split(tail, 2)]
    if ends[0] - ends[1] > max(LEVEL * full, noise):
        raise ValueError(
            "f_N must go on, level, for a tenth of the recording after the pads are apart"
        )
    fall[fall >= full - max(noise, FALL_SHARE * full)] = full
    fall[fall <= max(noise, 1e-6 * full)] = 0.0
    ended = int(np.flatnonzero(fall > 0)[-1]) + 2
    return TableRelease(t[:ended].tolist(), fall[:ended].tolist())


def grip_samples(grip: TableRelease) -> Array:
    """t [s] from the opening command on and force of one pad [N] (K, 2), every millisecond.

    A table of these has the same dwell and opening: no sample beside both ends is at the
    full force, or at zero.
    """
    held = np.arange(0.0, grip.dwell - STEP / 1000, STEP)
    falling = np.arange(STEP, grip.opening - STEP / 1000, STEP)
    force = grip.force(falling)
    kept = (force < (1 - 1.01 * FALL_SHARE) * grip.full) & (force > 1e-6 * grip.full)
    times = np.concatenate([[0.0], falling[kept], [grip.opening]])
    forces = np.concatenate([grip.force(0.0)[None], force[kept], [0.0]])
    rows = [np.column_stack([held, np.full(held.size, grip.full)])]
    return np.vstack([*rows, np.column_stack([grip.dwell + times, forces])])
