"""Picture of an identification: the error landscape (Fig. 15), and what is believed then."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..show import BLACK, BLUE, GREEN, GREY, RED, new_figure
from .grid import MISSED

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from .belief import Belief
    from .grid import Grid
    from .identified import Identified

Style = dict[str, Any]


def contact_picture(found: Identified) -> Figure:
    """Mean scaled error over mu and r_p, the prior and the fit with their 95 % regions."""
    figure = new_figure(7.6, 6.0)
    axis, words = figure.add_subplot(), [f"{found.model}, {len(found.data.throws)} throws"]
    if found.grid is not None:
        words += _landscape(axis, found.grid)
    if found.prior is not None:
        _belief(axis, found.prior, "prior, 95 % region", GREY)
    if found.fit is not None:
        belief = found.fit.posterior
        _belief(axis, belief, "fit, 95 % region", GREEN)
        low, high = axis.get_xlim()
        x = np.geomspace(max(low, 1e-3), max(high, 2e-3), 200)
        limits = axis.get_xlim(), axis.get_ylim()
        axis.plot(x, 1e3 * belief.product / x, color=BLACK, ls=":", lw=1, label="same μ r_p")
        axis.set(xlim=limits[0], ylim=limits[1])
        spread = 100 * belief.product_deviation
        words.append(f"fit: μ r_p {1e3 * belief.product:.3f} mm ± {spread:.1f} %")
    truth = found.data.truth
    if {"friction", "patch_radius"} <= set(truth):
        mu = truth["friction"] * truth.get("grip_scale", 1.0)
        style: Style = {"color": BLUE, "ms": 14, "mec": "white", "ls": "none", "label": "truth"}
        axis.plot(mu, 1e3 * truth["patch_radius"], "*", **style)
    axis.set(xlabel="friction μ", ylabel="patch radius r_p [mm]")
    axis.set_title("\n".join(words), loc="left", fontsize=10)
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _landscape(axis: Axes, grid: Grid) -> list[str]:
    """The grid's errors, the lowest 10 % encircled; what is to be said of it."""
    mu, radius, shown = grid.friction, 1e3 * grid.patch_radius, 100 * grid.error.T
    top, low = (float(np.quantile(shown, share)) for share in (0.98, 0.1))
    mesh = axis.pcolormesh(mu, radius, shown, cmap="inferno", vmax=top, shading="nearest")
    axis.contour(mu, radius, shown, [low], colors="white", linewidths=1.0)
    assert axis.figure is not None
    axis.figure.colorbar(mesh, label="mean scaled error [cm]", extend="max")
    best, (i, j) = 100 * grid.error.min(), grid.best()
    axis.plot(mu[i], radius[j], "X", color=RED, ms=11, mec="white", label="lowest mean error")
    words = [f"least {best:.2f} cm at μ {mu[i]:.2f}, r_p {radius[j]:.1f} mm; white: lowest 10 %"]
    lost = int(grid.missed.sum())
    if lost:
        words.append(f"{lost} of {grid.predictions} do not land (count as {MISSED:g} m)")
    return words


def _belief(axis: Axes, belief: Belief, label: str, colour: str) -> None:
    """A belief's mean and 95 % region."""
    known = belief.effective
    outline = known.ellipse()
    axis.plot(outline[:, 0], 1e3 * outline[:, 1], color=colour, lw=1.8, zorder=4)
    place = known.value("friction"), 1e3 * known.value("patch_radius")
    axis.plot(*place, "o-", color=colour, ms=7, mec="white", label=label, zorder=5)
