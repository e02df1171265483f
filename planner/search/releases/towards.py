"""Releases drawn towards one target, each kind of motion for itself."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ....models import Array, Indices
from .release_table import Releases, joined
from .sampling import ReleaseSampler

#: Pose error [m] that stands for a condition that a release does not keep.
UNMET = 1000.0


#: Releases are of different kinds if a coordinate differs by this share of its range among them.
DIFFERENT = 0.25


@dataclass(frozen=True)
class TowardsSettings:
    """Rounds of draws, states drawn in each, and releases of a kind beside which they are drawn."""

    rounds: int = 3
    draws: int = 2048
    parents: int = 4


SETTINGS = TowardsSettings()


def kinds(q: Array) -> list[int]:
    """The first row of q (N, n) of each kind."""
    apart = DIFFERENT * np.ptp(q, axis=0) if len(q) else 0.0
    chosen, free = list[int](), np.ones(len(q), bool)
    while free.any():
        chosen.append(int(free.argmax()))
        free &= (np.abs(q - q[chosen[-1]]) > apart).any(axis=1)
    return chosen


def drawn_towards(
    sampler: ReleaseSampler, releases: Releases, away: Callable[[Releases], Array]
) -> tuple[Releases, list[int]]:
    """Releases that land nearer to a target, and the numbers of the nearest of each kind, in order.

    away: pose errors (N,) [m] of releases' landings, and `UNMET` for each condition that a release
    does not keep on its way; NaN for those that do not land. Of the best those that keep most
    conditions are returned: first the nearest of all; each next one differs most in its coordinates
    from those before it, as limits hold motions that are alike short of a target at one place.
    """
    rng = np.random.default_rng(0)
    found, errors = _arriving(releases, away)
    if not len(errors):
        return found, []
    nearest = found.q[np.argsort(errors, kind="stable")]
    middles, span = nearest[kinds(nearest)], np.ptp(nearest, axis=0) + 1e-9
    for _ in range(SETTINGS.rounds):
        parents = _nearest_of_kinds(found.q, errors, middles, span, SETTINGS.parents)
        found, errors = found.picked(parents), errors[parents]
        beside = np.resize(np.arange(len(errors)), SETTINGS.draws)
        drawn, drawn_errors = _arriving(sampler.perturb(found, beside, rng), away)
        found, errors = joined(found, drawn), np.append(errors, drawn_errors)
    best = _nearest_of_kinds(found.q, errors, middles, span, 1)
    best = best[np.argsort(errors[best], kind="stable")]
    unmet = errors[best] // UNMET
    best = best[unmet == unmet.min()]
    return found, best[_farthest_first(found.q[best] / span)].tolist()


def _arriving(releases: Releases, away: Callable[[Releases], Array]) -> tuple[Releases, Array]:
    """The releases that arrive, and their pose errors [m]."""
    errors = away(releases)
    arrive = np.isfinite(errors)
    return releases.picked(arrive), errors[arrive]


def _nearest_of_kinds(q: Array, errors: Array, middles: Array, span: Array, count: int) -> Indices:
    """The `count` rows of q (N, n) with the least errors of each kind, which is that of the
    nearest of its middles (K, n); span (n,): unit of distances."""
    off = (q[:, None] - middles) / span
    kind = (off**2).sum(axis=2).argmin(axis=1)
    order = np.argsort(errors, kind="stable")
    return np.concatenate([order[kind[order] == k][:count] for k in range(len(middles))])


def _farthest_first(q: Array) -> list[int]:
    """The rows of q (N, n): the first, then each that is farthest from all before it."""
    chosen, near = list[int](), np.full(len(q), np.inf)
    for _ in range(len(q)):
        chosen.append(int(near.argmax()))
        near = np.minimum(near, np.abs(q - q[chosen[-1]]).max(axis=1))
        near[chosen] = -1.0
    return chosen
