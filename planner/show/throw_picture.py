"""throw.png, and parts shared with throw.gif."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...models import Array
from ..clearance import bar_outline, palm_corners
from ..throw import column_of
from .style import ARM, BLACK, GREEN, ORANGE, PHASES, RED, draw_cup, new_figure, save
from .timeline import Timeline, timeline

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ...models.robot import Solid
    from ...problems import Pose, Scene, ThrownObject
    from ..throw import Throw


#: Time [ms] from the start of the plots to the command.
LEAD_MS = 120.0
#: Least drawn width [m] of a bar.
MIN_WIDTH = 0.008
#: Drawn poses of the bar in the hand.
CARRIED = 6
#: Drawn poses of the bar in flight.
FLYING = 7
#: Drawn poses of the bar between the opening pads.
RELEASING = 5
#: Distance [m] from the moving bodies up to which fixed bodies are drawn.
AROUND = 0.4
#: Least span [rad/s] of the plot of turning rates.
MIN_RATE_SPAN = 1.0


def draw_throw(throw: Throw, path: Path | None, load: tuple[Array, Array] | None = None) -> Figure:
    """The throw as one picture: the plane, the release seen from the hand, plots over time.

    path: of the PNG file, None for none. load: times [s] and load of a robust plan's window, see
    `load_curve`.
    """
    line, scene = timeline(throw), throw.scene
    figure = new_figure(12.5, 7.6)
    grid = figure.add_gridspec(4, 2, width_ratios=(1.7, 1), height_ratios=(1.2, 1, 1, 1))
    stage = figure.add_subplot(grid[:, 0])
    draw_surroundings(stage, scene, throw.target)
    _draw_arms(stage, scene, line)
    _draw_bars(stage, scene.object, line)
    frame_stage(stage, scene, throw.target, line)
    _draw_release(figure.add_subplot(grid[0, 1]), scene, line)
    dx, dtheta = throw.deciding.miss(throw.target)
    angle = "" if throw.target.theta is None else f", {np.degrees(abs(dtheta)):.3f} deg"
    title = f"{scene.name}: lands {1e3 * abs(dx):.3f} mm{angle} from the target\n"
    title += f"{_flight_words(throw)}\n{throw.grip_words}"
    stage.set_title(title, loc="left", fontsize=10)
    plots = [figure.add_subplot(grid[i, 1]) for i in (1, 2, 3)]
    _draw_plots(plots, line)
    if load is not None:
        _draw_window(plots[-1], *load)
    if path is not None:
        save(figure, path)
    return figure


def _flight_words(throw: Throw) -> str:
    """Speed and turning rate at detach, time and turns of the flight."""
    flight = throw.landing_time - throw.detach_time
    ends = throw.flight(np.array([0.0, flight]))[2]
    v_x, v_z, omega = throw.deciding.release.com_twist[:, -1]
    return (
        f"leaves the hand at {np.hypot(v_x, v_z):.2f} m/s, turning {omega:.1f} rad/s; "
        f"flies {1e3 * flight:.0f} ms, {abs(ends[1] - ends[0]) / (2 * np.pi):.2f} turns"
    )


def bar_corners(bar: ThrownObject, com: Array) -> Array:
    """Corners (4, 2) of the bar, drawn at least `MIN_WIDTH` wide."""
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
    """Target, cup, floor, base column, and obstacles as the plane's side view shows them."""
    from matplotlib.patches import Polygon, Rectangle

    if scene.cup is not None:
        draw_cup(stage, scene.cup)
    workspace = scene.workspace
    if workspace is not None and workspace.floor is not None:
        look: dict[str, Any] = {"color": "#b0a99f", "lw": 1, "ls": "--", "zorder": 1}
        stage.axhline(workspace.floor, label="floor", **look)
    if (column := column_of(scene)) is not None:
        radius, height = column
        place = (-radius, 0.0), 2 * radius, height
        stage.add_patch(Rectangle(*place, color="#e4e1dc", zorder=0, label="base column"))
    for number, solid in enumerate(_obstacles(scene, target)):
        name = "obstacle" if number == 0 else None
        look = {"color": "#d9b8a6", "alpha": 0.6, "zorder": 0, "label": name}
        stage.add_patch(Polygon(solid.outline(), closed=True, **look))
    x = target.plane_x
    if target.theta is not None:
        corners = bar_corners(scene.object, np.array([x, target.z, target.theta]))
        stage.add_patch(Polygon(corners, closed=True, fill=False, ls="--", color="k", zorder=7))
    stage.plot([x], [target.z], "k+", ms=11, zorder=8, label="target")


