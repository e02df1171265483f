"""Pictures of an identification: the error landscape as in Fig. 15, and the fit's confidence."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from .fit_belief import Belief
from .grid import MISSED, Grid
from .identify_run import Identified, Profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]

BLUE, GREEN, RED, GREY, BLACK = "#4c78a8", "#2a9d6f", "#d1495b", "#8a8f98", "#222222"
#: Products mu r_p [m] whose lines are drawn.
PRODUCTS = np.array([1.25, 2.5, 5.0, 10.0]) * 1e-3
#: Half of chi-squared of one degree of freedom at 95 %: the cost that a profile crosses there.
CROSSES = 3.841 / 2


def draw_grid(found: Identified, path: Path) -> None:
    """grid-MODEL.png: mean scaled error over mu and r_p, the lowest 10 % hatched."""
    from matplotlib.figure import Figure

    grid = found.grid
    assert grid is not None
    figure = Figure(figsize=(7.6, 6.0), constrained_layout=True)
    axis = figure.add_subplot()
    mu, radius = grid.friction, 1e3 * grid.patch_radius
    shown = np.clip(100 * grid.error.T, None, 100 * MISSED)
    top = float(np.quantile(shown, 0.98))
    mesh = axis.pcolormesh(mu, radius, shown, cmap="inferno", vmax=top, shading="nearest")
    _hatch(axis, grid)
    limits = axis.get_xlim(), axis.get_ylim()
    _products(axis, mu)
    best = grid.optimum
    style: dict[str, Any] = {"ms": 11, "mec": "white", "mew": 1.2, "ls": "none", "zorder": 5}
    axis.plot(best[0], 1e3 * best[1], "X", color=RED, label="lowest mean error", **style)
    if found.fit is not None:
        _fit(axis, found.posterior, "fit, 95 % region")
    _truth(axis, found)
    axis.set(xlim=limits[0], ylim=limits[1], xlabel="friction μ", ylabel="patch radius r_p [mm]")
    figure.colorbar(mesh, label="mean scaled error [cm]", extend="max")
    entries = axis.get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower center", ncols=4, fontsize=9)
    axis.set_title(_title(found, grid), loc="left", fontsize=10)
    figure.savefig(path, dpi=110)


def _hatch(axis: Axes, grid: Grid) -> None:
    """Hatches the cells of the lowest 10 %."""
    from matplotlib.patches import Rectangle

    dx, dy = np.diff(grid.friction)[0], 1e3 * np.diff(grid.patch_radius)[0]
    style: dict[str, Any] = {"fill": False, "hatch": "////", "edgecolor": "white", "lw": 0}
    for i, j in np.argwhere(grid.lowest):
        corner = grid.friction[i] - dx / 2, 1e3 * grid.patch_radius[j] - dy / 2
        axis.add_patch(Rectangle(corner, dx, dy, **style))


def _title(found: Identified, grid: Grid) -> str:
    mu, radius = grid.optimum
    words = f"{found.model}, {grid.throws} throws: least {100 * grid.error.min():.2f} cm at "
    words += f"μ {mu:.2f}, r_p {1e3 * radius:.1f} mm, μ r_p {1e3 * grid.product:.2f} mm"
    if grid.delay or grid.grip_scale != 1.0:
        words += f"\nopening {1e3 * grid.delay:+.1f} ms late, grip force x {grid.grip_scale:.3f}"
    lost = int(grid.missed.sum())
    more = f"\n{lost} of {grid.predictions} predictions do not land (count as 10 m)" if lost else ""
    return words + "; hatched: lowest 10 %" + more


def _products(axis: Axes, mu: Array) -> None:
    """Lines of equal mu r_p."""
    x = np.linspace(mu[0], mu[-1], 200)
    for number, product in enumerate(PRODUCTS):
        label = "μ r_p = 1.25, 2.5, 5, 10 mm" if number == 0 else None
        axis.plot(x, 1e3 * product / x, color="white", lw=0.9, ls=":", alpha=0.8)
        axis.plot([], [], color=GREY, lw=0.9, ls=":", label=label) if label else None


def _fit(axis: Axes, belief: Belief, label: str, colour: str = GREEN) -> None:
    """A belief's mean and 95 % region."""
    outline = belief.effective.ellipse()
    axis.plot(outline[:, 0], 1e3 * outline[:, 1], color=colour, lw=1.8, zorder=4)
    known = belief.effective
    place = known.value("friction"), 1e3 * known.value("patch_radius")
    axis.plot(*place, "o-", color=colour, ms=7, mec="white", label=label, zorder=5)


