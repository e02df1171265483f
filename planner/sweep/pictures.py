"""What a sweep found, as pictures: landings, delay and tornado."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models import Array
from ..show import BLACK, BLUE, GREEN, GREY, RED, new_figure, save
from .samples import unit_of
from .statistics import OUTER, delay_band, scaled_error, swings

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from .running import Sweep


#: Points drawn of many.
POINTS = 5000
#: Least span of an axis [mm, deg].
LEAST = 0.02


def draw_sweep(sweep: Sweep, folder: Path) -> None:
    """landings.png, delay.png and, of several parameters, tornado.png."""
    draw_landings(sweep, folder / "landings.png")
    draw_delay(sweep, folder / "delay.png")
    if len(sweep.sampler.names) > 1:
        draw_tornado(sweep, folder / "tornado.png")


def _title(sweep: Sweep, words: str) -> dict[str, Any]:
    """One line over a picture: the scene, what is shown, how many throws, by which model."""
    made = f"{sweep.samples:,} throws, {sweep.thrower.model}"
    return {"t": f"{sweep.label}: {words} ({made})", "x": 0.01, "ha": "left", "fontsize": 11}


def _about(sweep: Sweep) -> tuple[float, str]:
    """The angle [rad] that landings are shown about, and whose it is."""
    theta = sweep.plan.target.theta
    return (float(sweep.nominal.pose[0, 1]), "nominal") if theta is None else (theta, "target")


def _off(sweep: Sweep, pose: Array) -> Array:
    """Landings (..., 2) off the target: x [mm], theta [deg]."""
    about, _ = _about(sweep)
    x, theta = pose[..., 0] - sweep.plan.goal.plane_x, pose[..., 1] - about
    return np.stack([1e3 * x, np.degrees(theta)], axis=-1)


def _tolerance(sweep: Sweep) -> tuple[float, float]:
    """Of x [mm] and theta [deg], NaN where theta is open."""
    allowed = sweep.plan.scene.tolerance
    angle = math.nan if sweep.plan.target.theta is None else math.degrees(allowed.angle)
    return 1e3 * allowed.position, angle


def _widen(axes: Axes, vertical: bool) -> None:
    """Axes [mm, deg] no narrower than `LEAST`: they would show rounding."""
    for limits, low, high in (("set_xlim", *axes.get_xlim()), ("set_ylim", *axes.get_ylim())):
        if high - low < LEAST and (vertical or limits == "set_xlim"):
            middle = (low + high) / 2
            getattr(axes, limits)(middle - LEAST / 2, middle + LEAST / 2)


def draw_landings(sweep: Sweep, path: Path) -> None:
    """Landing x and theta about the target, coloured by the parameter that matters most."""
    from matplotlib.patches import Rectangle

    figure = new_figure(8, 5.2)
    axes = figure.subplots()
    shown = slice(None, POINTS)
    off, held = _off(sweep, sweep.landings.pose[shown]), sweep.landings.held[shown]
    name = max(sweep.shares, key=lambda key: sum(sweep.shares[key]))
    factor, unit = unit_of(name)
    colour = factor * sweep.values[shown, sweep.sampler.names.index(name)]
    style: dict[str, Any] = {"cmap": "viridis", "vmin": colour.min(), "vmax": colour.max()}
    size = 14 if len(off) <= 2000 else 6
    x, theta = off.T
    found = axes.scatter(x[held], theta[held], s=size, c=colour[held], lw=0, **style)
    if not held.all():
        style |= {"marker": "x", "lw": 0.9, "label": "slips in the full grip before it opens"}
        axes.scatter(x[~held], theta[~held], s=22, c=colour[~held], **style)
    label = f"{name.replace('_', ' ')} [{unit}]" if unit else name
    figure.colorbar(found, ax=axes, label=label, pad=0.01)
    position, angle = _tolerance(sweep)
    if math.isfinite(angle):
        box: dict[str, Any] = {"fill": False, "ec": RED, "lw": 1.6, "zorder": 4}
        corner = (-position, -angle)
        axes.add_patch(Rectangle(corner, 2 * position, 2 * angle, label="tolerance", **box))
    else:
        axes.axvspan(-position, position, color=GREEN, alpha=0.25, lw=0, label="tolerance")
    mark: dict[str, Any] = {"color": BLACK, "mec": "white", "ms": 10, "zorder": 5}
    axes.plot(*_off(sweep, sweep.nominal.pose[0]), "P", label="nominal", **mark)
    axes.set(xlabel="x − target [mm]", ylabel=f"θ − {_about(sweep)[1]} [deg]")
    _widen(axes, vertical=True)
    axes.grid(alpha=0.25)
    axes.legend(loc="best", fontsize=9, framealpha=0.9)
    some = f", {POINTS:,} of them shown" if sweep.samples > POINTS else ""
    rate = 100 * float(sweep.success.mean())
    figure.suptitle(**_title(sweep, f"{rate:.1f} % succeed{some}"))
    save(figure, path)


def draw_delay(sweep: Sweep, path: Path) -> None:
    """Landing error over the opening delay: median and band over all other parameters."""
    names, limits = sweep.sampler.names, _delay_limits(sweep)
    delays, pose = delay_band(sweep.thrower, sweep.sampler, limits)
    dx, dtheta = np.moveaxis(pose[:, :, :2] - sweep.nominal.pose[0, :2], -1, 0)
    theta_counts = sweep.plan.target.theta is not None
    scaled = scaled_error(dx, dtheta, sweep.plan.scene.object.length, theta_counts)
    off, (position, angle) = _off(sweep, pose), _tolerance(sweep)
    rows = [("x − target [mm]", off[..., 0], position)]
    if theta_counts:
        rows.append(("θ − target [deg]", off[..., 1], angle))
    rows.append(("scaled error [mm]", 1e3 * scaled, math.nan))
    figure = new_figure(8, 2.3 * len(rows) + 0.9)
    each = figure.subplots(len(rows), 1, sharex=True)
    for axes, (label, values, tolerance) in zip(each, rows, strict=True):
        if math.isfinite(tolerance):
            axes.axhspan(-tolerance, tolerance, color=GREEN, alpha=0.18, lw=0, label="tolerance")
            axes.axhline(0.0, color=GREEN, lw=0.8)
        _band(axes, 1e3 * delays, values, bool(set(names) - {"delay"}))
        axes.axvline(0.0, color=GREY, lw=0.8, ls=":")
        # A bar that has slipped in the full grip has failed wherever it lands.
        words: str | None = "first delay that fails, slip before the opening counted"
        for end in (sweep.delays.early, sweep.delays.late):
            if end is not None and limits[0] <= end <= limits[1]:
                axes.axvline(1e3 * end, color=RED, lw=1.0, ls="--", label=words)
                words = None
        axes.set_ylabel(label)
        axes.grid(alpha=0.25)
        axes.margins(x=0)
    each[-1].set_xlabel("opening later than expected [ms]")
    each[-1].set_ylim(bottom=0)
    each[0].legend(loc="best", fontsize=9, framealpha=0.9)
    figure.suptitle(**_title(sweep, "landing over the opening delay"))
    save(figure, path)


def _delay_limits(sweep: Sweep) -> tuple[float, float]:
    """Delays [s] about the mean that the picture spans: nearly all that were drawn."""
    if "delay" not in sweep.sampler.names:
        return -0.01, 0.01
    low, high = sweep.sampler.quantiles("delay", np.array([0.001, 0.999]))
    mean = sweep.thrower.mean_delay
    return min(float(low) - mean, -1e-3), max(float(high) - mean, 1e-3)


def _band(axes: Axes, x: Array, values: Array, others: bool) -> None:
    """Median, and 5 to 95 % where something else than the delay is uncertain."""
    # Nothing lands where all throws of a delay are NaN.
    known = np.where(np.isnan(values), np.inf, values)
    low, middle, high = np.quantile(known, (0.05, 0.5, 0.95), axis=1, method="inverted_cdf")
    low, middle, high = (np.where(np.isfinite(v), v, np.nan) for v in (low, middle, high))
    if others:
        axes.fill_between(x, low, high, color=BLUE, alpha=0.25, lw=0, label="5 to 95 %")
    label = "median over the other parameters" if others else "landing"
    axes.plot(x, middle, color=BLUE, lw=1.8, label=label)


def draw_tornado(sweep: Sweep, path: Path) -> None:
    """How far each parameter alone moves the landing, from its 5 to its 95 % quantile."""
    poses, names = swings(sweep.thrower, sweep.sampler), sweep.sampler.names
    moved = np.nan_to_num(poses[:, :, :2] - sweep.nominal.pose[0, :2])
    figure = new_figure(12, 1.8 + 0.42 * len(names))
    each = figure.subplots(1, 2)
    parts = (("x [mm]", 1e3), ("θ [deg]", math.degrees(1.0)))
    for column, (axes, (label, factor)) in enumerate(zip(each, parts, strict=True)):
        order = np.argsort(np.ptp(np.pad(moved[:, :, column], ((0, 0), (0, 1))), axis=1))
        for row, i in enumerate(order):
            share = 100 * sweep.shares[names[i]][column]
            _swing(axes, row, factor * moved[i, :, column], f"{share:.0f} %")
        axes.set_yticks(range(len(names)), [_swing_label(sweep, names[i]) for i in order])
        axes.axvline(0.0, color=BLACK, lw=0.8)
        axes.set_xlabel(f"change of landing {label}")
        axes.margins(x=0.16)
        _widen(axes, vertical=False)
        axes.locator_params(axis="x", nbins=7)
        axes.grid(alpha=0.25, axis="x")
    for colour, words in ((BLUE, "at its 5 % quantile"), (RED, "at its 95 % quantile")):
        each[0].barh([0], [0], color=colour, label=words)
    figure.legend(*each[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    figure.suptitle(**_title(sweep, "each parameter alone; % of the landing's variance"))
    save(figure, path)


def _swing(axes: Axes, row: int, ends: Array, words: str) -> None:
    # Side by side: both may go the same way.
    for end, place, colour in zip(ends, (row + 0.17, row - 0.17), (BLUE, RED), strict=True):
        axes.barh(place, end, color=colour, height=0.34, zorder=2)
    right = max(float(ends.max()), 0.0)
    offset: dict[str, Any] = {"xytext": (5, 0), "textcoords": "offset points", "va": "center"}
    axes.annotate(words, (right, row), fontsize=9, **offset)


def _swing_label(sweep: Sweep, name: str) -> str:
    """Name of a parameter and its two quantiles."""
    factor, unit = unit_of(name)
    low, high = (f"{factor * end:.3g}" for end in sweep.sampler.quantiles(name, np.array(OUTER)))
    return f"{name.replace('_', ' ')}\n{low} … {high} {unit}".replace("-", "−").rstrip()
