"""Error against solving time of the planner's settings."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
from matplotlib.figure import Figure

COLOURS = ("#222222", "#8a8f98", "#4c78a8", "#2a9d6f", "#f2a33a", "#d1495b", "#9467bd", "#17becf")


def draw_settings(
    path: Path,
    points: npt.NDArray[np.float64],
    kinds: list[str],
    labels: list[str],
    best: list[bool],
) -> None:
    """Points (N, 2): solving time [ms], error [mm]; families by colour, Pareto points ringed."""
    figure = Figure(figsize=(9, 6), layout="constrained")
    axes = figure.subplots()
    names = {"integrator": "rk4: opening × substeps"}
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
            short = short.removeprefix(f"{kind} ").replace("as it is", "" if mine else "default")
            above = 4 if k % 2 else -8
            axes.annotate(
                short, points[k], fontsize=6, xytext=(3, above), textcoords="offset points"
            )
    ringed = points[np.array(best)]
    axes.plot(*ringed.T, "o", ms=13, mfc="none", mec="#222222", lw=0, label="Pareto set")
    axes.set(xscale="log", yscale="log")
    axes.set_xlabel("solve [ms]")
    axes.set_ylabel("scaled error before correction [mm]")
    axes.legend(fontsize=8)
    axes.grid(alpha=0.3, which="both")
    figure.savefig(path, dpi=110)
