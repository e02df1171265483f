"""Sampled releases ever nearer to one target, where the table has too few like it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene
from .releases import Releases, ReleaseSampler, distances, joined

#: Releases kept from round to round, states drawn beside each, the most rounds.
PARENTS, CHILDREN, ROUNDS = 24, 12, 10
#: It goes on while two rounds bring the nearest landing this much nearer.
NEARER = 0.85
SEED = 7


def closer(sampler: ReleaseSampler, releases: Releases, target: Pose) -> Releases:
    """`releases` and, after them, new ones whose landings lie nearer the target.

    Each round draws states beside the releases that land nearest.
    """
    scene, rng = sampler.scene, np.random.default_rng(SEED)
    where = scene, target.plane_x, target.z, target.theta

    def nearest(some: Releases) -> npt.NDArray[np.int_]:
        return np.argsort(distances(some, *where), kind="stable")[:PARENTS]

    best = releases.picked(nearest(releases))
    new, misses = np.zeros(len(best.q), bool), [_miss(best, *where)] if len(best.q) else []
    while misses and len(misses) <= ROUNDS:
        if len(misses) > 2 and not misses[-1] < NEARER * misses[-3]:
            break
        drawn = sampler.beside(best, np.repeat(np.arange(len(best.q)), CHILDREN), rng)
        both, new = joined(best, drawn), np.append(new, np.ones(len(drawn.q), bool))
        order = nearest(both)
        best, new = both.picked(order), new[order]
        misses.append(_miss(best, *where))
    return joined(releases, best.picked(new))


def _miss(some: Releases, scene: Scene, x: float, height: float, theta: float | None) -> float:
    """Scaled distance [m] (39) of the nearest landing, whether it meets column or hand or not."""
    away = distances(some, scene, x, height, theta, detour=0.0)
    return float(away.min())
