"""Which landing poses are in reach: sampled throws, sorted into bins of x and theta.

The states are those of `ReleaseSampler` from a free start: a scene with a given start is
wound up first, from rest there to rest at the run-up's start, in what the longest carry
leaves. Kept are the throws that keep floor, base column and the bounds of [landing]. A bin
with a landing is one that was hit, not one that a plan was made for: of 48 bins drawn on pose,
cup (without its cup; 2 cm bins) and hand-flip (6 cm), half of them among those with five
landings or more, the planner solved the middles of 47. An empty bin beside full ones may only
have been missed.
"""

from __future__ import annotations

import dataclasses
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..models.contact import HandMotion, pivot_wrench
from ..models.flight import land
from ..problems.errors import InputError
from ..problems.scene import Pose, Scene
from .api import as_scene
from .check import outline_kernel
from .files import prepare_folder
from .geometry import column_distance, lowest_of_bar, palm_corners, reach_of_bar
from .mover import Mover, make_mover
from .numbers import BRAKE_SHARE, FLIGHT_MAX
from .reach import highest
from .releases import Releases, ReleaseSampler
from .start import check_start

Array = npt.NDArray[np.float64]
Counts = npt.NDArray[np.int64]
Flags = npt.NDArray[np.bool_]
Progress = Callable[[int, int], None]

#: Sampled states at a time; most that may be asked for; usual number.
CHUNK, MOST, SAMPLES = 20_000, 10_000_000, 200_000
#: Bin widths [m, rad], finest first. The first is taken that leaves a reached bin FILL
#: landings on average and at most BINS bins on each axis.
WIDTHS = tuple(
    (x, math.radians(degrees))
    for x, degrees in ((0.02, 5.0), (0.04, 10.0), (0.06, 15.0), (0.1, 22.5), (0.2, 45.0))
)
FILL, BINS = 10.0, 400
#: Two throws are different when they lie in different cells of this share of the range of a
#: coordinate or rate.
CELL = 0.15
#: Instants of the flight that are held against the base column.
FLIGHT_INSTANTS = 40
#: Height [m] and distance [m] a target may have.
FARTHEST = 1e4
#: What a map leaves in its folder.
FILES = ("map.png", "map.npz")


@dataclass(frozen=True)
class Throws:
    """Sampled releases, as in `Releases`: q, dq, ddq (N, n), run_up (N,) [s], detach (N, 6)."""

    q: Array
    dq: Array
    ddq: Array
    run_up: Array
    detach: Array

    @classmethod
    def of(cls, *parts: Releases) -> Throws:
        """Those of all parts, one after the other."""
        names = [field.name for field in dataclasses.fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))

    def picked(self, chosen: Flags) -> Throws:
        """Those where `chosen` (N,) is true."""
        names = [field.name for field in dataclasses.fields(self)]
        return Throws(*(getattr(self, name)[chosen] for name in names))


