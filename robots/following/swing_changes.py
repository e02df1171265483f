"""Changes of the rest of a swing that make the object land elsewhere.

The samples after an instant may change; position, rate and acceleration at that instant stay, and
the time at which the pads open. The NLP, linearised about the rest of the swing, gives the cheapest
change and the longest one inside all limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ...models import Array, ReadOnly
from ...planner import (
    TICK,
    Budget,
    CondensedQp,
    NlpCache,
    ReducedVariables,
    Refinement,
    Request,
    Solution,
    State,
    Throw,
    condensed_at,
    initial_guess_from,
    remaining_trajectory,
)


@dataclass(frozen=True, eq=False)
class RestOfSwing:
    """The NLP about the rest of a swing from sample `first` on.

    about: its linearisation in the controls, whose numbers `u` begin with the opening's time, which
    stays; ticks (K,) [s] of the samples from there until the pads are open.
    """

    first: int
    about: CondensedQp
    controls: ReducedVariables
    u: Array
    ticks: Array

    @classmethod
    def of(
        cls, problems: NlpCache, throw: Throw, refinement: Refinement, first: int
    ) -> RestOfSwing | None:
        """The NLP about what is sent; None if its equations are singular there."""
        sent, budget = throw.samples, Budget()
        manipulator = problems.manipulator.from_state(
            State(sent.q[first], sent.dq[first], sent.ddq[first])
        )
        rest = remaining_trajectory(throw, TICK * first, manipulator)
        # The derivative of the landing is that of any target; an equation, not bounds.
        problems, goal = problems.from_state(manipulator), throw.target.middle
        program = problems.problem(goal, refinement, "fatrop", budget)
        near = rest.exact if program.nlp.linearised else None
        request = Request(throw.scene, manipulator, goal, refinement, reference=near)
        controls = ReducedVariables(request)
        point = Solution.none(initial_guess_from(program.nlp, rest))
        try:
            at = condensed_at(controls, program, request, point)
        except np.linalg.LinAlgError:
            return None
        count = math.ceil(rest.deciding.detach_time / TICK - 1e-9) + 1
        return cls(
            first,
            at.with_fixed_duration,
            controls,
            at.point[controls.places(program.nlp)],
            TICK * np.arange(float(count)),
        )

    def direction(self, later: int) -> Direction:
        """The cheapest change per landing. Limits are judged when it is tried: kept as equations,
        those that bind in the plan would bind for moves away from them, too.

        later: samples by which the played swing is behind this one.
        """
        found = self._direction(self.about.null_space_step(np.zeros(len(self.about.rows), bool)))
        return replace(found, first=self.first + later)

    def step(self, off: Array) -> tuple[Array, Direction] | None:
        """A change (3, K, n) that moves the landing by -off (L,), or as near to that as limits
        allow, and the direction along the limits that then bind. None without a solution."""
        step = replace(self.about, target_offset=-off).step(np.zeros(len(self.about.step_bounds)))
        if step is None:
            return None
        return self._change(step.du), self._direction(step.slope)

    def _direction(self, slope: Array) -> Direction:
        return Direction(self.first, np.array([self._change(column) for column in slope.T]))

    def _change(self, du: Array) -> Array:
        """Change of q, dq, ddq (3, K, n): linear in du, as the times stay."""
        return self._motion(self.u + np.append(0.0, du)) - self._motion(self.u)

    def _motion(self, u: Array) -> Array:
        return np.array([values.T for values in self.controls.motion(u)[0].at(self.ticks)])


@dataclass(frozen=True, eq=False)
class Direction(ReadOnly):
    """Change (L, 3, K, n) of q, dq, ddq from sample `first` until the pads are open, per change of
    the landing's x [m] and theta [rad] (L components)."""

    first: int
    change: Array
