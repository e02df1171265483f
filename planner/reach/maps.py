"""Landing poses in reach, in bins of x and theta: their words and file.

A bin has a landing if a sampled throw hit it; no plan is made for it. `benchmarks` plans to random
places in such bins. Sampling may have missed an empty bin next to full ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...models import Array, ReadOnly
from ...problems import InputError, Scene, checked
from ...problems.files import filling

Counts = npt.NDArray[np.int64]

#: Bin widths [m, rad]; a map has the finest that meet `MIN_FILL` and `MAX_BINS`.
WIDTHS = tuple(
    (x, math.radians(degrees))
    for x, degrees in ((0.02, 5.0), (0.04, 10.0), (0.06, 15.0), (0.1, 22.5), (0.2, 45.0))
)
#: Files of a map's folder; the picture of an earlier map goes.
MAP_FILES = ("map.npz", "map.png")


@dataclass(frozen=True, eq=False)
class ReachMap(ReadOnly):
    """Landing poses that sampled throws of `scene` reach at height `z` [m].

    samples: states drawn. x_edges (X + 1,) [m] and theta_edges (T + 1,) [rad] of the bins;
    theta_edges is None and T is 1 where the scene leaves theta open. Per bin (X, T):
    landings, how many throws landed there; solutions, how many different throws (occupied
    cells of a grid over coordinates and rates, 0.15 of each range wide, so neighbours
    across a cell's border count as two); margin, the best 1 - (largest use of velocity,
    acceleration, position range and grip), NaN without a landing. x, theta (N,): the
    landings. solved (2, S): x and theta of the throws of the scene's library. error95 (X, T) [m]:
    the least 95 % pose error of these throws in a bin under what is uncertain, NaN without one;
    None where it was not asked for. message: why no pose was found, empty if one was.
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
    error95: Array | None = None
    message: str = ""

    def __repr__(self) -> str:
        """One line instead of the arrays."""
        return f"ReachMap({self.scene.name}: {self.found:,} bins found at z {self.z:g} m)"

    @property
    def found(self) -> int:
        """Number of bins with a landing."""
        return int(np.count_nonzero(self.landings))

    @property
    def widths(self) -> tuple[float, float | None]:
        """Width of the bins [m, rad]; None where theta is open."""
        if not self.found:
            return WIDTHS[0][0], None
        theta = self.theta_edges
        angle = None if theta is None else float(theta[1] - theta[0])
        return float(self.x_edges[1] - self.x_edges[0]), angle

    def bin_of(self, x: float, theta: float | None = None) -> tuple[int, int] | None:
        """Indices of the bin at `x` [m], `theta` [rad]; None outside all bins."""
        _check_landing(x, theta)
        i, j = place(self.x_edges, x), 0
        if self.theta_edges is not None and theta is not None:
            j = place(self.theta_edges, theta)
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
        _check_landing(x, theta)
        if not self.found:
            return math.inf
        turn: Array | float = 0.0
        if theta is not None and self.theta_edges is not None:
            turn = self.theta - theta
        return float(self.scene.object.pose_error(self.x - x, turn).min())

    def to_dict(self, file: Path | None = None) -> dict[str, Any]:
        """The JSON object of `throwplan map`; a message is in it only if nothing is in reach."""
        nothing = not self.found
        free = nothing or self.theta_edges is None
        answer = {
            "scene": self.scene.name,
            "z": self.z,
            "found": self.found,
            "x": None if nothing else [float(self.x.min()), float(self.x.max())],
            "theta": None if free else [float(self.theta.min()), float(self.theta.max())],
            "file": None if file is None else str(file),
        }
        if self.solved.size:
            answer["solved"] = self.solved.shape[1]
        if self.least is not None:
            error, x, theta = self.least
            answer["least"] = {"error95": error, "x": x, "theta": None if free else theta}
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
            f"{self.scene.name}: at z {self.z:g} m {self.x.size:,} of {self.samples:,} sampled "
            f"throws land in {self.found:,} bins of {size}\n"
            f"  {ranges}, sampled: a plan may reach farther; the best throw keeps {best:.0f} % of "
            "every limit free\n"
            f"  {self._target_words()}{self._library_words()}{self._least_words()}"
        )

    @property
    def least(self) -> tuple[float, float, float] | None:
        """The least of `error95` [m], and the middle x [m], theta [rad] of its bin (theta 0 where
        it is open); None without any."""
        if self.error95 is None or np.isnan(self.error95).all():
            return None
        i, j = np.unravel_index(np.nanargmin(self.error95), self.error95.shape)
        theta = self.theta_edges
        angle = 0.0 if theta is None else float(theta[j : j + 2].mean())
        return float(self.error95[i, j]), float(self.x_edges[i : i + 2].mean()), angle

    def _least_words(self) -> str:
        """Where throws scatter least; empty where that is not known."""
        if self.least is None:
            return ""
        error, x, theta = self.least
        place = f"x {x:.2f} m"
        if self.theta_edges is not None:
            place += f", theta {math.degrees(theta):.0f} deg"
        return f"\n  least 95 % pose error: {1e3 * error:.2g} mm, near {place}"

    def _library_words(self) -> str:
        """Number of solved throws in the library; empty without one."""
        if not self.solved.size:
            return ""
        return f"\n  library: {self.solved.shape[1]:,} solved throws"

    def _target_words(self) -> str:
        """Whether the scene's target is in reach."""
        target = self.scene.aim
        x, theta = target.plane_x, target.theta
        words = "middle of the " if target.is_region else ""
        words += f"target x {x:.4g} m" + (" in the throw's plane" if x != target.x else "")
        if theta is not None:
            words += f", theta {math.degrees(theta):g} deg"
        where = self.bin_of(x, theta)
        if where is None or not self.landings[where]:
            away = self.distance(x, theta)
            return (
                f"{words}: not found, the nearest sampled throw has a pose error of "
                f"{1e3 * away:.0f} mm; a plan may still find one"
            )
        count, margin = self.solutions[where], 100 * self.margin[where]
        different = "1 throw lands" if count == 1 else f"{count:,} different throws land"
        free = f"the best keeps {margin:.0f} % of every limit free"
        return f"{words}: found, {different} near it, {free}"

    def save(self, folder: str | Path) -> Path:
        """Write map.npz; returns its path.

        map.npz has x_edges, theta_edges (empty where theta is open), landings, solutions,
        margin, x, theta and, if asked for, error95 as in this class, and z [m] and samples as
        scalars.
        """
        if not self.found:
            raise InputError(f"{self.scene.place}: nothing to save, {self.message}")
        with filling(Path(folder), MAP_FILES) as scratch:
            names = ("x_edges", "landings", "solutions", "margin", "x", "theta", "z", "samples")
            arrays: dict[str, Any] = {name: getattr(self, name) for name in names}
            if self.error95 is not None:
                arrays["error95"] = self.error95
            edges = np.empty(0) if self.theta_edges is None else self.theta_edges
            np.savez_compressed(scratch / "map.npz", theta_edges=edges, **arrays)
        return Path(folder) / "map.npz"


def _check_landing(x: float, theta: float | None) -> None:
    """InputError for what is no finite number."""
    checked("x", x, float, {})
    checked("theta", theta, float | None, {})


def places(edges: Array, values: Array) -> Counts:
    """Index (N,) of the bin of each value, -1 or len(edges) - 1 outside."""
    return np.asarray(np.searchsorted(edges, values, side="right") - 1, dtype=np.int64)


def place(edges: Array, value: float) -> int:
    """Index of a value's bin, -1 outside."""
    found = int(places(edges, np.array([value]))[0]) if math.isfinite(value) else -1
    return found if found < len(edges) - 1 else -1
