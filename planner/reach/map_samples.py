"""A map from sampled throws: how they are drawn, which are allowed, their margins and bins.

`ReleaseSampler` draws the states as if the start were free. With a given start the arm first
moves, from rest to rest, to where the run-up begins; both must fit into the longest carry.
Allowed are throws that keep floor, base column and palm.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ...models import Array, Flags
from ...problems import InputError, Scene, checked
from ...problems.scene_files import as_scene
from ...workers import Progress
from ..ocp import CUP_MARGINS, FLIGHT_MAX, PASSING_MARGIN
from ..search import (
    Library,
    Releases,
    ReleaseSampler,
    check_start,
    flies_past_column,
    highest,
    joined,
    run_up,
)
from ..throw import Limits, Manipulator, make_manipulator, outline
from ..verdict import held_bar, lands_well, lowest_of_bar, palm_corners
from .maps import WIDTHS, Counts, ReachMap, places

#: States that are sampled at a time.
CHUNK = 20_000
#: Two throws count as different if they lie in different cells, of this share of the range of
#: each coordinate and rate.
CELL = 0.15
#: Fewest landings, on average, of a bin with a landing.
MIN_FILL = 10.0
#: Most bins on each axis.
MAX_BINS = 400
#: Most sampled states.
MOST = 10_000_000
#: Default number of sampled states.
SAMPLES = 200_000
#: Largest height and depth [m] of a map.
FARTHEST = 100.0


def reach_map(
    scene: Scene | str | Path,
    z: float | None = None,
    samples: int = SAMPLES,
    *,
    robust: bool = False,
    progress: Progress | None = None,
) -> ReachMap:
    """The landing poses in reach of a scene at height `z` [m], by default the target's.

    Equal arguments and an equal library give equal maps. robust: with the 95 % pose errors of the
    library's throws. progress(done, samples) is called on the way. Raises InputError for a scene
    that cannot be planned, for numbers out of range, and with `robust` for a scene without a
    library; if no throw lands at the height, the map is empty and has a message.
    """
    scene = as_scene(scene)
    check_map(z, samples)
    manipulator = make_manipulator(scene)
    check_start(scene, manipulator)
    library = Library(scene, manipulator)
    if checked("robust", robust, bool, {}) and not len(library):
        words = f"throwplan prepare {scene.place}"
        raise InputError(f"robust: {scene.place} has no library of solved throws: first {words}")
    height = scene.aim.z if z is None else float(z)
    if robust and height != scene.aim.z:
        words = f"z = {height:g}: must be the target's, {scene.aim.z:g}, for a robust map"
        raise InputError(words)
    target = dataclasses.replace(scene.aim, z=height)
    aimed = scene.aimed_at(target)  # moves the cup along with the target
    parts: list[tuple[Array, Array, Array, Counts]] = []
    down, rise, done = 0, (-math.inf, ""), 0
    for count, drawn in chunks(scene, manipulator, samples):
        x, theta, time = scene.flight.land(drawn.detach, height).T
        landed = np.isfinite(time) & (time <= FLIGHT_MAX)
        down += int(landed.sum())
        if not down:
            rise = max(rise, highest(drawn, height, scene.flight))
        thrown, x, theta, time = drawn.picked(landed), x[landed], theta[landed], time[landed]
        good = allowed(scene, manipulator, thrown, time)
        good &= lands_well(aimed, thrown.detach, np.column_stack([x, theta, time]), CUP_MARGINS[0])
        thrown = thrown.picked(good)
        rest = margins(scene, manipulator, thrown), cells_of(manipulator, thrown)
        parts.append((x[good], theta[good], *rest))
        done += count
        if progress is not None:
            progress(done, samples)
    x, theta, margin, cells = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    empty = ReachMap(scene, height, samples, x=x, theta=theta)
    landings = library.landings(height)[:2]
    down_there = np.isfinite(landings).all(axis=0)
    empty = dataclasses.replace(empty, solved=landings[:, down_there])
    if not x.size:
        return dataclasses.replace(empty, message=_why_nothing(height, down, rise))
    found = _binned(empty, margin, cells)
    return _with_errors(found, library.records["error95"][down_there]) if robust else found


def check_map(z: float | None, samples: int, prefix: str = "") -> None:
    """InputError for numbers out of range; `prefix` as on the command line."""
    checked(f"{prefix}z", z, float | None, {"least": -FARTHEST, "most": FARTHEST})
    checked(f"{prefix}samples", samples, int, {"least": 1, "most": MOST})


def _with_errors(found: ReachMap, error95: Array) -> ReachMap:
    """The map with the least of the errors (S,) [m] of the library's throws into each bin."""
    x, theta = found.solved
    i = places(found.x_edges, x)
    j = np.zeros_like(i) if found.theta_edges is None else places(found.theta_edges, theta)
    inside = (i >= 0) & (j >= 0) & (i < found.landings.shape[0]) & (j < found.landings.shape[1])
    least = np.full(found.landings.shape, np.inf)
    np.minimum.at(least, (i[inside], j[inside]), error95[inside])
    return dataclasses.replace(found, error95=np.where(np.isinf(least), np.nan, least))


