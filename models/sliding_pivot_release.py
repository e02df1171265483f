"""A release by the non-smooth sliding pivot: fixed steps, or steps cut at the events."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import Literal

import casadi as ca
import numpy as np
import numpy.typing as npt

from .contact import Body, Contact, HandMotion
from .integrate import euler_step, rk4_step
from .release import HandSamples, Release, ReleaseCase, onset
from .sliding_pivot import Form, SlidingPivot

Array = npt.NDArray[np.float64]
Integrator = Literal["rk4", "euler"]

_STEPPERS = {"rk4": rk4_step, "euler": euler_step}


@dataclass(frozen=True)
class SlidingPivotRelease:
    """The sliding pivot in one of its forms.

    steps over the opening; integrator: 'rk4' or the paper's 'euler'; events: cut the
    steps where pivot or slide begins or ends, so that the integrator keeps its order.
    """

    form: Form = "continuous"
    steps: int = 1000
    integrator: Integrator = "rk4"
    events: bool = False

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case."""
        if self.events:
            return _located(self, case)
        instants = np.linspace(0.0, case.grip.opening, 2 * self.steps + 1)
        return self.along(case, case.hand.at(instants))

    def along(self, case: ReleaseCase, hand: HandSamples) -> Release:
        """The same for hand samples at 2 steps + 1 even instants of the opening."""
        instants, steps = hand.times, self.steps
        forces = case.grip.force(instants - instants[0])
        table = np.vstack([hand.pose[2], hand.twist[2], hand.acceleration, forces])
        columns = np.vstack([table[:, 0:-2:2], table[:, 1:-1:2], table[:, 2::2]])
        dt = (instants[-1] - instants[0]) / steps
        columns = np.vstack([columns, np.full(steps, dt)])
        start = np.array([0, 0, case.grasp_angle, 0, 0, 0], float)
        stepper = _compiled(self.form, self.integrator, steps)
        track = np.array(stepper(start, columns, np.repeat(numbers(case), steps, axis=1)))
        states = np.column_stack([start, track])
        nodes = HandSamples(
            instants[::2] - instants[0],
            hand.pose[:, ::2],
            hand.twist[:, ::2],
            hand.acceleration[:, ::2],
        )
        return world_release(self.law(case), nodes, states, forces[::2])

    def law(self, case: ReleaseCase) -> SlidingPivot:
        """The equations for one case."""
        return SlidingPivot(case.body, case.contact, case.gravity, self.form)


def world_release(law: SlidingPivot, hand: HandSamples, states: Array, forces: Array) -> Release:
    """World poses, twists and friction of relative states (6, K) along the hand."""
    motion = hand.motion
    state = np.vstack(law.com_state(states, hand.pose, hand.twist, motion))
    com, twist = state[:3], state[3:]
    torque, force = law.excess(states, motion, forces)
    pivot, slide = onset(hand.times, torque), onset(hand.times, force)
    wrench = np.vstack(law.friction(states, motion, forces))
    trouble = "the body slid out of the pads before they let go" if law.lost(states).any() else ""
    if not np.isfinite(com).all():
        trouble = "the steps blew up: needs more steps"
    return Release(hand.times, com, twist, pivot, slide, wrench, trouble)


def numbers(case: ReleaseCase) -> Array:
    """Parameter column (8, 1) of the compiled steppers."""
    body, contact = case.body, case.contact
    values = [body.mass, body.inertia, body.com_offset, contact.friction, contact.patch_radius]
    return np.array([*values, contact.torsion, contact.faces, case.gravity], float)[:, None]


def number_symbols() -> tuple[ca.SX, Body, Contact, ca.SX]:
    """Symbols of `numbers`: the column, and the body, contact and gravity it describes."""
    p = ca.SX.sym("p", 8)
    return p, Body(p[0], p[1], p[2]), Contact(p[3], p[4], p[5], p[6]), p[7]


@cache
def _compiled(form: Form, integrator: Integrator, steps: int) -> ca.Function:
    """`steps` steps as one function: (state (6,), columns (19, steps), numbers) -> states."""
    p, body, contact, gravity = number_symbols()
    state, u = ca.SX.sym("state", 6), ca.SX.sym("u", 19)
    law = SlidingPivot(body, contact, gravity, form)
    parts = [ca.vertsplit(u[6 * i : 6 * i + 6]) for i in range(3)]
    hands = [HandMotion(*part[:5]) for part in parts]
    step = _STEPPERS[integrator]
    new = step(law.rates, state, hands, [part[5] for part in parts], u[18])
    return ca.Function("sp", [state, u, p], [ca.cse(ca.vertcat(*new))]).mapaccum("sp", steps)


# Steps cut at the events.


def _located(model: SlidingPivotRelease, case: ReleaseCase) -> Release:
    """Fixed steps, each cut at the first change of mode inside it."""
    law, step = model.law(case), _STEPPERS[model.integrator]
    opening = case.grip.opening
    dt = opening / model.steps

    def advance(t: float, state: Array, h: float) -> Array:
        hand = case.hand.at(np.array([t, t + h / 2, t + h]))
        motions = [_at(hand, i) for i in range(3)]
        forces = [float(f) for f in case.grip.force(hand.times)]
        return np.array(step(law.rates, state, motions, forces, h))

    def excess(t: float, state: Array) -> Array:
        hand = case.hand.at(np.array([t]))
        return np.array(law.excess(state, _at(hand, 0), float(case.grip.force(t))))

    def excess_after(u: float, i: int, t: float, state: Array) -> float:
        return float(excess(t + u, advance(t, state, u))[i])

    t, state = 0.0, np.array([0, 0, case.grasp_angle, 0, 0, 0], float)
    times, states = [t], [state]
    before = excess(t, state)
    onsets: list[float | None] = [0.0 if value > 0 else None for value in before]
    while t < opening * (1 - 1e-12):
        h = min(dt, opening - t)
        after = excess(t + h, advance(t, state, h))
        changed = np.flatnonzero((before > 0) != (after > 0))
        if changed.size:
            root = min(_root(partial(excess_after, i=int(i), t=t, state=state), h) for i in changed)
            # Up to just before the root in the old mode, then over it in a tiny step.
            over = 1e-9 * dt
            h = max(root - over, 0.0)
            state, t = advance(t, state, h), t + h
            h = min(2 * over, opening - t)
        state, t = advance(t, state, h), t + h
        before = excess(t, state)
        for i in np.flatnonzero(before > 0):
            onsets[i] = t if onsets[i] is None else onsets[i]
        times.append(t)
        states.append(state)
    grid = np.array(times)
    release = world_release(law, case.hand.at(grid), np.array(states).T, case.grip.force(grid))
    return replace(release, pivot=onsets[0], slide=onsets[1])


def _root(function: Callable[[float], float], end: float) -> float:
    """Where `function` changes sign in (0, end], to rounding."""
    from scipy.optimize import brentq

    if (function(1e-12 * end) > 0) == (function(end) > 0):
        return end
    return float(brentq(function, 1e-12 * end, end, xtol=1e-13, rtol=1e-12))


def _at(hand: HandSamples, i: int) -> HandMotion:
    return HandMotion(hand.pose[2, i], hand.twist[2, i], *hand.acceleration[:, i])
