"""A sweep in three pictures: landings, the delay of the opening, and what each parameter does."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models import Array
from ..planner import OUTER, Sweep, delay_band, release_model, tornado, unit_of
from .style import BLACK, BLUE, GREEN, GREY, RED, new_figure, own_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Largest number of points in landings.png.
POINTS = 5000
#: Narrowest span [mm, deg] of an axis; a narrower one shows rounding.
MIN_SPAN = 0.02


def _title(sweep: Sweep, words: str) -> str:
    """Title of a picture: scene, contents, number of throws, release model."""
    throws = f"{sweep.samples:,} throws, {release_model(sweep.plan.scene, sweep.batch.model).title}"
    return f"{sweep.label}: {words} ({throws})"


def _tolerance_label(sweep: Sweep) -> str:
    """What the tolerance's box is called: with a cup it does not decide the success."""
    name = "target and tolerance" if sweep.plan.target.is_region else "tolerance"
    if sweep.plan.scene.cup is None:
        return name
    share = 100 * float(sweep.landings.in_tolerance.mean())
    return f"{name}: {share:.1f} % inside\n(the cup decides, not this)"


def _angle_origin(sweep: Sweep) -> tuple[float, str]:
    """The angle [rad] at the origin of the pictures, and its label."""
    theta = sweep.plan.target.theta
    return (float(sweep.nominal.pose[0, 1]), "nominal") if theta is None else (theta, "target")


def _landing_errors(sweep: Sweep, pose: Array) -> Array:
    """Landing errors (..., 2): x [mm], theta [deg]."""
    about, _ = _angle_origin(sweep)
    x, theta = pose[..., 0] - sweep.plan.goal.plane_x, pose[..., 1] - about
    return np.stack([1e3 * x, np.degrees(theta)], axis=-1)


def _tolerance(sweep: Sweep) -> tuple[float, float]:
    """Largest errors from the target's middle: x [mm]; theta [deg], NaN where theta is open."""
    allowed, target = sweep.plan.scene.tolerance, sweep.plan.target
    x, theta = allowed.position + target.half_widths[0], allowed.angle + target.half_widths[1]
    return 1e3 * x, math.nan if target.theta is None else math.degrees(theta)


def _widen(axes: Axes, vertical: bool) -> None:
    """Axes [mm, deg] no narrower than `MIN_SPAN`."""
    for limits, low, high in (("set_xlim", *axes.get_xlim()), ("set_ylim", *axes.get_ylim())):
        if high - low < MIN_SPAN and (vertical or limits == "set_xlim"):
            middle = (low + high) / 2
            getattr(axes, limits)(middle - MIN_SPAN / 2, middle + MIN_SPAN / 2)


@own_style()
def draw_landings(sweep: Sweep) -> Figure:
    """Landing errors, successful or not, coloured by the parameter with the largest share of
    their variance."""
    from matplotlib.patches import Rectangle

    into = "" if sweep.plan.scene.cup is None else " into the cup"
    some = f", {POINTS:,} of them shown" if sweep.samples > POINTS else ""
    rate = 100 * float(sweep.success.mean())
    figure = new_figure(8, 5.2, _title(sweep, f"{rate:.1f} % succeed{into}{some}"))
    axes = figure.subplots()
    rows = slice(None, POINTS)
    off, success = _landing_errors(sweep, sweep.landings.pose[rows]), sweep.success[rows]
    name = max(sweep.shares, key=lambda key: sum(sweep.shares[key]))
    factor, unit = unit_of(name)
    colour = factor * sweep.values[rows, sweep.sampler.names.index(name)]
    style: dict[str, Any] = {"cmap": "viridis", "vmin": colour.min(), "vmax": colour.max()}
    for chosen, look in (
        (success, {"s": 14 if len(off) <= 2000 else 6, "lw": 0, "label": f"succeeds{into}"}),
        (~success, {"s": 22, "marker": "x", "lw": 0.9, "label": "fails"}),
    ):
        x, theta = off[chosen].T
        if x.size or look["label"] != "fails":
            points = axes.scatter(x, theta, c=colour[chosen], **style, **look)
    label = f"{name.replace('_', ' ')} [{unit}]" if unit else name
    figure.colorbar(points, ax=axes, label=label, pad=0.01)
    position, angle = _tolerance(sweep)
    if math.isfinite(angle):
        box: dict[str, Any] = {"fill": False, "ec": RED, "lw": 1.6, "zorder": 4}
        corner = (-position, -angle)
        axes.add_patch(
            Rectangle(corner, 2 * position, 2 * angle, label=_tolerance_label(sweep), **box)
        )
    else:
        span: dict[str, Any] = {"color": GREEN, "alpha": 0.25, "lw": 0}
        axes.axvspan(-position, position, label=_tolerance_label(sweep), **span)
    mark: dict[str, Any] = {"color": BLACK, "mec": "white", "ms": 10, "zorder": 5}
    axes.plot(*_landing_errors(sweep, sweep.nominal.pose[0]), "P", label="nominal", **mark)
    axes.set(xlabel="x − target [mm]", ylabel=f"θ − {_angle_origin(sweep)[1]} [deg]")
    _widen(axes, vertical=True)
    axes.grid(alpha=0.25)
    axes.legend(loc="best", fontsize=9, framealpha=0.9)
    return figure


