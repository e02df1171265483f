"""Many different releases at once, as arrays: one entry per throw.

The same equations as everywhere, stepped with NumPy. Throws are taken in chunks that
fit the processor's cache, so memory does not grow with their number.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from .contact import Body, Contact, HandMotion
from .grip_force import GripProfile
from .integrate import rk4_step
from .sliding_pivot import LOST_SLIP, Form, SlidingPivot
from .time_stepping import HandState, LimitSurfaceStepping

Array = npt.NDArray[np.float64]
#: Numbers of some of the throws.
Throws = npt.NDArray[np.int_]
#: Pose, twist and acceleration of the hands, each (3, N).
Hands = tuple[Array, Array, Array]

#: Throws per chunk: some thirty arrays of this many doubles stay in the cache.
CHUNK = 2048
#: Grading of the sliding pivot's steps towards the end of the opening.
GRADING = 2.0


class HandsTrack(Protocol):
    """N hand motions, counted from the opening's start."""

    def at(self, times: Array) -> Hands:
        """The hands at `times` (N,) [s], one time per throw."""

    def part(self, throws: Throws) -> HandsTrack:
        """The hands of the given throws."""


@dataclass(frozen=True)
class ConstantAccelerations:
    """pose, twist, acceleration (N, 3) at the opening's start: x, z [m], theta [rad]."""

    pose: Array
    twist: Array
    acceleration: Array

    def part(self, throws: Throws) -> ConstantAccelerations:
        """The hands of the given throws."""
        return ConstantAccelerations(
            self.pose[throws], self.twist[throws], self.acceleration[throws]
        )

    def at(self, times: Array) -> Hands:
        """The hands at `times` (N,) [s]."""
        pose, twist, a = self.pose.T, self.twist.T, self.acceleration.T
        return pose + times * (twist + times * a / 2), twist + times * a, a


@dataclass(frozen=True)
class SampledHands:
    """N hand motions sampled at common `times` (K,) [s]: poses (N, K, 3), by cubic splines.

    One motion, (1, K, 3), serves all throws. delays (N,) [s] let each throw start that
    much later on its motion.
    """

    times: Array
    poses: Array
    delays: Array | None = None

    @cached_property
    def _coefficients(self) -> Array:
        """Spline coefficients (4, K - 1, N, 3)."""
        from scipy.interpolate import CubicSpline

        return np.asarray(CubicSpline(self.times, self.poses, axis=1).c)

    def part(self, throws: Throws) -> SampledHands:
        """The hands of the given throws."""
        poses = self.poses if len(self.poses) == 1 else self.poses[throws]
        return SampledHands(self.times, poses, None if self.delays is None else self.delays[throws])

    def at(self, times: Array) -> Hands:
        """The hands at `times` (N,) [s]."""
        t = times if self.delays is None else times + self.delays
        i = np.clip(np.searchsorted(self.times, t, "right") - 1, 0, len(self.times) - 2)
        u = (t - self.times[i])[:, None]
        row = 0 if len(self.poses) == 1 else np.arange(len(self.poses))
        c3, c2, c1, c0 = (self._coefficients[k][i, row] for k in range(4))
        pose = c0 + u * (c1 + u * (c2 + u * c3))
        twist = c1 + u * (2 * c2 + u * 3 * c3)
        return pose.T, twist.T, (2 * c2 + 6 * u * c3).T


@dataclass(frozen=True)
class ReleaseBatch:
    """N releases. Body and contact values, gravity, grasp_angle: numbers or arrays (N,).

    grip: the falling force, shared; opening (N,) [s] and force (N,) [N] stretch it to
    each throw's own duration and full grip.
    """

    count: int
    body: Body
    contact: Contact
    grip: GripProfile
    hands: HandsTrack
    opening: Array
    force: Array
    gravity: Any = 9.81
    grasp_angle: Any = 0.0

    def part(self, throws: Throws) -> ReleaseBatch:
        """The given throws as a batch of their own; numbers stay numbers."""

        def cut(value: Any) -> Any:
            return value[throws] if isinstance(value, np.ndarray) and value.ndim else value

        return replace(
            self,
            count=len(throws),
            body=Body(*(cut(getattr(self.body, f.name)) for f in fields(Body))),
            contact=Contact(*(cut(getattr(self.contact, f.name)) for f in fields(Contact))),
            hands=self.hands.part(throws),
            opening=self.opening[throws],
            force=self.force[throws],
            gravity=cut(self.gravity),
            grasp_angle=cut(self.grasp_angle),
        )


def run_batch(batch: ReleaseBatch, step: Callable[[ReleaseBatch], Array]) -> Array:
    """Detach states (N, 6): CoM pose and twist; `step` throws one chunk."""
    detach = np.empty((batch.count, 6))
    for first in range(0, batch.count, CHUNK):
        throws = np.arange(first, min(first + CHUNK, batch.count))
        detach[throws] = step(batch.part(throws)).T
    return detach


