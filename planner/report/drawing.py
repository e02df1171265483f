"""The report's pictures, one for each section, drawn from the section's own tables."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..show import BLACK, BLUE, GREEN, GREY, ORANGE, RED, TEAL, Row, Table, new_figure, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = npt.NDArray[np.float64]

#: Colour, marker and line of a release method; only settings that refine each other have a line.
METHODS = {
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
    "LuGre, σ₀ 1e7 1/m": (ORANGE, "1", ""),
    "LuGre, σ₀ 1e6 1/m": (ORANGE, "2", ""),
    "LuGre, σ₀ 1e5 1/m": (ORANGE, "3", ""),
}
#: Colour, marker and line of the planner's settings, by the first word of what differs.
SETTINGS = {
    "carry": (BLUE, "o", "-"),
    "opening": (GREEN, "o", "-"),
    "grading": (ORANGE, "o", "-"),
    "epsilon": (RED, "o", "-"),
    "integrator": (TEAL, "o", ""),
    "IPOPT": (GREY, "^", ""),
    "default": (BLACK, "D", ""),
}
#: Errors [mm] below these are drawn on them: converged answers are not known better.
OWN_FLOOR, MODEL_FLOOR = 1e-7, 1e-4
#: Where a target without a robust plan is drawn, and the least spread that is drawn.
LOST, LEAST = 20.0, 1e-4


def draw_work_precision(rows: Table) -> Figure:
    """Own error (above) and model error (below) over the time of a release; a column a throw."""
    throws = list(dict.fromkeys(rows.column("throw")))
    figure, grid = _figure(3.6 * len(throws), 8.0, 2, len(throws), sharex=True, sharey="row")
    for column, throw in enumerate(throws):
        some = rows.where(throw=throw)
        for line, (kind, floor) in enumerate((("own", OWN_FLOOR), ("model", MODEL_FLOOR))):
            axis = grid[line][column]
            _draw_methods(axis, some, kind, floor)
            axis.set(xscale="log", yscale="log")
        grid[0][column].set_title(str(throw), fontsize=10)
        grid[1][column].set_xlabel("time a throw [µs]")
    for line, words in enumerate(("own error", "model error")):
        grid[line][0].set_ylabel(f"{words}: scaled landing [mm]")
    handles, names = grid[0][0].get_legend_handles_labels()
    figure.legend(handles, names, loc="outside lower center", ncols=7, fontsize=9)
    return _finished(figure)


def _draw_methods(axis: Axes, rows: Sequence[Row], kind: str, floor: float) -> None:
    column = f"{kind} scaled [mm]"
    known = [row for row in rows if isinstance(row[column], float)]

    def places(some: Sequence[Row]) -> tuple[list[float], list[float]]:
        errors = [max(number(row[column]), floor) for row in some]
        return [number(row["time [µs]"]) for row in some], errors

    for name, (colour, marker, line) in METHODS.items():
        mine = [row for row in known if row["method"] == name]
        style: dict[str, Any] = {"color": colour, "marker": marker, "ms": 5, "lw": 1.1}
        axis.plot(*places(mine), ls=line or "none", label=name, **style)
    best = [row for row in known if kind in str(row["Pareto set"])]
    ring: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 11, "mfc": "none", "mec": BLACK}
    axis.plot(*places(best), label="Pareto set", **ring)


def draw_settings(rows: Table) -> Figure:
    """Error before correction over solving time; a panel a scene, a line a setting's values."""
    scenes = list(dict.fromkeys(rows.column("scene")))
    figure, grid = _figure(6.0 * len(scenes), 4.5, 1, len(scenes))
    for axis, scene in zip(grid[0], scenes, strict=True):
        known = [row for row in rows.where(scene=scene) if row["solve [ms]"] is not None]
        ringed = [row for row in known if row["Pareto set"]]
        for name, (colour, marker, line) in SETTINGS.items():
            some = [row for row in known if _family(row) == name]
            style: dict[str, Any] = {"color": colour, "marker": marker, "ls": line, "lw": 0.8}
            axis.plot(*_places(some), ms=5, label=name, **style)
        ring: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 12, "mfc": "none", "mec": BLACK}
        axis.plot(*_places(ringed), label="Pareto set", **ring)
        axis.set(xscale="log", yscale="log", title=str(scene), xlabel="solve [ms]")
    grid[0][0].set_ylabel("scaled error before correction [mm]")
    grid[0][-1].legend(fontsize=8)
    return _finished(figure)


def _family(row: Row) -> str:
    """Which setting differs from the default, or the other solver."""
    words = str(row["setting"]).split(maxsplit=1)[0]
    return "IPOPT" if row["solver"] == "ipopt" else words


def _places(rows: Sequence[Row]) -> tuple[list[Any], list[Any]]:
    return [r["solve [ms]"] for r in rows], [r["error before correction [mm]"] for r in rows]


