"""How much less robust plans spread than nominal ones, a dot a target."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

#: Where a target without a plan is drawn, and the least ratio that is told apart.
LOST, LEAST = 20.0, 1e-4


def draw_ratios(ratios: dict[str, npt.NDArray[np.float64]], path: Path) -> None:
    """Ratios (N,) by method, infinite without a plan; a bar at each median."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9, 4.5), layout="constrained")
    axes = figure.subplots()
    rng = np.random.default_rng(0)
    for place, found in enumerate(ratios.values()):
        solved = np.isfinite(found)
        height = np.where(solved, np.maximum(found, LEAST), LOST)
        across = place + rng.uniform(-0.25, 0.25, found.size)
        axes.plot(across[solved], height[solved], ".", color="#4c78a8", ms=5)
        axes.plot(across[~solved], height[~solved], "x", color="#d1495b", ms=5)
        # As in the table: one of them, not a mean of two of which one may be lost.
        middle = float(np.percentile(height, 50, method="higher"))
        axes.plot([place - 0.35, place + 0.35], [middle, middle], color="#222222", lw=2)
    axes.axhline(1.0, color="#8a8f98", lw=0.8, ls="--")
    axes.set_yscale("log")
    axes.set_xticks(range(len(ratios)), list(ratios))
    axes.set_ylabel("spread / nominal spread\n(× : no plan)")
    axes.grid(axis="y", alpha=0.3)
    figure.savefig(path, dpi=110)
