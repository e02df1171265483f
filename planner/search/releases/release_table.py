"""The table of sampled releases, and those of them that a solve for a target starts from."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from ....models import Array, Flags, FlightLaw, FlightState, ReadOnly
from ....problems import Pose, Scene
from ..library import Turns, nearest_landings


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

    def landings(self, height: float, flight: FlightLaw) -> Array:
        """x [m], theta [rad] and flight time [s] (3, N) of the landings at `height`; NaN without
        one."""
        return _landings(self, height, flight)

    def picked(self, chosen: npt.NDArray[Any]) -> Releases:
        """Some of the releases: flags (N,) or indices."""
        return Releases(*(getattr(self, name)[chosen] for name in ARRAYS))

    def key(self, index: int) -> bytes:
        """A release's coordinates and state at detach, as bytes that identify it in any table."""
        return bytes(self.q[index].tobytes() + self.detach[index].tobytes())


# A plan asks several times for one table and height.
@lru_cache(maxsize=4)
def _landings(releases: Releases, height: float, flight: FlightLaw) -> Array:
    return flight.land(releases.detach, height).T.copy()


#: Names of a table's arrays.
ARRAYS = ("q", "dq", "ddq", "run_up", "detach", "clear")


def joined(*parts: Releases) -> Releases:
    """The releases of all parts, one after the other."""
    return Releases(*(np.concatenate([getattr(p, name) for p in parts]) for name in ARRAYS))


def arrival(releases: Releases, scene: Scene, pose: Pose, within: float) -> tuple[float, float]:
    """The least pose error [m] of the landings at a pose, and the earliest time [s] at which one
    within a pose error [m] lands; inf for none."""
    x, theta, flown = releases.landings(pose.z, scene.flight)
    away = np.nan_to_num(scene.object.pose_error(*pose.miss(x, theta)), nan=np.inf)
    lands = releases.run_up + scene.gripper.profile().opening + flown
    return float(away.min(initial=np.inf)), float(lands[away <= within].min(initial=np.inf))


def nearest_releases(
    releases: Releases, scene: Scene, target: Pose, turns: Turns, count: int
) -> list[tuple[int, Pose, float]]:
    """(release's number, goal, pose error [m]) of the `count` releases that land nearest.

    With turns 'any' theta counts modulo full turns; an entry's goal has the turns it is for.
    """
    landings = releases.landings(target.z, scene.flight)
    return nearest_landings(scene, target, turns, landings, count)


def highest(releases: Releases, z: float, flight: FlightLaw) -> tuple[float, str]:
    """The height of the highest apex [m], and why no sampled release lands at a height z [m]."""
    if len(releases.q) == 0:
        return -math.inf, "no throw found: no sampled release keeps limits and grip"
    apex = float(flight.apex(FlightState(*releases.detach.T)).pose[1].max())
    if z <= apex:
        return apex, f"no throw found: no sampled release comes down through z {z:g} m"
    words = f"no throw found: no sampled release rises to z {z:g} m, at most about {apex:.2f} m"
    return apex, words
