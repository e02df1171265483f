"""Time stepping of all release laws, for one case or N.

A law (`SteppedLaw`) has one step. This module places the steps, evaluates hand and grip force, and
handles events.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any, Protocol

import casadi as ca
import numpy as np

from ...core import BatchC, library, threads
from ..body import Array, Body, Contact, HandMotion, HandSamples, Value, components, hand_of
from ..trajectory import INSIDE, Throws
from .cases import LOST_SLIP, BatchRelease, ReleaseBatch, ReleaseCase, by_chunks, chunks

Rates = Callable[[Value, HandMotion, Value], list[Value]]
#: Values at start, middle and end of a step.
Triple = Sequence[Value] | Array

#: Throws of a batch in one piece of work of a thread.
PIECE = 8192
#: Grading of the sliding pivot's steps towards the end of the opening.
GRADING = 2.0


class SteppedLaw(Protocol):
    """A release law with one step; a state is a list of values or arrays (N,)."""

    @property
    def uses_middle(self) -> bool:
        """Whether a step needs the hand in its middle."""

    def start(self, hand: HandSamples, grasp_angle: Value) -> list[Value]:
        """State of a body that sticks to the hand."""

    def advance(
        self, state: Value, hands: Sequence[HandSamples], forces: Triple, dt: Value
    ) -> list[Value]:
        """State `dt` [s] later; hands and grip force [N] at the step's start, middle, end."""

    def lost(self, state: Value) -> Value:
        """Whether the body has left the pads."""

    def com(self, state: Value, hand: HandSamples) -> Sequence[Value]:
        """CoM pose and twist in the world."""


def rk4_step(
    rates: Rates, state: Value, hand: Sequence[HandMotion], normal_force: Triple, dt: Value
) -> list[Value]:
    """One classical Runge-Kutta step of `dt` seconds.

    `hand` and `normal_force` hold the values at the start, middle and end of the
    step: three instants serve the four stages.
    """
    start = components(state)
    k1 = rates(start, hand[0], normal_force[0])
    k2 = rates(_moved(start, k1, 0.5 * dt), hand[1], normal_force[1])
    k3 = rates(_moved(start, k2, 0.5 * dt), hand[1], normal_force[1])
    k4 = rates(_moved(start, k3, dt), hand[2], normal_force[2])
    return [
        x + dt / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        for x, a, b, c, d in zip(start, k1, k2, k3, k4, strict=True)
    ]


def euler_step(
    rates: Rates, state: Value, hand: Sequence[HandMotion], normal_force: Triple, dt: Value
) -> list[Value]:
    """One explicit Euler step of `dt` seconds; only the start's values are used."""
    start = components(state)
    return _moved(start, rates(start, hand[0], normal_force[0]), dt)


def _moved(state: Sequence[Value], rates: Sequence[Value], dt: Value) -> list[Value]:
    return [x + dt * rate for x, rate in zip(state, rates, strict=True)]


# Numbers and arrays.


@dataclass(frozen=True)
class Opening:
    """Steps of one opening or of N, with hand and grip force at their nodes.

    shares: of the duration [s], at the 2 K + 1 nodes and middles of K steps, each a number or an
    array (N,); hands: the hand at a time [s]; forces [N]: at the shares. gap [s]: distance from a
    step's ends at which the hand is evaluated; its acceleration may jump at them.
    """

    shares: Sequence[Value] | Array
    duration: Value
    hands: Callable[[Value], HandSamples]
    forces: Sequence[Value] | Array
    gap: float = 0.0


def march(law: SteppedLaw, opening: Opening, grasp_angle: Value) -> tuple[list[Value], Value]:
    """CoM state at detach (6 values), and whether the body was lost before."""
    shares, hands = opening.shares, opening.hands
    end = hands(shares[0] * opening.duration)
    state, lost = law.start(end, grasp_angle), np.asarray(False)
    for k in range(0, len(shares) - 2, 2):
        start = end
        begin, finish = shares[k] * opening.duration, shares[k + 2] * opening.duration
        dt = finish - begin
        if opening.gap:
            inside = np.minimum(opening.gap, dt / 4)
            start, finish = hands(begin + inside), finish - inside
        middle = hands(shares[k + 1] * opening.duration) if law.uses_middle else start
        end = hands(finish)
        state = law.advance(state, (start, middle, end), opening.forces[k : k + 3], dt)
        lost = lost | law.lost(state)
    return list(law.com(state, end)), lost


def step_batch(
    batch: ReleaseBatch,
    law: Callable[[ReleaseBatch], SteppedLaw],
    shares: Callable[[ReleaseBatch], Array],
    gap: float = 0.0,
) -> BatchRelease:
    """All throws of a batch by a law that the compiled core does not have, chunk by chunk.

    shares, gap: as in `Opening`; shares (2 K + 1,), or (2 K + 1, N) for a chunk of throws.
    """

    def chunk(part: ReleaseBatch) -> BatchRelease:
        at = shares(part)
        forces = part.forces(at) if at.ndim == 1 else part.forces_at(at * part.opening)
        opening = Opening(at, part.opening, part.hands.at, forces, gap)
        state, lost = march(law(part), opening, part.grasp_angle)
        return BatchRelease(np.array(state).T, np.broadcast_to(lost, part.count).copy())

    return by_chunks(batch, chunk)


