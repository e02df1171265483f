"""The throw of a given motion by the non-smooth models: the truth plans are held to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...models import (
    FlightState,
    HandSamples,
    HandTrack,
    Release,
    ReleaseCase,
    pivot_wrench,
    time_to_height,
)
from ...problems import Scene
from ..compile import mapped
from .motion import Motion, PiecewiseMotion
from .mover import Mover

Array = npt.NDArray[np.float64]

#: Longest interval [s] between the instants at which sticking is checked before the opening.
CARRY_STEP = 0.002


@dataclass(frozen=True)
class MoverTrack:
    """The hand of a motion of the coordinates, counted from the opening's start [s]."""

    mover: Mover
    motion: Motion
    opening_time: float

    def at(self, times: Array) -> HandSamples:
        """The hand at `times` (K,) [s]."""
        hand = hand_samples(self.mover, self.motion, self.opening_time + times)
        return HandSamples(times, hand.pose, hand.twist, hand.acceleration)


def hand_samples(mover: Mover, motion: Motion, times: Array) -> HandSamples:
    """The hand at `times` of a motion of the coordinates."""
    return _hand(mover, times, *motion.at(times))


def _hand(mover: Mover, times: Array, *coordinates: Array) -> HandSamples:
    """The hand for q, dq, ddq, each (n, N)."""
    outputs = mapped(mover.motion)(*(rows.T for rows in coordinates))
    return HandSamples(times, *(o.T for o in outputs))


def case_of(scene: Scene, hand: HandTrack) -> ReleaseCase:
    """The scene's release along a hand motion."""
    return ReleaseCase(
        scene.body,
        scene.patch,
        scene.gripper.profile(),
        hand,
        scene.gravity,
        scene.grasp.angle,
    )


@dataclass(frozen=True)
class Landing:
    """Where and when the CoM comes down through a height; NaN if it never does."""

    x: float
    z: float
    theta: float
    flight_time: float
    state: FlightState


def landing(release: Release, height: float, gravity: float) -> Landing:
    """Flight of a release to `height` [m]."""
    time = time_to_height(release.detach, height, gravity)
    end = release.detach.after(time, gravity)
    return Landing(end.x, height if math.isfinite(time) else math.nan, end.theta, time, end)


def friction_use(scene: Scene, hand: HandSamples) -> tuple[Array, Array]:
    """Wrench that sticking needs, over the full grip's limits: (force share, torque share).

    For a held bar; shares above 1 slip.
    """
    theta = hand.pose[2] + scene.grasp.angle
    h = scene.com_offset
    f_x, f_z, torque = pivot_wrench(
        scene.body, scene.gravity, hand.motion, hand.twist[2], h * np.cos(theta), h * np.sin(theta)
    )
    limit = scene.patch.force_limit(scene.gripper.profile().full)
    return np.hypot(f_x, f_z) / limit, np.abs(torque) / (limit * scene.patch.torsion_arm)


def slip_while_carrying(
    scene: Scene, mover: Mover, motion: PiecewiseMotion, opening_time: float
) -> float:
    """Largest friction use (ellipsoid, 1 is the limit) from rest to the opening's start."""
    times, *coordinates = motion.closely(opening_time, CARRY_STEP)
    force, torque = friction_use(scene, _hand(mover, times, *coordinates))
    return float(np.sqrt((force**2 + torque**2).max()))


def kinks_of(motion: PiecewiseMotion, opening_time: float, opening: float) -> Array:
    """The motion's kinks inside the opening, from its start [s]."""
    times = motion.kinks - opening_time
    return np.asarray(times[(times > 0.0) & (times < opening)])
