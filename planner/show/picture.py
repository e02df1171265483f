"""throw.png, and what it shares with throw.gif."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...problems import Pose, Scene, ThrownObject
from ..check import SentThrow, bar_outline, palm_corners
from .style import ARM
from .style import PHASES as COLOURS
from .timeline import PHASES, Timeline, timeline

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]

#: The plots over time start this long before the command [ms].
LEAD_MS = 120.0
#: Least width drawn for a bar [m].
MIN_WIDTH = 0.008


def draw_throw(throw: SentThrow, path: Path, load: tuple[Array, Array] | None = None) -> None:
    """The throw as one picture: what moves where, and three plots over time.

    load: times [s] and load of a robust plan's window, as `load_curve` gives them.
    """
    from matplotlib.figure import Figure

    line, scene = timeline(throw), throw.scene
    figure = Figure(figsize=(12.5, 6.6), layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(2.1, 1))
    stage = figure.add_subplot(grid[:, 0])
    draw_surroundings(stage, scene, throw.target)
    _draw_arms(stage, scene, line)
    _draw_bars(stage, scene.object, line)
    frame_stage(stage, scene, line)
    stage.set_title(_title(throw), loc="left", fontsize=10)
    plots = [figure.add_subplot(grid[i, 1]) for i in range(3)]
    _draw_plots(plots, line)
    if load is not None:
        _draw_window(plots[-1], *load)
    figure.savefig(path, dpi=110)


def _title(throw: SentThrow) -> str:
    dx, dtheta = throw.final.miss(throw.target)
    kind = "exact" if throw.scene.robot is None else "sent"
    angle = "" if throw.target.theta is None else f", {np.degrees(abs(dtheta)):.3f} deg"
    return f"{throw.scene.name}: {kind} landing {1e3 * abs(dx):.3f} mm{angle} from the target"


def bar_corners(bar: ThrownObject, com: Array) -> Array:
    """Corners (4, 2) of the bar, widened to be seen."""
    wide = dataclasses.replace(bar, width=max(bar.width, MIN_WIDTH))
    return np.asarray(bar_outline(wide, com[:, None])[:, 0].T)


def hand_corners(scene: Scene, pose: Array) -> Array:
    """Corners (N, 2) of the palm, or of a small pad for a free hand."""
    if scene.arm is not None:
        return np.asarray(palm_corners(scene.arm.tool, pose[:, None])[:, 0].T)
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    corners = 0.02 * np.array([[-1, -0.7], [1, -0.7], [1, 0.7], [-1, 0.7]])
    return np.asarray(pose[:2] + corners @ np.array([[cos, sin], [-sin, cos]]))


def draw_surroundings(stage: Axes, scene: Scene, target: Pose) -> None:
    """Target, cup, floor and base column."""
    from matplotlib.patches import Polygon, Rectangle

    wall: dict[str, Any] = {"color": "#5b4a3f", "lw": 3, "solid_capstyle": "butt", "zorder": 2}
    if scene.cup is not None:
        cup = scene.cup
        bottom = cup.rim - cup.depth
        left, right = cup.x - cup.radius, cup.x + cup.radius
        stage.plot([left, left, right, right], [cup.rim, bottom, bottom, cup.rim], **wall)
    if scene.workspace is not None:
        workspace = scene.workspace
        if workspace.floor is not None:
            stage.axhline(workspace.floor, color="#b0a99f", lw=1, ls="--", zorder=1)
        if workspace.column_radius is not None and workspace.column_height is not None:
            radius, height = workspace.column_radius, workspace.column_height
            stage.add_patch(Rectangle((-radius, 0), 2 * radius, height, color="#e4e1dc", zorder=0))
    x = target.plane_x
    if target.theta is not None:
        corners = bar_corners(scene.object, np.array([x, target.z, target.theta]))
        stage.add_patch(Polygon(corners, closed=True, fill=False, ls="--", color="k", zorder=7))
    stage.plot([x], [target.z], "k+", ms=11, zorder=8, label="target")


def _draw_arms(stage: Axes, scene: Scene, line: Timeline) -> None:
    """The arm (or hand) at rest, as the opening starts and at detach."""
    from matplotlib.patches import Polygon

    kind = "hand" if line.arm is None else "arm"
    moments = {"at rest": 0.0} | {name: line.marks[name] for name in ("opening", "detach")}
    for (name, moment), alpha in zip(moments.items(), (0.25, 0.5, 0.9), strict=True):
        i = min(int(np.searchsorted(line.times, moment)), len(line.times) - 1)
        if line.arm is not None:
            stage.plot(
                *line.arm[i],
                "-o",
                color=ARM,
                alpha=alpha,
                lw=5,
                ms=5,
                zorder=2,
                solid_capstyle="round",
            )
        outline = hand_corners(scene, line.hand[:, i])
        stage.add_patch(Polygon(outline, closed=True, color=ARM, alpha=alpha, zorder=2))
        stage.plot([], [], color=ARM, alpha=alpha, lw=5, label=f"{kind}, {name}")


def _draw_bars(stage: Axes, bar: ThrownObject, line: Timeline) -> None:
    """The bar along its way, coloured by phase, and the CoM's path."""
    from matplotlib.patches import Polygon

    stage.plot(line.com[0], line.com[1], color="#222222", lw=0.9, zorder=3)
    shown = set(np.linspace(0, len(line.times) - 1, 22).astype(int).tolist())
    changes = np.flatnonzero(np.diff(line.phase)) + 1
    for i in sorted(shown | set(changes.tolist())):
        name = PHASES[line.phase[i]]
        stage.add_patch(
            Polygon(
                bar_corners(bar, line.com[:, i]),
                closed=True,
                color=COLOURS[name],
                alpha=0.75,
                lw=0.5,
                zorder=5,
            )
        )
    for index in np.unique(line.phase):
        name = PHASES[index]
        stage.plot([], [], color=COLOURS[name], lw=5, label=f"bar, {name}")


