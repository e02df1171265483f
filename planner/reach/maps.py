"""Landing poses in reach: sampled throws, sorted into bins of x and theta.

A bin has a landing if a sampled throw hit it; no plan is made for it. `benchmarks` plans to random
places in such bins. Sampling may have missed an empty bin next to full ones.
"""

from __future__ import annotations

import collections
import dataclasses
import itertools
import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import Array, ReadOnly
from ...problems import InputError, Scene, as_scene, check_arguments, checked
from ...problems.files import filling
from ..library import Library
from ..ocp import CUP_MARGIN, FLIGHT_MAX
from ..samples import highest, joined
from ..search import check_start
from ..throw import make_manipulator
from ..verdict import lands_well
from ..workers import Progress
from .map_samples import allowed, cells_of, chunks, margins
from .picture import MapPicture

Counts = npt.NDArray[np.int64]

#: Bin widths [m, rad]; a map has the finest that meet `MIN_FILL` and `MAX_BINS`.
WIDTHS = tuple(
    (x, math.radians(degrees))
    for x, degrees in ((0.02, 5.0), (0.04, 10.0), (0.06, 15.0), (0.1, 22.5), (0.2, 45.0))
)
#: Fewest landings, on average, of a bin with a landing.
MIN_FILL = 10.0
#: Most bins on each axis.
MAX_BINS = 400
#: Most sampled states.
MOST = 10_000_000
#: Default number of sampled states.
SAMPLES = 200_000
#: Largest height and depth [m] of a map.
FARTHEST = 1e4
#: Files of a map's folder.
MAP_FILES = ("map.png", "map.npz")