@dataclass(frozen=True, eq=False)
class ReachMap:
    """Landing poses that sampled throws of `scene` reach at height `z` [m].

    samples: states drawn. x_edges (X + 1,) [m] and theta_edges (T + 1,) [rad] of the bins;
    theta_edges is None and T is 1 where the scene leaves theta open. Per bin (X, T):
    landings, how many throws landed there; solutions, how many different throws (occupied
    cells of a grid over coordinates and rates, 0.15 of each range wide, so neighbours
    across a cell's border count as two); margin, the best 1 - (largest use of velocity,
    acceleration, position room and grip), NaN where nothing landed. x, theta (N,): the
    landings themselves. message: why nothing is in reach, empty if something is.
    """

    scene: Scene
    z: float
    samples: int
    x_edges: Array
    theta_edges: Array | None
    landings: Counts
    solutions: Counts
    margin: Array
    x: Array
    theta: Array
    message: str = ""

    @property
    def reachable(self) -> int:
        """How many bins a throw landed in."""
        return int(np.count_nonzero(self.landings))

    @property
    def widths(self) -> tuple[float, float | None]:
        """Width of the bins [m, rad]; None where theta is open."""
        if not self.reachable:
            return WIDTHS[0][0], None
        theta = self.theta_edges
        angle = None if theta is None else float(theta[1] - theta[0])
        return float(self.x_edges[1] - self.x_edges[0]), angle

    def bin_of(self, x: float, theta: float | None = None) -> tuple[int, int] | None:
        """Indices of the bin at `x` [m], `theta` [rad]; None outside all bins."""
        i = _place(self.x_edges, x)
        j = 0
        if self.theta_edges is not None and theta is not None:
            j = _place(self.theta_edges, theta)
        return None if i < 0 or j < 0 else (i, j)

    def contains(self, x: float, theta: float | None = None) -> bool:
        """Whether a throw landed in the bin of `x` [m], `theta` [rad]; None: at any theta."""
        found = self.bin_of(x, theta)
        if found is None:
            return False
        if theta is None:
            return bool(self.landings[found[0]].any())
        return bool(self.landings[found] > 0)

    def distance(self, x: float, theta: float | None = None) -> float:
        """Scaled distance [m] to the nearest landing: |dx| + |dtheta| length / 2 (39).

        Infinite without a landing. Theta does not count where it is open or None.
        """
        if not self.reachable:
            return math.inf
        away = np.abs(self.x - x)
        if theta is not None and self.theta_edges is not None:
            away = away + np.abs(self.theta - theta) * self.scene.object.length / 2
        return float(away.min())

    def to_dict(self, file: Path | None = None) -> dict[str, Any]:
        """The JSON object of `throwplan map`; a message is in it only if nothing is in reach."""
        nothing = not self.reachable
        free = nothing or self.theta_edges is None
        answer = {
            "scene": self.scene.name,
            "z": self.z,
            "reachable": self.reachable,
            "x": None if nothing else [float(self.x.min()), float(self.x.max())],
            "theta": None if free else [float(self.theta.min()), float(self.theta.max())],
            "file": None if file is None else str(file),
        }
        return answer | ({"message": self.message} if nothing else {})

    def save(self, folder: str | Path) -> Path:
        """Write map.png and map.npz, all or nothing; returns the path of map.npz.

        map.npz has x_edges, theta_edges (empty where theta is open), landings, solutions,
        margin, x and theta as in this class, and z [m] and samples as scalars.
        """
        from .map_picture import draw_map

        if not self.reachable:
            raise InputError(f"{self.scene.place}: nothing to save, {self.message}")
        folder = prepare_map_folder(Path(folder))
        try:
            with tempfile.TemporaryDirectory(dir=folder) as scratch:
                draw_map(self, Path(scratch) / "map.png")
                np.savez_compressed(Path(scratch) / "map.npz", **self._arrays())
                for name in FILES:
                    os.replace(Path(scratch) / name, folder / name)
        except OSError as error:
            raise InputError(f"--out {folder}: {error.strerror or error}") from None
        return folder / "map.npz"

    def _arrays(self) -> dict[str, Any]:
        names = ("x_edges", "landings", "solutions", "margin", "x", "theta", "z", "samples")
        arrays = {name: np.asarray(getattr(self, name)) for name in names}
        edges = np.empty(0) if self.theta_edges is None else self.theta_edges
        return arrays | {"theta_edges": edges}


def prepare_map_folder(folder: Path) -> Path:
    """Make `folder` if need be and make sure it takes the files; InputError if not."""
    folder = prepare_folder(folder)
    for name in FILES:
        if (folder / name).is_dir():
            raise InputError(f"--out {folder}: {name} is a folder there")
    return folder


