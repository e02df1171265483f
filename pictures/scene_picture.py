"""A scene before any plan, with what its numbers mean: arm, target, cup, obstacles by name, reach;
the object in the hand, the cup, the gripper's times, and the plane from above."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..planner import Manipulator, arm_points, held_bar
from .drawings import draw_bars, draw_cup
from .style import ARM, BLACK, BLUE, GREEN, GREY, new_figure, own_style
from .throw_picture import ARM_LINE, draw_surroundings, hand_corners, lay_out, name_obstacles

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..models import Array
    from ..problems import Scene

#: Look of an arrow between two ends of a length.
ARROW: dict[str, Any] = {"arrowstyle": "<->", "color": BLUE, "lw": 1.1, "shrinkA": 0, "shrinkB": 0}


@own_style()
def draw_scene(scene: Scene, manipulator: Manipulator, reach: tuple[float, float] | None) -> Figure:
    """The scene as one picture.

    reach [m]: least and largest x in the throw's plane of throws to the target's height, at any
    angle; None if none is known. A free start is drawn in the middle of the joints' ranges.
    """
    parts: list[Callable[[Axes, Scene], None]] = [_draw_object]
    parts += [_draw_cup] if scene.cup is not None else []
    parts += [_draw_bin] if scene.bin is not None else []
    parts += [_draw_times]
    parts += [_draw_from_above] if scene.arm is not None else []
    names = scene.name, scene.description
    figure = new_figure(12.5, 2.0 * len(parts), ": ".join(filter(None, names)))
    halves = figure.add_gridspec(1, 2, width_ratios=(1.6, 1))
    stage = figure.add_subplot(halves[0])
    _draw_stage(stage, scene, manipulator, reach)
    entries = stage.get_legend_handles_labels()
    figure.legend(*entries, loc="outside lower left", ncols=4, fontsize=8, frameon=False)
    rows = halves[1].subgridspec(len(parts), 1)
    for row, draw in enumerate(parts):
        draw(figure.add_subplot(rows[row]), scene)
    lay_out(figure)
    name_obstacles(stage, scene, scene.aim)
    return figure


def _draw_stage(
    stage: Axes, scene: Scene, manipulator: Manipulator, reach: tuple[float, float] | None
) -> None:
    """The throw's plane: arm or hand at the start, and all that stands there."""
    limits, start = manipulator.planning, manipulator.start
    q = (limits.q_min + limits.q_max) / 2 if start is None else start
    pose = np.array(manipulator.motion(q[:, None], 0 * q[:, None], 0 * q[:, None])[0])[:, 0]
    draw_surroundings(stage, scene, scene.aim)
    words = "start" if start is not None else "start is free"
    if (points := arm_points(manipulator, q[:, None])) is not None:
        stage.plot(*points[0], marker="o", label=f"arm, {words}", **ARM_LINE)
    label = None if points is not None else f"hand, {words}"
    stage.fill(*hand_corners(scene, pose).T, color=ARM, label=label, zorder=2)
    draw_bars(stage, scene.object, held_bar(scene, pose[:, None])[:, 0], color=GREY, alpha=0.8)
    if reach is not None:
        look: dict[str, Any] = {"color": GREEN, "lw": 6, "alpha": 0.35, "solid_capstyle": "butt"}
        stage.plot(reach, [scene.aim.z] * 2, label="sampled throws land here", zorder=1, **look)
    stage.set(xlabel="x in the throw's plane [m]", ylabel="z [m]")
    stage.set_aspect("equal", adjustable="datalim")
    stage.grid(alpha=0.25)


def _length(axes: Axes, begin: tuple[float, float], end: tuple[float, float], words: str) -> None:
    """An arrow between two points, and what it is."""
    axes.annotate("", begin, end, arrowprops=ARROW)
    # For the limits of the axes.
    axes.plot(*zip(begin, end, strict=True), lw=0)
    level = abs(end[0] - begin[0]) > abs(end[1] - begin[1])
    middle = (begin[0] + end[0]) / 2, (begin[1] + end[1]) / 2
    shift, side = ((0, 3), "center") if level else ((4, 0), "left")
    how: dict[str, Any] = {
        "xytext": shift,
        "textcoords": "offset points",
        "ha": side,
        "color": BLUE,
    }
    axes.annotate(words, middle, va="bottom" if level else "center", fontsize=8, **how)


