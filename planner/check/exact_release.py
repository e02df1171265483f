"""Releases of a known hand motion by the non-smooth models, mostly in 1 to 3 ms.

The equations are the models' own, made once into a function of CasADi's virtual machine
with every number of body, contact and hand as an input. It is fast because of where the
steps lie. The sliding pivot is run twice: a coarse run finds when pivoting and sliding
begin and end, the finer one has nodes there, so that Runge-Kutta keeps its order. The
limit surface, first order in its steps, is extrapolated. It has nodes where slip stops:
if friction turns round inside a step, the whole step is taken with the new friction, and
once all steps are longer than the rest of the old slip takes, that error does not shrink
with them. Either goes on with twice the steps until its detach state, and those events,
settle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import casadi as ca
import numpy as np
import numpy.typing as npt

from ...models import (
    BLEW_UP,
    INSIDE,
    LOST,
    LOST_SLIP,
    HandSamples,
    LimitSurfaceStepping,
    PivotSteps,
    Release,
    ReleaseCase,
    SlidingPivot,
    hand_of,
    number_symbols,
    numbers,
    onset,
    step_symbols,
    sticking_state,
)
from ..compile import STEPS, StepKernel

Array = npt.NDArray[np.float64]

#: Steps of the first run, of the sliding pivot and of the limit surface.
COARSE, SURFACE_COARSE = STEPS, 100
#: Steps of the last run, settled or not.
MOST = 2048
#: Settled: a finer run changes the detach state by less than this, see `_distance`. On
#: plans the finer run's own error is then below 0.001 mm, of the limit surface 0.05 mm.
SETTLED = 1e-3
#: Pivoting and sliding begin and end within this share of the opening from where a node was
#: put for it; otherwise another run follows.
ASTRAY = 5e-4
#: A node is put where slip stops, if that is farther than this share of the opening from
#: the ends of its step, at most so many times in a release.
OFF_NODE, PLACINGS = 1e-5, 6
#: Stops found nearer to each other than this share of the opening, in two runs, are one.
SAME = 1e-3
#: Friction of two steps whose directions' cosine is below this may have turned round.
TURNED = 0.99
#: Newton iterations of an impulse: on planned throws four are exact to rounding.
ITERATIONS = 6
#: Steps shrink towards the end as its distance to the power 1 - 1 / POWER.
POWER = 1.5
#: Kinks nearer than this share of the opening to each other or to its ends are one.
APART = 1e-9
#: Flight [s] over which a velocity error, and lever [m] by which an angle error, counts.
FLIGHT, LEVER = 0.5, 0.1


def sliding_pivot_release(case: ReleaseCase, kinks: Array) -> Release:
    """The release by the non-smooth sliding pivot.

    kinks: times [s] in the opening at which the hand's acceleration or jerk may step.
    """
    opening, steps, finer = case.grip.opening, COARSE, True
    run = _pivot_run(case, instants(graded_shares(kinks / opening, steps), opening))
    events, around = run.events(), np.zeros(0)
    while True:
        before, foreseen = run.states[-1], events
        nodes = np.concatenate([kinks, events, around]) / opening
        steps = min(max(2 * steps if finer else steps, _steps_for(nodes.size)), MOST)
        run = _pivot_run(case, instants(graded_shares(nodes, steps), opening))
        events = run.events()
        astray = np.abs(np.subtract.outer(events, foreseen)).min(axis=1, initial=opening)
        far = astray > ASTRAY * opening
        settled = _distance(run.states[-1], before) <= SETTLED
        if (settled and not far.any()) or steps == MOST:
            return run.release(SlidingPivot(case.body, case.contact, case.gravity))
        # Where an event was not foreseen well the next run has nodes on both sides of it;
        # the same number of steps serves for that once.
        around = (events[far] + 2 * astray[far] * [[-1.0], [1.0]]).ravel()
        finer = not finer or not settled


def relative_states(case: ReleaseCase, nodes: Array) -> Array:
    """Relative states (K + 1, 6) of the sliding pivot at `nodes` [s] of the opening.

    One Runge-Kutta step from each node to the next, from sticking at the first: rough
    where the nodes are, for starting points.
    """
    return _pivot_run(case, nodes).states


def limit_surface_release(case: ReleaseCase, kinks: Array) -> Release:
    """The release by the time-stepping limit surface: its two ends.

    kinks: as for the sliding pivot.
    """
    opening, stops, doublings, placings = case.grip.opening, np.zeros(0), 2, 0
    while True:
        shares = graded_shares(np.concatenate([kinks, stops]) / opening, SURFACE_COARSE)
        for _ in range(doublings):
            shares = halved(shares)
        steps = _surface_steps(case, shares)
        finest = steps.run()
        found = steps.stops(*finest) if placings < PLACINGS else np.zeros(0)
        if found.size:
            # Better known now are those that had a node close by.
            far = np.abs(np.subtract.outer(stops, found)).min(axis=1) > SAME * opening
            stops, placings = np.concatenate([stops[far], found]), placings + 1
            continue
        plain = [steps.run(4)[0][-1], steps.run(2)[0][-1], finest[0][-1]]
        # The stepping is first order: this takes the leading error away.
        before, detach = 2 * plain[1] - plain[0], 2 * plain[2] - plain[1]
        if shares.size > MOST or _distance(detach, before) <= SETTLED:
            break
        doublings += 1
    states = np.column_stack([steps.start, detach])
    return Release(steps.times[[0, -1]], states[:3], states[3:])


def _steps_for(kinks: int) -> int:
    """Steps, in whole blocks of the kernel, that leave one at least between two kinks."""
    return STEPS * math.ceil((kinks + 1) / STEPS)


def _distance(one: Array, other: Array) -> float:
    """How far two detach states make landings differ [m], roughly."""
    d = np.abs(one - other).tolist()
    return float(d[0] + d[1] + LEVER * d[2] + FLIGHT * (d[3] + d[4] + LEVER * d[5]))


@dataclass(frozen=True)
class _PivotRun:
    """Runge-Kutta steps of the sliding pivot.

    hand: at the K + 1 nodes; states (K + 1, 6); excess (K, 2, 2): how far torque and force
    are beyond their limits at begin and end of each step; lost: the slip at which the body
    has left the pads [m].
    """

    hand: HandSamples
    states: Array
    excess: Array
    lost: float

    def events(self) -> Array:
        """When pivoting, sliding or being lost begins or ends [s]."""
        times, slip = self.hand.times, self._slip() - self.lost
        # Begin and end of each step in a row: a change at a node is an event too.
        values = np.empty((2 * len(self.excess), 3))
        values[:, :2] = self.excess.reshape(-1, 2)
        values[::2, 2], values[1::2, 2] = slip[:-1], slip[1:]
        step, kind = np.nonzero((values[:-1] > 0) != (values[1:] > 0))
        low, high = values[step, kind], values[step + 1, kind]
        begin, end = times[(step + 1) // 2], times[(step + 2) // 2]
        return np.asarray(begin + (end - begin) * low / (low - high))

    def release(self, law: SlidingPivot) -> Release:
        """The body in the world; no wrench."""
        hand = self.hand
        state = np.vstack(law.com_state(self.states.T, hand.pose, hand.twist, hand.motion))
        at_nodes = np.vstack([self.excess[:1, 0], self.excess[:, 1]])
        trouble = ""
        if (self._slip() > self.lost).any():
            trouble = LOST
        if not np.isfinite(state).all():
            trouble = BLEW_UP
        pivot, slide = (onset(hand.times, values) for values in at_nodes.T)
        return Release(hand.times, state[:3], state[3:], pivot, slide, trouble=trouble)

    def _slip(self) -> Array:
        return np.asarray(np.hypot(self.states[:, 0], self.states[:, 1]))


def _pivot_run(case: ReleaseCase, nodes: Array) -> _PivotRun:
    """One step from each of `nodes` (K + 1,) [s] to the next."""
    steps = nodes.size - 1
    times = np.empty(3 * steps)
    times[::3], times[2::3] = nodes[:-1] + INSIDE, nodes[1:] - INSIDE
    times[1::3] = (nodes[:-1] + nodes[1:]) / 2
    hand = case.hand.at(times)
    table = np.empty((3 * steps, 10))
    table[:, :3], table[:, 3:6], table[:, 6:9] = hand.pose.T, hand.twist.T, hand.acceleration.T
    table[:, 9] = case.grip.force(times)
    columns = np.empty((steps, 39))
    columns[:, :30], columns[:, 30] = table.reshape(-1, 30), np.diff(nodes)
    columns[:, 31:] = numbers(case).T
    states = np.empty((steps + 1, 6))
    states[0] = 0.0, 0.0, case.grasp_angle, 0.0, 0.0, 0.0
    states[1:], excess = pivot_kernel()(states[0], columns)
    # The nodes: the first step's start, then each step's end.
    at = np.arange(-1, times.size, 3)
    at[0] = 0
    return _PivotRun(
        HandSamples(nodes, *(rows[:, at] for rows in (hand.pose, hand.twist, hand.acceleration))),
        states,
        excess.reshape(-1, 2, 2),
        case.body.com_offset + LOST_SLIP,
    )


@dataclass(frozen=True)
class _SurfaceSteps:
    """What the limit surface needs of an opening.

    times (K + 1,) [s]; hand (K + 1, 6): pose and twist; forces (2 K - 1,): grip at and
    between the inner nodes; numbers (8,); start (6,): the sticking CoM's pose and twist.
    """

    law: LimitSurfaceStepping
    times: Array
    start: Array
    hand: Array
    forces: Array
    numbers: Array

    def run(self, stride: int = 1) -> tuple[Array, Array]:
        """States (K, 6) after steps of `stride` intervals, and their friction (K, 3).

        Friction is in half axes of the limit surface: 1 long where the body slips.
        """
        times, hand = self.times[::stride], self.hand[::stride]
        # The law reads no hand in the middle, and no other force.
        columns = np.zeros((times.size - 1, 39))
        columns[:, :6], columns[:, 20:26] = hand[:-1], hand[1:]
        columns[:, 19] = self.forces[stride - 1 :: 2 * stride]
        columns[:, 30], columns[:, 31:] = np.diff(times), self.numbers
        states, friction = surface_kernel()(self.start, columns)
        return states, friction

    def stops(self, states: Array, friction: Array) -> Array:
        """When slip stops inside a step [s], as friction that turns round in it tells."""
        turned = np.einsum("ki,ki->k", friction[:-1], friction[1:]) < TURNED
        before = np.flatnonzero(turned)
        before = before[np.linalg.norm(friction[before], axis=1) > 1.0 - 1e-6]
        least = OFF_NODE * self.times[-1]
        stops = []
        for k in before.tolist():
            begin, end = self.times[k + 1 : k + 3]
            stop = begin + (end - begin) * self._stop(k, states, friction)
            if begin + least < stop < end - least:
                stops.append(stop)
        return np.array(stops)

    def _stop(self, k: int, states: Array, friction: Array) -> float:
        """Share of step k + 1 after which the slip at its start has stopped, or more than 1.

        Had friction not turned round in the step, it would have been on the other side of
        the limit surface, where slip differs along its direction before the step only.
        """
        old = friction[k]
        _, slip, _ = self._contact(k, states, friction)
        inverse_mass, new_slip, radius = self._contact(k + 1, states, friction)
        way, new = radius * np.linalg.solve(inverse_mass, old), radius * friction[k + 1]
        # The farther |new + braking way| = radius.
        a, b, c = way @ way, new @ way, min(new @ new - radius**2, 0.0)
        root = math.sqrt(b * b - a * c)
        # The root in the form that does not cancel; nothing brakes without a way.
        braking = radius * ((root - b) / a if b <= 0.0 and a > 0.0 else -c / max(root + b, 1e-300))
        rise = old @ (new_slip - slip) + braking
        return float(-(old @ slip) / rise) if rise > 0.0 else math.inf

    def _contact(self, k: int, states: Array, friction: Array) -> tuple[Array, Array, float]:
        """Of step k: inverse mass (3, 3), slip (3,) it leaves, largest impulse.

        In half axes of the limit surface.
        """
        state = states[k - 1] if k else self.start
        hands = [hand_of(row) for row in self.hand[k : k + 2]]
        dt = self.times[k + 1] - self.times[k]
        lever = self.law.lever(state, hands, dt)
        problem = self.law.problem(state, hands[1], lever, self.forces[2 * k], dt)
        inverse_mass = problem.inverse_mass
        slip = inverse_mass @ (problem.radius * friction[k]) - np.array(problem.rhs)
        return inverse_mass, slip, float(problem.radius)


def _surface_steps(case: ReleaseCase, shares: Array) -> _SurfaceSteps:
    """Steps at `shares`, which are halved shares."""
    opening = case.grip.opening
    times = instants(shares, opening)
    hand = case.hand.at(times)
    between = instants(halved(shares), opening)[1:-1]
    start = sticking_state(
        hand.pose[:, 0], hand.twist[:, 0], case.grasp_angle, case.body.com_offset
    )
    return _SurfaceSteps(
        LimitSurfaceStepping(case.body, case.contact, case.gravity),
        times,
        np.array(start),
        np.hstack([hand.pose.T, hand.twist.T]),
        case.grip.force(between),
        numbers(case)[:, 0],
    )


@cache
def pivot_kernel() -> StepKernel:
    """(state, hand and grip at start, middle, end, dt, numbers) -> state, excesses."""
    p, body, contact, gravity = number_symbols()
    state, (u, hands, forces, dt) = ca.SX.sym("state", 6), step_symbols()
    law = PivotSteps(SlidingPivot(body, contact, gravity))
    new = law.advance(state, hands, forces, dt)
    begin = law.excess(ca.vertsplit(state), hands[0].motion, forces[0])
    end = law.excess(new, hands[2].motion, forces[2])
    return StepKernel([state, ca.vertcat(u, p)], [ca.vertcat(*new), ca.vertcat(*begin, *end)])


@cache
def surface_kernel() -> StepKernel:
    """(state, hand at start and end, grip between, dt, numbers) -> state, friction."""
    p, body, contact, gravity = number_symbols()
    state, (u, hands, forces, dt) = ca.SX.sym("state", 6), step_symbols()
    law = LimitSurfaceStepping(body, contact, gravity, iterations=ITERATIONS)
    lever = law.lever(state, hands, dt)
    problem = law.problem(state, hands[-1], lever, forces[1], dt)
    y = problem.solve(ITERATIONS)
    new = law.after(state, hands, lever, y, dt)
    friction = ca.SX(ca.vertcat(*y)) / ca.fmax(problem.radius, 1e-300)
    return StepKernel([state, ca.vertcat(u, p)], [ca.vertcat(*new), friction])


# Instants of the opening at which steps are taken: denser towards the end, where the grip
# vanishes and the body slides, with a node wherever the hand's motion or the release itself
# has a kink: a step over a kink loses its order.


def graded_shares(kinks: Array, steps: int) -> Array:
    """Stretched shares (steps + 1,) of the opening, 0 to 1, with nodes at `kinks`.

    kinks: shares of the opening. Steps are even in the stretched share, as far as the
    kinks let them. More kinks than steps are left out.
    """
    inner = np.sort(kinks)
    inner = inner[(inner > APART) & (inner < 1.0 - APART)]
    inner = inner[np.diff(inner, prepend=0.0) > APART]
    if inner.size >= steps:
        return np.linspace(0.0, 1.0, steps + 1)
    ends = np.concatenate([[0.0], 1.0 - (1.0 - inner) ** (1.0 / POWER), [1.0]])
    # Cumulated steps: as the stretched shares ask, but one at least between two kinks.
    cumulated = np.maximum.accumulate(np.rint(ends * steps) - np.arange(ends.size))
    cumulated = np.minimum(cumulated + np.arange(ends.size), steps - np.arange(ends.size)[::-1])
    return np.asarray(np.interp(np.arange(steps + 1), cumulated, ends))


def halved(shares: Array) -> Array:
    """The same with twice as many steps."""
    even = np.interp(np.arange(2 * shares.size - 1), 2 * np.arange(shares.size), shares)
    return np.asarray(even)


def instants(shares: Array, duration: float) -> Array:
    """Times [s] of stretched shares of an opening of `duration` [s]."""
    return np.asarray(duration * (1.0 - (1.0 - shares) ** POWER))
