"""Run-ups in closed form: polynomials from rest to a state of the coordinates.

The launch of a sampled release, for the table, the map, guesses, and random test motions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def run_up(start: Array | None, q: Array, dq: Array, ddq: Array, duration: Any) -> list[Array]:
    """Coefficients c_0 .. c_5 of q(t), t from 0 to `duration` [s], ending at (q, dq, ddq).

    From rest at `start`, with no acceleration there, by a quintic; without a start by the
    rate a t^2 + b t^3, which begins where it falls. Arrays that broadcast, e.g. (N, n) and
    durations (N, 1).
    """
    zero, d = 0.0 * q * duration, duration
    if start is None:
        a, b = 3 * dq / d**2 - ddq / d, ddq / d**2 - 2 * dq / d**3
        return [q - a * d**3 / 3 - b * d**4 / 4, zero, zero, a / 3 + zero, b / 4 + zero, zero]
    gap = q - start
    return [
        start + zero,
        zero,
        zero,
        (20 * gap - 8 * dq * d + ddq * d**2) / (2 * d**3),
        (-30 * gap + 14 * dq * d - 2 * ddq * d**2) / (2 * d**4),
        (12 * gap - 6 * dq * d + ddq * d**2) / (2 * d**5),
    ]


def polynomial(coefficients: list[Array], t: Any, derivative: int = 0) -> Array:
    """sum c_i t^i, or a derivative of it, at times that broadcast with the coefficients."""
    terms = []
    for power in range(derivative, len(coefficients)):
        factor = float(np.prod(np.arange(power, power - derivative, -1)))
        terms.append(factor * coefficients[power] * t ** (power - derivative))
    return np.asarray(sum(terms))