def compiled_batch(law: str, batch: ReleaseBatch, shares: Array, gap: float = 0.0) -> BatchRelease:
    """N releases of hands on cubics by the compiled core.

    law: a function of core/batch.c. shares: (2 K + 1,), or (2 K + 1, N), of the opening; gap:
    both as in `Opening`.
    """
    powers, axes, pieces, rows = batch.hands.coefficients.shape
    curves = np.zeros((4, pieces, rows, axes))
    curves[4 - powers :] = batch.hands.coefficients.transpose(0, 2, 3, 1)
    grip = batch.grip.force(shares * batch.grip.opening) / batch.grip.full
    delays = np.broadcast_to(batch.hands.delays, batch.count)
    width, steps = 1 if shares.ndim == 1 else batch.count, len(shares) // 2
    found = BatchC(count=batch.count, steps=steps, pieces=pieces, rows=rows, width=width, gap=gap)
    given: dict[str, Array | None] = {
        "shares": shares,
        "grip": grip,
        "numbers": _numbers(batch),
        "curves": curves,
    }
    given |= {"knots": batch.hands.breaks, "delays": delays, "drift": batch.hands.drift}
    found.attach(
        **{k: v if v is None else np.ascontiguousarray(v, float) for k, v in given.items()}
    )
    detach, stray = np.empty((batch.count, 6)), np.empty((batch.count, 2))
    lost = np.empty(batch.count, bool)
    found.attach(detach=detach, stray=stray, lost=lost)
    getattr(library(), law)(found)
    return BatchRelease(detach, lost, stray=stray)


def _numbers(batch: ReleaseBatch) -> Array:
    """Parameters of the law in the order of number_symbols, then grasp angle, opening, force."""
    values = (*law_numbers(batch), batch.grasp_angle, batch.opening, batch.force)
    return np.array([np.broadcast_to(value, batch.count) for value in values], float)


def graded(steps: int, power: float = GRADING) -> Array:
    """Shares of the opening (steps + 1,), denser towards its end.

    The body slides in the last few per cent, where the grip vanishes: with power 2 the
    landing error is a tenth of that of even steps.
    """
    return np.asarray(1.0 - (1.0 - np.linspace(0.0, 1.0, steps + 1)) ** power)


def with_middles(nodes: Array) -> Array:
    """Nodes (K + 1, ...) and midpoints, in order: (2 K + 1, ...)."""
    both = np.empty((2 * len(nodes) - 1, *nodes.shape[1:]))
    both[::2], both[1::2] = nodes, (nodes[:-1] + nodes[1:]) / 2
    return both


def by_levels(
    batch: ReleaseBatch, run: Callable[[ReleaseBatch, int], BatchRelease]
) -> BatchRelease:
    """`run(throws, factor)` for groups of throws; the factor 1, 2, 4, ... follows from their
    swings.

    Threads share the work: compiled code releases Python's lock.
    """

    def levelled(piece: Throws) -> BatchRelease:
        part = batch.part(piece)
        levels = _levels(part)
        groups = [np.flatnonzero(levels == level) for level in np.unique(levels)]
        if len(groups) == 1:
            return run(part, 2 ** int(levels[0]))
        parts = [run(part.part(throws), 2 ** int(levels[throws[0]])) for throws in groups]
        return BatchRelease.joined(parts).part(np.argsort(np.concatenate(groups)))

    # Piece by piece: the splines of all hands at once would take too much memory.
    pieces = list(chunks(batch.count, PIECE))
    if len(pieces) == 1:
        return levelled(pieces[0])
    with ThreadPoolExecutor(threads()) as pool:
        return BatchRelease.joined(list(pool.map(levelled, pieces)))


def _levels(batch: ReleaseBatch) -> Array:
    """Number of doublings of the steps of each throw (N,), by its own swings.

    A body on a shaken hand swings at most at about sqrt(m h a / J); fast swings over a long opening
    need more steps. The number depends on the throw alone, and so does its result.
    """
    _, twist, acceleration = batch.hands.at(np.zeros(batch.count))
    body = batch.body
    pull = np.hypot(acceleration[0], acceleration[1]) + batch.gravity
    arm = body.mass * (body.com_offset + LOST_SLIP * 0.1)
    swing = np.sqrt(arm * pull / body.grasp_inertia) + np.abs(twist[2])
    turning = np.abs(acceleration[2]) * batch.opening
    cycles = batch.opening * (swing + turning)
    doublings = np.ceil(np.log2(np.maximum(cycles / 8.0, 1.0)))
    return np.asarray(np.clip(doublings, 0, 6).astype(int))


# CasADi: one step as a function of numbers, many of them in one call.


