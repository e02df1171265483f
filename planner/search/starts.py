"""Which sampled releases a plan starts from."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from ...problems import Pose, Scene
from .release_room import flies_past_column
from .releases import Releases, nearest

Turns = Literal["exact", "any"]


def starts(
    releases: Releases, scene: Scene, target: Pose, turns: Turns, count: int
) -> list[tuple[int, Pose, float]]:
    """(release's number, target, scaled distance [m]) of the `count` nearest landings.

    With turns 'any' theta counts modulo full turns, and each entry says which it is for.
    """
    found: list[tuple[int, Pose, float]] = []
    for goal in goals_of(releases, scene, target, turns):
        pairs = zip(*nearest(releases, scene, goal.plane_x, goal.z, goal.theta, count), strict=True)
        found += [(int(i), goal, float(d)) for i, d in pairs]
    return sorted(found, key=lambda entry: entry[2])


def past_column(releases: Releases, scene: Scene, height: float) -> Releases:
    """The releases whose bar flies past the base column down to `height` [m]; all, if none does."""
    _, _, time = releases.landings(height, scene.gravity)
    found = flies_past_column(scene, releases.detach, time)
    return releases.picked(found) if found.any() else releases


def goals_of(releases: Releases, scene: Scene, target: Pose, turns: Turns) -> list[Pose]:
    """The target; with turns 'any' at the turns about what is usual in the table."""
    if turns == "exact" or target.theta is None:
        return [target]
    _, thetas, _ = releases.landings(target.z, scene.gravity)
    usual = float(np.nanmedian(thetas)) if np.isfinite(thetas).any() else target.theta
    nearest_turn = round((usual - target.theta) / (2 * math.pi))
    return [target.turned(2 * math.pi * (nearest_turn + k)) for k in range(-2, 3)]
