"""Limit surfaces of a patch contact, and releases by them with rigid-body dynamics, (20)-(25).

Sliding with contact twist v, friction is the wrench on the ellipsoid (19) whose normal is along
-v: Gamma(v) per newton of normal force.

The hand's motion determines the wrench on a sticking body, (28) and (31). Slip starts when that
wrench first reaches the surface of the falling grip force. Then the contact moves along the
surface's normal: rotation and sliding start at one instant, except for a motion that the normal
does not have, such as rotation without torque.

`ls` is Karnopp's routine with explicit Euler steps, as published: it chatters between
stick and slide once the body starts to slide. With a half-band the sliding wrench is
viscous-smoothed; explicit Euler still chatters, an implicit integrator (`ils`) does not.
"""

from __future__ import annotations

import itertools
import math
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from ..body import (
    Array,
    Body,
    HandMotion,
    HandSamples,
    com_wrench,
    contact_twist,
    pivot_wrench,
    sticking_state,
)
from .cases import BatchRelease, Release, ReleaseBatch, ReleaseCase, by_chunks, failed


@dataclass(frozen=True)
class KarnoppRelease:
    """Explicit Euler with Karnopp's dead zone, (20), on the contact's own ellipsoid.

    steps over the opening (500 in 50 ms is the paper's 0.1 ms); dead_zone delta [m/s];
    half_band d [m/s] of the viscous smoothing, 0 without. The slip's size |v| is the paper's,
    which mixes m/s and rad/s.
    """

    steps: int = 500
    dead_zone: float = 1e-8
    half_band: float = 0.0

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case; `trouble` says so if the steps blew up."""
        times = np.linspace(0.0, case.grip.opening, self.steps + 1)
        hand, forces = case.hand.at(times), case.grip.force(times)
        hands = (
            HandSamples(0.0, *(rows[:, k : k + 1] for rows in hand)) for k in range(len(times))
        )
        start, dt = case.start()[:, None], case.grip.opening / self.steps
        states, wrenches = [start], list[Array]()
        for state, wrench in self._steps(case, start, hands, forces[:-1], dt):
            if not np.abs(state).max() < 1e4:
                return failed(times, "explicit steps blew up: needs more steps")
            states.append(state)
            wrenches.append(wrench)
        track, wrench = np.hstack(states), np.hstack([wrenches[0], *wrenches])
        f_x, f_z, torque = wrench
        used = case.contact.utilisation_squared(f_x, f_z, torque, np.maximum(forces, 1e-12))
        sliding = used > 0.25
        y = wrench / (np.abs(wrench).max(axis=1, keepdims=True) + 1e-300)
        opposed = (y[:, 1:] * y[:, :-1]).sum(axis=0) < 0
        turns = int((opposed & sliding[1:] & sliding[:-1]).sum())
        words = f"explicit steps chatter: friction turned round {turns} times"
        release = _as_release(case, times, track, wrench)
        return replace(release, trouble=words) if turns > 10 else release

    def throw(self, batch: ReleaseBatch, steps: int) -> BatchRelease:
        """N releases, in steps of 0.1 ms as in the paper if `steps` is 0, 20,000 at most."""
        if steps == 0:
            longest = float(np.max(batch.opening))
            steps = int(np.clip(np.ceil(1e4 * longest - 1e-9), 1, 20_000))
        return by_chunks(batch, lambda part: self._chunk(part, steps))

    def _chunk(self, part: ReleaseBatch, steps: int) -> BatchRelease:
        shares = np.linspace(0.0, 1.0, steps + 1)
        pose, twist, _ = part.hands.at(np.zeros_like(part.opening))
        state = np.array(sticking_state(pose, twist, part.grasp_angle, part.body.com_offset), float)
        hands, forces = (part.hands.at(s * part.opening) for s in shares), part.forces(shares[:-1])
        for stepped_state, _ in self._steps(part, state, hands, forces, part.opening / steps):
            state = stepped_state
        detach = state.T
        detach[~np.isfinite(detach).all(axis=1)] = np.nan
        return BatchRelease(detach, np.zeros(part.count, bool))

    def _steps(
        self,
        given: ReleaseCase | ReleaseBatch,
        state: Array,
        hands: Iterator[HandSamples],
        forces: Iterable[Array],
        dt: Any,
    ) -> Iterator[tuple[Array, Array]]:
        """CoM states (6, N) of N throws after each step, and the wrenches (3, N) in it."""
        body, contact, gravity = given.body, given.contact, given.gravity
        arm = contact.torsion_arm
        for force, (pose, twist, acceleration) in zip(forces, hands, strict=False):
            slip, lever = _slip(state, pose, twist)
            limit, speed = contact.force_limit(force), np.sqrt((slip**2).sum(axis=0))
            sliding = contact.faces * force * contact.sliding_wrench(slip)
            if self.half_band:
                sliding = sliding * np.minimum(speed / self.half_band, 1.0)
            # Sticking: the wrench that keeps the body with the hand, cut off at the surface.
            motion = HandMotion(pose[2], twist[2], *acceleration)
            h_x, h_z, h_t = pivot_wrench(body, gravity, motion, state[5], *lever)
            needed = np.sqrt(h_x**2 + h_z**2 + (h_t / arm) ** 2)
            share = np.minimum(limit / np.maximum(needed, 1e-300), 1.0)
            sticking = share * np.array([h_x, h_z, h_t])
            wrench = np.where(speed > self.dead_zone, sliding, sticking)
            state = state + dt * _rates(body, gravity, state, wrench, lever)
            yield state, wrench


@dataclass(frozen=True)
class ImplicitRelease:
    """The viscous-smoothed limit surface by a stiff integrator (ILS).

    half_band d [m/s]: Gamma_d(v) = Gamma(v) min(|v| / d, 1); method, rtol and atol of
    scipy.integrate.solve_ivp; samples kept; budget: evaluations before it gives up.
    """

    half_band: float = 0.01
    method: Literal["LSODA", "Radau", "BDF"] = "LSODA"
    rtol: float = 1e-8
    atol: float = 1e-10
    samples: int = 501
    budget: int = 100_000

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case; `trouble` says so if the integrator gave up."""
        from scipy.integrate import solve_ivp

        times = np.linspace(0.0, case.grip.opening, self.samples)

        def friction(t: float, state: Array) -> tuple[Array, tuple[Array, Array]]:
            """Wrench (3,), and the lever [m]."""
            hand = case.hand.at(np.array([t]))
            slip, lever = _slip(state, hand.pose[:, 0], hand.twist[:, 0])
            size = math.sqrt(slip @ slip)
            force = case.contact.faces * float(case.grip.force(t)) * min(size / self.half_band, 1.0)
            return force * case.contact.sliding_wrench(slip), lever

        spent = itertools.count(1)

        def rates(t: float, state: Array) -> Array:
            if next(spent) > self.budget:
                raise _OutOfBudgetError
            return _rates(case.body, case.gravity, state, *friction(t, state))

        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            options: dict[str, Any] = {"rtol": self.rtol, "atol": self.atol}
            # A first step within the time in which the contact creeps up to its load.
            options["first_step"] = 1e-6 * case.grip.opening
            try:
                run = solve_ivp(
                    rates, (0.0, times[-1]), case.start(), self.method, times, **options
                )
            except _OutOfBudgetError:
                return failed(times, f"{self.method} gave up after {self.budget} evaluations")
        if not run.success or run.y.shape[1] != len(times) or not np.isfinite(run.y).all():
            words = str(caught[-1].message) if caught else run.message
            return failed(times, f"{self.method} gave up: {words}")
        wrenches = [friction(t, state)[0] for t, state in zip(times, run.y.T, strict=True)]
        return _as_release(case, times, run.y, np.array(wrenches).T)


class _OutOfBudgetError(Exception):
    """The integrator makes no headway."""


def _slip(state: Array, pose: Array, twist: Array) -> tuple[Array, tuple[Array, Array]]:
    """Slip (3, ...) of the contact against the hand, and the lever [m]; state (6, ...)."""
    x_r, z_r = state[0] - pose[0], state[1] - pose[1]
    return np.array(contact_twist(state[3], state[4], state[5], x_r, z_r)) - twist, (x_r, z_r)


def _rates(
    body: Body, gravity: Any, state: Array, wrench: Array, lever: tuple[Array, Array]
) -> Array:
    """Rates of the CoM state (6, ...) under a contact wrench (3, ...), (25)."""
    f_x, f_z, torque = com_wrench(wrench[0], wrench[1], wrench[2], *lever)
    a_x, a_z = f_x / body.mass, f_z / body.mass - gravity
    return np.array([*state[3:], a_x, a_z, torque / body.inertia])


def _as_release(case: ReleaseCase, times: Array, states: Array, wrench: Array) -> Release:
    pivot, slide = case.slip_onset()
    return Release(times, states[:3], states[3:], pivot, slide, wrench)
