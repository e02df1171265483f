"""Starts of an NLP: decision vectors of throws; and the rest of a swing from an instant on."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from ...models import Array, FlightState, Trajectory
from ...models.release import ReleaseCase, relative_states
from ...problems import Scene
from ..ocp import TURN, Block, Refinement, Request, ThrowNlp, lower_end
from ..result import PlannedThrow
from ..throw import NO_SAMPLES, TICK, Manipulator, Throw


def _relative(nlp: ThrowNlp, case: ReleaseCase, nodes: Array) -> Array:
    """Relative states (K + 1, 6; 4 without the pivot) of the sliding pivot at the nodes."""
    # Two steps in each interval: one alone is too rough.
    fine = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:]) / 2]))
    track = relative_states(case, fine)[::2]
    return track if nlp.structure.pivot else track[:, [0, 1, 3, 4]]


def _cup_times(nlp: ThrowNlp, scene: Scene, detach: Array, flight: float) -> Array:
    """Times (1 + depths,) [s] after detach: of the bar's lowest corner at the rim, then of the
    middle of its lower end at each depth below; none without a cup.

    detach (6,): CoM pose and twist. The landing height may be above the rim.
    """
    cup, target, depths = scene.cup, scene.target, nlp.count("t_cup")
    if cup is None or target is None:
        return np.zeros(0)
    # From 0.15 s before the landing height to 0.3 s after it, every 2.5 ms.
    times = flight + np.linspace(-0.15, 0.3, 181)
    _, z, theta = scene.flight.after(FlightState(*detach), times).pose
    lands = target.theta
    if nlp.structure.elastic or lands is None:
        lands = float(np.interp(flight, times, theta))
    along, across, radius = lower_end(scene.object, lands)
    middle = z + along * np.sin(theta) + across * np.cos(theta) - radius
    half = 0.0 if scene.object.outline else scene.object.width / 2
    corner = middle - half * np.abs(np.cos(theta))

    def times_at(heights: Array, depth: Array) -> Array:
        # The end of a spinning bar may rise: the largest depth until each instant counts.
        deepest = np.maximum.accumulate(cup.rim - heights)
        return np.interp(depth, deepest + 1e-9 * np.arange(times.size), times)

    insertions = cup.insertion * np.arange(depths) / max(depths - 1, 1)
    return np.append(times_at(corner, np.zeros(1)), times_at(middle, insertions))


def initial_guess_from(nlp: ThrowNlp, throw: PlannedThrow) -> Array:
    """Decision vector of `nlp` from a throw: a sampled one, or another NLP's."""
    s = nlp.structure
    request = nlp.request
    times = request.times(throw.opening_time)
    size = 6 if s.pivot else 4
    before, track, flight, entries = _as_thrown(nlp, throw)
    delays = [0.0, *(() if request.window is None else request.window.delays)]

    def relative(k: int, opening: int) -> Array:
        since = request.nodes[k - s.carry] - delays[opening]
        return np.array([np.interp(since, before, track[:, i]) for i in range(size)])

    depths = nlp.count("t_cup")

    def other(block: Block) -> Array | float:
        if block.name == "t_cup":
            share = block.index / max(depths - 1, 1)
            return float(np.interp(share, np.linspace(0.0, 1.0, len(entries) - 1), entries[1:]))
        if block.name == "t_rim":
            return float(entries[0])
        if block.name == "t_f":
            # The flights of other openings start at the window's end.
            late = times[-1] - times[s.detach]
            return flight if block.index == 0 else flight - late
        # Normals that part an object from a bin's rim are not at their bounds.
        return math.pi / 4 if block.name == TURN.name else 0.0

    return nlp.decision_vector(times, list(throw.planned.at(times)), relative, other)


def guess_of(throw: PlannedThrow) -> Callable[[ThrowNlp], Array]:
    """What makes the decision vector of an NLP from a throw."""
    return partial(initial_guess_from, throw=throw)


def _as_thrown(nlp: ThrowNlp, throw: PlannedThrow) -> tuple[Array, Array, float, Array]:
    """Nodes [s] of a throw's opening, relative states there; flight time [s] from the last one,
    times into the cup.

    Of the solution of an NLP with these nodes; else of the exact model."""
    nodes, source = nlp.request.opening_nodes, throw.layout
    own = Request(throw.scene, throw.manipulator, refinement=throw.refinement).opening_nodes
    if source is None or throw.solution is None or not np.array_equal(own, nodes):
        pivot, late = throw.exact, nodes[-1] - throw.scene.gripper.profile().opening
        flown, relative = pivot.landing.flight_time, _relative(nlp, pivot.case, nodes)
        into = _cup_times(nlp, throw.scene, pivot.release.end, flown)
        return nodes, relative, flown - late, into - late
    x, old = throw.solution.x, source.structure
    states = [source.block(x, "rel", old.opens + i) for i in range(1, old.opening + 1)]
    known = [state for state in states if state is not None]
    track = np.array([np.zeros_like(known[0]), *known])
    flight = source.block(x, "t_f", old.detach)
    entered = [source.block(x, "t_cup", old.detach, i) for i in range(source.count("t_cup"))]
    entered.insert(0, source.block(x, "t_rim", old.detach))
    assert flight is not None
    entries = [time for time in entered if time is not None]
    return nodes, track, float(flight[0]), np.concatenate([np.zeros(0), *entries])


def remaining_throw(throw: PlannedThrow, manipulator: Manipulator) -> PlannedThrow:
    """The rest of a throw from its sample nearest to the state that `manipulator` begins in."""
    assert manipulator.start is not None
    samples, weight = throw.samples, manipulator.hard.dq
    off = np.abs(samples.q - manipulator.start)
    off += np.abs(samples.dq - manipulator.initial_motion[0]) / weight
    before = math.floor(throw.opening_time / TICK)
    time = TICK * int(off[:before].sum(axis=1).argmin())
    rest = remaining_trajectory(throw.deciding, time, manipulator, throw.planned)
    return replace(rest, refinement=Refinement(quiet=throw.refinement.quiet))


def remaining_trajectory(
    throw: Throw, time: float, manipulator: Manipulator, planned: Trajectory | None = None
) -> PlannedThrow:
    """The rest of a throw's motion from `time` [s] on; planned: its motion up to detach."""
    path, opens = throw.path.shifted(time), throw.opening_time - time
    rest = replace(
        throw, manipulator=manipulator, path=path, opening_time=opens, samples=NO_SAMPLES
    )
    return PlannedThrow(path if planned is None else planned.shifted(time), rest, 0.0, (0, 0))
