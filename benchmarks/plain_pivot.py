"""The sliding pivot in even steps that no event cuts, by CasADi, for comparison."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Literal

import casadi as ca
import numpy as np
from throwplan.models import Array, Body, HandMotion, HandSamples, PinchContact
from throwplan.models.release import Release, ReleaseCase, SlidingPivot, rk4_step


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
        hand = case.hand.at(np.linspace(0.0, case.grip.opening, 2 * self.steps + 1))
        rows, dt = np.vstack([*hand, case.grip.force(hand.times)]), np.diff(hand.times[::2])
        columns = np.vstack([rows[:, :-2:2], rows[:, 1::2], rows[:, 2::2], dt])
        values = [*vars(case.body).values(), *vars(case.contact).values(), case.gravity]
        numbers = np.tile(np.array(values, float)[:, None], self.steps)
        start = np.array([0.0, 0.0, case.grasp_angle, 0.0, 0.0, 0.0])
        states = np.column_stack([start, np.array(_compiled(self)(start, columns, numbers))])
        nodes = HandSamples(hand.times[::2], *(track[:, ::2] for track in hand))
        return world_release(law, nodes, states, rows[-1, ::2])


@cache
def _compiled(model: PlainPivot) -> ca.Function:
    """All steps as one function of the first state, of the values that a step takes, and of the
    law's numbers."""
    state, u, p = (ca.SX.sym(name, size) for name, size in (("state", 6), ("u", 31), ("p", 8)))
    body, contact, gravity = Body(p[0], p[1], p[2]), PinchContact(p[3], p[4], p[5], p[6]), p[7]
    rates = SlidingPivot(body, contact, gravity, model.form).rates
    # Hand (9) and grip at start, middle and end; and dt.
    motions = [HandMotion(u[i + 2], u[i + 5], u[i + 6], u[i + 7], u[i + 8]) for i in (0, 10, 20)]
    forces = [u[9], u[19], u[29]]
    if model.integrator == "rk4":
        new = rk4_step(rates, state, motions, forces, u[30])
    else:
        slopes = rates(state, motions[0], forces[0])
        new = [x + u[30] * slope for x, slope in zip(ca.vertsplit(state), slopes, strict=True)]
    step = ca.Function("step", [state, u, p], [ca.cse(ca.vertcat(*new))])
    return step.mapaccum("steps", model.steps)


def world_release(law: SlidingPivot, hand: HandSamples, states: Array, forces: Array) -> Release:
    """The release of relative states (6, K) along the hand; no wrench."""
    motion = hand.motion
    nodes = np.vstack([hand.times, *law.com_state(states, hand.pose, hand.twist, motion)])
    onsets = [_onset(hand.times, over) for over in law.excess(states, motion, forces)]
    return Release.from_nodes(nodes.T, onsets, bool(law.lost(states).any()))


def _onset(times: Array, excess: Array) -> float:
    """First time [s] at which `excess` rises above zero, linear between grid points, or NaN."""
    above = np.flatnonzero(excess > 0)
    if above.size == 0 or above[0] == 0:
        return float(times[0]) if above.size else math.nan
    around = slice(above[0] - 1, above[0] + 1)
    return float(np.interp(0.0, excess[around], times[around]))
