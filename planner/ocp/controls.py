"""The few numbers that a whole throw follows from, and a solved throw by them.

Of a throw's decision vector only the carry's duration, a free start and the controls (jerks, or
a hand's accelerations) are free: gaps, collocation and flight time are equations for all the
rest. They are `u` here, about 40 numbers, and enough to throw the motion again.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...models import Array, Path
from .asked import USUAL, Asked, Request
from .layout import JERK_UNIT, T
from .nlp import WEIGHTS, ThrowNlp
from .phases import interval_effort


@dataclass(frozen=True, eq=False)
class Optimum:
    """A solved throw, and how it moves with its target.

    u (size,) and slope = du / d(landing x [m], theta [rad]) (size, 2; 1 with theta open), see
    `Controls` and `Condensed.slope`; detach (6,): CoM pose and twist there by the model that
    counts; effort: the NLP's cost; smoothing: how far its landing (dx [m], dtheta [rad]) is from
    the exact one of the planned motion; asked, nlp_size: of its NLP; binding: limits that bind,
    strongest first.
    """

    u: Array
    slope: Array
    detach: Array
    effort: float
    nlp_size: tuple[int, int]
    smoothing: tuple[float, float]
    asked: Asked = USUAL
    binding: tuple[str, ...] = ()


@dataclass(frozen=True)
class Controls:
    """How `u` makes the motion of a request's throws.

    u (size,): the carry's duration [s], the start (n,) where it is free, the controls (n,) of
    each interval in the units of the decision vector.
    """

    request: Request

    @cached_property
    def start(self) -> Array | None:
        """The given start (n,); None where it is free."""
        return self.request.mover.start

    @cached_property
    def size(self) -> int:
        """Length of u."""
        n, mesh = self.request.mover.size, self.request.scene.mesh
        stages = mesh.carry + len(self.request.nodes) - 1
        return 1 + n * (stages + (self.start is None))

    @cached_property
    def opening(self) -> Array:
        """Lengths (O,) [s] of the intervals after the carry."""
        return np.diff(self.request.nodes)

    @cached_property
    def _before(self) -> Array:
        """Sums over the intervals before each: (stages, stages) below the diagonal."""
        stages = self.request.scene.mesh.carry + len(self.opening)
        return np.tri(stages, k=-1)

    def places(self, nlp: ThrowNlp) -> list[int]:
        """Indices (size,) of u in the NLP's decision vector."""
        blocks = [nlp.place("T", 0)]
        if self.start is None:
            blocks.append(nlp.place("q", 0))
        blocks += [nlp.place("c", k) for k in range(nlp.structure.last)]
        return [i for where in blocks if where is not None for i in range(where.start, where.stop)]

    def _split(self, u: Array) -> tuple[float, Array, Array, Array]:
        """Carry's duration, start (n,), controls (stages, n), intervals' lengths (stages,)."""
        n, carry = self.request.mover.size, self.request.scene.mesh.carry
        free = n if self.start is None else 0
        start = u[1 : 1 + n] if self.start is None else self.start
        duration = float(u[0])
        lengths = np.concatenate([np.full(carry, duration / carry), self.opening])
        return duration, start, u[1 + free :].reshape(-1, n), lengths

    def _states(self, u: Array) -> tuple[Array, Array, Array, Array, Array]:
        """q, dq, ddq, jerk (stages, n) at the intervals' starts, and their lengths (stages,)."""
        _, start, control, lengths = self._split(u)
        rate, acceleration = self.request.mover.begins
        dt, before = lengths[:, None], self._before
        if self.request.mover.jerk_control:
            jerk = JERK_UNIT * control
            ddq = acceleration + before @ (dt * jerk)
        else:
            jerk, ddq = np.zeros_like(control), control
        dq = rate + before @ (dt * (ddq + dt * jerk / 2))
        q = start + before @ (dt * (dq + dt * (ddq / 2 + dt * jerk / 6)))
        return q, dq, ddq, jerk, lengths

    def motion(self, u: Array) -> tuple[Path, float]:
        """The motion, from rest to detach, and when the grip force starts to fall on it [s]."""
        q, dq, ddq, jerk, lengths = self._states(u)
        times = np.concatenate([[0.0], np.cumsum(lengths)])
        return Path.cubics(times, q, dq, ddq, jerk), float(u[0] - self.request.nodes[0])

    def effort(self, u: Array) -> float:
        """The NLP's cost: relative acceleration and jerk squared, and the carry's time."""
        _, _, ddq, jerk, lengths = self._states(u)
        most, dt = self.request.mover.planning, lengths[:, None]
        first, last = ddq / most.ddq, (ddq + dt * jerk) / most.ddq
        rate = None if most.jerk is None else jerk / most.jerk
        cost = interval_effort(first, last, rate, WEIGHTS, lambda values: values.sum(axis=1))
        return float(lengths @ cost + WEIGHTS[2] * u[0])

    def within(self, u: Array) -> Array:
        """The same with a carry that is neither too short nor too long."""
        shortest, longest = T.bounds(self.request)
        return np.concatenate([[min(max(u[0], shortest), longest)], u[1:]])
