"""Decision vectors to start an NLP from: of a sampled release, or of a throw of another NLP."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...models import Path
from ...problems import Scene
from ..check import Mover, case_of, relative_states
from ..ocp import (
    Block,
    Request,
    ThrowNlp,
    decision_vector,
    lower_end,
    opening_nodes,
    stage_times,
)
from ..result import PlannedThrow
from .launch import polynomial, run_up
from .release_table import Releases

Array = npt.NDArray[np.float64]

#: How long before and after the landing height [s] the cup's depths are looked for, and in
#: how many instants.
CUP_SPAN, CUP_INSTANTS = (0.15, 0.3), 181


def guess_from(
    nlp: ThrowNlp, scene: Scene, mover: Mover, releases: Releases, index: int, flight: float
) -> Array:
    """Decision vector that starts the NLP from release `index`, which flies for `flight` [s]."""
    s, request = nlp.structure, Request(scene, mover)
    q, dq, ddq = releases.q[index], releases.dq[index], releases.ddq[index]
    duration = float(releases.run_up[index])
    nodes, times = request.nodes, stage_times(request, duration)
    launch = run_up(mover.start, q, dq, ddq, duration)
    launched = times[: s.opens + 1, None]
    before = [polynomial(launch, launched, k).T for k in range(3)]
    opening = Path.cubics(nodes[[0, -1]], q[None], dq[None], ddq[None], 0 * q[None])
    states = [np.hstack(pair) for pair in zip(before, opening.at(nodes[1:]), strict=True)]
    # A step in the middle of each interval too: one alone is rough.
    fine = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:]) / 2]))
    track = relative_states(case_of(scene, mover.hand(opening)), fine)[::2]
    relative = track if s.pivot else track[:, [0, 1, 3, 4]]
    entries = _cup_times(scene, releases.detach[index], flight, nlp.count("t_cup"))

    def other(block: Block) -> float:
        if block.name in ("t_rim", "t_cup"):
            return float(entries[block.index + (block.name == "t_cup")])
        return flight if block.name == "t_f" else 0.0

    return decision_vector(nlp, times, states, lambda k, _: relative[k - s.opens], other)


def _cup_times(scene: Scene, detach: Array, flight: float, depths: int) -> Array:
    """When (1 + depths,) [s] after detach the bar's lowest corner is at the rim, and the middle
    of its lower end at each depth below; none without a cup.

    detach (6,): CoM pose and twist. The landing height may well be above the rim.
    """
    cup, target = scene.cup, scene.target
    if cup is None or target is None:
        return np.zeros(0)
    times = flight + np.linspace(-CUP_SPAN[0], CUP_SPAN[1], CUP_INSTANTS)
    z = detach[1] + (detach[4] - scene.gravity / 2 * times) * times
    theta = detach[2] + detach[5] * times
    middle = z + lower_end(scene, target) * np.sin(theta)
    corner = middle - scene.object.width / 2 * np.abs(np.cos(theta))

    def when(heights: Array, asked: Array) -> Array:
        # Falling from here on, as far as the spin lets it.
        depth = np.maximum.accumulate(cup.rim - heights)
        return np.interp(asked, depth + 1e-9 * np.arange(times.size), times)

    asked = cup.insertion * np.arange(depths) / max(depths - 1, 1)
    return np.append(when(corner, np.zeros(1)), when(middle, asked))


def refit(nlp: ThrowNlp, throw: PlannedThrow, request: Request) -> Array:
    """Decision vector of the request's `nlp` from a throw of another."""
    source, x = throw.nlp, throw.solution.x
    s, old = nlp.structure, source.structure
    times = stage_times(request, throw.opening_time)
    flight = float(source.block(x, "t_f", old.detach)[0])  # type: ignore[index]
    size = 6 if s.pivot else 4
    # The source's opening may have other intervals.
    before = opening_nodes(throw.scene.mesh, request.scene.gripper.profile().opening)
    states = [source.block(x, "rel", old.opens + i) for i in range(1, old.opening + 1)]
    track = np.array([np.zeros(size), *[state for state in states if state is not None]])
    delays = [0.0] if request.window is None else [0.0, *request.window.delays]

    def relative(k: int, opening: int) -> Array:
        since = request.nodes[k - s.carry] - delays[opening]
        return np.array([np.interp(since, before, track[:, i]) for i in range(size)])

    depths, old_depths = nlp.count("t_cup"), source.count("t_cup")
    entered = [source.block(x, "t_cup", old.detach, i) for i in range(old_depths)]
    entries = [float(time[0]) for time in entered if time is not None]

    def other(block: Block) -> Array | float:
        if block.name == "t_cup":
            share = block.index / max(depths - 1, 1)
            return float(np.interp(share, np.linspace(0.0, 1.0, old_depths), entries))
        if block.name == "t_rim":
            return np.asarray(source.block(x, "t_rim", old.detach))
        if block.name == "t_f":
            # Those of other openings start at the window's end.
            late = times[-1] - times[s.detach]
            return flight if block.index == 0 else flight - late
        return 0.0

    return decision_vector(nlp, times, list(throw.planned.at(times)), relative, other)
