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
from .run_up import polynomial, run_up

Array = npt.NDArray[np.float64]

#: Time [s] between the cup's depths in a guess.
CUP_STEP = 0.02


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
        return {"T": duration, "t_f": flight}.get(name, 0.0)

    return with_accelerations(nlp, nlp.fill(value), np.diff(nodes))