def _binned(found: ReachMap, margin: Array, cells: Counts) -> ReachMap:
    """The map with its landings in bins, of theta only where the target has one.

    margin (N,): of each landing; cells (N,): equal for throws that count as one.
    """
    x, theta, angle = found.x, found.theta, found.scene.aim.theta is not None
    edges = edges_of([x, theta] if angle else [x])
    theta_edges = edges[1] if angle else None
    shape = (len(edges[0]) - 1, len(edges[1]) - 1 if angle else 1)
    where = places(edges[0], x) * shape[1]
    if angle:
        where = where + places(edges[1], theta)
    size = shape[0] * shape[1]
    best = np.full(size, -np.inf)
    np.maximum.at(best, where, margin)
    different = np.unique(np.column_stack([where, cells]), axis=0)[:, 0]
    return dataclasses.replace(
        found,
        x_edges=edges[0],
        theta_edges=theta_edges,
        landings=np.bincount(where, minlength=size).reshape(shape),
        solutions=np.bincount(different, minlength=size).reshape(shape),
        margin=np.where(np.isfinite(best), best, np.nan).reshape(shape),
    )


def _why_nothing(z: float, down: int, rise: tuple[float, str]) -> str:
    """Why no throw was found; down: throws that land; rise: the highest apex [m], and words."""
    if down:
        kept = "keeps floor, base column, longest carry and the bounds of [landing]"
        return f"no throw found: none of {down:,} sampled throws down to z {z:g} m {kept}"
    if rise[0] > z:
        return f"no throw found: none comes down through z {z:g} m within {FLIGHT_MAX:g} s"
    return rise[1]


def edges_of(axes: list[Array]) -> list[Array]:
    """Edges of the bins on each axis (x, or x and theta): multiples of one of WIDTHS.

    Landings too far apart for WIDTHS get bins of twice, four times, ... the last of them.
    """
    coarser = (tuple(2.0**k * width for width in WIDTHS[-1]) for k in itertools.count(1))
    for number, widths in enumerate(itertools.chain(WIDTHS, coarser)):
        if any(np.ptp(v) > (MAX_BINS - 2) * w for v, w in zip(axes, widths, strict=False)):
            continue
        edges = [_multiples(v, w) for v, w in zip(axes, widths, strict=False)]
        found = [places(e, v) for e, v in zip(edges, axes, strict=True)]
        reached = np.unique(np.column_stack(found), axis=0)
        if len(axes[0]) >= MIN_FILL * len(reached) or number >= len(WIDTHS) - 1:
            break
    return edges


def _multiples(values: Array, width: float) -> Array:
    """Multiples of `width` around all values, none of which is on the last by rounding."""
    first = math.floor(float(values.min()) / width - 1e-9)
    last = math.floor(float(values.max()) / width + 1e-9) + 1
    return np.asarray(np.arange(first, last + 1) * width, dtype=np.float64)


def margins(scene: Scene, manipulator: Manipulator, throws: Releases) -> Array:
    """1 - largest use of a limit (N,) at the opening's start and end, and after braking.

    Uses are shares of the planner's limits: rates, accelerations, the distance from the middle
    of a coordinate's range over half the range, and friction (root of the ellipsoid) at full
    grip.
    """
    limits, sampler = manipulator.planning, ReleaseSampler(scene, manipulator)
    q, dq, ddq = throws.q, throws.dq, throws.ddq
    end, rate, stop = sampler.opened(q, dq, ddq)
    middle, half = (limits.q_max + limits.q_min) / 2, (limits.q_max - limits.q_min) / 2
    half = np.maximum(half, 1e-12)
    uses = [_velocity_use(limits, *state) for state in ((q, dq), (end, rate))]
    uses += [np.abs(ddq) / limits.ddq]
    uses += [np.abs(position - middle) / half for position in (q, end, stop)]
    most = np.max([use.max(axis=1) for use in uses], axis=0)
    return np.asarray(1.0 - np.maximum(most, sampler.grip_use(q, dq, ddq)))


def _velocity_use(limits: Limits, q: Array, dq: Array) -> Array:
    """Velocities (N, n) over their limits at positions q (N, n)."""
    low, high = limits.velocity(q)
    return np.asarray(np.maximum(dq / np.maximum(high, 1e-9), dq / np.minimum(low, -1e-9)))


def chunks(scene: Scene, manipulator: Manipulator, samples: int) -> Iterator[tuple[int, Releases]]:
    """Of each chunk the number of states drawn, and the releases among them."""
    # A given start is where the carry begins; the run-up begins anywhere.
    sampler = ReleaseSampler(scene, dataclasses.replace(manipulator, start=None))
    for seed, first in enumerate(range(0, samples, CHUNK)):
        count = min(CHUNK, samples - first)
        drawn = sampler.draw(count, seed)
        if seed == 0 and manipulator.start is not None:
            # The last state of a draw lets go at rest at the start.
            drawn = joined(drawn, ReleaseSampler(scene, manipulator).draw(1))
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
    times = [
        15 / 8 * distance / limits.dq,
        np.sqrt(10 / math.sqrt(3) * distance / limits.ddq),
        np.cbrt(60 * distance / limits.jerk),
    ]
    needed = np.max(times, axis=0).max(axis=1, initial=0.0)
    return np.asarray(needed + throws.run_up <= scene.nlp.carry_max)


def _off_floor(scene: Scene, manipulator: Manipulator, throws: Releases) -> Flags:
    """Whether arm, hand and held bar (N,) are off the floor at all ends of the motion."""
    clear = np.ones(len(throws.q), dtype=bool)
    floor = scene.bounds.floor
    if floor is None or not clear.size:
        return clear
    end, _, stop = ReleaseSampler(scene, manipulator).opened(throws.q, throws.dq, throws.ddq)
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