def step_symbols() -> tuple[ca.SX, list[HandSamples], list[ca.SX], ca.SX]:
    """Numbers of one step (31,): hand (9) and grip at start, middle, end, and dt; its parts."""
    u = ca.SX.sym("u", 31)
    rows = [u[10 * i : 10 * i + 10] for i in range(3)]
    hands = [hand_of(row) for row in rows]
    return u, hands, [row[9] for row in rows], u[30]


def step_columns(hand: HandSamples, forces: Array) -> Array:
    """Those numbers (31, K) for K steps: hand and forces at their 2 K + 1 nodes and middles."""
    rows = np.vstack([hand.pose, hand.twist, hand.acceleration, forces])
    dt = np.diff(hand.times[::2])
    return np.vstack([rows[:, :-2:2], rows[:, 1::2], rows[:, 2::2], dt])


def number_symbols() -> tuple[ca.SX, Body, Contact, ca.SX]:
    """Symbols of `numbers`: the column, and the body, contact and gravity it describes."""
    p = ca.SX.sym("p", 8)
    return p, Body(p[0], p[1], p[2]), Contact(p[3], p[4], p[5], p[6]), p[7]


def numbers(case: ReleaseCase) -> Array:
    """Parameter column (8, 1) of the compiled steps."""
    return np.array(law_numbers(case), float)[:, None]


def law_numbers(given: ReleaseCase | ReleaseBatch) -> list[Any]:
    """The law's numbers, in the order of `number_symbols`."""
    return [*vars(given.body).values(), *vars(given.contact).values(), given.gravity]


def step_function(law: SteppedLaw, parameters: ca.SX, steps: int) -> ca.Function:
    """`steps` steps as one function: (state (6,), columns, parameters) -> states (6, steps).

    law: of the symbols `parameters`, which are given for each step too.
    """
    state, (u, hands, forces, dt) = ca.SX.sym("state", 6), step_symbols()
    new = law.advance(state, hands, forces, dt)
    step = ca.Function("step", [state, u, parameters], [ca.cse(ca.vertcat(*new))])
    return step.mapaccum("steps", steps)


def run_steps(function: ca.Function, start: Array, columns: Array, parameters: Array) -> Array:
    """States (6, K + 1) from `start` on by a `step_function`; parameters (n, 1)."""
    repeated = np.repeat(parameters, columns.shape[1], axis=1)
    return np.column_stack([start, np.array(function(start, columns, repeated))])


# Steps cut at the events of a law that has modes.


class EventLaw(SteppedLaw, Protocol):
    """A law with modes: it sticks, pivots, slides."""

    def excess(self, state: Value, hand: HandMotion, normal_force: Value) -> Sequence[Value]:
        """Event functions: above zero the body pivots, slides."""


def located_steps(
    law: EventLaw, case: ReleaseCase, nodes: Array
) -> tuple[Array, Array, list[float | None]]:
    """Steps of one case from each of `nodes` [s] to the next, cut at changes of mode inside.

    Times (K,) and states (K, 6), and when each event function first rises above zero [s].
    """
    over = 1e-9 * float(nodes[-1]) / len(nodes)

    def hands(*times: float) -> list[HandSamples]:
        rows = np.concatenate([*case.hand.at(np.array(times))]).T.tolist()
        return [hand_of(row) for row in rows]

    def advance(t: float, state: Array, h: float) -> Array:
        inside = min(INSIDE, h / 4)
        times = (t + inside, t + h / 2, t + h - inside)
        forces = [float(f) for f in case.grip.force(np.array(times))]
        return np.array(law.advance(state, hands(*times), forces, h))

    def excess(t: float, state: Array) -> Array:
        return np.array(law.excess(state, hands(t)[0].motion, float(case.grip.force(t))))

    def excess_after(u: float, i: int, t: float, state: Array) -> float:
        return float(excess(t + u, advance(t, state, u))[i])

    t, state = 0.0, np.array(law.start(hands(0.0)[0], case.grasp_angle), float)
    times, states = [t], [state]
    before = excess(t, state)
    onsets: list[float | None] = [0.0 if value > 0 else None for value in before]
    while t < nodes[-1] - over / 2:
        end = float(nodes[np.searchsorted(nodes, t + over / 2)])
        h = end - t
        after = excess(t + h, advance(t, state, h))
        changed = np.flatnonzero((before > 0) != (after > 0))
        if changed.size:
            root = min(_root(partial(excess_after, i=int(i), t=t, state=state), h) for i in changed)
            # Up to just before the root in the old mode, then over it in a tiny step.
            h = max(root - over, 0.0)
            state, t = advance(t, state, h), t + h
            h = min(2 * over, end - t)
        state, t = advance(t, state, h), t + h
        before = excess(t, state)
        for i in np.flatnonzero(before > 0):
            onsets[i] = t if onsets[i] is None else onsets[i]
        times.append(t)
        states.append(state)
    return np.array(times), np.array(states), onsets


def _root(function: Callable[[float], float], end: float) -> float:
    """Zero of `function` in (0, end], to rounding."""
    from scipy.optimize import brentq

    if (function(1e-12 * end) > 0) == (function(end) > 0):
        return end
    return float(brentq(function, 1e-12 * end, end, xtol=1e-13, rtol=1e-12))
