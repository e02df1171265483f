"""Error against solving time of the planner's settings."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]

COLOURS = ("#222222", "#8a8f98", "#4c78a8", "#2a9d6f", "#f2a33a", "#d1495b", "#9467bd", "#17becf")
#: Size of the labels, width of one of their letters [points], and room about a marker.
LETTERS, WIDE, MARKER = 6.0, 3.8, 6.5


def draw_settings(
    path: Path,
    points: npt.NDArray[np.float64],
    kinds: list[str],
    labels: list[str],
    best: list[bool],
) -> None:
    """Points (N, 2): solving time [ms], error [mm]; families by colour, Pareto points ringed."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots()
    names, words = {"integrator": "rk4: opening × substeps"}, [""] * len(labels)
    for kind, color in zip(dict.fromkeys(kinds), COLOURS, strict=False):
        members = [k for k, other in enumerate(kinds) if other == kind]
        members = [k for k in members if np.isfinite(points[k]).all()]
        if not members:
            continue
        mine = kind == "default"
        axes.plot(
            *points[members].T,
            marker="D" if mine else "o",
            ms=9 if mine else 5,
            # No line between solvers.
            lw=0.0 if kind in ("compiled", "IPOPT") else 0.8,
            color=color,
            label=names.get(kind, kind),
            zorder=2,
        )
        for k in members:
            short = labels[k].replace("integrator rk4, opening ", "").replace(", substeps ", " × ")
            words[k] = short.removeprefix(f"{kind} ").replace("as it is", "" if mine else "default")
    ringed = points[np.array(best)]
    axes.plot(*ringed.T, "o", ms=13, mfc="none", mec="#222222", lw=0, label="Pareto set")
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel("solve [ms]")
    axes.set_ylabel("scaled error before correction [mm]")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3, which="both")
    figure.draw_without_rendering()
    known = [k for k, word in enumerate(words) if word]
    _label(axes, points[known], [words[k] for k in known])
    figure.savefig(path, dpi=110)


def _label(axes: Axes, points: Array, words: list[str]) -> None:
    """Each of `words` as near its point (N, 2) as others and their points leave room."""
    scale = 72.0 / axes.get_figure(root=True).dpi  # type: ignore[union-attr]
    places = scale * axes.transData.transform(points)
    taken = [(*place - MARKER, *place + MARKER) for place in places]
    for point, place, word in zip(points, places, words, strict=True):
        size = np.array([WIDE * len(word), LETTERS])
        away = min(_ways(size), key=lambda way: _cost(place + way, size, taken, way))
        taken.append((*place + away, *place + away + size))
        far = math.hypot(*(away + size / 2)) > 3 * LETTERS
        axes.annotate(
            word,
            point,
            fontsize=LETTERS,
            xytext=tuple(away),
            textcoords="offset points",
            arrowprops={"arrowstyle": "-", "lw": 0.4, "color": "#8a8f98"} if far else None,
        )


def _ways(size: Array) -> list[Array]:
    """Offsets [points] of a label's lower left corner from its point, near ones first."""
    return [
        np.array([math.cos(turn), math.sin(turn)]) * (radius + size / 2) - size / 2
        for radius in (MARKER, 1.5 * MARKER, 2 * MARKER, 3 * MARKER, 4 * MARKER, 6 * MARKER)
        for turn in np.radians([-45, 45, 135, -135, 0, 180, 90, -90, 20, -20, 160, -160])
    ]


def _cost(
    corner: Array, size: Array, taken: list[tuple[float, float, float, float]], way: Array
) -> float:
    """How much of a label would cover others [square points], and how far off it is."""
    covered = 0.0
    for left, low, right, high in taken:
        wide = min(corner[0] + size[0], right) - max(corner[0], left)
        tall = min(corner[1] + size[1], high) - max(corner[1], low)
        covered += max(wide, 0.0) * max(tall, 0.0)
    return covered + 0.05 * math.hypot(*(way + size / 2))
