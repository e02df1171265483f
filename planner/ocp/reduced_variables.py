"""The reduced variables of a throw: those that determine all others.

Of a throw's decision vector only the carry's duration, a free start and the controls (jerks, or
a hand's accelerations) are free: gaps, collocation and flight time are equations for all others.
They are `u` here, about 40 numbers, and determine the motion.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...core import MoveC, library
from ...models import Array, Flags, Trajectory
from .lazy_constraints import BASE, Refinement
from .nlp import ThrowNlp
from .problem import Weights, mean_effort
from .request import Request
from .variables import ACCELERATION, JERK, JERK_UNIT, Q, T

#: Distance of a variable of u from its bounds, as a share of their range, up to which a moved throw
#: is sampled: a correction may leave the bounds and come back.
SLACK = 1.0
#: Rounding [s] of a duration of single precision.
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Optimum:
    """A solved throw and its sensitivity to the target.

    u (size,) and slope = du / d(landing x [m], theta [rad]) (size, 2; 1 with theta open), see
    `ReducedVariables` and `CondensedQp.slope`; detach (6,): CoM pose and twist there by the model
    that counts; effort: the NLP's cost; smoothing: how far its landing (dx [m], dtheta [rad]) is
    from the exact one of the planned motion; refinement, nlp_size: of its NLP; binding: limits that
    bind, strongest first.
    """

    u: Array
    slope: Array
    detach: Array
    effort: float
    nlp_size: tuple[int, int]
    smoothing: tuple[float, float]
    refinement: Refinement = BASE
    binding: tuple[str, ...] = ()


@dataclass(frozen=True)
class ReducedVariables:
    """The variables `u` of a request's throws, and the motion that they determine.

    u (size,): the carry's duration [s], the start (n,) where it is free, the controls (n,) of
    each interval in the units of the decision vector.
    """

    request: Request

    @cached_property
    def start(self) -> Array | None:
        """The given start (n,); None where it is free."""
        return self.request.manipulator.start

    @property
    def size(self) -> int:
        """Length of u."""
        return int(self.core.size)

    @cached_property
    def opening(self) -> Array:
        """Lengths (O,) [s] of the intervals after the carry."""
        return np.diff(self.request.nodes)

    @cached_property
    def core(self) -> MoveC:
        """u and its motion as the compiled core takes them; what moves u is left open."""
        manipulator, carry = self.request.manipulator, self.request.scene.mesh.carry
        n, stages = manipulator.size, carry + len(self.opening)
        size = 1 + n * (stages + (self.start is None))
        found = MoveC(n=n, carry=carry, stages=stages, size=size, unit=JERK_UNIT)
        found.by_jerk = manipulator.jerk_control
        found.before, (found.shortest, found.longest) = self.request.nodes[0], self.durations
        arrays = {
            "start": self.start,
            **dict(zip(("rate", "acceleration"), manipulator.initial_motion, strict=True)),
            "opening": self.opening,
            **dict(zip(("low", "high"), self._bounds(stages), strict=True)),
        }
        for name, values in arrays.items():
            found.attach(
                **{name: values if values is None else np.ascontiguousarray(values, float)}
            )
        return found

    def places(self, nlp: ThrowNlp) -> list[int]:
        """Indices (size,) of u in the NLP's decision vector."""
        blocks = [nlp.place("T", 0)]
        if self.start is None:
            blocks.append(nlp.place("q", 0))
        blocks += [nlp.place("c", k) for k in range(nlp.structure.last)]
        return [i for where in blocks if where is not None for i in range(where.start, where.stop)]

    def motion(self, u: Array) -> tuple[Trajectory, float]:
        """The motion, from rest to detach, and when the grip force starts to fall on it [s]."""
        n, stages = self.core.n, self.core.stages
        times, cubics = np.empty(stages + 1), np.empty((4, n, stages, 1))
        library().plan_motion(self.core, np.ascontiguousarray(u, float), times, cubics)
        return Trajectory(times, cubics, times), self.opening_time(u)

    def opening_time(self, u: Array) -> float:
        """When the grip force starts to fall [s]."""
        return float(u[0] - self.request.nodes[0])

    def effort(self, u: Array) -> float:
        """The NLP's cost: relative acceleration and jerk squared, and the carry's time."""
        return self.effort_of(self.motion(u)[0])

    def effort_of(self, motion: Trajectory) -> float:
        """The cost of a motion that some u determines."""
        limits, breaks, weights = self.request.manipulator.planning, motion.breaks, Weights()
        ddq, jerk, lengths = motion.starts(2), motion.starts(3), breaks[1:] - breaks[:-1]
        first, last = ddq / limits.ddq, (ddq + lengths[:, None] * jerk) / limits.ddq
        relative = np.zeros_like(jerk) if limits.jerk is None else jerk / limits.jerk
        cost = (lengths @ mean_effort(first, last, relative, weights)).sum()
        return float(cost + weights.carry_time * breaks[self.request.scene.mesh.carry])

    def within(self, u: Array) -> Array:
        """u with the duration inside its bounds."""
        return np.concatenate([[np.clip(u[0], *self.durations)], u[1:]])

    @property
    def durations(self) -> tuple[float, float]:
        """Shortest and longest carry [s]."""
        return T.bounds(self.request)

    def _bounds(self, stages: int) -> tuple[Array, Array]:
        """Lower and upper bounds (size,) of u, SLACK farther apart; the duration's as they are."""
        request, n = self.request, self.request.manipulator.size
        control = (JERK if request.manipulator.jerk_control else ACCELERATION).bounds(request)
        low, high = (
            np.concatenate(
                [
                    np.full(1, self.durations[end]),
                    *([np.asarray(Q.bounds(request)[end])] if self.start is None else []),
                    np.tile(np.broadcast_to(control[end], n), stages),
                ]
            )
            for end in (0, 1)
        )
        slack = SLACK * (high - low)
        slack[0] = ROUNDING
        return low - slack, high + slack

    def near_bounds(self, u: Array) -> Flags:
        """Which of u (N, size) are within its bounds, SLACK farther apart."""
        low, high = self.core.kept["low"], self.core.kept["high"]
        return np.asarray(((u >= low) & (u <= high)).all(axis=1))