def reach_map(
    scene: Scene | str | Path,
    z: float | None = None,
    samples: int = SAMPLES,
    *,
    progress: Progress | None = None,
) -> ReachMap:
    """The landing poses in reach of a scene at height `z` [m], by default the target's.

    The same arguments give the same map. progress(done, samples) is called on the way.
    Raises InputError for a scene that cannot be planned and for numbers out of range; a
    height that no throw comes down through gives an empty map with its message.
    """
    scene = as_scene(scene)
    check_map(z, samples)
    mover = make_mover(scene)
    check_start(scene, mover)
    assert scene.target is not None  # checked by Scene, for all that have a mover
    height = scene.target.z if z is None else float(z)
    target = dataclasses.replace(scene.target, z=height)
    parts: list[tuple[Array, Array, Array, Counts]] = []
    down, best, done = 0, (-math.inf, ""), 0
    for count, drawn in _chunks(scene, mover, samples):
        thrown = Throws.of(*drawn)
        x, theta, time = land(thrown.detach, height, scene.gravity).T
        in_time = np.isfinite(time) & (time <= FLIGHT_MAX)
        down += int(in_time.sum())
        if not down:
            best = max(best, *(_highest(part, target, scene.gravity) for part in drawn))
        # Only what lands is asked for its way there.
        thrown, x, theta, time = thrown.picked(in_time), x[in_time], theta[in_time], time[in_time]
        good = _wound_up(scene, mover, thrown) & _off_floor(scene, mover, thrown)
        good &= _bounded(scene, thrown, time) & _beside_column(scene, thrown, time)
        thrown = thrown.picked(good)
        parts.append((x[good], theta[good], margins(scene, mover, thrown), _cells(mover, thrown)))
        done += count
        if progress is not None:
            progress(done, samples)
    x, theta, margin, cells = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    if not x.size:
        message = _why_nothing(height, down, best)
        empty = np.zeros((0, 1))
        counts = empty.astype(np.int64)
        return ReachMap(
            scene, height, samples, np.empty(0), None, counts, counts, empty, x, theta, message
        )
    angle = scene.target.theta is not None
    return _sorted_in(scene, height, samples, angle, x, theta, margin, cells)


def check_map(z: float | None, samples: int, prefix: str = "") -> None:
    """InputError for numbers out of range; `prefix` as on the command line."""
    if z is not None:
        number = isinstance(z, float | int | np.number) and not isinstance(z, bool)
        if not number or not abs(z) <= FARTHEST:
            most = f"{FARTHEST:g}"
            raise InputError(f"{prefix}z = {z!r}: must be a number, -{most} to {most} m")
    whole = isinstance(samples, int | np.integer) and not isinstance(samples, bool)
    if not whole or not 1 <= samples <= MOST:
        raise InputError(f"{prefix}samples = {samples!r}: must be a whole number, 1 to {MOST}")


def margins(scene: Scene, mover: Mover, throws: Throws) -> Array:
    """1 - largest use of a limit (N,) at the opening's start and end, and where it stops.

    Uses are shares of the planner's limits: rates, accelerations, the way from the middle of
    a coordinate's range to its end, and friction (root of the ellipsoid) at full grip.
    """
    limits, q, dq, ddq = mover.planning, throws.q, throws.dq, throws.ddq
    end, stop, rate = _ahead(scene, mover, throws)
    middle, half = (limits.q_max + limits.q_min) / 2, (limits.q_max - limits.q_min) / 2
    half = np.maximum(half, 1e-12)
    uses = [np.abs(v) / limits.dq for v in (dq, rate)] + [np.abs(ddq) / limits.ddq]
    uses += [np.abs(position - middle) / half for position in (q, end, stop)]
    most = np.max([use.max(axis=1) for use in uses], axis=0)
    return np.asarray(1.0 - np.maximum(most, _friction_use(scene, mover, throws)))


def _friction_use(scene: Scene, mover: Mover, throws: Throws) -> Array:
    """Friction use (N,) of the held bar at the opening's start; 1 slips."""
    motion = mover.motion(throws.q.T, throws.dq.T, throws.ddq.T)
    pose, twist, acceleration = (np.array(o) for o in motion)
    hand = HandMotion(pose[2], twist[2], *acceleration)
    theta, h = pose[2] + scene.grasp.angle, scene.com_offset
    x_r, z_r = h * np.cos(theta), h * np.sin(theta)
    wrench = pivot_wrench(scene.body, scene.gravity, hand, hand.omega, x_r, z_r)
    full = scene.gripper.profile().full
    return np.asarray(np.sqrt(scene.patch.utilisation_squared(*wrench, full)))


def _ahead(scene: Scene, mover: Mover, throws: Throws) -> tuple[Array, Array, Array]:
    """Coordinates (N, n) at the opening's end and after braking, and rates at its end."""
    opening = scene.gripper.profile().opening
    end = throws.q + throws.dq * opening + throws.ddq * opening**2 / 2
    rate = throws.dq + throws.ddq * opening
    way = rate * np.abs(rate) / (2 * BRAKE_SHARE * mover.planning.ddq)
    return end, end + way, rate


