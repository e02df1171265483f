"""The table of sampled releases, and those of them that a solve for a target starts from."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import Array, Flags, FlightLaw, FlightState, Indices, ReadOnly
from ...problems import Pose, Scene
from ..library import Turns

#: Nearest landings among which starting points are chosen.
POOL = 400
#: Releases differ if a coordinate, a rate or the flight time does by this share of its range.
DIFFERENT = 0.15
#: Height [m] above every sampled apex from which a target is out of reach.
HEIGHT_ROOM = 0.25


@dataclass(frozen=True, repr=False, eq=False)
class Releases(ReadOnly):
    """Feasible sampled releases: (N, n) coordinates, rates and accelerations at the
    opening's start, run-up time (N,), detach states (N, 6): x, z, theta, v_x, v_z, omega,
    and whether (N,) the held bar clears column and arm, and the arm itself, on the run-up, and the
    flying bar arm and palm.
    """

    q: Array
    dq: Array
    ddq: Array
    run_up: Array
    detach: Array
    clear: Flags

    def landings(self, height: float, flight: FlightLaw) -> tuple[Array, Array, Array]:
        """x [m], theta [rad] and flight time [s] of the landing at `height`; NaN without one."""
        x, theta, time = _landings(self, height, flight)
        return x, theta, time

    def flight_time(self, index: int, height: float, flight: FlightLaw) -> float:
        """Time [s] that release `index` flies down to `height`; NaN if it does not."""
        return float(self.landings(height, flight)[2][index])

    def picked(self, chosen: npt.NDArray[Any]) -> Releases:
        """Some of the releases: flags (N,) or indices."""
        return Releases(*(getattr(self, name)[chosen] for name in ARRAYS))


# A plan asks several times for one table and height.


@lru_cache(maxsize=4)
def _landings(releases: Releases, height: float, flight: FlightLaw) -> Array:
    return flight.land(releases.detach, height).T.copy()


@lru_cache(maxsize=4)
def _shares(releases: Releases, height: float, flight: FlightLaw) -> Array:
    """Coordinates, rates and flight times (N, 2n + 1), each as a share of its range."""
    time = releases.landings(height, flight)[2]
    states = np.hstack([releases.q, releases.dq, time[:, None]])
    spread = np.nanmax(states, axis=0) - np.nanmin(states, axis=0)
    return np.asarray(states / np.maximum(spread, 1e-9))


#: Names of a table's arrays.
ARRAYS = ("q", "dq", "ddq", "run_up", "detach", "clear")


def joined(*parts: Releases) -> Releases:
    """The releases of all parts, one after the other."""
    return Releases(*(np.concatenate([getattr(p, name) for p in parts]) for name in ARRAYS))


def distances(releases: Releases, scene: Scene, target: Pose) -> Array:
    """Pose errors [m] (39) (N,) of the landings; inf without a landing."""
    x, theta, time = releases.landings(target.z, scene.flight)
    distance = scene.object.pose_error(*target.miss(x, theta))
    return np.asarray(np.where(np.isfinite(time), distance, np.inf))


def arrival(releases: Releases, scene: Scene, pose: Pose, within: float) -> tuple[float, float]:
    """The least pose error [m] of the landings at a pose, and the earliest time [s] at which one
    within a pose error [m] lands; inf for none."""
    away = distances(releases, scene, pose)
    flown = releases.landings(pose.z, scene.flight)[2]
    lands = releases.run_up + scene.gripper.profile().opening + flown
    return float(away.min(initial=np.inf)), float(lands[away <= within].min(initial=np.inf))


def nearest(releases: Releases, scene: Scene, target: Pose, count: int) -> tuple[Indices, Array]:
    """Indices and pose errors [m] (39) of `count` near landings, nearest first.

    The releases differ, except if fewer than `count` of the nearest do.
    """
    distance = distances(releases, scene, target)
    size = min(max(POOL, count), len(distance))
    if size == 0:
        return np.zeros(0, int), np.zeros(0)
    pool = np.argpartition(distance, size - 1)[:size]
    pool = pool[np.argsort(distance[pool], kind="stable")]
    pool = pool[np.isfinite(distance[pool])]
    if count > 1 and len(pool):
        pool = pool[_different(_shares(releases, target.z, scene.flight)[pool], count)]
    found = pool[:count]
    return found, distance[found]


def _different(states: Array, count: int) -> Indices:
    """Indices, in order, of at most `count` rows that differ, then of other rows up to `count`."""
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
    """(release's number, target, pose error [m]) of the `count` nearest landings.

    With turns 'any' theta counts modulo full turns; an entry's target has the turns it is for.
    """
    found: list[tuple[int, Pose, float]] = []
    for goal in goals_of(releases, scene, target, turns):
        pairs = zip(*nearest(releases, scene, goal, count), strict=True)
        found += [(int(i), goal, float(d)) for i, d in pairs]
    return sorted(found, key=lambda entry: entry[2])


def goals_of(releases: Releases, scene: Scene, target: Pose, turns: Turns) -> list[Pose]:
    """The target; with turns 'any' at the turns around the table's median."""
    if turns == "exact" or target.theta is None:
        return [target]
    _, thetas, _ = releases.landings(target.z, scene.flight)
    usual = float(np.nanmedian(thetas)) if np.isfinite(thetas).any() else target.theta
    nearest_turn = round((usual - target.theta) / (2 * math.pi))
    return [target.turned(2 * math.pi * (nearest_turn + k)) for k in range(-2, 3)]


def highest(releases: Releases, target: Pose, flight: FlightLaw) -> tuple[bool, Pose | None, str]:
    """The highest apex, if no sampled release lands at the target's height.

    Returns whether the target is out of reach above it, the pose at the apex, and words.
    """
    if len(releases.q) == 0:
        return False, None, "no throw found: no sampled release keeps limits and grip"
    x, apex, theta = flight.apex(FlightState(*releases.detach.T)).pose
    i = int(np.argmax(apex))
    angle = None if target.theta is None else float(theta[i])
    pose = replace(target.in_plane(float(x[i]), angle), z=float(apex[i]))
    far = bool(target.z > apex[i] + HEIGHT_ROOM)
    kind = "out of reach" if far else "no throw found"
    if target.z <= apex[i]:
        return far, pose, f"{kind}: no sampled release comes down through z {target.z:g} m"
    apex_words = f"at most about {apex[i]:.2f} m"
    return far, pose, f"{kind}: no sampled release rises to z {target.z:g} m, {apex_words}"
