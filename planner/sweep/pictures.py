"""A sweep in four pictures: landings.png, delay.png, histogram.png, tornado.png."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import MODELS
from ..show import BLACK, BLUE, GREEN, GREY, RED, bar_corners, draw_cup, new_figure, save
from .sweep_sensitivity import OUTER, delay_band, swings
from .sweep_statistics import quantiles, scaled_error
from .sweep_units import unit_of
from .uncertain import quantile

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .sweep import Sweep

Array = npt.NDArray[np.float64]

#: Models whose chunks are smaller than this take milliseconds a throw.
SLOW_CHUNK = 256
#: Points and bars shown of many; margin around the bars, as a share.
POINTS, BARS, MARGIN = 5000, 120, 0.06
#: Least span of an axis [mm, deg]: rounding errors are not spread over a picture.
LEAST = 0.02


def draw_sweep(sweep: Sweep, folder: Path) -> None:
    """The four pictures."""
    for name, draw in (
        ("landings.png", _draw_landings),
        ("delay.png", _draw_delay),
        ("histogram.png", _draw_histogram),
        ("tornado.png", _draw_tornado),
    ):
        draw(sweep, folder / name)


def _title(sweep: Sweep, words: str) -> dict[str, Any]:
    """A line over a picture: the scene, what is shown, how many throws, by which model."""
    text = f"{sweep.label}: {words} ({sweep.samples:,} throws, {sweep.thrower.model})"
    return {"t": text, "x": 0.01, "ha": "left", "fontsize": 11}


def _draw_landings(sweep: Sweep, path: Path) -> None:
    """Landings about the target with the tolerance, and the bars as they come down."""
    figure = new_figure(12, 5.2)
    points, bars = figure.subplots(1, 2, width_ratios=(1.35, 1))
    _draw_points(points, sweep)
    _draw_bars(bars, sweep)
    some = f"{POINTS:,} landings shown, " if sweep.samples > POINTS else ""
    figure.suptitle(**_title(sweep, f"{some}{100 * float(sweep.success.mean()):.1f} % succeed"))
    save(figure, path)


def _widen(axes: Axes, *names: str) -> None:
    """Axes "x" and "y" [mm, deg] no narrower than `LEAST`."""
    for name in names:
        low, high = getattr(axes, f"get_{name}lim")()
        if high - low < LEAST:
            middle = (low + high) / 2
            getattr(axes, f"set_{name}lim")(middle - LEAST / 2, middle + LEAST / 2)


def _draw_points(axes: Axes, sweep: Sweep) -> None:
    """Landing x and theta from the target, coloured by the parameter that matters most."""
    from matplotlib.patches import Rectangle

    scene, target = sweep.plan.scene, sweep.plan.target
    pose, held = sweep.landings.pose[:POINTS], sweep.landings.held[:POINTS]
    nominal = sweep.nominal.pose[0]
    about = float(nominal[1]) if target.theta is None else target.theta
    name = max(sweep.shares, key=lambda key: sum(sweep.shares[key]))
    factor, unit = unit_of(name)
    colour = factor * sweep.values[:POINTS, sweep.sampler.names.index(name)]
    style: dict[str, Any] = {"cmap": "viridis", "vmin": colour.min(), "vmax": colour.max()}
    x, theta = 1e3 * (pose[:, 0] - target.plane_x), np.degrees(pose[:, 1] - about)
    size = 14 if len(x) <= 2000 else 6
    found = axes.scatter(x[held], theta[held], s=size, c=colour[held], lw=0, **style)
    if not held.all():
        style |= {"s": 22, "marker": "x", "lw": 0.9, "c": colour[~held]}
        axes.scatter(
            x[~held], theta[~held], label="slips in the full grip before it opens", **style
        )
    label = f"{name.replace('_', ' ')} [{unit}]" if unit else name
    axes.figure.colorbar(found, ax=axes, label=label, pad=0.01)
    position, angle = 1e3 * scene.tolerance.position, math.degrees(scene.tolerance.angle)
    if target.theta is None:
        axes.axvspan(-position, position, color=GREEN, alpha=0.25, lw=0, label="tolerance")
    else:
        box: dict[str, Any] = {"fill": False, "ec": RED, "lw": 1.6, "zorder": 4}
        corner = (-position, -angle)
        axes.add_patch(Rectangle(corner, 2 * position, 2 * angle, label="tolerance", **box))
    place = 1e3 * (nominal[0] - target.plane_x), math.degrees(nominal[1] - about)
    axes.plot(*place, "P", color=BLACK, mec="white", ms=10, zorder=5, label="nominal")
    origin = "nominal" if target.theta is None else "target"
    axes.set(xlabel="x − target [mm]", ylabel=f"θ − {origin} [deg]")
    _widen(axes, "x", "y")
    axes.grid(alpha=0.25)
    axes.legend(loc="best", fontsize=9, framealpha=0.9)


def _draw_bars(axes: Axes, sweep: Sweep) -> None:
    """Bars as their CoM passes the target's height, and the cup."""
    from matplotlib.collections import PolyCollection
    from matplotlib.patches import Polygon

    scene, target = sweep.plan.scene, sweep.plan.target
    landed = np.flatnonzero(np.isfinite(sweep.landings.pose[:, 0]))[:BARS]
    success = sweep.success[landed]

    def outline(pose: Array) -> Array:
        return bar_corners(scene.object, np.array([pose[0], target.z, pose[1]]))

    outlines = np.array([outline(pose) for pose in sweep.landings.pose[landed]]).reshape(-1, 4, 2)
    thin: dict[str, Any] = {"facecolor": "none", "lw": 0.6, "alpha": 0.5}
    for kind, colour, words in ((~success, RED, "fails"), (success, GREEN, "succeeds")):
        if kind.any():
            axes.add_collection(PolyCollection(list(outlines[kind]), edgecolor=colour, **thin))
            axes.plot([], [], color=colour, label=words)
    if np.isfinite(sweep.nominal.pose[0, 0]):
        nominal = outline(sweep.nominal.pose[0])
        axes.add_patch(Polygon(nominal, fill=False, ec=BLACK, lw=1.6, label="nominal"))
        outlines = np.concatenate([outlines, nominal[None]])
    points = outlines.reshape(-1, 2)
    cup = scene.cup
    if cup is not None:
        draw_cup(axes, cup)
        low_corner = [cup.x - cup.radius, cup.rim - cup.depth]
        points = np.concatenate([points, [low_corner, [cup.x + cup.radius, cup.rim]]])
    axes.plot([target.plane_x], [target.z], "+", color=BLACK, ms=11)
    low, high = points.min(axis=0), points.max(axis=0)
    margin = MARGIN * float((high - low).max())
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
    axes.set_aspect("equal")
    axes.set(xlabel="x [m]", ylabel="z [m]")
    few = "" if len(landed) == sweep.samples else f"{len(landed)} of them "
    axes.set_title(f"{few}as the CoM passes z = {target.z:g} m", fontsize=10, loc="center")
    axes.grid(alpha=0.25)
    axes.figure.legend(*axes.get_legend_handles_labels(), loc="outside lower right", ncols=3)