def frame_stage(stage: Axes, scene: Scene, line: Timeline) -> None:
    """Equal axes around everything that moves."""
    points = [bar_outline(scene.object, line.com).reshape(2, -1), line.hand[:2]]
    if line.arm is not None:
        points.append(line.arm.transpose(1, 0, 2).reshape(2, -1))
    everything = np.hstack(points)
    low, high = everything.min(axis=1) - 0.08, everything.max(axis=1) + 0.08
    if scene.cup is not None:
        low[1] = min(low[1], scene.cup.rim - scene.cup.depth - 0.04)
        high[0] = max(high[0], scene.cup.x + scene.cup.radius + 0.05)
    stage.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", ylabel="z [m]")
    stage.set_aspect("equal")
    stage.grid(alpha=0.25)
    handles, _ = stage.get_legend_handles_labels()
    if len(handles) > 1:
        stage.legend(loc="best", fontsize=8, framealpha=0.9, ncols=2)


def _draw_window(axis: Axes, times: Array, load: Array) -> None:
    """When the pads may open, and what they would transmit then under full grip."""
    axis.axvspan(1e3 * times[0], 1e3 * times[-1], color=COLOURS["flight"], alpha=0.12, lw=0)
    label = f"load while they may open,\nat most {100 * load.max():.1f} %"
    axis.plot(1e3 * times, load, color=COLOURS["flight"], lw=2, label=label)
    axis.legend(fontsize=8)


def _draw_plots(axes: list[Axes], line: Timeline) -> None:
    """Grip force, turning rates and friction use from shortly before the command."""
    grip, rate, use = axes
    t = 1e3 * line.times
    grip.plot(t, np.where(line.times <= line.marks["detach"], line.grip, 0.0), color="#444444")
    grip.set_ylabel("f_N [N]")
    rate.plot(t, line.hand_rate, color=ARM, label="hand")
    rate.plot(t, line.object_rate, color=COLOURS["flight"], label="object")
    rate.set_ylabel("ω [rad/s]")
    rate.legend(fontsize=8)
    use.plot(t, np.minimum(line.force_use, 3.0), color=COLOURS["slide"], label="force")
    use.plot(t, np.minimum(line.torque_use, 3.0), color=COLOURS["pivot"], label="torque")
    use.axhline(1.0, color="k", lw=0.8)
    use.set(ylabel="friction use", xlabel="t [ms]", ylim=(0, 1.6))
    use.legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.set_xlim(max(0.0, 1e3 * line.marks["command"] - LEAD_MS), t[-1])
        for name, moment in line.marks.items():
            axis.axvline(1e3 * moment, color="#999999", lw=0.8, ls=":")
            if axis is grip and name != "landing":
                axis.annotate(
                    name,
                    (1e3 * moment, 1.0),
                    xycoords=("data", "axes fraction"),
                    fontsize=7,
                    rotation=90,
                    va="top",
                    ha="right",
                )
