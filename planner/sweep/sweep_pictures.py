"""What a sweep found, as pictures: delay.png, histogram.png, tornado.png; and landings.png."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...models import MODELS
from .sweep import Sweep
from .sweep_landings_picture import LEAST, draw_landings, widen
from .sweep_sensitivity import OUTER, delay_band, swings
from .sweep_statistics import quantiles, scaled_error
from .sweep_units import unit_of
from .uncertain import quantile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

BLUE, GREEN, RED, GREY, BLACK = "#4c78a8", "#2a9d6f", "#d1495b", "#8a8f98", "#222222"
#: Models whose chunks are smaller than this take milliseconds a throw.
SLOW_CHUNK = 256


def draw_sweep(sweep: Sweep, folder: Path) -> None:
    """The four pictures."""
    draw_landings(sweep, folder / "landings.png")
    draw_delay(sweep, folder / "delay.png")
    draw_histogram(sweep, folder / "histogram.png")
    draw_tornado(sweep, folder / "tornado.png")


def title(sweep: Sweep, words: str) -> str:
    """One line over a picture: the scene, what is shown, how many throws, by which model."""
    return f"{sweep.label}: {words} ({sweep.samples:,} throws, {sweep.thrower.model})"


def draw_delay(sweep: Sweep, path: Path) -> None:
    """Landing error over the opening delay: median and band over all other parameters."""
    from matplotlib.figure import Figure

    scene, target = sweep.plan.scene, sweep.plan.target
    limits = _delay_limits(sweep)
    slow = MODELS[sweep.thrower.model].chunk <= SLOW_CHUNK
    delays, pose = delay_band(sweep.thrower, sweep.sampler, limits, slow)
    off = pose[:, :, :2] - sweep.nominal.pose[0, :2]
    theta_counts = target.theta is not None
    scaled = scaled_error(off[..., 0], off[..., 1], scene.object.length, theta_counts)
    rows = [
        ("x − target [mm]", 1e3 * (pose[:, :, 0] - target.plane_x), 1e3 * scene.tolerance.position)
    ]
    if target.theta is not None:
        turned = np.degrees(pose[:, :, 1] - target.theta)
        rows.append(("θ − target [deg]", turned, math.degrees(scene.tolerance.angle)))
    rows.append(("scaled error [mm]", 1e3 * scaled, math.nan))
    figure = Figure(figsize=(8, 2.3 * len(rows) + 0.9), layout="constrained")
    axes = figure.subplots(len(rows), 1, sharex=True)
    for axis, (label, values, tolerance) in zip(axes, rows, strict=True):
        if math.isfinite(tolerance):
            axis.axhspan(-tolerance, tolerance, color=GREEN, alpha=0.18, lw=0, label="tolerance")
            axis.axhline(0.0, color=GREEN, lw=0.8)
        _band(axis, 1e3 * delays, values, bool(set(sweep.sampler.names) - {"delay"}))
        axis.axvline(0.0, color=GREY, lw=0.8, ls=":")
        # A bar that has slipped in the full grip has failed wherever it lands.
        words: str | None = "first delay that fails, slip before the opening counted"
        for end in (sweep.delays.early, sweep.delays.late):
            if end is not None and limits[0] <= end <= limits[1]:
                axis.axvline(1e3 * end, color=RED, lw=1.0, ls="--", label=words)
                words = None
        axis.set_ylabel(label)
        axis.grid(alpha=0.25)
        axis.margins(x=0)
    axes[-1].set_xlabel("opening later than expected [ms]")
    axes[-1].set_ylim(bottom=0)
    axes[0].legend(loc="best", fontsize=9, framealpha=0.9)
    figure.suptitle(title(sweep, "landing over the opening delay"), x=0.01, ha="left", fontsize=11)
    _save(figure, path)


def _delay_limits(sweep: Sweep) -> tuple[float, float]:
    """Delays [s] about the mean that the picture spans: nearly all that were drawn."""
    names = sweep.sampler.names
    if "delay" not in names:
        return -0.01, 0.01
    i = names.index("delay")
    ends = quantile(sweep.sampler.spreads[i], np.array([0.001, 0.999]), sweep.sampler.ranges[i])
    low, high = ends - sweep.thrower.mean_delay
    return min(float(low), -1e-3), max(float(high), 1e-3)


def _band(axis: Axes, x: Array, values: Array, others: bool) -> None:
    """Median, and 5 to 95 % where something else than the delay is uncertain."""
    # Nothing lands where all throws of a delay are NaN.
    known = np.where(np.isnan(values), np.inf, values)
    low, middle, high = np.quantile(known, (0.05, 0.5, 0.95), axis=1, method="inverted_cdf")
    low, middle, high = (np.where(np.isfinite(v), v, np.nan) for v in (low, middle, high))
    if others:
        axis.fill_between(x, low, high, color=BLUE, alpha=0.25, lw=0, label="5 to 95 %")
    label = "median over the other parameters" if others else "landing"
    axis.plot(x, middle, color=BLUE, lw=1.8, label=label)


def draw_histogram(sweep: Sweep, path: Path) -> None:
    """Landing x and theta about the target, and the scaled error with its quantiles."""
    from matplotlib.figure import Figure

    scene, target = sweep.plan.scene, sweep.plan.target
    landed = sweep.landings.pose[np.isfinite(sweep.landings.pose[:, 0])]
    figure = Figure(figsize=(12, 3.9), layout="constrained")
    axes = figure.subplots(1, 3)
    dx = 1e3 * (landed[:, 0] - target.plane_x)
    _bars(axes[0], dx, "x − target [mm]", 1e3 * scene.tolerance.position)
    about = sweep.nominal.pose[0, 1] if target.theta is None else target.theta
    label = "θ − nominal [deg]" if target.theta is None else "θ − target [deg]"
    width = math.nan if target.theta is None else math.degrees(scene.tolerance.angle)
    _bars(axes[1], np.degrees(landed[:, 1] - about), label, width)
    scaled = sweep.errors["scaled"]
    _bars(axes[2], 1e3 * scaled[np.isfinite(scaled)], "scaled error from nominal [mm]", math.nan)
    for name, value in quantiles(scaled).items():
        if math.isfinite(value):
            _mark(axes[2], 1e3 * value, f"{name} %")
    axes[0].set_ylabel("share of the throws [%]")
    axes[0].legend(loc="best", fontsize=9)
    figure.suptitle(title(sweep, "landings"), x=0.01, ha="left", fontsize=11)
    _save(figure, path)


def _bars(axis: Axes, values: Array, label: str, tolerance: float) -> None:
    """Histogram in per cent, with the tolerance."""
    if values.size:
        count = int(np.clip(math.sqrt(values.size), 10, 60))
        weights = np.full(values.size, 100 / values.size)
        low, high = float(values.min()), float(values.max())
        room = max(LEAST - (high - low), 0.0) / 2
        edges = np.linspace(low - room, high + room, count + 1)
        axis.hist(values, bins=list(edges), weights=weights, color=BLUE)
    if math.isfinite(tolerance):
        axis.axvspan(-tolerance, tolerance, color=GREEN, alpha=0.3, lw=0, label="tolerance")
        for edge in (-tolerance, tolerance):
            axis.axvline(edge, color=GREEN, lw=1)
    axis.set_xlabel(label)
    axis.grid(alpha=0.25, axis="y")
    axis.set_axisbelow(True)


def _mark(axis: Axes, x: float, words: str) -> None:
    """A line with a few words above it."""
    axis.axvline(x, color=RED, lw=1)
    place: dict[str, Any] = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "bottom"}
    axis.annotate(words, (x, 1.01), rotation=90, fontsize=8, color=RED, **place)


def draw_tornado(sweep: Sweep, path: Path) -> None:
    """How far each parameter alone moves the landing, from its 5 to its 95 % quantile."""
    from matplotlib.figure import Figure

    poses = swings(sweep.thrower, sweep.sampler)
    moved = np.nan_to_num(poses[:, :, :2] - sweep.nominal.pose[0, :2])
    names = sweep.sampler.names
    height = 1.8 + 0.42 * len(names)
    figure = Figure(figsize=(12, height), layout="constrained")
    axes = figure.subplots(1, 2)
    parts = (("x [mm]", 1e3, 0), ("θ [deg]", math.degrees(1.0), 1))
    for axis, (label, factor, column) in zip(axes, parts, strict=True):
        order = np.argsort(np.ptp(np.pad(moved[:, :, column], ((0, 0), (0, 1))), axis=1))
        for row, i in enumerate(order):
            share = 100 * sweep.shares[names[i]][column]
            _swing(axis, row, factor * moved[i, :, column], f"{share:.0f} %")
        axis.set_yticks(range(len(names)), [_swing_label(sweep, int(i)) for i in order])
        axis.axvline(0.0, color=BLACK, lw=0.8)
        axis.set_xlabel(f"change of landing {label}")
        axis.margins(x=0.16)
        widen(axis, vertical=False)
        axis.locator_params(axis="x", nbins=7)
        axis.grid(alpha=0.25, axis="x")
    for colour, words in ((BLUE, "at its 5 % quantile"), (RED, "at its 95 % quantile")):
        axes[0].barh([0], [0], color=colour, label=words)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    words = title(sweep, "each parameter alone; % of the landing's variance")
    figure.suptitle(words, x=0.01, ha="left", fontsize=11)
    _save(figure, path)


def _swing(axis: Axes, row: int, ends: Array, words: str) -> None:
    style: dict[str, Any] = {"height": 0.62, "zorder": 2}
    # The shorter one in front, where both go the same way.
    for k in np.argsort(-np.abs(ends)):
        axis.barh(row, ends[k], color=(BLUE, RED)[k], **style)
    end = max(float(ends.max()), 0.0)
    beside: dict[str, Any] = {"xytext": (5, 0), "textcoords": "offset points", "va": "center"}
    axis.annotate(words, (end, row), fontsize=9, **beside)


def _swing_label(sweep: Sweep, i: int) -> str:
    """Name of a parameter and its two quantiles."""
    name = sweep.sampler.names[i]
    factor, unit = unit_of(name)
    ends = quantile(sweep.sampler.spreads[i], np.array(OUTER), sweep.sampler.ranges[i])
    low, high = (f"{factor * end:.3g}" for end in ends)
    return f"{name.replace('_', ' ')}\n{low} … {high} {unit}".replace("-", "−").rstrip()


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path, dpi=110)