def draw_ladder(rows: Table) -> Figure:
    """Variables and solving time of the same throw, with one part more at a time."""
    figure, ((left, right),) = _figure(10.0, 4.0, 1, 2, sharey=True)
    names = [str(name) for name in rows.column("hand-box")]
    for axis, column, colour in ((left, "variables", BLUE), (right, "solve [ms]", GREEN)):
        values = [number(cell) for cell in rows.column(column)]
        bars = axis.barh(names, values, color=colour)
        axis.bar_label(bars, [f"{value:.3g}" for value in values], padding=3, fontsize=8)
        axis.set(xlabel=column, xscale="log", xlim=(np.nanmin(values) / 2, 3 * np.nanmax(values)))
    left.invert_yaxis()
    return _finished(figure)


def draw_targets(rows: Table) -> Figure:
    """Targets in x and theta, what was said of them, and the nearest poses that were named."""
    figure, ((axis,),) = _figure(9.0, 5.0)
    some = rows.rows
    named = [row for row in some if row["nearest x [m]"] is not None]
    for row in named:
        x, theta = (
            [row[f"{k}{name}"] for k in ("", "nearest ")] for name in ("x [m]", "theta [deg]")
        )
        axis.plot(x, theta, color="#dddddd", lw=0.7, zorder=1)
    groups = (
        ("thrown to", [r for r in some if r["status"] == "solved"], "", BLUE, "."),
        ("out of reach", [r for r in some if r["status"] == "out_of_reach"], "", RED, "x"),
        ("nearest pose named", named, "nearest ", GREEN, "+"),
        ("no answer", [r for r in some if r["status"] == "not_converged"], "", BLACK, "s"),
    )
    for words, group, which, colour, marker in groups:
        if group:
            x = [row[f"{which}x [m]"] for row in group]
            theta = [row[f"{which}theta [deg]"] for row in group]
            axis.plot(x, theta, marker, color=colour, ms=5, label=f"{words} ({len(group)})")
    axis.set(xlabel="x [m]", ylabel="θ [deg]")
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=4, frameon=False)
    return _finished(figure)


def draw_ratios(rows: Table) -> Figure:
    """Spread of robust plans over the nominal plan's, a dot a target, a bar at the median."""
    scenes = list(dict.fromkeys(rows.column("scene")))
    figure, grid = _figure(6.0 * len(scenes), 4.5, 1, len(scenes), sharey=True)
    rng = np.random.default_rng(0)
    for axis, scene in zip(grid[0], scenes, strict=True):
        some = rows.where(scene=scene)
        methods = list(dict.fromkeys(str(row["method"]) for row in some))
        for place, method in enumerate(methods):
            ratios = [row["spread / nominal"] for row in some if row["method"] == method]
            found = np.array([number(ratio) for ratio in ratios])
            solved = np.isfinite(found)
            height = np.where(solved, np.maximum(found, LEAST), LOST)
            across = place + rng.uniform(-0.25, 0.25, found.size)
            axis.plot(across[solved], height[solved], ".", color=BLUE, ms=5)
            axis.plot(across[~solved], height[~solved], "x", color=RED, ms=5)
            # One of them, not a mean of two of which one may have no plan.
            middle = float(np.percentile(height, 50, method="higher"))
            axis.plot([place - 0.35, place + 0.35], [middle, middle], color=BLACK, lw=2)
        axis.axhline(1.0, color=GREY, lw=0.8, ls="--")
        axis.set(yscale="log", title=str(scene))
        axis.set_xticks(range(len(methods)), methods, rotation=30, ha="right")
    grid[0][0].set_ylabel("spread / nominal spread (× : no plan)")
    return _finished(figure)


def draw_learning(rows: Table) -> Figure:
    """Real landing error over the number of throws that were learned from."""
    figure, ((axis,),) = _figure(7.0, 4.0)
    some = rows.rows
    for model, colour in zip(dict.fromkeys(rows.column("learned by")), (BLUE, GREEN), strict=False):
        mine = [row for row in some if row["learned by"] == model]
        counts = [row["throws"] for row in mine]
        for column, line in (("error, median [mm]", "-"), ("error, worst [mm]", ":")):
            words = f"{model}, {column.split(', ')[1].removesuffix(' [mm]')}"
            axis.plot(
                counts, [row[column] for row in mine], line, marker="o", color=colour, label=words
            )
    axis.set(xlabel="throws learned from", ylabel="real scaled error [mm]", yscale="log")
    axis.legend(frameon=False, fontsize=8)
    return _finished(figure)


def _figure(
    width: float, height: float, lines: int = 1, columns: int = 1, **share: Any
) -> tuple[Figure, Any]:
    """A figure of so many inches, and its axes in lines and columns."""
    figure = new_figure(width, height)
    return figure, figure.subplots(lines, columns, squeeze=False, **share)


def _finished(figure: Figure) -> Figure:
    """With grids, and with readable labels on short logarithmic axes."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    for axes in figure.axes:
        axes.grid(alpha=0.3)
        for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
            if axis.get_scale() == "log" and 0 < high < 100 * low:
                # Less than two decades: labels between the powers of ten.
                axis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
                for formatter in (axis.set_minor_formatter, axis.set_major_formatter):
                    formatter(StrMethodFormatter("{x:g}"))
    return figure
