"""The rest of a swing under way: its motion from an instant on."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from ...models import Trajectory
from ..result import PlannedThrow
from ..throw import (
    NO_SAMPLES,
    TICK,
    Manipulator,
    Throw,
)


def remaining_throw(throw: PlannedThrow, manipulator: Manipulator) -> PlannedThrow | None:
    """The rest of a throw from where it is nearest to the state that `manipulator` begins in."""
    if manipulator.start is None:
        return None
    samples, weight = throw.samples, manipulator.hard.dq
    off = np.abs(samples.q - manipulator.start)
    off += np.abs(samples.dq - manipulator.initial_motion[0]) / weight
    before = math.floor(throw.opening_time / TICK)
    time = TICK * int(off[:before].sum(axis=1).argmin())
    return remaining_trajectory(throw.deciding, time, manipulator, throw.planned)


def remaining_trajectory(
    throw: Throw, time: float, manipulator: Manipulator, planned: Trajectory | None = None
) -> PlannedThrow:
    """The rest of a throw's motion from `time` [s] on; planned: its motion up to detach."""
    path, opens = throw.path.shifted(time), throw.opening_time - time
    rest = replace(
        throw, manipulator=manipulator, path=path, opening_time=opens, samples=NO_SAMPLES
    )
    return PlannedThrow(path if planned is None else planned.shifted(time), rest, 0.0, (0, 0))
