"""A sampled release as the starting point of an NLP."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ..problems.scene import Scene
from .context import JERK_UNIT
from .exact_release import relative_states
from .motion import PlannedMotion, stage_times
from .mover import Mover
from .nlp import ThrowNlp
from .numbers import opening_nodes, with_accelerations
from .releases import Releases
from .rollout import MoverTrack, case_of

Array = npt.NDArray[np.float64]
#: q, dq, ddq, each (n, K).
Coordinates = tuple[Array, Array, Array]

#: Time [s] between the cup's depths in a guess.
CUP_STEP = 0.02


def guess_from(
    nlp: ThrowNlp, scene: Scene, mover: Mover, releases: Releases, index: int, flight: float
) -> Array:
    """Decision vector that starts the NLP from release `index`, which flies for `flight` [s]."""
    s = nlp.structure
    q, dq, ddq = releases.q[index], releases.dq[index], releases.ddq[index]
    run_up = float(releases.run_up[index])
    nodes = opening_nodes(scene.mesh, scene.gripper.profile().opening)
    times = stage_times(s, run_up, nodes, 0.0)
    before = _run_up(mover, q, dq, ddq, run_up, times[: s.opens + 1])
    opening = PlannedMotion(nodes[[0, -1]], q[None], dq[None], ddq[None], 0 * q[None])
    during = opening.at(nodes[1:])
    coordinates = {
        name: np.hstack(pair)
        for name, *pair in zip(("q", "dq", "ddq"), before, during, strict=True)
    }
    # A step in the middle of each interval too: one alone is rough.
    fine = np.sort(np.concatenate([nodes, (nodes[:-1] + nodes[1:]) / 2]))
    track = relative_states(case_of(scene, MoverTrack(mover, opening, 0.0)), fine)[::2].T
    relative = track if s.pivot else track[[0, 1, 3, 4]]
    steps = np.diff(times)
    change = np.diff(coordinates["ddq" if s.jerk_control else "dq"], axis=1) / steps
    control = change / JERK_UNIT if s.jerk_control else change

    def value(name: str, k: int) -> Array | float:
        if name in coordinates:
            return np.asarray(coordinates[name][:, k])
        if name == "c":
            return np.asarray(control[:, k])
        if name == "rel":
            return np.asarray(relative[:, k - s.opens])
        if name.startswith("t_cup"):
            return flight + CUP_STEP * (int(name[5:]) - (s.cup - 1) / 2)
        return {"T": run_up, "t_f": flight}.get(name, 0.0)

    return with_accelerations(nlp, nlp.fill(value), np.diff(nodes))


def _run_up(
    mover: Mover, q: Array, dq: Array, ddq: Array, run_up: float, times: Array
) -> Coordinates:
    """Coordinates at `times` on the shortest polynomial from rest to (q, dq, ddq)."""
    t, end = times[None], run_up
    q, dq, ddq = q[:, None], dq[:, None], ddq[:, None]
    if mover.start is None:
        # Rate a t^2 + b t^3: the start is where it falls.
        a, b = 3 * dq / end**2 - ddq / end, ddq / end**2 - 2 * dq / end**3
        place = q - a * (end**3 - t**3) / 3 - b * (end**4 - t**4) / 4
        return place, a * t**2 + b * t**3, 2 * a * t + 3 * b * t**2
    start = mover.start[:, None]
    gap = q - start
    c3 = (20 * gap - 8 * dq * end + ddq * end**2) / (2 * end**3)
    c4 = (-30 * gap + 14 * dq * end - 2 * ddq * end**2) / (2 * end**4)
    c5 = (12 * gap - 6 * dq * end + ddq * end**2) / (2 * end**5)
    return (
        start + c3 * t**3 + c4 * t**4 + c5 * t**5,
        3 * c3 * t**2 + 4 * c4 * t**3 + 5 * c5 * t**4,
        6 * c3 * t + 12 * c4 * t**2 + 20 * c5 * t**3,
    )