def _schematic(axes: Axes, title: str) -> None:
    """Equal axes without ticks."""
    axes.set_title(title, loc="left", fontsize=9)
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.margins(0.15)
    axes.set(xticks=[], yticks=[])


def _draw_object(axes: Axes, scene: Scene) -> None:
    """The object between the pads, in the hand's frame: com, offset and angle."""
    from matplotlib.patches import Circle

    thing, grasp = scene.object, scene.grasp
    axes.fill(*hand_corners(scene, np.zeros(3)).T, color=ARM, alpha=0.4, lw=0)
    pose = held_bar(scene, np.zeros((3, 1)))[:, 0]
    draw_bars(axes, thing, pose, color=GREY, alpha=0.6)
    axes.add_patch(Circle((0.0, 0.0), scene.patch.patch_radius, fill=False, color=BLACK, ls=":"))
    axes.plot(*pose[:2], "o", color=BLACK, ms=4)
    along = np.array([math.cos(grasp.angle), math.sin(grasp.angle)])
    across = np.array([-along[1], along[0]])
    end, size = pose[:2] - thing.com * along, max(thing.width, 0.2 * thing.length)

    def place(share: float, way: float) -> tuple[float, float]:
        x, z = end + way * along + share * size * across
        return float(x), float(z)

    _length(axes, place(1.0, 0.0), place(1.0, thing.com), f"com {thing.com:g}")
    if grasp.offset:
        _length(axes, place(-1.2, 0.0), place(-1.2, grasp.offset), f"offset {grasp.offset:g}")
    angle = f", angle_deg {math.degrees(grasp.angle):g}" if grasp.angle else ""
    _schematic(axes, f"[object] in the pads (dotted){angle} [m]")


def _draw_cup(axes: Axes, scene: Scene) -> None:
    """The cup and the target pose: rim, depth, radius, insertion, z."""
    cup, target = scene.cup, scene.aim
    assert cup is not None
    draw_cup(axes, cup)
    angle = 0.0 if target.theta is None else target.theta
    draw_bars(
        axes, scene.object, np.array([target.plane_x, target.z, angle]), color=GREEN, alpha=0.5
    )
    axes.plot(target.plane_x, target.z, "k+", ms=9)
    left, right, bottom = cup.x - cup.radius, cup.x + cup.radius, cup.rim - cup.depth
    axes.axhline(cup.rim, color=GREY, lw=0.8, ls=":")
    low = bottom - cup.radius
    _length(axes, (cup.x, low), (right, low), f"radius {cup.radius:g}")
    _length(
        axes,
        (right + 0.3 * cup.radius, bottom),
        (right + 0.3 * cup.radius, cup.rim),
        f"depth {cup.depth:g}",
    )
    deep = cup.rim - cup.insertion
    _length(axes, (left - 0.3 * cup.radius, deep), (left - 0.3 * cup.radius, cup.rim), "")
    look: dict[str, Any] = {"fontsize": 8, "color": BLUE}
    axes.text(
        left - 0.45 * cup.radius,
        (deep + cup.rim) / 2,
        f"insertion {cup.insertion:g}",
        ha="right",
        va="center",
        **look,
    )
    axes.text(right + 0.3 * cup.radius, cup.rim, f" rim {cup.rim:g}", va="bottom", **look)
    axes.text(cup.x + 0.2 * cup.radius, target.z, f"target z {target.z:g}", va="bottom", **look)
    _schematic(axes, "[cup] and [target] [m]")