def _obstacles(scene: Scene, target: Pose) -> list[Solid]:
    """The obstacles as the plane of a throw to the target sees them."""
    aimed = scene.aimed_at(target).target
    assert aimed is not None
    return [aimed.plane.seen(obstacle.solid) for obstacle in scene.obstacle]


def frame_stage(stage: Axes, scene: Scene, target: Pose, line: Timeline) -> None:
    """Equal axes around the moving bodies and fixed bodies near them; the legend below."""
    low, high = line.extent(scene)
    outlines = [solid.outline() for solid in _obstacles(scene, target)]
    if scene.cup is not None:
        cup = scene.cup
        left, right, bottom = cup.x - cup.radius, cup.x + cup.radius, cup.rim - cup.depth
        outlines.append(np.array([[left, bottom], [right, cup.rim]]))
    if (column := column_of(scene)) is not None:
        outlines.append(np.array([[-column[0], 0.0], column]))
    if scene.workspace is not None and scene.workspace.floor is not None:
        outlines.append(np.array([[low[0], scene.workspace.floor]]))
    points = np.clip(np.vstack([*outlines, [low, high]]), low - AROUND, high + AROUND)
    low, high = points.min(axis=0) - 0.06, points.max(axis=0) + 0.06
    stage.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), xlabel="x [m]", ylabel="z [m]")
    stage.set_aspect("equal")
    stage.grid(alpha=0.25)
    if len(stage.get_legend_handles_labels()[0]) > 1:
        below: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.1)}
        stage.legend(fontsize=8, frameon=False, ncols=5, **below)


def _draw_release(axes: Axes, scene: Scene, line: Timeline) -> None:
    """The bar between the pads at some instants of the opening, in the hand's frame.

    The carried bar is horizontal; the title has its slip and pivot angle.
    """
    from matplotlib.patches import Circle, Polygon

    begin, end = (line.index(line.marks[name]) for name in ("opening", "detach"))
    angle = line.hand[2] + scene.grasp.angle
    x, z = line.com[:2] - line.hand[:2]
    cos, sin = np.cos(angle), np.sin(angle)
    in_hand = np.array([cos * x + sin * z, cos * z - sin * x, line.com[2] - angle])
    palm = hand_corners(scene, np.array([0.0, 0.0, -scene.grasp.angle]))
    axes.add_patch(Polygon(palm, closed=True, color=ARM, alpha=0.4, lw=0, zorder=1))
    for i in np.linspace(begin, end, RELEASING).astype(int):
        corners, colour = bar_corners(scene.object, in_hand[:, i]), PHASES[line.phase_name(i)]
        look: dict[str, Any] = {"fc": (colour, 0.1), "ec": colour, "lw": 1.2, "zorder": 3}
        axes.add_patch(Polygon(corners, closed=True, **look))
    pad = float(scene.patch.patch_radius)
    axes.add_patch(Circle((0.0, 0.0), pad, fill=False, color=BLACK, ls=":", zorder=4))
    axes.plot(*in_hand[:2, begin : end + 1], color=BLACK, lw=1.2, zorder=4)
    axes.plot(*in_hand[:2, end], "o", color=BLACK, ms=3, zorder=4)
    axes.set_aspect("equal")
    axes.autoscale_view()
    axes.margins(0.04)
    axes.set_xlabel("in the hand's frame [m]", fontsize=8)
    axes.tick_params(labelsize=7)
    angle_at_end = in_hand[2, end]
    # Motion of the pads' centre along and across the bar.
    across = [
        [np.cos(angle_at_end), np.sin(angle_at_end)],
        [-np.sin(angle_at_end), np.cos(angle_at_end)],
    ]
    slip = np.linalg.norm(np.array(across) @ in_hand[:2, end] - in_hand[:2, begin])
    words = (
        f"slips {1e3 * slip:.2f} mm, pivots {np.degrees(angle_at_end - in_hand[2, begin]):.1f} deg"
    )
    opening = 1e3 * (line.times[end] - line.times[begin])
    title = f"between the pads (dotted) while they open, {opening:.0f} ms:\n{words}"
    axes.set_title(title, loc="left", fontsize=9)


