"""Many different releases at once, as arrays: one entry per throw.

The same equations as everywhere, stepped with NumPy. Throws are taken in chunks that
fit the processor's cache, so memory does not grow with their number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from .contact import Body, Contact, HandMotion
from .grip_force import GripProfile
from .integrate import rk4_step
from .path import Path, Throws
from .release import BLEW_UP, LOST, sticking_state
from .sliding_pivot import LOST_SLIP, Form, SlidingPivot
from .time_stepping import HandState, LimitSurfaceStepping

Array = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

#: Throws per chunk: some thirty arrays of this many doubles stay in the cache.
CHUNK = 2048
#: Steps of an opening, usually: errors of random throws are below 0.03 and 0.2 mm.
PIVOT_STEPS, SURFACE_STEPS = 48, 120
#: Grading of the sliding pivot's steps towards the end of the opening.
GRADING = 2.0


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
    hands: Path
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


@dataclass(frozen=True)
class BatchRelease:
    """What N releases come to.

    detach (N, 6): CoM pose and twist at the end of the opening, NaN where it could not be
    computed, which `why_not` explains; lost (N,): whether the body slid out of the pads
    before.
    """

    detach: Array
    lost: Flags
    why_not: str = BLEW_UP

    @classmethod
    def empty(cls, count: int) -> BatchRelease:
        """Room for `count` releases."""
        return cls(np.empty((count, 6)), np.empty(count, bool))

    def put(self, throws: Throws, part: BatchRelease) -> None:
        """Fills in the releases of some throws."""
        self.detach[throws], self.lost[throws] = part.detach, part.lost

    @property
    def trouble(self) -> npt.NDArray[np.object_]:
        """Why each throw (N,) is not to be trusted, as in `Release`; empty if it is."""
        words = np.full(len(self.detach), "", object)
        words[self.lost] = LOST
        words[~np.isfinite(self.detach).all(axis=1)] = self.why_not
        return words


#: A release model in so many steps, the same number for all throws of the batch.
EvenSteps = Callable[[ReleaseBatch, int], BatchRelease]


def by_chunks(batch: ReleaseBatch, run: Callable[[ReleaseBatch], BatchRelease]) -> BatchRelease:
    """`run` on one chunk of throws after the other."""
    whole = BatchRelease.empty(batch.count)
    for throws in chunks(batch.count, CHUNK):
        whole.put(throws, run(batch.part(throws)))
    return whole


def chunks(count: int, size: int) -> Iterator[Throws]:
    """The numbers of `count` throws, `size` at a time."""
    for first in range(0, count, size):
        yield np.arange(first, min(first + size, count))


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


def sliding_pivot_batch(
    batch: ReleaseBatch, steps: int = PIVOT_STEPS, form: Form = "continuous"
) -> Array:
    """Detach states (N, 6) by the non-smooth sliding pivot, see `throw_sliding_pivot`."""
    return throw_sliding_pivot(batch, steps, form).detach


def stepped_batch(batch: ReleaseBatch, steps: int = SURFACE_STEPS) -> Array:
    """Detach states (N, 6) by the time-stepping limit surface, see `throw_limit_surface`."""
    return throw_limit_surface(batch, steps).detach


def throw_sliding_pivot(
    batch: ReleaseBatch,
    steps: int = PIVOT_STEPS,
    form: Form = "continuous",
    even: EvenSteps | None = None,
) -> BatchRelease:
    """N releases by the non-smooth sliding pivot.

    `steps` Runge-Kutta steps; doubled, once or more, for throws that swing fast. `even`:
    another program for the steps than NumPy's, a compiled one.
    """
    law = even or partial(sliding_pivot_steps, form=form)
    return _by_levels(batch, lambda part, factor: law(part, steps * factor))


def throw_limit_surface(
    batch: ReleaseBatch, steps: int = SURFACE_STEPS, even: EvenSteps | None = None
) -> BatchRelease:
    """N releases by the time-stepping limit surface.

    `steps` and twice as many steps, extrapolated: the stepping is first order, so this
    takes away the leading error at three times the cost of the shorter run. `even` as in
    `throw_sliding_pivot`.
    """
    law = even or limit_surface_steps

    def run(part: ReleaseBatch, factor: int) -> BatchRelease:
        coarse, fine = law(part, steps * factor), law(part, 2 * steps * factor)
        return BatchRelease(2 * fine.detach - coarse.detach, fine.lost)

    return _by_levels(batch, run)


def _by_levels(
    batch: ReleaseBatch, run: Callable[[ReleaseBatch, int], BatchRelease]
) -> BatchRelease:
    """`run(throws, factor)`, the factor by each throw's own swings."""
    whole = BatchRelease.empty(batch.count)
    # Piece by piece, so that no array of all hands' splines is ever made.
    for piece in chunks(batch.count, 4 * CHUNK):
        part = batch.part(piece)
        levels = _levels(part)
        for level in np.unique(levels):
            throws = np.flatnonzero(levels == level)
            some = part if len(throws) == len(piece) else part.part(throws)
            whole.put(piece[throws], run(some, 2 ** int(level)))
    return whole


def sliding_pivot_steps(batch: ReleaseBatch, steps: int, form: Form = "continuous") -> BatchRelease:
    """The sliding pivot in `steps` graded steps for all throws, by NumPy."""
    shares = graded(steps, GRADING)
    middles = (shares[:-1] + shares[1:]) / 2

    def chunk(part: ReleaseBatch) -> BatchRelease:
        law = SlidingPivot(part.body, part.contact, part.gravity, form)
        zero = np.zeros_like(part.opening)
        state: list[Array] = [zero, zero, zero + part.grasp_angle, zero, zero, zero]
        lost = np.zeros(part.count, bool)
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
            lost |= law.lost(state)
            start = end
        return BatchRelease(np.array(law.com_state(state, pose, twist, start)).T, lost)

    return by_chunks(batch, chunk)


def limit_surface_steps(batch: ReleaseBatch, steps: int) -> BatchRelease:
    """The limit surface in `steps` even steps for all throws, by NumPy; nothing extrapolated."""
    shares = np.linspace(0.0, 1.0, steps + 1)

    def chunk(part: ReleaseBatch) -> BatchRelease:
        law = LimitSurfaceStepping(part.body, part.contact, part.gravity, settle=True)
        forces = _forces(part, (shares[:-1] + shares[1:]) / 2)
        pose, twist, _ = part.hands.at(np.zeros_like(part.opening))
        state: list[Array] = sticking_state(pose, twist, part.grasp_angle, part.body.com_offset)
        start = HandState(*pose, *twist)
        for k in range(steps):
            pose, twist, _ = part.hands.at(shares[k + 1] * part.opening)
            end = HandState(*pose, *twist)
            dt = (shares[k + 1] - shares[k]) * part.opening
            state = law.step(state, start, end, forces[k], dt)
            start = end
        return BatchRelease(np.array(state).T, np.zeros(part.count, bool))

    return by_chunks(batch, chunk)


def _motion(pose: Array, twist: Array, acceleration: Array) -> HandMotion:
    return HandMotion(pose[2], twist[2], *acceleration)


def _forces(batch: ReleaseBatch, shares: Array) -> list[Array]:
    """Grip force (N,) at shares of the opening."""
    shape = batch.grip.force(shares * batch.grip.opening) / batch.grip.full
    return [batch.force * value for value in shape]