def _draw_bin(axes: Axes, scene: Scene) -> None:
    """The bin from above, the throw to the right: its inside, yaw, and the landings."""
    into = scene.bin
    assert into is not None
    size = 1.2 * into.reach
    axes.plot([-size, size], [0.0, 0.0], color=ARM, lw=1, ls=":")
    if into.radius is not None:
        angles = np.linspace(0.0, 2 * math.pi, 73)
        corners = into.radius * np.array([np.cos(angles), np.sin(angles)])
        _length(axes, (0.0, 0.0), (0.0, into.radius), f"radius {into.radius:g}")
    else:
        half, wide = (into.length or 0.0) / 2, (into.width or 0.0) / 2
        cos, sin = math.cos(into.yaw), math.sin(into.yaw)
        turn = np.array([[cos, -sin], [sin, cos]])
        corners = turn @ (np.array([[1, 1, -1, -1, 1], [1, -1, -1, 1, 1]]) * [[half], [wide]])
        place = [turn @ point for point in ([-half, -0.7 * wide], [half, -0.7 * wide])]
        _length(axes, tuple(place[0]), tuple(place[1]), f"length {into.length:g}")
        place = [turn @ point for point in ([-0.7 * half, -wide], [-0.7 * half, wide])]
        # Empty lines: the words are below the line of the landings.
        _length(axes, tuple(place[0]), tuple(place[1]), f"\n\nwidth {into.width:g}")
    axes.plot(*corners, color=BLACK, lw=2)
    off, (half, _) = scene.aim.plane_x - into.plane_x, scene.aim.half_widths
    axes.plot([off - half, off + half], [0.0, 0.0], "|-", color=GREEN, ms=9)
    yaw = f", yaw_deg {math.degrees(into.yaw):g}" if into.yaw else ""
    words = f"rim {into.rim:g}, depth {into.depth:g}{yaw}"
    _schematic(axes, f"[bin] from above, landings: {words} [m]")


def _draw_times(axes: Axes, scene: Scene) -> None:
    """The grip force after the opening command: delay, dwell, opening."""
    grip, delay = scene.gripper.profile(), scene.mean_delay
    begin, opens = delay + grip.dwell, delay + grip.dwell + grip.opening
    times = np.linspace(min(delay, 0.0) - 0.02, opens + 0.02, 400)
    force: Array = np.array(grip.force(times - begin), float)
    axes.plot(1e3 * times, force, color=BLACK, lw=1.5)
    axes.axvline(0.0, color=GREY, ls=":", lw=1)
    ends = {"delay": (0.0, delay), "dwell": (delay, begin), "opening": (begin, opens)}
    for number, (name, (first, last)) in enumerate(ends.items()):
        if last != first:
            height = (0.25 + 0.22 * number) * grip.full
            words = f"{name} {abs(last - first):g}"
            _length(axes, (1e3 * first, height), (1e3 * last, height), words)
    axes.set_title("[gripper] force of one pad after the command [s]", loc="left", fontsize=9)
    axes.set_xlabel("t [ms]", fontsize=8)
    axes.set_ylabel("f_N [N]", fontsize=8)
    axes.tick_params(labelsize=7)


def _draw_from_above(axes: Axes, scene: Scene) -> None:
    """The throw's plane from above: x, y, azimuth, and how far beside the axis an arm throws."""
    target = scene.aim
    begin, end = target.plane.points(np.array([0.0, target.plane_x]), np.zeros(2))[:, :2]
    axes.plot(0.0, 0.0, "o", color=ARM, ms=8)
    axes.plot(*zip(begin, end, strict=True), color=ARM, lw=1.5)
    axes.plot(*end, "k+", ms=9)
    x, y = float(end[0]), float(end[1])
    _length(axes, (0.0, 0.0), (x, 0.0), f"x {target.x:g}")
    if abs(y) > 1e-3:
        _length(axes, (x, 0.0), (x, y), f"y {target.y:g}")
    azimuth = math.degrees(target.plane.azimuth)
    _schematic(axes, f"throw's plane from above: azimuth {azimuth:.3g} deg [m]")
