"""The motion that a solution of the NLP stands for."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..check import Mover, PlannedMotion
from .context import JERK_UNIT, Structure
from .nlp import ThrowNlp

Array = npt.NDArray[np.float64]


def stage_times(structure: Structure, opening_time: float, nodes: Array, step: float) -> Array:
    """Times (last + 1,) [s] of the stages on the motion's clock.

    nodes: of the opening, from its start; step: of the window's other intervals [s].
    """
    s = structure
    carry = opening_time - s.early * step
    parts = [
        np.linspace(0.0, carry, s.carry + 1),
        carry + step * np.arange(1, s.early + 1),
        opening_time + nodes[1:],
        opening_time + nodes[-1] + step * np.arange(1, s.late + 1),
    ]
    return np.concatenate(parts)


def opening_start(nlp: ThrowNlp, x: Array, step: float = 0.0) -> float:
    """When the grip force starts to fall in decision vector `x` [s]."""
    return float(x[nlp.places["T", 0]][0]) + nlp.structure.early * step


def planned_motion(
    nlp: ThrowNlp, mover: Mover, x: Array, nodes: Array, step: float = 0.0
) -> PlannedMotion:
    """The motion in decision vector `x`, from rest to detach, or to the window's end.

    nodes (opening + 1,) [s]: the opening's, from its start; step [s]: of a robust plan's
    other intervals of fixed length.
    """
    s = nlp.structure
    times = stage_times(s, opening_start(nlp, x, step), nodes, step)
    zero = np.zeros(mover.size)

    def blocks(name: str, default: Array) -> Array:
        found = [nlp.block(x, name, k) for k in range(s.last)]
        return np.array([default if value is None else value for value in found])

    start = zero if mover.start is None else mover.start
    control = blocks("c", zero)
    if s.jerk_control:
        ddq, jerk = blocks("ddq", zero), JERK_UNIT * control
    else:
        ddq, jerk = control, 0 * control
    return PlannedMotion(times, blocks("q", start), blocks("dq", zero), ddq, jerk)
