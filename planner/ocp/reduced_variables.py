"""The reduced variables `u` of a throw: they determine all others.

u, about 40 numbers, has the carry's duration, a free start and the controls (jerks, or a hand's
accelerations). Gaps, collocation and flight time are equations for all other variables.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...core import MoveC, library
from ...models import Array, Flags, Trajectory
from .lazy_constraints import BASE, Refinement
from .nlp import ThrowNlp
from .problem import Weights, mean_effort, variable_bounds
from .request import Request
from .variables import JERK_UNIT

#: Distance of a variable of u beyond its bounds, as a share of their range, up to which a moved
#: throw is still sampled: a correction may leave the bounds and return.
SLACK = 1.0
#: Rounding [s] of a duration in single precision.
ROUNDING = 1e-6


@dataclass(frozen=True, eq=False)
class Optimum:
    """A solved throw and its sensitivity to the target.

    u (size,): see `ReducedVariables`. slope (size, 2; 1 with theta open): du / d(landing x [m],
    theta [rad]), see `CondensedQp.slope`. detach (6,): CoM pose and twist by the deciding model.
    effort: cost of the NLP. smoothing: its landing (x [m], theta [rad]) less the exact landing of
    the planned motion. refinement, nlp_size: of its NLP. binding: limits that bind, strongest
    first.
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
    """The variables `u` of a request's throws, and their motion.

    u (size,): the carry's duration [s], the start (n,) where it is free, the controls (n,) of
    each interval in the units of the decision vector.
    """

    request: Request

    @cached_property
    def start(self) -> Array | None:
        """The given start (n,); None for a free start."""
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
        """Layout and bounds of u for the compiled core, without a sensitivity."""
        manipulator, carry = self.request.manipulator, self.request.scene.mesh.carry
        n, stages = manipulator.size, carry + len(self.opening)
        size = 1 + n * (stages + (self.start is None))
        core = MoveC(n=n, carry=carry, stages=stages, size=size, unit=JERK_UNIT)
        core.by_jerk = manipulator.jerk_control
        core.before, (core.shortest, core.longest) = self.request.nodes[0], self.durations
        arrays = {
            "start": self.start,
            **dict(zip(("rate", "acceleration"), manipulator.initial_motion, strict=True)),
            "opening": self.opening,
            **dict(zip(("low", "high"), self._bounds(stages), strict=True)),
        }
        for name, values in arrays.items():
            core.attach(**{name: values if values is None else np.ascontiguousarray(values, float)})
        return core

    def places(self, nlp: ThrowNlp) -> list[int]:
        """Indices (size,) of u in the NLP's decision vector."""
        blocks = [nlp.place("T", 0)]
        if self.start is None:
            blocks.append(nlp.place("q", 0))
        blocks += [nlp.place("c", k) for k in range(nlp.structure.last)]
        return [i for where in blocks if where is not None for i in range(where.start, where.stop)]

    def motion(self, u: Array) -> tuple[Trajectory, float]:
        """The motion from rest to detach, and the time [s] on it at which the grip force starts to
        fall."""
        n, stages = self.core.n, self.core.stages
        times, cubics = np.empty(stages + 1), np.empty((4, n, stages, 1))
        library().plan_motion(self.core, np.ascontiguousarray(u, float), times, cubics)
        return Trajectory(times, cubics, times), self.opening_time(u)

    def opening_time(self, u: Array) -> float:
        """The time [s] at which the grip force starts to fall."""
        return float(u[0] - self.request.nodes[0])

    def effort(self, u: Array) -> float:
        """The NLP's cost: relative acceleration and jerk squared, and the carry's time."""
        return self.effort_of(self.motion(u)[0])

    def effort_of(self, motion: Trajectory) -> float:
        """The cost of a motion made from u."""
        limits, breaks, weights = self.request.manipulator.planning, motion.breaks, Weights()
        ddq, jerk, lengths = motion.starts(2), motion.starts(3), breaks[1:] - breaks[:-1]
        first, last = ddq / limits.ddq, (ddq + lengths[:, None] * jerk) / limits.ddq
        relative = np.zeros_like(jerk) if limits.jerk is None else jerk / limits.jerk
        cost = (lengths @ mean_effort(first, last, relative, weights)).sum()
        return float(cost + weights.carry_time * breaks[self.request.scene.mesh.carry])

    def within(self, u: Array) -> Array:
        """u with the carry's duration clipped to its bounds."""
        return np.concatenate([[np.clip(u[0], *self.durations)], u[1:]])

    @property
    def durations(self) -> tuple[float, float]:
        """Shortest and longest carry [s]."""
        shortest, longest = variable_bounds(self.request)["T"]
        return shortest, longest

    def _bounds(self, stages: int) -> tuple[Array, Array]:
        """Lower and upper bounds (size,) of u, widened by SLACK; those of the duration exact."""
        bounds, n = variable_bounds(self.request), self.request.manipulator.size
        low, high = (
            np.concatenate(
                [
                    np.full(1, bounds["T"][end]),
                    *([np.asarray(bounds["q"][end])] if self.start is None else []),
                    np.tile(np.broadcast_to(bounds["c"][end], n), stages),
                ]
            )
            for end in (0, 1)
        )
        slack = SLACK * (high - low)
        slack[0] = ROUNDING
        return low - slack, high + slack

    def near_bounds(self, u: Array) -> Flags:
        """Whether each u (N, size) is inside the widened bounds."""
        low, high = self.core.kept["low"], self.core.kept["high"]
        return np.asarray(((u >= low) & (u <= high)).all(axis=1))