@dataclass(frozen=True, eq=False)
class ReachMap(ReadOnly):
    """Landing poses that sampled throws of `scene` reach at height `z` [m].

    samples: states drawn. x_edges (X + 1,) [m] and theta_edges (T + 1,) [rad] of the bins;
    theta_edges is None and T is 1 where the scene leaves theta open. Per bin (X, T):
    landings, how many throws landed there; solutions, how many different throws (occupied
    cells of a grid over coordinates and rates, 0.15 of each range wide, so neighbours
    across a cell's border count as two); margin, the best 1 - (largest use of velocity,
    acceleration, position range and grip), NaN without a landing. x, theta (N,): the
    landings. solved (2, S), beyond (2, B): x and theta of the throws of the scene's library, and
    of the places that it found to be out of reach, with the limits (B,) that bind there; empty
    without one. message: why no pose is in reach, empty if one is.
    """

    scene: Scene
    z: float
    samples: int
    x_edges: Array = field(default_factory=lambda: np.empty(0))
    theta_edges: Array | None = None
    landings: Counts = field(default_factory=lambda: np.zeros((0, 1), np.int64))
    solutions: Counts = field(default_factory=lambda: np.zeros((0, 1), np.int64))
    margin: Array = field(default_factory=lambda: np.zeros((0, 1)))
    x: Array = field(default_factory=lambda: np.empty(0))
    theta: Array = field(default_factory=lambda: np.empty(0))
    solved: Array = field(default_factory=lambda: np.zeros((2, 0)))
    beyond: Array = field(default_factory=lambda: np.zeros((2, 0)))
    binding: tuple[str, ...] = ()
    message: str = ""

    def __repr__(self) -> str:
        """One line instead of the arrays."""
        return f"ReachMap({self.scene.name}: {self.reachable:,} bins in reach at z {self.z:g} m)"

    @property
    def reachable(self) -> int:
        """Number of bins with a landing."""
        return int(np.count_nonzero(self.landings))

    @property
    def widths(self) -> tuple[float, float | None]:
        """Width of the bins [m, rad]; None where theta is open."""
        if not self.reachable:
            return WIDTHS[0][0], None
        theta = self.theta_edges
        angle = None if theta is None else float(theta[1] - theta[0])
        return float(self.x_edges[1] - self.x_edges[0]), angle

    @check_arguments
    def bin_of(self, x: float, theta: float | None = None) -> tuple[int, int] | None:
        """Indices of the bin at `x` [m], `theta` [rad]; None outside all bins."""
        i = place(self.x_edges, x)
        j = 0
        if self.theta_edges is not None and theta is not None:
            j = place(self.theta_edges, theta)
        return None if i < 0 or j < 0 else (i, j)

    @check_arguments
    def contains(self, x: float, theta: float | None = None) -> bool:
        """Whether a throw landed in the bin of `x` [m], `theta` [rad]; None: at any theta."""
        found = self.bin_of(x, theta)
        if found is None:
            return False
        if theta is None:
            return bool(self.landings[found[0]].any())
        return bool(self.landings[found] > 0)

    @check_arguments
    def distance(self, x: float, theta: float | None = None) -> float:
        """Scaled distance [m] to the nearest landing: |dx| + |dtheta| length / 2 (39).

        Infinite without a landing. Theta does not count where it is open or None.
        """
        if not self.reachable:
            return math.inf
        turn: Array | float = 0.0
        if theta is not None and self.theta_edges is not None:
            turn = self.theta - theta
        return float(self.scene.object.pose_error(self.x - x, turn).min())

    @check_arguments
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
        if self.solved.size:
            answer["solved"] = self.solved.shape[1]
        return answer | ({"message": self.message} if nothing else {})

    def summary(self) -> str:
        """The map in some lines for people; it must hold a landing."""
        wide, angle = self.widths
        size = f"{100 * wide:g} cm" + ("" if angle is None else f" x {math.degrees(angle):g} deg")
        ranges = f"x {self.x.min():.2f} to {self.x.max():.2f} m"
        if angle is not None:
            low, high = np.degrees([self.theta.min(), self.theta.max()])
            ranges += f", theta {low:.0f} to {high:.0f} deg"
        best = 100 * float(np.nanmax(self.margin))
        return (
            f"{self.scene.name}: {self.reachable:,} bins of {size} in reach at z {self.z:g} m "
            f"({self.x.size:,} landings of {self.samples:,} samples)\n"
            f"  {ranges}; best margin {best:.0f} % (left of the limit that is used most)\n"
            f"  {self._target_words()}{self._library_words()}"
        )

    def _library_words(self) -> str:
        """Numbers of solved throws and unreachable places in the library; empty without one."""
        if not self.solved.size:
            return ""
        most = [name for name, _ in collections.Counter(self.binding).most_common(3)]
        limits = f", most of them by {', '.join(most)}" if most else ""
        return (
            f"\n  library: {self.solved.shape[1]:,} solved throws, "
            f"{self.beyond.shape[1]:,} places out of reach{limits}"
        )

    def _target_words(self) -> str:
        """Whether the scene's target is in reach."""
        target = self.scene.target
        assert target is not None  # a scene with a map has one
        x, theta = target.plane_x, target.theta
        words = "middle of the " if target.is_region else ""
        words += f"target x {x:.4g} m" + (" in the throw's plane" if x != target.x else "")
        if theta is not None:
            words += f", theta {math.degrees(theta):g} deg"
        where = self.bin_of(x, theta)
        if where is None or not self.landings[where]:
            away = self.distance(x, theta)
            return f"{words}: in no bin that was hit, nearest landing {away:.3f} m away (scaled)"
        count, margin = self.solutions[where], 100 * self.margin[where]
        different = "1 throw" if count == 1 else f"{count:,} different throws"
        return f"{words}: in reach, {different} in its bin, best margin {margin:.0f} %"

    @check_arguments
    def save(self, folder: str | Path) -> Path:
        """Write map.png and map.npz, all or nothing; returns the path of map.npz.

        map.npz has x_edges, theta_edges (empty where theta is open), landings, solutions,
        margin, x and theta as in this class, and z [m] and samples as scalars.
        """
        if not self.reachable:
            raise InputError(f"{self.scene.place}: nothing to save, {self.message}")
        with filling(Path(folder), MAP_FILES) as scratch:
            self._picture().draw(scratch / "map.png")
            names = ("x_edges", "landings", "solutions", "margin", "x", "theta", "z", "samples")
            arrays: dict[str, Any] = {name: getattr(self, name) for name in names}
            edges = np.empty(0) if self.theta_edges is None else self.theta_edges
            np.savez_compressed(scratch / "map.npz", theta_edges=edges, **arrays)
        return Path(folder) / "map.npz"

    def _picture(self) -> MapPicture:
        """The content of map.png."""
        wide, angle = self.widths
        size = f"{100 * wide:g} cm" + ("" if angle is None else f" × {math.degrees(angle):g}°")
        cup = ", with the cup there" if self.scene.cup is not None else ""
        title = (
            f"{self.scene.name}: landing poses in reach at z = {self.z:g} m{cup}\n"
            f"{self.x.size:,} landings of {self.samples:,} sampled states, bins of {size}; "
            "blank: not hit"
        )
        target, number = self.scene.target, self.solutions.astype(float)
        assert target is not None  # a scene with a map has one
        bins = self.x_edges, self.theta_edges, self.margin, number
        return MapPicture(title, *bins, self.solved, self.beyond, target, self.z)


