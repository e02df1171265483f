"""Sliding pivots on hands whose acceleration steps: no integration step across such a kink."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from ...models import (
    GRADING,
    BatchRelease,
    HandMotion,
    ReleaseBatch,
    SlidingPivot,
    by_chunks,
    graded,
    rk4_step,
)

Array = npt.NDArray[np.float64]

#: The hand is asked for this far [s] inside an integration step's ends.
INSIDE = 1e-9


def kinked_steps(
    batch: ReleaseBatch, steps: int, kinks: Callable[[ReleaseBatch], Array]
) -> BatchRelease:
    """The sliding pivot in `steps` graded steps, cut at the kinks of the hands' motions.

    kinks: their times (K, N) [s] after each opening of some throws. Across a kink the
    Runge-Kutta steps would be of first order only.
    """
    shares = graded(steps, GRADING)[:, None]

    def chunk(part: ReleaseBatch) -> BatchRelease:
        opening = part.opening
        nodes = np.vstack([shares * opening, np.clip(kinks(part), 0.0, opening)])
        return _throw(part, np.sort(nodes, axis=0))

    return by_chunks(batch, chunk)


def _throw(part: ReleaseBatch, nodes: Array) -> BatchRelease:
    """Throws in one step from each of `nodes` (K, N) [s] to the next."""
    law = SlidingPivot(part.body, part.contact, part.gravity)
    zero = np.zeros_like(part.opening)
    state: list[Array] = [zero, zero, zero + part.grasp_angle, zero, zero, zero]
    lost = np.zeros(part.count, bool)
    for start, end in itertools.pairwise(nodes):
        dt = end - start
        inside = np.minimum(INSIDE, dt / 4)
        instants = (start + inside, (start + end) / 2, end - inside)
        hands = [_motion(part, instant) for instant in instants]
        forces = [_force(part, instant) for instant in (start, instants[1], end)]
        state = rk4_step(law.rates, state, hands, forces, dt)
        lost |= law.lost(state)
    # What the body leaves with is the hand's before any kink at detach.
    pose, twist, _ = part.hands.at(instants[2])
    return BatchRelease(np.array(law.com_state(state, pose, twist, hands[2])).T, lost)


def _motion(part: ReleaseBatch, times: Array) -> HandMotion:
    pose, twist, acceleration = part.hands.at(times)
    return HandMotion(pose[2], twist[2], *acceleration)


def _force(part: ReleaseBatch, times: Array) -> Array:
    """Grip force (N,) [N] at `times` (N,) after each opening's start."""
    stretched = times / part.opening * part.grip.opening
    return np.asarray(part.force * part.grip.force(stretched) / part.grip.full)
