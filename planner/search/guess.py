"""Decision vectors to start an NLP from: of a sampled release, or of a throw of another NLP."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...models import Path
from ...problems import Scene
from ..check import Mover, case_of, relative_states
from ..ocp import (
    JERK_UNIT,
    Block,
    ThrowNlp,
    lower_end,
    opening_nodes,
    stage_times,
    with_accelerations,
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
    s = nlp.structure
    q, dq, ddq = releases.q[index], releases.dq[index], releases.ddq[index]
    duration = float(releases.run_up[index])
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    times = stage_times(s, duration, nodes, 0.0)
    launch = run_up(mover.start, q, dq, ddq, duration)
    launched = times[: s.opens + 1, None]
    before = [polynomial(launch, launched, k).T for k in range(3)]
    opening = Path.cubics(nodes[[0, -1]], q[None], dq[None], ddq[None], 0 * q[None])
    during = opening.at(nodes[1:])
    coordinates = {
        name: np.hstack(pair)
        for name, *pair in zip(("q", "dq", "ddq"), before, during, strict=True)
    }
    # A step in the middle of each interval too: one alone is rough.
    fine = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:]) / 2]))
    track = relative_states(case_of(scene, mover.hand(opening)), fine)[::2].T
    relative = track if s.pivot else track[[0, 1, 3, 4]]
    steps = np.diff(times)
    change = np.diff(coordinates["ddq" if s.jerk_control else "dq"], axis=1) / steps
    control = change / JERK_UNIT if s.jerk_control else change

    entries = _cup_times(scene, releases.detach[index], flight, nlp.count("t_cup"))

    def value(block: Block, k: int) -> Array | float:
        name = block.name
        if name in coordinates:
            return np.asarray(coordinates[name][:, k])
        if name == "c":
            return np.asarray(control[:, k])
        if name == "rel":
            return np.asarray(relative[:, k - s.opens])
        if name in ("t_rim", "t_cup"):
            return float(entries[block.index + (name == "t_cup")])
        return {"T": duration, "t_f": flight}.get(name, 0.0)

    return with_accelerations(nlp, nlp.fill(value), np.diff(nodes))


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


def refit(nlp: ThrowNlp, throw: PlannedThrow, nodes: Array, step: float, delays: Array) -> Array:
    """Decision vector of `nlp` from a throw of another; delays (scenarios,) [s]."""
    source = throw.nlp
    s, old = nlp.structure, source.structure
    times = stage_times(s, throw.opening_time, nodes, step)
    coordinates = dict(zip(("q", "dq", "ddq"), throw.planned.at(times), strict=True))
    x = throw.solution.x
    flight = float(source.block(x, "t_f", old.detach)[0])  # type: ignore[index]
    size = 6 if s.pivot else 4
    # The source's opening may have other intervals.
    before = opening_nodes(throw.scene.mesh, float(nodes[-1]))
    relative = [source.block(x, "rel", old.opens + i) for i in range(1, old.opening + 1)]
    track = np.array([np.zeros(size), *[r for r in relative if r is not None]])

    def relative_at(since: float) -> Array:
        return np.array([np.interp(since, before, track[:, i]) for i in range(size)])

    depths, old_depths = nlp.count("t_cup"), source.count("t_cup")
    entered = [source.block(x, "t_cup", old.detach, i) for i in range(old_depths)]
    entries = [float(time[0]) for time in entered if time is not None]

    def value(block: Block, k: int) -> Array | float:
        name, number = block.name, block.index
        if name in coordinates:
            return np.asarray(coordinates[name][:, k])
        if name == "c":
            kind = "ddq" if s.jerk_control else "dq"
            change = coordinates[kind][:, k + 1] - coordinates[kind][:, k]
            slope = change / (times[k + 1] - times[k])
            return np.asarray(slope / JERK_UNIT if s.jerk_control else slope)
        if name == "T":
            return throw.opening_time - s.early * step
        if name == "rel" and number == 0:
            return relative_at(float(nodes[k - s.opens]))
        if name == "rel":
            return relative_at(times[k] - throw.opening_time - delays[number - 1])
        if name == "t_cup":
            share = number / max(depths - 1, 1)
            return float(np.interp(share, np.linspace(0.0, 1.0, old_depths), entries))
        if name == "t_rim":
            return np.asarray(source.block(x, name, old.detach))
        if name == "t_f":
            return flight if number == 0 else flight - s.late * step
        return 0.0

    return with_accelerations(nlp, nlp.fill(value), np.diff(nodes))
