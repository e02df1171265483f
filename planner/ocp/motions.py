"""From decision vectors to motions and the names of binding limits, and back to guesses."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...models import Array, Path
from .asked import Request
from .layout import JERK_UNIT, Block
from .nlp import ThrowNlp
from .phases import SLIP_UNIT, TURN_UNIT
from .solver import Solution

#: A multiplier counts as binding above this share of the largest, where the bound is this near.
BINDING_SHARE, BINDING_DISTANCE = 0.02, 1e-4


def planned_motion(nlp: ThrowNlp, request: Request, x: Array) -> tuple[Path, float]:
    """The motion in decision vector `x`, from rest to detach or to the window's end, and when
    the grip force starts to fall on it [s]."""
    s, mover = nlp.structure, request.mover
    duration = nlp.block(x, "T", 0)
    assert duration is not None
    opening_time = float(duration[0] - request.nodes[0])
    zero, (rate, acceleration) = np.zeros(mover.size), mover.begins

    def blocks(name: str, default: Array) -> Array:
        found = [nlp.block(x, name, k) for k in range(s.last)]
        return np.array([default if value is None else value for value in found])

    start = zero if mover.start is None else mover.start
    control = blocks("c", zero)
    if s.jerk_control:
        ddq, jerk = blocks("ddq", acceleration), JERK_UNIT * control
    else:
        ddq, jerk = control, 0 * control
    times = request.times(opening_time)
    return Path.cubics(times, blocks("q", start), blocks("dq", rate), ddq, jerk), opening_time


def decision_vector(
    nlp: ThrowNlp,
    times: Array,
    states: Sequence[Array],
    relative: Callable[[int, int], Array],
    other: Callable[[Block], Array | float],
) -> Array:
    """Decision vector of a motion, to start from.

    times (last + 1,) [s], states: q, dq, ddq (n, last + 1) at the stages. relative: the sliding
    pivot's state (6; 4) at a stage, of which opening; other: values of blocks that are neither.
    """
    s = nlp.structure
    coordinates = dict(zip(("q", "dq", "ddq"), states, strict=True))
    control = np.diff(coordinates["ddq" if s.jerk_control else "dq"], axis=1) / np.diff(times)
    control /= JERK_UNIT if s.jerk_control else 1.0

    def value(block: Block, k: int) -> Array | float:
        if block.name in coordinates:
            return np.asarray(coordinates[block.name][:, k])
        if block.name == "c":
            return np.asarray(control[:, k])
        if block.name == "T":
            return float(times[s.carry])
        return relative(k, block.index) if block.name == "rel" else other(block)

    x = nlp.fill(value)
    if s.integrator == "gauss":
        # The unknown accelerations of collocation: each interval's mean.
        size = 3 if s.pivot else 2
        units = np.array([SLIP_UNIT, SLIP_UNIT, TURN_UNIT][:size])
        before = np.zeros(size)
        for k in range(s.opens, s.detach):
            after, where = relative(k + 1, 0)[size:], nlp.place("acc", k)
            x[where] = np.tile((after - before) / (times[k + 1] - times[k]) / units, 2)
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