def _chunks(scene: Scene, mover: Mover, samples: int) -> Iterator[tuple[int, list[Releases]]]:
    """(states drawn, releases that can be thrown from a free start) of each chunk."""
    # A start that is given says where the wind-up begins, not where the run-up does.
    sampler = ReleaseSampler(scene, dataclasses.replace(mover, start=None))
    for seed, first in enumerate(range(0, samples, CHUNK)):
        count = min(CHUNK, samples - first)
        drawn = [sampler.draw(count, seed)]
        if seed == 0 and mover.start is not None:
            # The last of a draw just lets go at the start.
            drawn.append(ReleaseSampler(scene, mover).draw(1))
        yield count, drawn


def _highest(releases: Releases, target: Pose, gravity: float) -> tuple[float, str]:
    """Highest rise [m] of the releases and words on it; -inf if there are none."""
    _, pose, words = highest(releases, target, gravity)
    return (-math.inf if pose is None else pose.z), words


def _run_up_start(throws: Throws) -> Array:
    """Coordinates (N, n) at rest before the run-up, whose rate is a t^2 + b t^3."""
    time = throws.run_up[:, None]
    # With the rate and the acceleration of the release at its end.
    return np.asarray(throws.q - throws.dq * time / 2 + throws.ddq * time**2 / 12)


def _wound_up(scene: Scene, mover: Mover, throws: Throws) -> Flags:
    """Whether the longest carry (N,) leaves time to go from the start to the run-up's start.

    By a quintic from rest to rest, whose peaks are 15/8 d/T, 10/sqrt(3) d/T^2, 60 d/T^3.
    """
    if mover.start is None:
        return np.ones(len(throws.q), dtype=bool)
    limits, way = mover.planning, np.abs(_run_up_start(throws) - mover.start)
    times = [15 / 8 * way / limits.dq, np.sqrt(10 / math.sqrt(3) * way / limits.ddq)]
    if limits.jerk is not None:
        times.append(np.cbrt(60 * way / limits.jerk))
    needed = np.max(times, axis=0).max(axis=1, initial=0.0)
    return np.asarray(needed + throws.run_up <= scene.mesh.carry_max)


def _off_floor(scene: Scene, mover: Mover, throws: Throws) -> Flags:
    """Whether arm, hand and held bar (N,) are off the floor at all ends of the motion."""
    fine = np.ones(len(throws.q), dtype=bool)
    workspace = scene.workspace
    if workspace is None or workspace.floor is None or not fine.size:
        return fine
    end, stop, _ = _ahead(scene, mover, throws)
    outline = outline_kernel(mover.motion, mover.kinematics)
    for q, holds in ((_run_up_start(throws), True), (throws.q, True), (end, False), (stop, False)):
        hand, lowest = outline(q)
        lowest = np.minimum(np.ravel(lowest), hand[:, 1])
        if scene.arm is not None:
            lowest = np.minimum(lowest, palm_corners(scene.arm.tool, hand.T)[1].min(axis=1))
        if holds:
            theta, h = hand[:, 2] + scene.grasp.angle, scene.com_offset
            com = np.array([hand[:, 0], hand[:, 1] + h * np.sin(theta), theta])
            lowest = np.minimum(lowest, lowest_of_bar(scene.object, com))
        fine &= lowest >= workspace.floor
    return fine


def _beside_column(scene: Scene, throws: Throws, time: Array) -> Flags:
    """Whether the flying bar (N,) passes the base column, and lands beside it."""
    fine = np.ones(len(throws.q), dtype=bool)
    workspace = scene.workspace
    if workspace is None or workspace.column_radius is None or workspace.column_height is None:
        return fine
    radius, height = workspace.column_radius, workspace.column_height
    x, z, theta, v_x, v_z, omega = throws.detach.T
    for share in np.linspace(0.0, 1.0, FLIGHT_INSTANTS):
        t = share * time
        com = np.array([x + v_x * t, z + (v_z - scene.gravity * t / 2) * t, theta + omega * t])
        room = np.maximum(np.abs(com[0]) - radius, com[1] - height)
        near = np.flatnonzero(room < reach_of_bar(scene.object))
        fine[near] &= column_distance(scene.object, com[:, near], radius, height) >= 0.0
    return fine


