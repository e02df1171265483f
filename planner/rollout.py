"""The throw of a given motion by the non-smooth models: the truth plans are held to."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..models.contact import pivot_wrench
from ..models.flight import FlightState, time_to_height
from ..models.release import HandSamples, HandTrack, Release, ReleaseCase
from ..models.sliding_pivot_release import SlidingPivotRelease
from ..models.time_stepping_release import SteppedRelease
from ..problems.scene import Scene
from .motion import Motion
from .mover import Mover

Array = npt.NDArray[np.float64]

#: Steps over the opening: enough that halving them moves a landing by under 0.01 mm
#: (sliding pivot) and 0.2 mm (limit surface).
SLIDING_PIVOT = SlidingPivotRelease(steps=1000)
LIMIT_SURFACE = SteppedRelease(steps=2000)
#: Grid [s] on which sticking is checked before the opening.
CARRY_STEP = 0.0005


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
    outputs = mover.motion(*motion.at(times))
    return HandSamples(times, *(np.array(o) for o in outputs))


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


def slip_while_carrying(scene: Scene, mover: Mover, motion: Motion, opening_time: float) -> float:
    """Largest friction use (ellipsoid, 1 is the limit) from rest to the opening's start."""
    steps = max(math.ceil(opening_time / CARRY_STEP), 2)
    hand = hand_samples(mover, motion, np.linspace(0.0, opening_time, steps + 1))
    force, torque = friction_use(scene, hand)
    return float(np.sqrt(force**2 + torque**2).max())
