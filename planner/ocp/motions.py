"""From decision vectors to motions and the names of binding limits, and back to guesses."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...models import Path
from ..check import Mover
from .context import Structure
from .layout import JERK_UNIT
from .nlp import ThrowNlp
from .phases import SLIP_UNIT, TURN_UNIT
from .solver import Solution

Array = npt.NDArray[np.float64]

#: A multiplier counts as binding above this share of the largest, where the bound is this near.
BINDING_SHARE, BINDING_DISTANCE = 0.02, 1e-4


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
    duration = nlp.block(x, "T", 0)
    assert duration is not None
    return float(duration[0]) + nlp.structure.early * step


def planned_motion(nlp: ThrowNlp, mover: Mover, x: Array, nodes: Array, step: float = 0.0) -> Path:
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
    return Path.cubics(times, blocks("q", start), blocks("dq", zero), ddq, jerk)


def with_accelerations(nlp: ThrowNlp, x: Array, intervals: Array) -> Array:
    """`x` with the collocation's unknowns set to each interval's mean acceleration.

    intervals (opening,) [s]. For guesses, which know the relative states at the nodes.
    """
    s = nlp.structure
    if s.integrator != "gauss":
        return x
    size = 3 if s.pivot else 2
    units = np.array([SLIP_UNIT, SLIP_UNIT, TURN_UNIT][:size])
    before = np.zeros(size)
    for k, dt in enumerate(intervals, start=s.opens):
        state, where = nlp.block(x, "rel", k + 1), nlp.place("acc", k)
        assert state is not None and where is not None
        after = state[size:]
        x[where] = np.tile((after - before) / dt / units, 2)
        before = after
    return x


def binding_limits(
    nlp: ThrowNlp, joints: tuple[str, ...], solution: Solution, limits: tuple[Array, Array]
) -> tuple[str, ...]:
    """Names of the limits with the largest multipliers at a solution, strongest first.

    joints: names of the coordinates; limits: bounds of the decision vector.
    """
    strength: dict[str, float] = {}

    def add(name: str, multiplier: float) -> None:
        strength[name] = max(strength.get(name, 0.0), abs(multiplier))

    for name, low, high, multiplier in zip(
        nlp.row_names, nlp.lbg, nlp.ubg, solution.lam_g, strict=True
    ):
        if low < high:
            add(name, multiplier)
    distance = np.minimum(solution.x - limits[0], limits[1] - solution.x)
    for block, _, where in nlp.layout:
        for i, at in enumerate(range(where.start, where.stop)):
            if block.limit and distance[at] < BINDING_DISTANCE:
                joint = f"{joints[i]} " if block.each else ""
                add(f"{joint}{block.limit}", solution.lam_x[at])
    least = max(BINDING_SHARE * max(strength.values(), default=0.0), 1e-6)
    return tuple(sorted((n for n, s in strength.items() if s > least), key=lambda n: -strength[n]))