@check_arguments
def reach_map(
    scene: Scene | str | Path,
    z: float | None = None,
    samples: int = SAMPLES,
    *,
    progress: Progress | None = None,
) -> ReachMap:
    """The landing poses in reach of a scene at height `z` [m], by default the target's.

    Equal arguments give equal maps. progress(done, samples) is called on the way. Raises
    InputError for a scene that cannot be planned and for numbers out of range; if no throw lands at
    the height, the map is empty and has a message.
    """
    scene = as_scene(scene)
    check_map(z, samples)
    manipulator = make_manipulator(scene)
    check_start(scene, manipulator)
    assert scene.target is not None  # checked by Scene, for all that have a manipulator
    height = scene.target.z if z is None else float(z)
    target = dataclasses.replace(scene.target, z=height)
    aimed = scene.aimed_at(target)  # moves the cup along with the target
    parts: list[tuple[Array, Array, Array, Counts]] = []
    down, rise, done = 0, (-math.inf, ""), 0
    for count, drawn in chunks(scene, manipulator, samples):
        thrown = joined(*drawn)
        x, theta, time = scene.flight.land(thrown.detach, height).T
        landed = np.isfinite(time) & (time <= FLIGHT_MAX)
        down += int(landed.sum())
        if not down:
            for part in drawn:
                _, pose, words = highest(part, target, scene.flight)
                rise = max(rise, (-math.inf if pose is None else pose.z, words))
        thrown, x, theta, time = thrown.picked(landed), x[landed], theta[landed], time[landed]
        good = allowed(scene, manipulator, thrown, time)
        good &= lands_well(aimed, thrown.detach, np.column_stack([x, theta, time]), CUP_MARGIN)
        thrown = thrown.picked(good)
        rest = margins(scene, manipulator, thrown), cells_of(manipulator, thrown)
        parts.append((x[good], theta[good], *rest))
        done += count
        if progress is not None:
            progress(done, samples)
    x, theta, margin, cells = (np.concatenate(rows) for rows in zip(*parts, strict=True))
    empty = ReachMap(scene, height, samples, x=x, theta=theta)
    library = Library(scene, manipulator)
    if len(library):
        beyond = library.records[library.records["boundary"]]
        empty = dataclasses.replace(
            empty,
            solved=library.landings(height)[:2],
            beyond=beyond["landing"].T.astype(float),
            binding=tuple(name.decode() for name in beyond["binding"][:, 0]),
        )
    if not x.size:
        return dataclasses.replace(empty, message=_why_nothing(height, down, rise))
    return _binned(empty, margin, cells)


def check_map(z: float | None, samples: int, prefix: str = "") -> None:
    """InputError for numbers out of range; `prefix` as on the command line."""
    checked(f"{prefix}z", z, float | None, {"least": -FARTHEST, "most": FARTHEST})
    checked(f"{prefix}samples", samples, int, {"least": 1, "most": MOST})


def _binned(found: ReachMap, margin: Array, cells: Counts) -> ReachMap:
    """The map with its landings in bins, of theta only where the target has one.

    margin (N,): of each landing; cells (N,): equal for throws that count as one.
    """
    x, theta, target = found.x, found.theta, found.scene.target
    angle = target is not None and target.theta is not None
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


def places(edges: Array, values: Array) -> Counts:
    """Index (N,) of the bin of each value, -1 or len(edges) - 1 outside."""
    return np.asarray(np.searchsorted(edges, values, side="right") - 1, dtype=np.int64)


def place(edges: Array, value: float) -> int:
    """Index of a value's bin, -1 outside."""
    found = int(places(edges, np.array([value]))[0]) if math.isfinite(value) else -1
    return found if found < len(edges) - 1 else -1
