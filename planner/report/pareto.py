"""The settings worth choosing: none of the others is better in both."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np


def pareto(seconds: Sequence[float], errors: Sequence[float]) -> list[int]:
    """Which runs have no other that is at least as fast and nearer."""
    found, nearest = [], math.inf
    for i in np.lexsort((errors, seconds)):
        if errors[i] < nearest:
            nearest = errors[i]
            found.append(int(i))
    return found
