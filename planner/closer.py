"""Sampled releases ever nearer to one target, where the table has too few like it."""

from __future__ import annotations

import numpy as np

from ..problems.scene import Pose
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

    def nearest(some: Releases) -> tuple[Releases, float]:
        away = distances(some, scene, target.plane_x, target.z, target.theta)
        order = np.argsort(away, kind="stable")[:PARENTS]
        return some.picked(order), float(away[order[0]])

    if not len(releases.q):
        return releases
    best, miss = nearest(releases)
    misses = [miss]
    while len(misses) <= ROUNDS and not (len(misses) > 2 and miss > NEARER * misses[-3]):
        parents = np.repeat(np.arange(len(best.q)), CHILDREN)
        best, miss = nearest(joined(best, sampler.beside(best, parents, rng)))
        misses.append(miss)
    return joined(releases, best)
