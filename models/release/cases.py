"""Input and output of a release model: one release, or N at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ..body import (
    Array,
    Body,
    Flags,
    HandTrack,
    PinchContact,
    ReadOnly,
    held_wrench,
    read_only,
    sticking_state,
)
from ..flight import FlightState
from ..surface import SurfaceShape
from ..trajectory import Throws, Trajectory
from .grip import GripProfile

#: Reasons not to trust a release.
LOST = "the body slid out of the pads before they let go"
BLEW_UP = "the steps blew up: needs more steps"
#: Slip [m] beyond h at which the body has left the pads. By the published law a body that continues
#: to slide under a turning hand would run away.
LOST_SLIP = 0.1


@dataclass(frozen=True)
class ReleaseCase:
    """One release: the held body, the contact, the grip force falling, the moving hand.

    The body sticks to the hand at time 0, at `grasp_angle` [rad] against it.
    """

    body: Body
    contact: PinchContact
    grip: GripProfile
    hand: HandTrack
    gravity: float = 9.81
    grasp_angle: float = 0.0

    def start(self) -> Array:
        """CoM pose and twist (6,) at time 0, sticking: x, z, theta, v_x, v_z, omega."""
        hand = self.hand.at(np.zeros(1))
        pose, twist = hand.pose[:, 0], hand.twist[:, 0]
        return np.array(sticking_state(pose, twist, self.grasp_angle, self.body.com_offset))

    def held_wrench(self, times: Array) -> Array:
        """Contact wrench (3, K) in world axes that a sticking body needs at `times` (K,) [s]."""
        hand = self.hand.at(times)
        wrench = held_wrench(self.body, self.gravity, hand.motion, self.grasp_angle)
        return np.array(np.broadcast_arrays(*wrench))

    def slip_onset(self, shape: SurfaceShape | None = None) -> tuple[float | None, float | None]:
        """Times [s] at which pivot and slide start on the limit surface, of another shape than the
        plain ellipsoid if one is given; None for a motion that does not.

        Slip starts when the wrench of a sticking body first reaches the surface of the falling grip
        force. Accurate to 1e-12 of the opening; 0 for a body that slips under full grip.
        """
        from scipy.optimize import brentq

        def excess(times: Array) -> Array:
            """Excess of the needed wrench over the surface, as a share of it."""
            f_x, f_z, torque = wrench = self.held_wrench(times)
            # The addition is against slip by rounding errors.
            force = self.grip.force(times) + 1e-11 * self.grip.full
            if shape is not None:
                return shape.use(self.contact, wrench, force, self.hand.at(times).pose[2]) - 1.0
            return np.asarray(self.contact.utilisation_squared(f_x, f_z, torque, force) - 1.0)

        times = np.linspace(0.0, self.grip.opening, 201)
        above = np.flatnonzero(excess(times) > 0)
        if above.size == 0:
            return None, None
        i = int(above[0])
        onset = float(times[i])
        if i > 0:
            ends = times[i - 1], onset
            onset = float(brentq(lambda t: float(excess(np.array([t]))[0]), *ends, xtol=1e-12))
        load = self.held_wrench(np.array([onset]))[:, 0]
        return onsets(onset, load, self.contact.torsion_arm)


def onsets(time: float, load: Array, arm: float) -> tuple[float | None, float | None]:
    """Onsets of pivot and slide [s] at `time`, for a wrench (3,) in newtons (torque over arm).

    The contact moves along the surface's normal. A motion outside the normal, such as rotation
    without torque, does not start: its component is below a millionth of the normal.
    """
    sizes = np.abs(load / [1.0, 1.0, arm])
    least = 1e-6 * sizes.max()
    return time if sizes[2] > least else None, time if sizes[:2].max() > least else None


@dataclass(frozen=True)
class Release(ReadOnly):
    """One release by one model.

    times (K,) from the start of the opening [s]; com (3, K) and com_twist (3, K) of the body;
    wrench (3, K): friction on the body at the contact point [N, N, N m], None for a model without
    it; pivot, slide: onset times [s], None without an onset. trouble: reason not to trust the
    result; empty for none.
    """

    times: Array
    com: Array
    com_twist: Array
    pivot: float | None = None
    slide: float | None = None
    wrench: Array | None = None
    trouble: str = ""

    @classmethod
    def from_nodes(
        cls, nodes: Array, onsets: Sequence[float] = (math.nan, math.nan), lost: bool = False
    ) -> Release:
        """The release with the core's nodes (K, 7): time, CoM pose and twist; no wrench.

        onsets [s]: of pivot and slide, NaN for what does not begin.
        """
        rows, trouble = nodes.T.copy(), LOST if lost else ""
        trouble = trouble if np.isfinite(rows).all() else BLEW_UP
        pivot, slide = (None if math.isnan(time) else float(time) for time in onsets)
        return cls(rows[0], rows[1:4], rows[4:], pivot, slide, trouble=trouble)

    @cached_property
    def end(self) -> Array:
        """CoM pose and twist (6,) at the end of the opening; (6, N) of N releases."""
        return read_only(np.concatenate([self.com[:, -1], self.com_twist[:, -1]]))

    @cached_property
    def detach(self) -> FlightState:
        """`end` as a state of flight."""
        return FlightState(*self.end.tolist())


class CaseModel(Protocol):
    """A release model that throws one body."""

    def release(self, case: ReleaseCase) -> Release:
        """The release of one case, from sticking to the end of the opening."""


def failed(times: Array, trouble: str) -> Release:
    """A failed release: NaN, with the reason."""
    nothing = np.full((3, len(times)), np.nan)
    return Release(times, nothing, nothing, trouble=trouble)


# N releases at once.


@dataclass(frozen=True)
class ReleaseBatch:
    """N releases. Body and contact values, gravity, grasp_angle: numbers or arrays (N,).

    grip: the falling force, shared, or an array (N,) of such; opening (N,) [s] and force (N,) [N]
    stretch it to each throw's own duration and full grip.
    """

    count: int
    body: Body
    contact: PinchContact
    grip: GripProfile | npt.NDArray[np.object_]
    hands: Trajectory
    opening: Array
    force: Array
    gravity: Any = 9.81
    grasp_angle: Any = 0.0

    def part(self, throws: Throws) -> ReleaseBatch:
        """The batch of the given throws; numbers stay numbers."""

        def cut(value: Any) -> Any:
            return value[throws] if isinstance(value, np.ndarray) and value.ndim else value

        return replace(
            self,
            count=len(throws),
            body=Body(*(cut(getattr(self.body, f.name)) for f in fields(Body))),
            contact=PinchContact(
                *(cut(getattr(self.contact, f.name)) for f in fields(PinchContact))
            ),
            hands=self.hands.part(throws),
            opening=self.opening[throws],
            force=self.force[throws],
            gravity=cut(self.gravity),
            grasp_angle=cut(self.grasp_angle),
            grip=cut(self.grip),
        )

    def grip_shares(self, shares: Array) -> Array:
        """Grip force over the full one at `shares` (K,), or (K, N), of the openings: (K, N), or
        (K,) where all throws share these and the grip."""
        if isinstance(self.grip, GripProfile):
            return self.grip.force(shares * self.grip.opening) / self.grip.full
        found = np.empty((len(shares), self.count))
        for grip in dict.fromkeys(self.grip.tolist()):
            mine = np.flatnonzero(self.grip == grip)
            own = shares[:, None] if shares.ndim == 1 else shares[:, mine]
            found[:, mine] = grip.force(own * grip.opening) / grip.full
        return found

    def forces(self, shares: Array) -> list[Array]:
        """Grip force (N,) [N] of one pad at each of `shares` (K,), or (K, N), of the openings."""
        return [self.force * value for value in self.grip_shares(shares)]


@dataclass(frozen=True)
class BatchRelease(ReadOnly):
    """The results of N releases.

    detach (N, 6): CoM pose and twist at the end of the opening, NaN for a failed one, with the
    reason in `why_not`. lost (N,): the body slid out of the pads before. track (N, K, 4): K
    instants from the opening's start [s] to its end, and the CoM's poses; None for most models.
    """

    detach: Array
    lost: Flags
    why_not: str = BLEW_UP
    track: Array | None = None

    @property
    def trouble(self) -> npt.NDArray[np.object_]:
        """Why each throw (N,) is not to be trusted, as in `Release`; empty if it is."""
        words = np.full(len(self.detach), "", object)
        words[self.lost] = LOST
        words[~np.isfinite(self.detach).all(axis=1)] = self.why_not
        return words

    @staticmethod
    def joined(parts: Sequence[BatchRelease]) -> BatchRelease:
        """The releases of several batches, one after the other."""

        def all_of(name: str) -> Any:
            values = [getattr(part, name) for part in parts]
            return None if any(value is None for value in values) else np.concatenate(values)

        why_not = parts[0].why_not
        return BatchRelease(all_of("detach"), all_of("lost"), why_not, all_of("track"))

    def part(self, throws: Throws) -> BatchRelease:
        """The releases of the given throws."""
        track = None if self.track is None else self.track[throws]
        return BatchRelease(self.detach[throws], self.lost[throws], self.why_not, track)


def chunks(count: int, size: int) -> Iterator[Throws]:
    """The numbers of `count` throws, `size` at a time."""
    for first in range(0, count, size):
        yield np.arange(first, min(first + size, count))


def by_chunks(
    batch: ReleaseBatch, run: Callable[[ReleaseBatch], BatchRelease], size: int = 2048
) -> BatchRelease:
    """`run` on one chunk of throws after the other: memory does not grow with their number.

    Thirty arrays of 2048 doubles fit the processor's cache.
    """
    if batch.count <= size:
        return run(batch)
    return BatchRelease.joined([run(batch.part(throws)) for throws in chunks(batch.count, size)])