def _draw_delay(sweep: Sweep, path: Path) -> None:
    """Landing error over the opening delay: median and band over all other parameters."""
    scene, target = sweep.plan.scene, sweep.plan.target
    limits = _delay_limits(sweep)
    slow = MODELS[sweep.thrower.model].chunk <= SLOW_CHUNK
    delays, pose = delay_band(sweep.thrower, sweep.sampler, limits, slow)
    dx, dtheta = np.moveaxis(pose[:, :, :2] - sweep.nominal.pose[0, :2], 2, 0)
    scaled = scaled_error(dx, dtheta, scene.object.length, target.theta is not None)
    position, angle = 1e3 * scene.tolerance.position, math.degrees(scene.tolerance.angle)
    rows = [("x − target [mm]", 1e3 * (pose[:, :, 0] - target.plane_x), position)]
    if target.theta is not None:
        rows.append(("θ − target [deg]", np.degrees(pose[:, :, 1] - target.theta), angle))
    rows.append(("scaled error [mm]", 1e3 * scaled, math.nan))
    figure = new_figure(8, 2.3 * len(rows) + 0.9)
    panels = figure.subplots(len(rows), 1, sharex=True)
    ends = (sweep.delays.early, sweep.delays.late)
    failing = [end for end in ends if end is not None and limits[0] <= end <= limits[1]]
    for axes, (label, values, tolerance) in zip(panels, rows, strict=True):
        if math.isfinite(tolerance):
            axes.axhspan(-tolerance, tolerance, color=GREEN, alpha=0.18, lw=0, label="tolerance")
            axes.axhline(0.0, color=GREEN, lw=0.8)
        _band(axes, 1e3 * delays, values, bool(set(sweep.sampler.names) - {"delay"}))
        axes.axvline(0.0, color=GREY, lw=0.8, ls=":")
        for i, end in enumerate(failing):
            words = "" if i else "first delay that fails, slip before the opening counted"
            axes.axvline(1e3 * end, color=RED, lw=1.0, ls="--", label=words)
        axes.set_ylabel(label)
        axes.grid(alpha=0.25)
        axes.margins(x=0)
    panels[-1].set_xlabel("opening later than expected [ms]")
    panels[-1].set_ylim(bottom=0)
    panels[0].legend(loc="best", fontsize=9, framealpha=0.9)
    figure.suptitle(**_title(sweep, "landing over the opening delay"))
    save(figure, path)


