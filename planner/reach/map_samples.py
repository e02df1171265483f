"""The sampled throws of a map: how they are drawn, which are allowed, and their margins.

`ReleaseSampler` draws the states as if the start were free. With a given start the arm first
moves, from rest to rest, to where the run-up begins; both must fit into the longest carry.
Allowed are throws that keep floor, base column and palm.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator

import numpy as np
import numpy.typing as npt

from ...models import Array, Flags
from ...problems import Scene
from ..clearance import held_bar, lowest_of_bar, palm_corners
from ..ocp import BRAKE_SHARE, PASSING_MARGIN
from ..samples import Releases, ReleaseSampler, flies_past_column, run_up
from ..throw import Limits, Manipulator, outline

Counts = npt.NDArray[np.int64]

#: States that are sampled at a time.
CHUNK = 20_000
#: Two throws count as different if they lie in different cells, of this share of the range of
#: each coordinate and rate.
CELL = 0.15


def margins(scene: Scene, manipulator: Manipulator, throws: Releases) -> Array:
    """1 - largest use of a limit (N,) at the opening's start and end, and after braking.

    Uses are shares of the planner's limits: rates, accelerations, the distance from the middle
    of a coordinate's range over half the range, and friction (root of the ellipsoid) at full
    grip.
    """
    limits, q, dq, ddq = manipulator.planning, throws.q, throws.dq, throws.ddq
    end, stop, rate = _ahead(scene, manipulator, throws)
    middle, half = (limits.q_max + limits.q_min) / 2, (limits.q_max - limits.q_min) / 2
    half = np.maximum(half, 1e-12)
    uses = [_velocity_use(limits, *state) for state in ((q, dq), (end, rate))]
    uses += [np.abs(ddq) / limits.ddq]
    uses += [np.abs(position - middle) / half for position in (q, end, stop)]
    most = np.max([use.max(axis=1) for use in uses], axis=0)
    return np.asarray(
        1.0 - np.maximum(most, ReleaseSampler(scene, manipulator).grip_use(q, dq, ddq))
    )


def _velocity_use(limits: Limits, q: Array, dq: Array) -> Array:
    """Velocities (N, n) over their limits at positions q (N, n)."""
    low, high = limits.velocity(q)
    return np.asarray(np.maximum(dq / np.maximum(high, 1e-9), dq / np.minimum(low, -1e-9)))


def _ahead(scene: Scene, manipulator: Manipulator, throws: Releases) -> tuple[Array, Array, Array]:
    """Coordinates (N, n) at the opening's end and after braking, and rates at its end."""
    opening = scene.gripper.profile().opening
    end = throws.q + throws.dq * opening + throws.ddq * opening**2 / 2
    rate = throws.dq + throws.ddq * opening
    braking = rate * np.abs(rate) / (2 * BRAKE_SHARE * manipulator.planning.ddq)
    return end, end + braking, rate


def chunks(
    scene: Scene, manipulator: Manipulator, samples: int
) -> Iterator[tuple[int, list[Releases]]]:
    """Of each chunk the number of states drawn, and the releases among them."""
    # A given start is where the carry begins; the run-up begins anywhere.
    sampler = ReleaseSampler(scene, dataclasses.replace(manipulator, start=None))
    for seed, first in enumerate(range(0, samples, CHUNK)):
        count = min(CHUNK, samples - first)
        drawn = [sampler.draw(count, seed)]
        if seed == 0 and manipulator.start is not None:
            # The last state of a draw lets go at rest at the start.
            drawn.append(ReleaseSampler(scene, manipulator).draw(1))
        yield count, drawn


def _start(manipulator: Manipulator, throws: Releases) -> Array:
    """Coordinates (N, n) at rest before the run-up from a free start."""
    free = dataclasses.replace(manipulator, start=None)
    return run_up(free, throws.q, throws.dq, throws.ddq, throws.run_up[:, None])[0]


def allowed(scene: Scene, manipulator: Manipulator, throws: Releases, time: Array) -> Flags:
    """Whether the throws (N,) are reached from the start and break no constraint.

    time (N,): of flight [s].
    """
    good = (
        throws.clear & _reached(scene, manipulator, throws) & _off_floor(scene, manipulator, throws)
    )
    return good & flies_past_column(scene, throws.detach, time, PASSING_MARGIN)


def _reached(scene: Scene, manipulator: Manipulator, throws: Releases) -> Flags:
    """Whether the longest carry (N,) leaves time to go from the start to the run-up's start.

    By a quintic from rest to rest, whose peaks are 15/8 d/T, 10/sqrt(3) d/T^2, 60 d/T^3.
    """
    if manipulator.start is None:
        return np.ones(len(throws.q), dtype=bool)
    limits, distance = manipulator.planning, np.abs(_start(manipulator, throws) - manipulator.start)
    times = [15 / 8 * distance / limits.dq, np.sqrt(10 / math.sqrt(3) * distance / limits.ddq)]
    if limits.jerk is not None:
        times.append(np.cbrt(60 * distance / limits.jerk))
    needed = np.max(times, axis=0).max(axis=1, initial=0.0)
    return np.asarray(needed + throws.run_up <= scene.mesh.carry_max)


def _off_floor(scene: Scene, manipulator: Manipulator, throws: Releases) -> Flags:
    """Whether arm, hand and held bar (N,) are off the floor at all ends of the motion."""
    clear = np.ones(len(throws.q), dtype=bool)
    floor = scene.bounds.floor
    if floor is None or not clear.size:
        return clear
    end, stop, _ = _ahead(scene, manipulator, throws)
    for q, holds in (
        (_start(manipulator, throws), True),
        (throws.q, True),
        (end, False),
        (stop, False),
    ):
        hand, lowest = outline(manipulator, q.T)
        if scene.arm is not None:
            lowest = np.minimum(lowest, palm_corners(scene.arm.tool, hand)[1].min(axis=1))
        if holds:
            bar = held_bar(scene, hand)
            lowest = np.minimum(lowest, lowest_of_bar(scene.object, bar))
        clear &= lowest >= floor
    return clear


def cells_of(manipulator: Manipulator, throws: Releases) -> Counts:
    """Number (N,) of each release's cell in the grid over coordinates and rates."""
    limits, count = manipulator.planning, math.ceil(1 / CELL)
    wide = np.maximum(limits.q_max - limits.q_min, 1e-12)
    shares = np.hstack([(throws.q - limits.q_min) / wide, throws.dq / limits.dq / 2 + 0.5])
    places = np.clip((shares / CELL).astype(np.int64), 0, count - 1)
    return np.asarray(places @ count ** np.arange(places.shape[1], dtype=np.int64))
