"""Pictures of an identification: the error landscape (Fig. 15), and what is believed then."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..show import BLACK, BLUE, GREEN, GREY, RED, new_figure
from .grid import MISSED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .belief import Belief
    from .identified import Identified

Style = dict[str, Any]

#: Products mu r_p [m] whose lines are drawn.
PRODUCTS = np.array([1.25, 2.5, 5.0, 10.0]) * 1e-3


def grid_picture(found: Identified) -> Figure:
    """Mean scaled error over mu and r_p, the lowest 10 % hatched, with the fit."""
    from matplotlib.patches import Rectangle

    grid = found.grid
    assert grid is not None
    figure = new_figure(7.6, 6.0)
    axis = figure.add_subplot()
    mu, radius = grid.friction, 1e3 * grid.patch_radius
    shown = 100 * grid.error.T
    top = float(np.quantile(shown, 0.98))
    mesh = axis.pcolormesh(mu, radius, shown, cmap="inferno", vmax=top, shading="nearest")
    size = float(np.diff(mu)[0]), float(np.diff(radius)[0])
    hatched: Style = {"fill": False, "hatch": "////", "edgecolor": "white", "lw": 0}
    for i, j in np.argwhere(grid.lowest):
        corner = mu[i] - size[0] / 2, radius[j] - size[1] / 2
        axis.add_patch(Rectangle(corner, *size, **hatched))
    limits = axis.get_xlim(), axis.get_ylim()
    x = np.linspace(mu[0], mu[-1], 200)
    axis.plot(x, 1e3 * PRODUCTS / x[:, None], color="white", lw=0.9, ls=":", alpha=0.8)
    axis.plot([], [], color=GREY, lw=0.9, ls=":", label="μ r_p = 1.25, 2.5, 5, 10 mm")
    style: Style = {"ms": 11, "mec": "white", "mew": 1.2, "ls": "none", "zorder": 5}
    best = grid.optimum
    axis.plot(best[0], 1e3 * best[1], "X", color=RED, label="lowest mean error", **style)
    if found.fit is not None:
        _belief(axis, found.posterior, "fit, 95 % region", GREEN)
    _true_contact(axis, found)
    axis.set(xlim=limits[0], ylim=limits[1], xlabel="friction μ", ylabel="patch radius r_p [mm]")
    figure.colorbar(mesh, label="mean scaled error [cm]", extend="max")
    entries = axis.get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower center", ncols=4, fontsize=9)
    words = f"{found.model}, {grid.throws} throws: least {100 * grid.error.min():.2f} cm at "
    words += f"μ {best[0]:.2f}, r_p {1e3 * best[1]:.1f} mm, μ r_p {1e3 * grid.product:.2f} mm"
    if grid.delay or grid.grip_scale != 1.0:
        words += f"\nopening {1e3 * grid.delay:+.1f} ms late, grip force x {grid.grip_scale:.3f}"
    words += "; hatched: lowest 10 %"
    lost = int(grid.missed.sum())
    if lost:
        words += f"\n{lost} of {grid.predictions} predictions do not land (count as {MISSED:g} m)"
    axis.set_title(words, loc="left", fontsize=10)
    return figure


def fit_picture(found: Identified) -> Figure:
    """The fit's confidence region and the prior's, on the ridge of equal mu r_p."""
    figure, belief = new_figure(7.0, 5.2), found.posterior
    axis = figure.add_subplot()
    _belief(axis, belief, "fit and 95 % region", GREEN)
    if found.prior is not None:
        _belief(axis, found.prior, "prior and 95 % region", GREY)
    _true_contact(axis, found)
    limits = axis.get_xlim(), axis.get_ylim()
    low = max(limits[0][0], 1e-3)
    x = np.geomspace(low, max(limits[0][1], 1.1 * low), 200)
    axis.plot(x, 1e3 * belief.product / x, color=BLACK, ls=":", lw=1, label="same μ r_p")
    axis.set(xlim=limits[0], ylim=limits[1], xlabel="friction μ", ylabel="patch radius r_p [mm]")
    parts = [f"{found.model}, {len(found.data.throws)} throws\n"]
    for name, label, unit, scale in (
        ("friction", "μ", "", 1.0),
        ("patch_radius", "r_p", " mm", 1e3),
    ):
        value, deviation = scale * belief.value(name), 100 * belief.deviation(name)
        parts.append(f"{label} {value:.3g}{unit} ± {deviation:.1f} %, ")
    parts.append(f"μ r_p {1e3 * belief.product:.3f} mm ± {100 * belief.product_deviation:.1f} %")
    axis.set_title("".join(parts), loc="left", fontsize=10)
    axis.legend(loc="best", fontsize=9)
    axis.grid(alpha=0.25)
    return figure


def _belief(axis: Axes, belief: Belief, label: str, colour: str) -> None:
    """A belief's mean and 95 % region."""
    known = belief.effective
    outline = known.ellipse()
    axis.plot(outline[:, 0], 1e3 * outline[:, 1], color=colour, lw=1.8, zorder=4)
    place = known.value("friction"), 1e3 * known.value("patch_radius")
    axis.plot(*place, "o-", color=colour, ms=7, mec="white", label=label, zorder=5)


def _true_contact(axis: Axes, found: Identified) -> None:
    """The truth of synthetic throws."""
    truth = found.data.truth
    if {"friction", "patch_radius"} <= set(truth):
        mu = truth["friction"] * truth.get("grip_scale", 1.0)
        style: Style = {"color": BLUE, "ms": 14, "mec": "white", "ls": "none", "label": "truth"}
        axis.plot(mu, 1e3 * truth["patch_radius"], "*", **style)