def _delay_limits(sweep: Sweep) -> tuple[float, float]:
    """Delays [s] about the mean that the picture spans: nearly all that were drawn."""
    names = sweep.sampler.names
    if "delay" not in names:
        return -0.01, 0.01
    i = names.index("delay")
    ends = quantile(sweep.sampler.spreads[i], np.array([0.001, 0.999]), sweep.sampler.ranges[i])
    low, high = ends - sweep.thrower.mean_delay
    return min(float(low), -1e-3), max(float(high), 1e-3)


def _band(axes: Axes, x: Array, values: Array, others: bool) -> None:
    """Median, and 5 to 95 % if parameters other than the delay are uncertain."""
    # A throw that does not land counts as infinitely far; a delay without landings has no line.
    known = np.where(np.isnan(values), np.inf, values)
    band = np.quantile(known, (0.05, 0.5, 0.95), axis=1, method="inverted_cdf")
    low, middle, high = np.where(np.isfinite(band), band, np.nan)
    if others:
        axes.fill_between(x, low, high, color=BLUE, alpha=0.25, lw=0, label="5 to 95 %")
    label = "median over the other parameters" if others else "landing"
    axes.plot(x, middle, color=BLUE, lw=1.8, label=label)


def _draw_histogram(sweep: Sweep, path: Path) -> None:
    """Landing x and theta about the target, and the scaled error with its quantiles."""
    scene, target = sweep.plan.scene, sweep.plan.target
    landed = sweep.landings.pose[np.isfinite(sweep.landings.pose[:, 0])]
    scaled = 1e3 * sweep.errors["scaled"]
    figure = new_figure(12, 3.9)
    left, middle, right = figure.subplots(1, 3)
    dx = 1e3 * (landed[:, 0] - target.plane_x)
    _bars(left, dx, "x − target [mm]", 1e3 * scene.tolerance.position)
    if target.theta is None:
        turned = np.degrees(landed[:, 1] - sweep.nominal.pose[0, 1])
        _bars(middle, turned, "θ − nominal [deg]", math.nan)
    else:
        turned = np.degrees(landed[:, 1] - target.theta)
        _bars(middle, turned, "θ − target [deg]", math.degrees(scene.tolerance.angle))
    _bars(right, scaled[np.isfinite(scaled)], "scaled error from nominal [mm]", math.nan)
    words: dict[str, Any] = {"rotation": 90, "fontsize": 8, "color": RED}
    words |= {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
    for name, value in quantiles(scaled).items():
        if math.isfinite(value):
            right.axvline(value, color=RED, lw=1)
            right.annotate(f"{name} %", (value, 1.01), **words)
    left.set_ylabel("share of the throws [%]")
    left.legend(loc="best", fontsize=9)
    figure.suptitle(**_title(sweep, "landings"))
    save(figure, path)


def _bars(axes: Axes, values: Array, label: str, tolerance: float) -> None:
    """Histogram in per cent, with the tolerance."""
    if values.size:
        count = int(np.clip(math.sqrt(values.size), 10, 60))
        weights = np.full(values.size, 100 / values.size)
        low, high = float(values.min()), float(values.max())
        margin = max(LEAST - (high - low), 0.0) / 2
        edges = np.linspace(low - margin, high + margin, count + 1)
        axes.hist(values, bins=list(edges), weights=weights, color=BLUE)
    if math.isfinite(tolerance):
        axes.axvspan(-tolerance, tolerance, color=GREEN, alpha=0.3, lw=0, label="tolerance")
        for edge in (-tolerance, tolerance):
            axes.axvline(edge, color=GREEN, lw=1)
    axes.set_xlabel(label)
    axes.grid(alpha=0.25, axis="y")
    axes.set_axisbelow(True)


def _draw_tornado(sweep: Sweep, path: Path) -> None:
    """How far each parameter alone moves the landing, from its 5 to its 95 % quantile."""
    poses = swings(sweep.thrower, sweep.sampler)
    moved = np.nan_to_num(poses[:, :, :2] - sweep.nominal.pose[0, :2])
    names = sweep.sampler.names
    figure = new_figure(12, 1.8 + 0.42 * len(names))
    panels = figure.subplots(1, 2)
    parts = (("x [mm]", 1e3, 0), ("θ [deg]", math.degrees(1.0), 1))
    for axes, (label, factor, column) in zip(panels, parts, strict=True):
        order = np.argsort(np.ptp(np.pad(moved[:, :, column], ((0, 0), (0, 1))), axis=1))
        for row, i in enumerate(order):
            share = 100 * sweep.shares[names[i]][column]
            _swing(axes, row, factor * moved[i, :, column], f"{share:.0f} %")
        axes.set_yticks(range(len(names)), [_swing_label(sweep, int(i)) for i in order])
        axes.axvline(0.0, color=BLACK, lw=0.8)
        axes.set_xlabel(f"change of landing {label}")
        axes.margins(x=0.16)
        _widen(axes, "x")
        axes.locator_params(axis="x", nbins=7)
        axes.grid(alpha=0.25, axis="x")
    for colour, words in ((BLUE, "at its 5 % quantile"), (RED, "at its 95 % quantile")):
        panels[0].barh([0], [0], color=colour, label=words)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.suptitle(**_title(sweep, "each parameter alone; % of the landing's variance"))
    save(figure, path)


def _swing(axes: Axes, row: int, ends: Array, words: str) -> None:
    """Two bars from zero to `ends`, the shorter in front, and words next to them."""
    for k in np.argsort(-np.abs(ends)):
        axes.barh(row, ends[k], color=(BLUE, RED)[k], height=0.62, zorder=2)
    place: dict[str, Any] = {"xytext": (5, 0), "textcoords": "offset points", "va": "center"}
    axes.annotate(words, (max(float(ends.max()), 0.0), row), fontsize=9, **place)


def _swing_label(sweep: Sweep, i: int) -> str:
    """Name of a parameter and its two quantiles."""
    name = sweep.sampler.names[i]
    factor, unit = unit_of(name)
    ends = quantile(sweep.sampler.spreads[i], np.array(OUTER), sweep.sampler.ranges[i])
    low, high = (f"{factor * end:.3g}" for end in ends)
    return f"{name.replace('_', ' ')}\n{low} … {high} {unit}".replace("-", "−").rstrip()
