"""Targets on the plane of x and theta, and the nearest poses named for those out of reach."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def draw_targets(path: Path, *, solved: Array, lost: Array, outside: Array, nearest: Array) -> None:
    """Poses (N, 2) [m, rad]; `nearest` belongs to `outside`, row by row."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots()
    for one, other in zip(outside, nearest, strict=True):
        axes.plot(*_shown(np.array([one, other])), color="#dddddd", lw=0.7, zorder=1)
    groups = (
        (solved, "thrown to", "#4c78a8", "."),
        (outside, "out of reach", "#d1495b", "x"),
        (nearest, "nearest pose named", "#2a9d6f", "+"),
        (lost, "no answer", "#222222", "s"),
    )
    for poses, label, color, marker in groups:
        if len(poses):
            words = f"{label} ({len(poses)})"
            axes.plot(*_shown(poses), marker, color=color, label=words, ms=5, zorder=2)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("θ [deg]")
    axes.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False)
    axes.grid(alpha=0.3)
    figure.savefig(path, dpi=110)


def _shown(poses: Array) -> tuple[Array, Array]:
    return poses[:, 0], np.degrees(poses[:, 1])
