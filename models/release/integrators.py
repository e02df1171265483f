"""Releases in steps by the compiled core, and the formula of a Runge-Kutta step.

The core's releases of one throw are exact. The sliding pivot takes Runge-Kutta steps, which end at
kinks of the hand's motion and at starts and ends of pivoting and sliding; their number is doubled
until the detach state converges. The limit surface, first order in its steps, is extrapolated.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np

from ...core import Structure, array, library, out, threads
from ..backend import Value, components
from ..body import Array, HandMotion
from ..trajectory import MovedHand, Throws, Trajectory
from .cases import LOST_SLIP, BatchRelease, Release, ReleaseBatch, ReleaseCase, chunks
from .grip import GripProfile

#: Throws of a batch from which threads share it.
PARALLEL = 64
Rates = Callable[[Value, HandMotion, Value], list[Value]]
#: Values at start, middle and end of a step.
Triple = Sequence[Value] | Array


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


def _moved(state: Sequence[Value], rates: Sequence[Value], dt: Value) -> list[Value]:
    return [x + dt * rate for x, rate in zip(state, rates, strict=True)]


def law_numbers(given: ReleaseCase | ReleaseBatch) -> list[Any]:
    """The law's numbers, in the order of `release` of core/structures.h."""
    return [*vars(given.body).values(), *vars(given.contact).values(), given.gravity]


# N releases by the core.

#: Longest time [s] between nodes of releases that a track keeps, about.
TRACK_STEP = 1e-3


def track_length(longest: float) -> int:
    """Number of nodes of the tracks of openings that take `longest` [s] at most."""
    return max(math.ceil(longest / TRACK_STEP), 1) + 1


def compiled_batch(
    law: str, batch: ReleaseBatch, shares: Array, gap: float = 0.0, *, paper: bool = False
) -> BatchRelease:
    """N releases of hands on cubics by the compiled core.

    law: a function of core/batch.c; paper: its sliding pivot in the paper's form. shares: nodes
    and middles of K steps as shares of the opening, (2 K + 1,) or (2 K + 1, N). gap [s]: distance
    from a step's ends at which the hand is evaluated; its acceleration may jump at them.
    """
    powers, axes, pieces, rows = batch.hands.coefficients.shape
    curves = np.zeros((4, pieces, rows, axes))
    curves[4 - powers :] = batch.hands.coefficients.transpose(0, 2, 3, 1)
    values = (*law_numbers(batch), batch.grasp_angle, batch.opening, batch.force)
    force, count, steps = batch.grip_shares(shares), batch.count, len(shares) // 2
    if force.ndim > shares.ndim:
        shares = np.broadcast_to(shares[:, None], force.shape)
    width = 1 if shares.ndim == 1 else count
    numbers = np.array([np.broadcast_to(value, count) for value in values], float)
    given: dict[str, tuple[Array | None, tuple[int, ...]]] = {
        "shares": (shares, (2 * steps + 1, width)),
        "grip": (force, (2 * steps + 1, width)),
        "numbers": (numbers, (11, count)),
        "curves": (curves, (4, pieces, rows, 3)),
        "knots": (batch.hands.breaks, (pieces + 1,)),
        "delays": (np.broadcast_to(batch.hands.delays, count), (count,)),
        "drift": (batch.hands.drift, (3, count)),
    }
    sizes = {"count": count, "steps": steps, "pieces": pieces, "rows": rows, "width": width}
    found = Structure("batch", **sizes, gap=gap, paper=paper)
    for name, (part, shape) in given.items():
        if part is not None:
            found.attach(**{name: array(np.ascontiguousarray(part, float), *shape)})
    detach, lost = np.empty((count, 6)), np.empty(count, bool)
    found.attach(detach=out(detach, count, 6), lost=out(lost, count))
    getattr(library(), law)(found)
    return BatchRelease(detach, lost)


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
    pieces = list(chunks(batch.count, 8192))
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
    arm = body.mass * (np.abs(body.com_offset) + LOST_SLIP * 0.1)
    swing = np.sqrt(arm * pull / body.grasp_inertia) + np.abs(twist[2])
    turning = np.abs(acceleration[2]) * batch.opening
    cycles = batch.opening * (swing + turning)
    doublings = np.ceil(np.log2(np.maximum(cycles / 8.0, 1.0)))
    return np.asarray(np.clip(doublings, 0, 6).astype(int))


# One release by the core.


def exact_pivot_release(case: ReleaseCase) -> Release:
    """The release by the non-smooth sliding pivot; no wrench."""
    return _pivot_release(compiled_release(case), 0, _nodes(case), None)


def pivot_steps(case: ReleaseCase, steps: int, *, paper: bool) -> tuple[Release, Array]:
    """The sliding pivot, in the paper's form or not, in about `steps` steps: its release without
    a wrench, and the relative states (K, 6)."""
    release, rows = compiled_release(case), _nodes(case, steps)
    release.paper, states = paper, np.empty((len(rows), 6))
    found = _pivot_release(release, steps, rows, states)
    return found, states[: found.times.size]


