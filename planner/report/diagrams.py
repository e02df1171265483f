"""Work-precision diagrams: error against time, log-log, the best of each time marked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..sweep import BLACK, BLUE, GREEN, GREY, RED

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]

#: Colour, marker and line of a family; where settings do not form one row of refinements,
#: there is no line.
STYLES = {
    "sp, Euler": (BLUE, "v", ":"),
    "sp, RK4": (BLUE, "o", "-"),
    "sp, RK4, events located": (BLUE, "s", "--"),
    "sp, smoothed, RK4": (BLUE, "x", "-."),
    "ls, Karnopp, Euler": (GREY, "X", ""),
    "ils, LSODA": (RED, "o", ""),
    "ils, Radau": (RED, "^", ""),
    "ils, BDF": (RED, "x", ""),
    "ls-step": (GREEN, "o", "-"),
    "ls-step, extrapolated": (GREEN, "s", "--"),
    "patch": (BLACK, "D", "-"),
    "LuGre": (GREY, "1", ""),
}


@dataclass(frozen=True)
class Point:
    """One run: its family, time [s], error, and whether nothing is both faster and nearer."""

    family: str
    seconds: float
    error: float
    best: bool


@dataclass(frozen=True)
class Panel:
    """One diagram.

    floor: errors below it are drawn on it, as the converged answer is not known better;
    lines: errors that no effort goes below, by family; band: errors between which another
    model lies, and its name.
    """

    label: str
    points: Sequence[Point]
    floor: float
    lines: Mapping[str, float]
    band: tuple[float, float, str] | None = None


def draw_work_precision(rows: Sequence[Sequence[Panel]], title: str, path: Path) -> None:
    """Rows of panels over one time axis, one legend for all."""
    from matplotlib.figure import Figure

    wide, high = len(rows[0]), len(rows)
    figure = Figure(figsize=(4.4 * wide, 3.7 * high + 1.2), layout="constrained")
    grid = figure.subplots(high, wide, sharex=True, squeeze=False)
    for axes, panels in zip(grid, rows, strict=True):
        for axis, panel in zip(axes, panels, strict=True):
            _draw(axis, panel)
    for axis in grid[-1]:
        axis.set_xlabel("time a throw [µs]")
    found: dict[str, Artist] = {}
    for axis in grid.ravel():
        handles, names = axis.get_legend_handles_labels()
        found.update(zip(names, handles, strict=True))
    figure.legend(
        list(found.values()), list(found), loc="outside lower center", ncols=4, fontsize=9
    )
    figure.suptitle(title, x=0.01, ha="left", fontsize=12)
    figure.savefig(path, dpi=110)


def _draw(axis: Axes, panel: Panel) -> None:
    if panel.band:
        low, high, words = panel.band
        axis.axhspan(low, high, color=GREY, alpha=0.2, lw=0, label=words)
    for family, error in panel.lines.items():
        colour = STYLES[family][0]
        words = f"{family.split(',')[0]}, converged"
        axis.axhline(max(error, panel.floor), color=colour, lw=0.9, ls=(0, (1, 3)), label=words)
    for family, (colour, marker, line) in STYLES.items():
        points = [point for point in panel.points if point.family == family]
        if not points:
            continue
        x = [1e6 * point.seconds for point in points]
        y = [max(point.error, panel.floor) for point in points]
        style: dict[str, Any] = {
            "color": colour,
            "marker": marker,
            "ms": 5,
            "lw": 1.1,
            "label": family,
        }
        axis.plot(x, y, ls=line or "none", **style)
    best = [point for point in panel.points if point.best]
    axis.plot(
        [1e6 * point.seconds for point in best],
        [max(point.error, panel.floor) for point in best],
        ls="none", marker="o", ms=11, mfc="none", mec=BLACK, mew=1.0, label="Pareto set",
    )  # fmt: skip
    axis.set_xscale("log")
    axis.set_yscale("log")
    axis.set_title(panel.label, fontsize=10)
    axis.grid(alpha=0.25)


def draw_widths(
    panels: Sequence[tuple[str, Mapping[str, Array]]], steps: Sequence[int], path: Path
) -> None:
    """Error [mm] over the number of steps: per throw a line for each width, no width last."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(3.6 * len(panels), 4.2), layout="constrained")
    axes = figure.subplots(1, len(panels), sharey=True, squeeze=False)
    for axis, (name, lines) in zip(axes[0], panels, strict=True):
        for i, (words, errors) in enumerate(lines.items()):
            last = i == len(lines) - 1
            shade = 0.3 + 0.7 * i / max(len(lines) - 1, 1)
            colour = RED if last else BLUE
            axis.plot(
                steps, errors, color=colour, alpha=1.0 if last else shade, marker="o", ms=3,
                label=words if last else None,
            )  # fmt: skip
            if not last:
                axis.annotate(words, (steps[-1], errors[-1]), xytext=(3, 0), fontsize=7,
                              textcoords="offset points", va="center")  # fmt: skip
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.set_title(name, fontsize=10)
        axis.set_xlabel("even Runge-Kutta steps")
        axis.grid(alpha=0.25)
        axis.set_xlim(steps[0] / 1.4, steps[-1] * 4)
    axes[0][0].set_ylabel("scaled landing error to ε → 0 [mm]")
    axes[0][0].legend(fontsize=8)
    figure.savefig(path, dpi=110)
