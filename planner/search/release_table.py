"""The table of sampled releases, and which of them a solve for a target starts from."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from ...models import Array, Flags, Indices, land
from ...problems import Pose, Scene
from .launch import flies_past_column

Turns = Literal["exact", "any"]

#: Nearest landings among which starting points are chosen, and how far apart these are: as a
#: share of the table's range of some coordinate, rate or the flight time.
POOL, DIFFERENT = 400, 0.15
#: How much nearer [m, scaled error] a landing must be for a throw that meets column or hand.
DETOUR = 0.1


@dataclass(frozen=True, repr=False)
class Releases:
    """Feasible sampled releases: (N, n) coordinates, rates and accelerations at the
    opening's start, run-up time (N,), detach states (N, 6): x, z, theta, v_x, v_z, omega,
    and whether (N,) the bar clears the base column on the run-up, and then the hand's body.
    """

    q: Array
    dq: Array
    ddq: Array
    run_up: Array
    detach: Array
    clear: Flags

    # Of the last height asked for: a plan asks several times for one.
    _last: dict[str, Any] = field(default_factory=dict, repr=False, init=False)

    def landings(self, height: float, gravity: float) -> tuple[Array, Array, Array]:
        """x [m], theta [rad] and flight time [s] of coming down through `height`; NaN if not."""
        x, theta, time = self._at(height, gravity)["landings"]
        return x, theta, time

    def flight_time(self, index: int, height: float, gravity: float) -> float:
        """How long release `index` flies down to `height` [s]; NaN if it does not."""
        return float(self.landings(height, gravity)[2][index])

    def shares(self, height: float, gravity: float) -> Array:
        """Coordinates, rates and flight times (N, 2n + 1), each as a share of its range."""
        last = self._at(height, gravity)
        if "shares" not in last:
            states = np.hstack([self.q, self.dq, last["landings"][2][:, None]])
            spread = np.nanmax(states, axis=0) - np.nanmin(states, axis=0)
            last["shares"] = states / np.maximum(spread, 1e-9)
        return np.asarray(last["shares"])

    def _at(self, height: float, gravity: float) -> dict[str, Any]:
        if self._last.get("for") != (height, gravity):
            self._last.clear()
            found = land(self.detach, height, gravity).T.copy()
            self._last.update({"for": (height, gravity), "landings": found})
        return self._last

    def picked(self, chosen: npt.NDArray[Any]) -> Releases:
        """Some of the releases: flags (N,) or indices."""
        return Releases(*(getattr(self, name)[chosen] for name in ARRAYS))


#: What a table of releases holds.
ARRAYS = ("q", "dq", "ddq", "run_up", "detach", "clear")


def joined(*parts: Releases) -> Releases:
    """The releases of all parts, one after the other."""
    return Releases(*(np.concatenate([getattr(p, name) for p in parts]) for name in ARRAYS))


def distances(
    releases: Releases,
    scene: Scene,
    x: float,
    height: float,
    theta: float | None,
    *,
    detour: float = DETOUR,
) -> Array:
    """Scaled distances [m] (39) (N,) of the landings; inf where there is none.

    Throws whose bar meets column or hand count as `detour` [m] farther.
    """
    land_x, land_theta, time = releases.landings(height, scene.gravity)
    distance = np.abs(land_x - x)
    if theta is not None:
        distance = distance + np.abs(land_theta - theta) * scene.object.length / 2
    distance = np.where(np.isfinite(time), distance, np.inf)
    return np.asarray(distance + np.where(releases.clear, 0.0, detour))


def nearest(
    releases: Releases,
    scene: Scene,
    x: float,
    height: float,
    theta: float | None,
    count: int,
) -> tuple[Indices, Array]:
    """Indices and scaled distances [m] (39) of `count` near landings, nearest first.

    Throws whose bar clears column and hand come first where they are not much farther. Each
    differs from those before it; where there are too few such among the nearest, others
    like them fill up.
    """
    distance = distances(releases, scene, x, height, theta)
    size = min(max(POOL, count), len(distance))
    if size == 0:
        return np.zeros(0, int), np.zeros(0)
    pool = np.argpartition(distance, size - 1)[:size]
    pool = pool[np.argsort(distance[pool], kind="stable")]
    pool = pool[np.isfinite(distance[pool])]
    if count > 1 and len(pool):
        pool = pool[_different(releases.shares(height, scene.gravity)[pool], count)]
    found = pool[:count]
    return found, distance[found] - np.where(releases.clear[found], 0.0, DETOUR)


def _different(states: Array, count: int) -> Indices:
    """Indices of at most `count` rows, in order, that differ; filled up with other rows."""
    chosen: list[int] = []
    free = np.ones(len(states), bool)
    while len(chosen) < count and free.any():
        i = int(free.argmax())
        chosen.append(i)
        free &= np.abs(states - states[i]).max(axis=1) > DIFFERENT
    others = np.setdiff1d(np.arange(len(states)), chosen)[: count - len(chosen)]
    return np.sort(np.concatenate([np.array(chosen, int), others]))


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