def _truth(axis: Axes, found: Identified) -> None:
    """The truth of synthetic throws."""
    truth = found.data.truth
    if {"friction", "patch_radius"} <= set(truth):
        mu = truth["friction"] * truth.get("grip_scale", 1.0)
        axis.plot(mu, 1e3 * truth["patch_radius"], "*", color=BLUE, ms=14, mec="white", ls="none")
        axis.plot([], [], "*", color=BLUE, ms=10, ls="none", label="truth")


def draw_fit(found: Identified, path: Path) -> None:
    """fit.png: the confidence region, and the cost along mu r_p, along mu and along r_p."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11.5, 4.8), constrained_layout=True)
    left, right = figure.subplots(1, 2)
    belief = found.posterior
    _fit(left, belief, "fit and 95 % region")
    if found.prior is not None:
        _fit(left, found.prior, "prior and 95 % region", GREY)
    _truth(left, found)
    limits = left.get_xlim(), left.get_ylim()
    low = max(limits[0][0], 1e-3)
    x = np.geomspace(low, max(limits[0][1], 1.1 * low), 200)
    left.plot(x, 1e3 * belief.product / x, color=BLACK, ls=":", lw=1, label="same μ r_p")
    left.set(xlim=limits[0], ylim=limits[1], xlabel="friction μ", ylabel="patch radius r_p [mm]")
    left.set_title(_words(found), loc="left", fontsize=10)
    left.legend(loc="best", fontsize=9)
    styles = (("product", RED, "μ r_p"), ("friction", BLUE, "μ"), ("patch_radius", GREEN, "r_p"))
    for name, colour, label in styles:
        if name in found.profiles:
            _profile(right, found.profiles[name], colour, label)
    right.axhline(CROSSES, color=BLACK, lw=0.9, ls="--", label="95 %")
    right.set(xlabel="factor against the fit", ylabel="cost above the fit's", xscale="log")
    right.set_ylim(0, 4 * CROSSES)
    right.set_title("narrow in μ r_p, wide in each: the ridge", loc="left", fontsize=10)
    ticks = [0.5, 0.7, 0.8, 0.9, 1.0, 1.1, 1.25, 1.5, 2.0]
    right.set_xticks(ticks, [f"{tick:g}" for tick in ticks], minor=False)
    right.minorticks_off()
    right.legend(loc="best", fontsize=9)
    for axis in (left, right):
        axis.grid(alpha=0.25)
    figure.savefig(path, dpi=110)


def _profile(axis: Axes, profile: Profile, colour: str, label: str) -> None:
    middle = profile.value[len(profile.value) // 2]
    axis.plot(profile.value / middle, profile.cost, "o-", ms=3, color=colour, label=label)


def _words(found: Identified) -> str:
    belief = found.posterior
    parts = [
        f"μ {belief.value('friction'):.3f} ± {100 * belief.deviation('friction'):.1f} %",
        f"r_p {1e3 * belief.value('patch_radius'):.2f} mm ± "
        f"{100 * belief.deviation('patch_radius'):.1f} %",
        f"μ r_p {1e3 * belief.product:.3f} mm ± {100 * belief.product_deviation:.1f} %",
    ]
    return f"{found.model}, {len(found.data.throws)} throws\n" + ", ".join(parts)
