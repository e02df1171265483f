"""landings.png: where the throws of a sweep land, as points and as bars."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..check import bar_outline
from ..show import MIN_WIDTH
from .sweep import Sweep
from .sweep_units import unit_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]

GREEN, RED, GREY, BLACK = "#2a9d6f", "#d1495b", "#8a8f98", "#222222"
#: Points and bars shown of many; margin around them, as a share.
POINTS, BARS, MARGIN = 5000, 120, 0.06
#: Least span of an axis [mm, deg].
LEAST = 0.02


def draw_landings(sweep: Sweep, path: Path) -> None:
    """Landings about the target with the tolerance, and the bars as they come down."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 5.2), layout="constrained")
    points, bars = figure.subplots(1, 2, width_ratios=(1.35, 1))
    _draw_points(points, sweep)
    _draw_bars(bars, sweep)
    shown = min(sweep.samples, POINTS)
    some = "" if shown == sweep.samples else f", {shown:,} of them shown"
    rate = 100 * float(sweep.success.mean())
    figure.suptitle(
        f"{sweep.label}: {sweep.samples:,} throws by {sweep.thrower.model}{some}; "
        f"{rate:.1f} % succeed",
        x=0.01,
        ha="left",
        fontsize=11,
    )
    figure.savefig(path, dpi=110)


def widen(axis: Axes, vertical: bool = True) -> None:
    """Axes [mm, deg] no narrower than `LEAST`: nobody wants to look at rounding."""
    for limits, low, high in (("set_xlim", *axis.get_xlim()), ("set_ylim", *axis.get_ylim())):
        if high - low < LEAST and (vertical or limits == "set_xlim"):
            middle = (low + high) / 2
            getattr(axis, limits)(middle - LEAST / 2, middle + LEAST / 2)


def _draw_points(axis: Axes, sweep: Sweep) -> None:
    """Landing x and theta from the target, coloured by the parameter that matters most."""
    from matplotlib.patches import Rectangle

    scene, target = sweep.plan.scene, sweep.plan.target
    shown = slice(None, POINTS)
    pose, held = sweep.landings.pose[shown], sweep.landings.held[shown]
    about = float(sweep.nominal.pose[0, 1]) if target.theta is None else target.theta
    x, theta = 1e3 * (pose[:, 0] - target.plane_x), np.degrees(pose[:, 1] - about)
    name = max(sweep.shares, key=lambda key: sum(sweep.shares[key]))
    factor, unit = unit_of(name)
    colour = factor * sweep.values[shown, sweep.sampler.names.index(name)]
    style: dict[str, Any] = {"cmap": "viridis", "vmin": colour.min(), "vmax": colour.max()}
    size = 14 if len(x) <= 2000 else 6
    found = axis.scatter(x[held], theta[held], s=size, c=colour[held], lw=0, **style)
    if not held.all():
        lost = ~held
        axis.scatter(
            x[lost],
            theta[lost],
            s=22,
            c=colour[lost],
            marker="x",
            lw=0.9,
            label="slips in the full grip before it opens",
            **style,
        )
    label = f"{name.replace('_', ' ')} [{unit}]" if unit else name
    axis.figure.colorbar(found, ax=axis, label=label, pad=0.01)
    position, angle = 1e3 * scene.tolerance.position, math.degrees(scene.tolerance.angle)
    box: dict[str, Any] = {"fill": False, "ec": RED, "lw": 1.6, "zorder": 4, "label": "tolerance"}
    if target.theta is None:
        axis.axvspan(-position, position, color=GREEN, alpha=0.25, lw=0, label="tolerance")
    else:
        axis.add_patch(Rectangle((-position, -angle), 2 * position, 2 * angle, **box))
    nominal = sweep.nominal.pose[0]
    axis.plot(
        1e3 * (nominal[0] - target.plane_x),
        math.degrees(nominal[1] - about),
        "P",
        color=BLACK,
        mec="white",
        ms=10,
        zorder=5,
        label="nominal",
    )
    origin = "nominal" if target.theta is None else "target"
    axis.set(xlabel="x − target [mm]", ylabel=f"θ − {origin} [deg]")
    widen(axis)
    axis.grid(alpha=0.25)
    axis.legend(loc="best", fontsize=9, framealpha=0.9)


def _draw_bars(axis: Axes, sweep: Sweep) -> None:
    """Bars as their CoM passes the target's height, and the cup."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Polygon

    scene, target = sweep.plan.scene, sweep.plan.target
    landed = np.flatnonzero(np.isfinite(sweep.landings.pose[:, 0]))[:BARS]
    success = sweep.success[landed]
    outlines = _outlines(sweep, sweep.landings.pose[landed])
    thin: dict[str, Any] = {"facecolor": "none", "lw": 0.6, "alpha": 0.5}
    for kind, colour, words in ((~success, RED, "fails"), (success, GREEN, "succeeds")):
        if kind.any():
            axis.add_collection(PolyCollection(list(outlines[kind]), edgecolor=colour, **thin))
            axis.plot([], [], color=colour, label=words)
    if np.isfinite(sweep.nominal.pose[0, 0]):
        nominal = _outlines(sweep, sweep.nominal.pose)[0]
        axis.add_patch(Polygon(nominal, fill=False, ec=BLACK, lw=1.6, label="nominal"))
        outlines = np.concatenate([outlines, nominal[None]])
    cup = scene.cup
    if cup is not None:
        bottom, left, right = cup.rim - cup.depth, cup.x - cup.radius, cup.x + cup.radius
        wall: dict[str, Any] = {"color": "#5b4a3f", "lw": 3, "solid_capstyle": "butt"}
        axis.plot([left, left, right, right], [cup.rim, bottom, bottom, cup.rim], **wall)
        outlines = np.concatenate([outlines, [[[left, bottom], [right, bottom]] * 2]])
    axis.plot([target.plane_x], [target.z], "+", color=BLACK, ms=11)
    low, high = outlines.reshape(-1, 2).min(axis=0), outlines.reshape(-1, 2).max(axis=0)
    room = MARGIN * float((high - low).max())
    axis.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room))
    axis.set_aspect("equal")
    axis.set(xlabel="x [m]", ylabel="z [m]")
    few = "" if len(landed) == sweep.samples else f"{len(landed)} of them "
    axis.set_title(f"{few}as the CoM passes z = {target.z:g} m", fontsize=10, loc="center")
    axis.grid(alpha=0.25)
    axis.figure.legend(*axis.get_legend_handles_labels(), loc="outside lower right", ncols=3)


def _outlines(sweep: Sweep, pose: Array) -> Array:
    """Corners (N, 4, 2) of the bars, widened to be seen, at landings (N, 3)."""
    import dataclasses

    bar = sweep.plan.scene.object
    wide = dataclasses.replace(bar, width=max(bar.width, MIN_WIDTH))
    height = np.full(len(pose), sweep.plan.target.z)
    com = np.array([pose[:, 0], height, pose[:, 1]])
    return np.asarray(bar_outline(wide, com).transpose(1, 2, 0))