def _draw_arms(stage: Axes, scene: Scene, line: Timeline) -> None:
    """The arm (or hand) at rest, as the opening starts and at detach."""
    from matplotlib.patches import Polygon

    kind = "hand" if line.arm is None else "arm"
    moments = {"at rest": 0.0} | {name: line.marks[name] for name in ("opening", "detach")}
    for (name, moment), alpha in zip(moments.items(), (0.25, 0.5, 0.9), strict=True):
        i = line.index(moment)
        if line.arm is not None:
            stage.plot(
                *line.arm[i], "-o", color=ARM, alpha=alpha, lw=5, ms=5, solid_capstyle="round"
            )
        outline = hand_corners(scene, line.hand[:, i])
        stage.add_patch(Polygon(outline, closed=True, color=ARM, alpha=alpha, zorder=2))
        stage.plot([], [], color=ARM, alpha=alpha, lw=5, label=f"{kind}, {name}")


def _draw_bars(stage: Axes, bar: ThrownObject, line: Timeline) -> None:
    """Poses of the bar, coloured by phase, and the CoM's path."""
    from matplotlib.patches import Polygon

    stage.plot(line.com[0], line.com[1], color=BLACK, lw=0.9, zorder=3)
    detach, last = line.index(line.marks["detach"]), len(line.times) - 1
    carried = np.linspace(0, line.index(line.marks["opening"]), CARRIED).astype(int)[:-1]
    indices = np.union1d(carried, np.linspace(detach, last, FLYING).astype(int))
    changes = np.flatnonzero(np.diff(line.phase)) + 1
    for i in np.union1d(indices, changes):
        colour, corners = PHASES[line.phase_name(i)], bar_corners(bar, line.com[:, i])
        patch = Polygon(corners, closed=True, color=colour, alpha=0.75, lw=0.5, zorder=5)
        stage.add_patch(patch)
    for i in np.unique(line.phase, return_index=True)[1]:
        name = line.phase_name(i)
        stage.plot([], [], color=PHASES[name], lw=5, label=f"bar, {name}")


def _draw_plots(axes: list[Axes], line: Timeline) -> None:
    """Grip force, turning rates and friction use from shortly before the command."""
    grip, rate, use = axes
    t = 1e3 * line.times
    grip.plot(t, np.where(line.times <= line.marks["detach"], line.grip, 0.0), color=ARM)
    grip.set_ylabel("f_N [N]")
    rate.plot(t, line.hand_rate, color=ARM, label="hand")
    rate.plot(t, line.object_rate, color=GREEN, label="object")
    low, high = rate.get_ylim()
    if high - low < MIN_RATE_SPAN:
        rate.set_ylim((low + high - MIN_RATE_SPAN) / 2, (low + high + MIN_RATE_SPAN) / 2)
    rate.set_ylabel("ω [rad/s]")
    use.plot(t, np.minimum(line.force_use, 3.0), color=RED, label="force")
    use.plot(t, np.minimum(line.torque_use, 3.0), color=ORANGE, label="torque")
    use.axhline(1.0, color="k", lw=0.8)
    use.set(ylabel="friction use", xlabel="t [ms]", ylim=(0, 1.6))
    for axis in (rate, use):
        axis.legend(fontsize=8)
    for axis in axes:
        axis.grid(alpha=0.25)
        axis.set_xlim(max(0.0, 1e3 * line.marks["command"] - LEAD_MS), t[-1])
        for moment in line.marks.values():
            axis.axvline(1e3 * moment, color="#999999", lw=0.8, ls=":")
    words: dict[str, Any] = {"fontsize": 7, "rotation": 90, "va": "top", "ha": "right"}
    for name in ("command", "opening", "detach"):
        place = 1e3 * line.marks[name], 1.0
        grip.annotate(name, place, xycoords=("data", "axes fraction"), **words)


def _draw_window(axis: Axes, times: Array, load: Array) -> None:
    """The window of an uncertain opening, and the load on the pads in it."""
    axis.axvspan(1e3 * times[0], 1e3 * times[-1], color=GREEN, alpha=0.12, lw=0)
    label = f"load while the pads may open,\nat most {100 * load.max():.1f} %"
    axis.plot(1e3 * times, load, color=GREEN, lw=2, label=label)
    axis.legend(fontsize=8)
