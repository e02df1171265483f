"""One interface for all release models: what goes in, and what comes out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from .backend import Value, backend, components
from .contact import Body, Contact, HandMotion, com_twist
from .flight import FlightState
from .grip_force import GripProfile

Array = npt.NDArray[np.float64]

#: Why a release is not to be trusted.
LOST = "the body slid out of the pads before they let go"
BLEW_UP = "the steps blew up: needs more steps"
UNSOLVED = "a step of the patch was not solved"


@dataclass(frozen=True)
class HandSamples:
    """Hand pose, twist and acceleration, each (3, K), at `times` (K,) [s].

    Rows: x, z [m], theta [rad] and their first and second derivatives. For a batch of N
    throws each is (3, K, N).
    """

    times: Array
    pose: Array
    twist: Array
    acceleration: Array

    def __iter__(self) -> Iterator[Array]:
        """pose, twist, acceleration."""
        return iter((self.pose, self.twist, self.acceleration))

    @property
    def motion(self) -> HandMotion:
        """What the contact equations need, as arrays."""
        return HandMotion(self.pose[2], self.twist[2], *self.acceleration)


class HandTrack(Protocol):
    """A hand motion over time, counted from the start of the opening."""

    def at(self, times: Array) -> HandSamples:
        """The hand at `times` (K,) [s]."""


@dataclass(frozen=True)
class ReleaseCase:
    """One release: the held body, the contact, the grip force falling, the moving hand.

    The body sticks to the hand at time 0, at `grasp_angle` [rad] against it.
    """

    body: Body
    contact: Contact
    grip: GripProfile
    hand: HandTrack
    gravity: float = 9.81
    grasp_angle: float = 0.0

    def start(self) -> Array:
        """CoM pose and twist (6,) at time 0, sticking: x, z, theta, v_x, v_z, omega."""
        hand = self.hand.at(np.zeros(1))
        pose, twist = hand.pose[:, 0], hand.twist[:, 0]
        return np.array(sticking_state(pose, twist, self.grasp_angle, self.body.com_offset))


def sticking_state(pose: Value, twist: Value, grasp_angle: Value, com_offset: Value) -> list[Value]:
    """CoM pose and twist (6 values) of a body that sticks to a hand of this pose and twist."""
    x, z, theta = components(pose)
    v_x, v_z, omega = components(twist)
    angle = theta + grasp_angle
    xp = backend(angle)
    x_r, z_r = com_offset * xp.cos(angle), com_offset * xp.sin(angle)
    return [x + x_r, z + z_r, angle, *com_twist(v_x, v_z, omega, x_r, z_r)]


@dataclass(frozen=True)
class Release:
    """One release by one model.

    times (K,) from the start of the opening [s]; com (3, K) and com_twist (3, K) of the
    body; wrench (3, K): friction on the body at the contact point [N, N, N m], None
    where the model does not give it; pivot, slide: onset times [s], None if it never
    happens or the model knows no such thing. trouble: why the result is not to be
    trusted; empty if it is.
    """

    times: Array
    com: Array
    com_twist: Array
    pivot: float | None = None
    slide: float | None = None
    wrench: Array | None = None
    trouble: str = ""

    @property
    def detach(self) -> FlightState:
        """State at the end of the opening."""
        return FlightState(*self.com[:, -1], *self.com_twist[:, -1])


class ReleaseModel(Protocol):
    """How a body leaves the hand."""

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case, from sticking to the end of the opening."""


def failed(times: Array, trouble: str) -> Release:
    """A release that could not be computed: NaN all along, and why."""
    nothing = np.full((3, len(times)), np.nan)
    return Release(times, nothing, nothing, trouble=trouble)


def onset(times: Array, excess: Array) -> float | None:
    """First time [s] at which `excess` rises above zero; linear between grid points."""
    above = np.flatnonzero(excess > 0)
    if above.size == 0:
        return None
    i = int(above[0])
    if i == 0:
        return float(times[0])
    low, high = excess[i - 1], excess[i]
    return float(times[i - 1] + (times[i] - times[i - 1]) * -low / (high - low))
