"""A replay as files: replay.json, replay.csv, replay.png. All or nothing."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ...problems import Cup, ThrownObject, filling
from ..check import bar_outline
from .replay import Replay

Array = npt.NDArray[np.float64]

#: What a replay may leave in its folder.
FILES = ("replay.json", "replay.csv", "replay.png")
#: Between the poses drawn [s].
EVERY = 0.02
WALL: dict[str, Any] = {"color": "#5b4a3f", "lw": 3, "solid_capstyle": "butt", "zorder": 2}
COLOURS = (
    ("#f2a33a", "opening"),
    ("#2a9d6f", "after it"),
    ("#d1495b", "end"),
    ("#4c78a8", "landing, sliding pivot"),
    ("#222222", "landing, limit surface"),
)
#: The landings to compare: name, words, colour.
LANDINGS = (
    ("sp", "sliding pivot", "#4c78a8"),
    ("limit_surface", "limit surface", "#f2a33a"),
    ("mujoco", "MuJoCo", "#d1495b"),
)


def save_replay(replay: Replay, folder: Path, draw: bool) -> None:
    """Write a replay's files into `folder`, and take away those of an earlier one."""
    with filling(folder, FILES) as scratch:
        text = json.dumps(replay.to_dict(), indent=2, allow_nan=False)
        (scratch / "replay.json").write_text(text + "\n", encoding="utf-8")
        _write_path(replay, scratch / "replay.csv")
        if draw:
            _draw(replay, scratch / "replay.png")


def _write_path(replay: Replay, path: Path) -> None:
    """replay.csv: the CoM at 1 kHz from the opening on; with y, in the base frame, for an arm."""
    x, z, theta = replay.com
    names, columns = "t,x,z,theta", [replay.times, x, z, theta]
    if replay.throw.scene.robot is not None:
        turn = replay.throw.target.azimuth
        names = "t,x,y,z,theta"
        columns[1:2] = [x * math.cos(turn), x * math.sin(turn)]
    table = np.column_stack(columns)
    np.savetxt(path, table, delimiter=",", header=names, comments="", fmt="%.9g")


def _draw(replay: Replay, path: Path) -> None:
    """The bar's way at true scale, and beside it the landings about the target."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 6.4), layout="constrained")
    stage, near = figure.subplots(1, 2, width_ratios=(1.2, 1))
    _draw_way(replay, stage)
    _draw_landings(replay, near)
    figure.suptitle(_title(replay), fontsize=11)
    figure.savefig(path, dpi=110)


def _draw_way(replay: Replay, axes: Any) -> None:
    """The path of the CoM and the bar along it, from the opening to the end."""
    bar, com = _seen(replay), replay.com
    if replay.throw.scene.cup is not None:
        _draw_cup(axes, replay.throw.scene.cup)
    axes.plot(com[0], com[1], color="#222222", lw=1, zorder=4, label="CoM")
    opening = replay.throw.detach_time - replay.throw.opening_time
    for i in range(0, len(replay.times), max(round(1e3 * EVERY), 1)):
        held = replay.times[i] < replay.times[0] + opening
        _draw_bar(axes, bar, com[:, i], fc="#f2a33a" if held else "#2a9d6f", alpha=0.45)
    _draw_bar(axes, bar, com[:, -1], fc="#d1495b", alpha=0.9)
    for pose, colour in ((replay.sp, "#4c78a8"), (replay.limit_surface, "#222222")):
        if math.isfinite(pose[0]):
            _draw_bar(axes, bar, np.array(pose), fc="none", ec=colour, lw=1.2, zorder=7)
    for colour, words in COLOURS:
        axes.plot([], [], color=colour, lw=5, label=words)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="z [m]")
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2)


def _draw_landings(replay: Replay, axes: Any) -> None:
    """How far everybody's landing is from the target, and the tolerance."""
    from matplotlib.patches import Rectangle

    target, tolerance = replay.throw.target, replay.throw.scene.tolerance
    # Where the target leaves the angle open, MuJoCo's is as good as any.
    theta = replay.landing[2] if target.theta is None else target.theta
    poses = {"sp": replay.sp, "limit_surface": replay.limit_surface, "mujoco": replay.landing}
    for name, words, colour in LANDINGS:
        x, _, angle = poses[name]
        dx, dtheta = 1e3 * (x - target.plane_x), math.degrees(angle - theta)
        if math.isfinite(dx) and math.isfinite(dtheta):
            label = f"{words}: {dx:+.2f} mm, {dtheta:+.2f}°"
            axes.plot(dx, dtheta, "o", color=colour, ms=9, label=label)
    axes.plot(0, 0, "k+", ms=14, label="target")
    dx, dtheta = 1e3 * tolerance.position, math.degrees(tolerance.angle)
    box = Rectangle((-dx, -dtheta), 2 * dx, 2 * dtheta, fill=False, ls="--", label="tolerance")
    if target.theta is not None:
        axes.add_patch(box)
    axes.margins(0.15)
    axes.grid(alpha=0.25)
    given = "target" if target.theta is not None else "MuJoCo's"
    axes.set(xlabel="x off the target [mm]", ylabel=f"theta off the {given} [deg]")
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=2)


def _seen(replay: Replay) -> ThrownObject:
    """The bar, wide enough to be seen."""
    import dataclasses

    bar = replay.throw.scene.object
    return dataclasses.replace(bar, width=max(bar.width, 0.008))


def _draw_bar(axes: Any, bar: ThrownObject, com: Array, **style: Any) -> None:
    from matplotlib.patches import Polygon

    corners = bar_outline(bar, com[:, None])[:, 0].T
    axes.add_patch(Polygon(corners, closed=True, **{"lw": 0.5, "zorder": 6, **style}))


def _draw_cup(axes: Any, cup: Cup) -> None:
    bottom, left, right = cup.rim - cup.depth, cup.x - cup.radius, cup.x + cup.radius
    axes.plot([left, left, right, right], [cup.rim, bottom, bottom, cup.rim], **WALL)


def _title(replay: Replay) -> str:
    words = f"{replay.throw.scene.name}: thrown in MuJoCo"
    if replay.rest is None:
        return words
    return f"{words}, ends {'in' if replay.rest.inside else 'outside'} the cup\n{replay.assumed}"
