"""A solved throw as the starting point of another NLP of the same scene."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..ocp import JERK_UNIT, ThrowNlp, opening_nodes, stage_times, with_accelerations
from ..result import PlannedThrow
from .correction import Search

Array = npt.NDArray[np.float64]


def again(nlp: ThrowNlp, search: Search) -> Array:
    """Decision vector of `nlp` from the search's last throw, which breaks something."""
    assert search.broken is not None
    scene = search.scene
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    return refit(nlp, search.broken, nodes, 0.0, np.zeros(0))


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

    entered = [source.block(x, f"t_cup{i}", old.detach) for i in range(old.cup)]
    entries = [float(time[0]) for time in entered if time is not None]
    depths = np.linspace(0.0, 1.0, len(entries))

    def scenario(name: str, k: int) -> Array:
        return relative_at(times[k] - throw.opening_time - delays[int(name.rsplit("_", 1)[1])])

    def value(name: str, k: int) -> Array | float:
        if name in coordinates:
            return np.asarray(coordinates[name][:, k])
        if name == "c":
            kind = "ddq" if s.jerk_control else "dq"
            change = coordinates[kind][:, k + 1] - coordinates[kind][:, k]
            slope = change / (times[k + 1] - times[k])
            return np.asarray(slope / JERK_UNIT if s.jerk_control else slope)
        if name == "T":
            return throw.opening_time - s.early * step
        if name == "rel":
            return relative_at(float(nodes[k - s.opens]))
        if name.startswith("rel_"):
            return scenario(name, k)
        if name.startswith("t_cup"):
            return float(np.interp(int(name[5:]) / max(s.cup - 1, 1), depths, entries))
        if name == "t_rim":
            return np.asarray(source.block(x, name, old.detach))
        if name.startswith("t_f_"):
            return flight - s.late * step
        return flight if name == "t_f" else 0.0

    return with_accelerations(nlp, nlp.fill(value), np.diff(nodes))
