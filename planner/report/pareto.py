"""The settings worth choosing: none of the others is better in both."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np


def pareto(seconds: Sequence[float], errors: Sequence[float], margin: float = 0.0) -> list[int]:
    """Which runs have no other that is at least as near and faster.

    margin: share by which figures may differ by chance; with it a run falls out where another
    is better by more than that in one and not worse by more than that in the other. Of runs
    that are alike in both the first stays. In the order of their times.
    """
    time, error = np.asarray(seconds, float), np.asarray(errors, float)
    found: list[int] = []
    for i in np.lexsort((error, time)):
        better = (time < time[i]) | (error < error[i])
        faster = (time * (1.0 + margin) <= time[i]) & (error <= error[i] * (1.0 + margin))
        nearer = (error * (1.0 + margin) <= error[i]) & (time <= time[i] * (1.0 + margin))
        beaten = (faster | nearer) & better
        alike = any(time[k] == time[i] and error[k] == error[i] for k in found)
        if not beaten.any() and not alike:
            found.append(int(i))
    return found