def _levels(batch: ReleaseBatch) -> npt.NDArray[np.int_]:
    """How often the steps of each throw (N,) are doubled: by its own swings alone.

    A body on a shaken hand swings at most at about sqrt(m h a / J); fast swings over a
    long opening need more steps. That the number depends on the throw alone keeps its
    result independent of its neighbours.
    """
    zero = np.zeros(batch.count)
    _, twist, acceleration = batch.hands.at(zero)
    body = batch.body
    pull = np.hypot(acceleration[0], acceleration[1]) + batch.gravity
    arm = body.mass * (body.com_offset + LOST_SLIP * 0.1)
    swing = np.sqrt(arm * pull / body.grasp_inertia) + np.abs(twist[2])
    turning = np.abs(acceleration[2]) * batch.opening
    cycles = batch.opening * (swing + turning)
    doublings = np.ceil(np.log2(np.maximum(cycles / 8.0, 1.0)))
    return np.asarray(np.clip(doublings, 0, 6).astype(int))


def graded(steps: int, power: float) -> Array:
    """Shares of the opening (steps + 1,), denser towards its end.

    The body slides in the last few per cent, where the grip vanishes: with power 2 the
    landing error is a tenth of that of even steps.
    """
    return np.asarray(1.0 - (1.0 - np.linspace(0.0, 1.0, steps + 1)) ** power)


def sliding_pivot_batch(batch: ReleaseBatch, steps: int = 48, form: Form = "continuous") -> Array:
    """Detach states (N, 6) by the non-smooth sliding pivot.

    `steps` Runge-Kutta steps; doubled, once or more, for throws that swing fast.
    """
    return _by_levels(batch, lambda part, factor: _sliding_pivot_even(part, steps * factor, form))


def _by_levels(batch: ReleaseBatch, run: Callable[[ReleaseBatch, int], Array]) -> Array:
    """Detach states (N, 6) of `run(throws, factor)`, the factor by each throw's own swings."""
    detach = np.empty((batch.count, 6))
    # Piece by piece, so that no array of all hands' splines is ever made.
    for first in range(0, batch.count, 4 * CHUNK):
        piece = np.arange(first, min(first + 4 * CHUNK, batch.count))
        levels = _levels(batch.part(piece))
        for level in np.unique(levels):
            throws = piece[levels == level]
            detach[throws] = run(batch.part(throws), 2 ** int(level))
    return detach


def _sliding_pivot_even(batch: ReleaseBatch, steps: int, form: Form) -> Array:
    """The same in `steps` steps for all."""
    shares = graded(steps, GRADING)
    middles = (shares[:-1] + shares[1:]) / 2

    def chunk(part: ReleaseBatch) -> Array:
        law = SlidingPivot(part.body, part.contact, part.gravity, form)
        zero = np.zeros_like(part.opening)
        state: list[Array] = [zero, zero, zero + part.grasp_angle, zero, zero, zero]
        pose, twist, acceleration = part.hands.at(zero)
        start = _motion(pose, twist, acceleration)
        nodes, between = _forces(part, shares), _forces(part, middles)
        for k in range(steps):
            middle = _motion(*part.hands.at(middles[k] * part.opening))
            pose, twist, acceleration = part.hands.at(shares[k + 1] * part.opening)
            end = _motion(pose, twist, acceleration)
            forces = [nodes[k], between[k], nodes[k + 1]]
            dt = (shares[k + 1] - shares[k]) * part.opening
            state = rk4_step(law.rates, state, [start, middle, end], forces, dt)
            start = end
        return np.array(law.com_state(state, pose, twist, start))

    return run_batch(batch, chunk)


def stepped_batch(batch: ReleaseBatch, steps: int = 120) -> Array:
    """Detach states (N, 6) by the time-stepping limit surface.

    `steps` and twice as many steps, extrapolated: the stepping is first order, so this
    takes away the leading error at three times the cost of the shorter run.
    """

    def run(part: ReleaseBatch, factor: int) -> Array:
        n = steps * factor
        return 2 * _stepped_even(part, 2 * n) - _stepped_even(part, n)

    return _by_levels(batch, run)


def _stepped_even(batch: ReleaseBatch, steps: int) -> Array:
    """The same in `steps` even steps, without extrapolation."""
    shares = np.linspace(0.0, 1.0, steps + 1)

    def chunk(part: ReleaseBatch) -> Array:
        law = LimitSurfaceStepping(part.body, part.contact, part.gravity, settle=True)
        forces = _forces(part, (shares[:-1] + shares[1:]) / 2)
        pose, twist, _ = part.hands.at(np.zeros_like(part.opening))
        start = HandState(*pose, *twist)
        theta, h = pose[2] + part.grasp_angle, part.body.com_offset
        x_r, z_r = h * np.cos(theta), h * np.sin(theta)
        v_x, v_z = twist[0] - twist[2] * z_r, twist[1] + twist[2] * x_r
        state: list[Array] = [pose[0] + x_r, pose[1] + z_r, theta, v_x, v_z, twist[2]]
        for k in range(steps):
            pose, twist, _ = part.hands.at(shares[k + 1] * part.opening)
            end = HandState(*pose, *twist)
            dt = (shares[k + 1] - shares[k]) * part.opening
            state = law.step(state, start, end, forces[k], dt)
            start = end
        return np.array(state)

    return run_batch(batch, chunk)


def _motion(pose: Array, twist: Array, acceleration: Array) -> HandMotion:
    return HandMotion(pose[2], twist[2], *acceleration)


def _forces(batch: ReleaseBatch, shares: Array) -> list[Array]:
    """Grip force (N,) at shares of the opening."""
    shape = batch.grip.force(shares * batch.grip.opening) / batch.grip.full
    return [batch.force * value for value in shape]