def _bounded(scene: Scene, throws: Throws, time: Array) -> Flags:
    """Whether the landings (N,) keep the bounds of [landing]."""
    bounds = scene.landing
    v_x, v_z, omega = throws.detach.T[3:]
    fine = np.ones(len(time), dtype=bool)
    if bounds is None:
        return fine
    speed = np.hypot(v_x, v_z - scene.gravity * time)
    fine &= speed >= bounds.speed_min
    if bounds.speed_max is not None:
        fine &= speed <= bounds.speed_max
    if bounds.rate_max is not None:
        fine &= np.abs(omega) <= bounds.rate_max
    return fine


def _cells(mover: Mover, throws: Throws) -> Counts:
    """Number (N,) of each release's cell in the grid over coordinates and rates."""
    limits, count = mover.planning, math.ceil(1 / CELL)
    wide = np.maximum(limits.q_max - limits.q_min, 1e-12)
    shares = np.hstack([(throws.q - limits.q_min) / wide, throws.dq / limits.dq / 2 + 0.5])
    places = np.clip((shares / CELL).astype(np.int64), 0, count - 1)
    return np.asarray(places @ count ** np.arange(places.shape[1], dtype=np.int64))


def _sorted_in(
    scene: Scene,
    z: float,
    samples: int,
    angle: bool,
    x: Array,
    theta: Array,
    margin: Array,
    cells: Counts,
) -> ReachMap:
    """The landings in bins; those of theta only if it counts."""
    x_edges, theta_edges = _edges(x, theta, angle)
    shape = (len(x_edges) - 1, 1 if theta_edges is None else len(theta_edges) - 1)
    place = _places(x_edges, x) * shape[1]
    if theta_edges is not None:
        place = place + _places(theta_edges, theta)
    size = shape[0] * shape[1]
    best = np.full(size, -np.inf)
    np.maximum.at(best, place, margin)
    different = np.unique(np.column_stack([place, cells]), axis=0)[:, 0]
    return ReachMap(
        scene,
        z,
        samples,
        x_edges,
        theta_edges,
        np.bincount(place, minlength=size).reshape(shape),
        np.bincount(different, minlength=size).reshape(shape),
        np.where(np.isfinite(best), best, np.nan).reshape(shape),
        x,
        theta,
    )


def _edges(x: Array, theta: Array, angle: bool) -> tuple[Array, Array | None]:
    """Edges of the bins, multiples of widths that leave enough landings in a bin."""
    axes = [x, theta] if angle else [x]
    coarser = (tuple(2.0**k * width for width in WIDTHS[-1]) for k in range(1, 60))
    edges: list[Array] = []
    for number, widths in enumerate((*WIDTHS, *coarser)):
        if any(np.ptp(v) > (BINS - 2) * w for v, w in zip(axes, widths, strict=False)):
            continue
        edges = [_multiples(v, w) for v, w in zip(axes, widths, strict=False)]
        places = [_places(e, v) for e, v in zip(edges, axes, strict=True)]
        reached = np.unique(np.column_stack(places), axis=0)
        if len(x) >= FILL * len(reached) or number >= len(WIDTHS) - 1:
            break
    return edges[0], edges[1] if angle else None


def _multiples(values: Array, width: float) -> Array:
    """Multiples of `width` around all values, none of which is on the last by rounding."""
    first = math.floor(float(values.min()) / width - 1e-9)
    last = math.floor(float(values.max()) / width + 1e-9) + 1
    return np.asarray(np.arange(first, last + 1) * width, dtype=np.float64)


def _places(edges: Array, values: Array) -> Counts:
    """Index (N,) of the bin of each value, -1 or len(edges) - 1 outside."""
    return np.asarray(np.searchsorted(edges, values, side="right") - 1, dtype=np.int64)


def _place(edges: Array, value: float) -> int:
    """Index of a value's bin, -1 outside."""
    place = int(_places(edges, np.array([value]))[0]) if math.isfinite(value) else -1
    return place if place < len(edges) - 1 else -1


def _why_nothing(z: float, down: int, best: tuple[float, str]) -> str:
    """Why no throw was found; best: highest rise [m] of all and words on it."""
    if down:
        kept = "keeps floor, base column, longest carry and the bounds of [landing]"
        return f"no throw found: none of {down:,} sampled throws down to z {z:g} m {kept}"
    if best[0] > z:
        return f"no throw found: none comes down through z {z:g} m within {FLIGHT_MAX:g} s"
    return best[1]
