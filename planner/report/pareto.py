"""The settings worth choosing: none of the others is as good in all figures and better in one."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

Figures = Sequence[float] | npt.NDArray[np.float64]


def pareto(*figures: Figures, margins: Sequence[float] | None = None) -> list[int]:
    """Which runs no other beats; each of `figures` has one number a run, less is better.

    margins: for each figure the share by which it may differ by chance (0 if not given): a run
    is beaten by one that is better by more than that in a figure and not worse by more than
    that in any. Of runs alike in all the first stays. In the order of the first figure.
    """
    values = np.array(figures, float)
    shares = [0.0] * len(values) if margins is None else margins
    room = 1.0 + np.array(shares)[:, None]
    found: list[int] = []
    for i in np.lexsort(values[::-1]):
        mine = values[:, i : i + 1]
        clearly = ((values < mine) & (values * room <= mine)).any(axis=0)
        beaten = clearly & (values <= mine * room).all(axis=0)
        alike = any((values[:, k] == values[:, i]).all() for k in found)
        if not beaten.any() and not alike:
            found.append(int(i))
    return found
