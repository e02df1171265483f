"""The sliding pivot in even steps that no event cuts, for comparison."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Literal

import casadi as ca
import numpy as np
from throwplan.models import Body, Contact, HandSamples, Value
from throwplan.models.release import (
    Release,
    ReleaseCase,
    SlidingPivot,
    Step,
    rk4_step,
    run_steps,
    step_function,
    world_release,
)


@dataclass(frozen=True)
class PlainPivot:
    """Releases by the sliding pivot in one of its forms.

    steps over the opening; integrator: 'rk4' or the paper's explicit 'euler'.
    """

    form: Literal["continuous", "paper"] = "continuous"
    steps: int = 1000
    integrator: Literal["rk4", "euler"] = "rk4"

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case."""
        law = SlidingPivot(case.body, case.contact, case.gravity, self.form)
        start = np.array([0.0, 0.0, case.grasp_angle, 0.0, 0.0, 0.0])
        hand, forces, states = run_steps(_compiled(self), case, start, self.steps)
        nodes = HandSamples(hand.times[::2], *(rows[:, ::2] for rows in hand))
        return world_release(law, nodes, states, forces[::2])


@cache
def _compiled(model: PlainPivot) -> ca.Function:
    def step_of(body: Body, contact: Contact, gravity: Value) -> Step:
        rates = SlidingPivot(body, contact, gravity, model.form).rates

        def euler(state: Value, hands: Value, forces: Value, dt: Value) -> list[Value]:
            slopes = rates(state, hands[0].motion, forces[0])
            return [x + dt * slope for x, slope in zip(ca.vertsplit(state), slopes, strict=True)]

        def rk4(state: Value, hands: Value, forces: Value, dt: Value) -> list[Value]:
            return rk4_step(rates, state, [hand.motion for hand in hands], forces, dt)

        return rk4 if model.integrator == "rk4" else euler

    return step_function(step_of, model.steps)
