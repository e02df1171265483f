"""What truly happens in synthetic throws: a meshed patch lets the bar go, it flies."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from ...models import (
    PATCH_CHUNK,
    Body,
    Contact,
    FlightState,
    HandSamples,
    LinearRelease,
    LuGreRelease,
    PatchThrows,
    Release,
    land,
    march_patch,
    sticking_state,
)
from ...problems import ThrownObject
from ..check import Mover, hand_samples
from .make_throws_design import Throwing

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Law:
    """The true release law: a rigid meshed patch, or LuGre bristles of a stiffness [1/m].

    steps over the opening, first order: 8 times as many move the design's landings by up to
    0.03 mm and 0.03 deg.
    """

    kind: Literal["patch", "lugre"] = "patch"
    stiffness: float = 1e6
    steps: int = 1000

    @property
    def words(self) -> str:
        """The law in words."""
        if self.kind == "patch":
            return "meshed patch, rigid"
        return f"meshed patch, LuGre bristles of stiffness {self.stiffness:g} 1/m"

    def march(self, throws: PatchThrows) -> Release:
        """Releases side by side."""
        if self.kind == "patch":
            return march_patch(throws)
        return march_patch(throws, bristles=LuGreRelease(stiffness=self.stiffness).bristles(throws))


@dataclass(frozen=True)
class Event:
    """One throw as it truly is: its motion, bar and contact, its grip (dwell after `command`).

    command [s]: when the opening command goes out, on the motion's clock.
    """

    motion: Throwing
    bar: ThrownObject
    friction: float
    patch_radius: float
    grip: LinearRelease
    command: float

    @property
    def opening(self) -> float:
        """When the grip force truly starts to fall [s]."""
        return self.command + self.grip.dwell


@dataclass(frozen=True)
class Flown:
    """A true throw: landing x [m], theta [rad], flight time [s]; CoM poses over time."""

    event: Event
    mover: Mover
    times: Array
    com: Array
    detach: FlightState
    landing: Array
    gravity: float

    @property
    def landed(self) -> float:
        """When the CoM comes down through the landing height, on the motion's clock [s]."""
        return float(self.event.opening + self.times[-1] + self.landing[2])

    def poses(self, times: Array) -> Array:
        """CoM poses (K, 3) at times [s] of the motion's clock: held, let go, flying."""
        since = times - self.event.opening
        held = hand_samples(self.mover, self.event.motion.samples, times).pose
        x, z, theta = sticking_state(held, 0 * held, 0.0, self.event.bar.com)[:3]
        going = [np.interp(since, self.times, values) for values in self.com]
        flying = self.detach.after(since - self.times[-1], self.gravity)
        parts = [(x, z, theta), going, (flying.x, flying.z, flying.theta)]
        phase = (since > 0).astype(int) + (since >= self.times[-1])
        return np.asarray(np.choose(phase, np.array(parts)), float).T


def true_throws(
    mover: Mover,
    events: Sequence[Event],
    law: Law,
    height: float,
    gravity: float = 9.81,
    progress: Callable[[int, int], None] | None = None,
) -> list[Flown]:
    """All events, thrown by the law and flown to `height` [m].

    Raises ArithmeticError for a throw that the law does not solve.
    """
    found: list[Flown] = []
    for first in range(0, len(events), PATCH_CHUNK):
        part = events[first : first + PATCH_CHUNK]
        release = law.march(_throws(mover, part, law.steps, gravity))
        detach = np.vstack([release.com[:, -1], release.com_twist[:, -1]])
        landing = land(detach.T, height, gravity)
        if not np.isfinite(landing).all():
            raise ArithmeticError("a true throw could not be computed")
        for i, event in enumerate(part):
            state = FlightState(*(float(value) for value in detach[:, i]))
            times, com = release.times[:, i], release.com[:, :, i]
            found.append(Flown(event, mover, times, com, state, landing[i], gravity))
        if progress is not None:
            progress(len(found), len(events))
    return found


def _throws(mover: Mover, events: Sequence[Event], steps: int, gravity: float) -> PatchThrows:
    """The events' releases side by side, hands taken at each step from the motion itself."""
    times, hands, forces = [], [], []
    for event in events:
        t = np.linspace(0.0, event.grip.opening, steps + 1)
        hand = hand_samples(mover, event.motion.samples, event.opening + t)
        times.append(t)
        hands.append((hand.pose, hand.twist, hand.acceleration))
        forces.append(event.grip.force((t[1:] + t[:-1]) / 2))
    pose, twist, acceleration = np.array(hands).transpose(1, 2, 3, 0)
    bars = np.array([(e.bar.mass, e.bar.inertia, e.bar.com) for e in events]).T
    contact = Contact(
        np.array([event.friction for event in events]),
        np.array([event.patch_radius for event in events]),
    )
    start = np.array(sticking_state(pose[:, 0], twist[:, 0], 0.0, bars[2]))
    samples = HandSamples(np.array(times).T, pose, twist, acceleration)
    return PatchThrows(Body(*bars), contact, start, samples, np.array(forces).T, gravity)