@own_style()
def draw_delay(sweep: Sweep) -> Figure:
    """Landing error over the opening delay: median and band over all other parameters."""
    names, limits = sweep.sampler.names, _delay_limits(sweep)
    delays, pose = delay_band(sweep.batch, sweep.sampler, limits)
    dx, dtheta = np.moveaxis(pose[:, :, :2] - sweep.nominal.pose[0, :2], -1, 0)
    theta_counts = sweep.plan.target.theta is not None
    scaled = sweep.plan.scene.object.pose_error(dx, dtheta if theta_counts else 0.0)
    off, (position, angle) = _landing_errors(sweep, pose), _tolerance(sweep)
    rows = [("x − target [mm]", off[..., 0], position)]
    if theta_counts:
        rows.append(("θ − target [deg]", off[..., 1], angle))
    rows.append(("pose error [mm]\n|Δx| + |Δθ| l/2", 1e3 * scaled, math.nan))
    title = _title(sweep, "landing over the opening delay")
    figure = new_figure(8, 2.3 * len(rows) + 0.9, title)
    each = figure.subplots(len(rows), 1, sharex=True)
    for axes, (label, values, tolerance) in zip(each, rows, strict=True):
        if math.isfinite(tolerance):
            axes.axhspan(
                -tolerance, tolerance, color=GREEN, alpha=0.18, lw=0, label=_tolerance_label(sweep)
            )
            axes.axhline(0.0, color=GREEN, lw=0.8)
        _band(axes, 1e3 * delays, values, bool(set(names) - {"delay"}))
        axes.axvline(0.0, color=GREY, lw=0.8, ls=":")
        words: str | None = "largest delay that succeeds"
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
    return figure


def _delay_limits(sweep: Sweep) -> tuple[float, float]:
    """Range of delays [s] about the mean that the picture shows: 99.8 % of the samples."""
    if "delay" not in sweep.sampler.names:
        return -0.01, 0.01
    low, high = sweep.sampler.quantiles("delay", np.array([0.001, 0.999]))
    mean = sweep.batch.scene.mean_delay
    return min(float(low) - mean, -1e-3), max(float(high) - mean, 1e-3)


def _band(axes: Axes, x: Array, values: Array, others: bool) -> None:
    """Median; if other parameters than the delay are uncertain, the band of 5 to 95 %."""
    # NaN is no landing: an infinite error.
    finite_values = np.where(np.isnan(values), np.inf, values)
    low, middle, high = np.quantile(finite_values, (0.05, 0.5, 0.95), axis=1, method="inverted_cdf")
    low, middle, high = (np.where(np.isfinite(v), v, np.nan) for v in (low, middle, high))
    if others:
        axes.fill_between(x, low, high, color=BLUE, alpha=0.25, lw=0, label="5 to 95 %")
    label = "median over the other parameters" if others else "landing"
    axes.plot(x, middle, color=BLUE, lw=1.8, label=label)


@own_style()
def draw_tornado(sweep: Sweep) -> Figure:
    """Change of the landing by each parameter alone, from its 5 to its 95 % quantile."""
    poses, names = tornado(sweep.batch, sweep.sampler), sweep.sampler.names
    change = poses[:, :, :2] - sweep.nominal.pose[0, :2]
    # A throw that never lands is an infinite change.
    size = np.nan_to_num(change, nan=np.inf)
    title = _title(sweep, "each parameter alone; % of the landing's variance")
    figure = new_figure(12, 1.8 + 0.42 * len(names), title)
    each = figure.subplots(1, 2)
    parts = (("x [mm]", 1e3), ("θ [deg]", math.degrees(1.0)))
    for column, (axes, (label, factor)) in enumerate(zip(each, parts, strict=True)):
        low, high = (part(size[:, :, column], axis=1, initial=0.0) for part in (np.min, np.max))
        order = np.argsort(high - low)
        for row, i in enumerate(order):
            share = 100 * sweep.shares[names[i]][column]
            _swing(axes, row, factor * change[i, :, column], f"{share:.0f} %")
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
    return figure


def _swing(axes: Axes, row: int, ends: Array, words: str) -> None:
    # Bars side by side: both changes may have equal signs.
    for end, place, colour in zip(ends, (row + 0.17, row - 0.17), (BLUE, RED), strict=True):
        if math.isfinite(end):
            axes.barh(place, end, color=colour, height=0.34, zorder=2)
        else:
            axes.text(0.0, place, " no landing ", color=colour, fontsize=8, ha="right", va="center")
    right = max(float(np.nanmax(ends, initial=0.0)), 0.0)
    offset: dict[str, Any] = {"xytext": (5, 0), "textcoords": "offset points", "va": "center"}
    axes.annotate(words, (right, row), fontsize=9, **offset)


def _swing_label(sweep: Sweep, name: str) -> str:
    """Name of a parameter and its two quantiles."""
    factor, unit = unit_of(name)
    low, high = (f"{factor * end:.3g}" for end in sweep.sampler.quantiles(name, np.array(OUTER)))
    return f"{name.replace('_', ' ')}\n{low} … {high} {unit}".replace("-", "−").rstrip()
