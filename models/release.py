"""What a release model is given, and what it gives back: one release, or N at once."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from .body import Array, Body, Contact, Flags, FlightState, HandTrack, sticking_state
from .path import Path, Throws

#: Why a release is not to be trusted.
LOST = "the body slid out of the pads before they let go"
BLEW_UP = "the steps blew up: needs more steps"
UNSOLVED = "a step of the patch was not solved"
#: Slip beyond h by which the body has left the pads [m]. The published law lets a body
#: that slides on under a turning hand run away; from here on it flies freely.
LOST_SLIP = 0.1
#: A table's fall starts where its force leaves the first value by this share.
FALL_SHARE = 0.01
#: Throws per chunk: some thirty arrays of this many doubles stay in the processor's cache.
CHUNK = 2048


@dataclass(frozen=True)
class LinearRelease:
    """Grip force of one pad: full [N] for `dwell` [s] after the opening command, then linear
    to zero in `opening` [s]."""

    full: float
    dwell: float
    opening: float

    def force(self, time: npt.ArrayLike) -> Array:
        """f_N [N] at `time` [s] after the start of the fall."""
        return self.full * np.clip(1.0 - np.asarray(time, float) / self.opening, 0.0, 1.0)


class TableRelease:
    """A measured grip force: times [s] from the opening command, forces [N] of one pad.

    Interpolated by monotone cubics (PCHIP): no overshoot, continuous slope. The last
    force must be zero within 1 % of the largest, and the force may not rise again by
    more than 5 % of the largest. Raises ValueError saying what is wrong.
    """

    def __init__(self, times: Sequence[float], forces: Sequence[float]) -> None:
        t, f = np.array(times, float), np.array(forces, float)
        _check_table(t, f)
        peak = f.max()
        f[-1] = 0.0
        self.full = float(f[0])
        falling = np.flatnonzero(f < (1.0 - FALL_SHARE) * f[0])
        start = max(int(falling[0]) - 1, 0)
        ended = int(np.flatnonzero(f > 1e-9 * peak)[-1]) + 1
        self.dwell = float(t[start])
        self.opening = float(t[ended] - t[start])
        self._times, self._forces = t[start : ended + 1] - t[start], f[start : ended + 1]

    @cached_property
    def curve(self) -> Any:
        """The force over the time from its fall on, as SciPy's piecewise cubics."""
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self._times, self._forces)

    def force(self, time: npt.ArrayLike) -> Array:
        """f_N [N] at `time` [s] after the start of the fall."""
        force = self.curve(np.clip(np.asarray(time, float), 0.0, self.opening))
        return np.asarray(np.maximum(force, 0.0))


def _check_table(t: Array, f: Array) -> None:
    if t.size < 2 or t.shape != f.shape:
        raise ValueError("needs at least two rows of t, f_N")
    if not (np.isfinite(t).all() and np.isfinite(f).all()):
        raise ValueError("has a value that is not a finite number")
    if t[0] < 0 or (np.diff(t) <= 0).any():
        raise ValueError("t must start at 0 or later and rise from row to row")
    peak = f.max()
    if peak <= 0 or (f < 0).any():
        raise ValueError("f_N must not be negative and must start above 0")
    if f[-1] > 0.01 * peak:
        raise ValueError(f"f_N must end at 0, but the last row has {f[-1]:g} N")
    if f[0] < 0.5 * peak:
        raise ValueError("f_N must start at the full grip and fall from there")
    if (f - np.minimum.accumulate(f)).max() > 0.05 * peak:
        raise ValueError("f_N must fall: it rises by more than 5 % of its largest value")


#: Grip force over time: full, dwell, opening and force(time).
GripProfile = LinearRelease | TableRelease


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
    def end(self) -> Array:
        """CoM pose and twist (6,) at the end of the opening; (6, N) of N releases."""
        return np.concatenate([self.com[:, -1], self.com_twist[:, -1]])

    @cached_property
    def detach(self) -> FlightState:
        """The same as a state of flight."""
        return FlightState(*self.end.tolist())


class CaseModel(Protocol):
    """How one body leaves the hand."""

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


# N releases at once.


@dataclass(frozen=True)
class ReleaseBatch:
    """N releases. Body and contact values, gravity, grasp_angle: numbers or arrays (N,).

    grip: the falling force, shared; opening (N,) [s] and force (N,) [N] stretch it to
    each throw's own duration and full grip.
    """

    count: int
    body: Body
    contact: Contact
    grip: GripProfile
    hands: Path
    opening: Array
    force: Array
    gravity: Any = 9.81
    grasp_angle: Any = 0.0

    def part(self, throws: Throws) -> ReleaseBatch:
        """The given throws as a batch of their own; numbers stay numbers."""

        def cut(value: Any) -> Any:
            return value[throws] if isinstance(value, np.ndarray) and value.ndim else value

        return replace(
            self,
            count=len(throws),
            body=Body(*(cut(getattr(self.body, f.name)) for f in fields(Body))),
            contact=Contact(*(cut(getattr(self.contact, f.name)) for f in fields(Contact))),
            hands=self.hands.part(throws),
            opening=self.opening[throws],
            force=self.force[throws],
            gravity=cut(self.gravity),
            grasp_angle=cut(self.grasp_angle),
        )

    def forces(self, shares: Array) -> list[Array]:
        """Grip force (N,) [N] of one pad at each of `shares` (K,) of the openings."""
        shape = self.grip.force(shares * self.grip.opening) / self.grip.full
        return [self.force * value for value in shape]

    def forces_at(self, times: Array) -> Array:
        """Grip force [N] of one pad at `times` (..., N) [s] after each opening's start."""
        stretched = times / self.opening * self.grip.opening
        return np.asarray(self.force * self.grip.force(stretched) / self.grip.full)


@dataclass(frozen=True)
class BatchRelease:
    """What N releases come to.

    detach (N, 6): CoM pose and twist at the end of the opening, NaN where it could not be
    computed, which `why_not` explains; lost (N,): whether the body slid out of the pads
    before.
    """

    detach: Array
    lost: Flags
    why_not: str = BLEW_UP

    @property
    def trouble(self) -> npt.NDArray[np.object_]:
        """Why each throw (N,) is not to be trusted, as in `Release`; empty if it is."""
        words = np.full(len(self.detach), "", object)
        words[self.lost] = LOST
        words[~np.isfinite(self.detach).all(axis=1)] = self.why_not
        return words

    @staticmethod
    def joined(parts: Sequence[BatchRelease]) -> BatchRelease:
        """All of several, one after the other."""
        detach = np.concatenate([part.detach for part in parts])
        return BatchRelease(detach, np.concatenate([part.lost for part in parts]), parts[0].why_not)


def chunks(count: int, size: int = CHUNK) -> Iterator[Throws]:
    """The numbers of `count` throws, `size` at a time."""
    for first in range(0, count, size):
        yield np.arange(first, min(first + size, count))


def by_chunks(
    batch: ReleaseBatch, run: Callable[[ReleaseBatch], BatchRelease], size: int = CHUNK
) -> BatchRelease:
    """`run` on one chunk of throws after the other: memory does not grow with their number."""
    if batch.count <= size:
        return run(batch)
    return BatchRelease.joined([run(batch.part(throws)) for throws in chunks(batch.count, size)])
