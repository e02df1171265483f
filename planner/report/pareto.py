"""The settings worth choosing: none of the others is better in both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def pareto(seconds: Sequence[float], errors: Sequence[float], margin: float = 0.0) -> list[int]:
    """Which runs have no other that is at least as near and faster.

    Faster means by more than the share `margin`, for times that differ from run to run. Of
    runs that are alike in both the first stays. In the order of their times.
    """
    time, error = np.asarray(seconds, float), np.asarray(errors, float)
    found: list[int] = []
    for i in np.lexsort((error, time)):
        better = (time < time[i]) | (error < error[i])
        beaten = (time * (1.0 + margin) <= time[i]) & (error <= error[i]) & better
        alike = any(time[k] == time[i] and error[k] == error[i] for k in found)
        if not beaten.any() and not alike:
            found.append(int(i))
    return found