def _pivot_release(release: Structure, steps: int, rows: Array, states: Array | None) -> Release:
    onset, lost = np.empty(2), np.empty(1, np.int64)
    arrays = (
        out(rows, len(rows), 7),
        None if states is None else out(states, len(rows), 6),
        out(onset, 2),
        out(lost, 1),
    )
    count = library().pivot_release(release, steps, len(rows), *arrays)
    return Release.from_nodes(rows[:count], onset.tolist(), bool(lost[0]))


def surface_steps(case: ReleaseCase, steps: int) -> Release:
    """The release by even steps on the limit surface; no wrench, no onsets."""
    rows = np.empty((steps + 1, 7))
    library().surface_steps(compiled_release(case), steps, out(rows, steps + 1, 7))
    return Release.from_nodes(rows)


def exact_surface_release(case: ReleaseCase) -> Release:
    """The release by the time-stepping limit surface; no wrench, no onsets (see `slip_onset`)."""
    rows = _nodes(case)
    nodes = out(rows, len(rows), 7)
    count = library().surface_release(compiled_release(case), len(rows), nodes)
    if not count:
        raise MemoryError
    return Release.from_nodes(rows[:count])


def exact_releases(
    case: ReleaseCase, batch: ReleaseBatch, delays: Array, *, surface: bool
) -> BatchRelease:
    """The releases of a batch on a case's motion, each by the time-stepping limit surface or the
    sliding pivot as a single one.

    The batch's hands are ignored; delays (N,) [s]: of its openings after the case's. Threads share
    the work: compiled code releases Python's lock.
    """
    turning = 0.0 if batch.hands.drift is None else batch.hands.drift[2]
    angle, delays_total = batch.grasp_angle, float(_path(case).delays) + delays
    values = (*law_numbers(batch), angle, delays_total, turning, batch.opening)
    numbers = np.column_stack([np.broadcast_to(value, batch.count) for value in values])
    length = track_length(float(batch.opening.max(initial=0.0)))
    detach, track = np.empty((batch.count, 6)), np.empty((batch.count, length, 4))
    lost = np.empty(batch.count, np.int64)
    shared = compiled_release(case)

    def throw(throws: Throws) -> None:
        part = slice(int(throws[0]), int(throws[-1]) + 1)
        rows, n = np.ascontiguousarray(numbers[part], float), len(throws)
        nodes = length, out(track[part], n, length, 4)
        found = (out(detach[part], n, 6), *nodes, out(lost[part], n))
        if library().many_releases(shared, int(surface), n, array(rows, n, 12), *found):
            raise MemoryError

    count = threads() if batch.count >= PARALLEL else 1
    pieces = list(chunks(batch.count, -(-batch.count // count) or 1))
    if count == 1:
        for piece in pieces:
            throw(piece)
    else:
        with ThreadPoolExecutor(count) as pool:
            list(pool.map(throw, pieces))
    return BatchRelease(detach, lost > 0, track=track)


def relative_states(case: ReleaseCase, nodes: Array) -> Array:
    """Relative states (K + 1, 6) of the sliding pivot at `nodes` [s] of the opening.

    It takes one Runge-Kutta step between nodes, from sticking at the first. Its accuracy is that of
    an initial guess.
    """
    times, states = np.ascontiguousarray(nodes, float), np.empty((nodes.size, 6))
    arrays = array(times, nodes.size), out(states, nodes.size, 6)
    library().pivot_track(compiled_release(case), nodes.size, *arrays)
    return states


def _path(case: ReleaseCase) -> Trajectory:
    path = case.hand.path if isinstance(case.hand, MovedHand) else case.hand
    assert isinstance(path, Trajectory)
    return path


def _nodes(case: ReleaseCase, steps: int = 512) -> Array:
    """Rows for the nodes of a release in `steps` steps at most: time, CoM pose and twist."""
    path = _path(case)
    kinks = path.kinks - path.delays
    inside = np.count_nonzero((kinks > 0.0) & (kinks < case.grip.opening))
    # Events cut at most 200 steps in two.
    return np.empty((steps + 256 + 2 * inside, 7))


def compiled_release(case: ReleaseCase) -> Structure:
    """The case for the core."""
    path = _path(case)
    arm, turning = Structure("linkage", n=3), 0.0
    if isinstance(case.hand, MovedHand):
        arm, turning = case.hand.linkage, case.hand.turning
    motion, grip = path.core, _grip(case.grip)
    assert motion.n == arm.n
    release = Structure("release", angle=case.grasp_angle, turning=turning, law=law_numbers(case))
    release.delay = float(path.delays)
    release.attach(motion=motion, arm=arm, grip=grip)
    return release


def _grip(profile: GripProfile) -> Structure:
    """A grip force for the core."""
    breaks, curves = profile.cubics
    grip = Structure("grip", opening=profile.opening, stretch=1.0, pieces=curves.shape[1])
    grip.breaks, grip.curves = array(breaks, grip.pieces + 1), array(curves, 4, grip.pieces)
    return grip
