"""A cycle as one picture: when each object is grasped, swung and flies, and the floor plan."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..planner import TICK
from .style import BLACK, BLUE, GREEN, GREY, ORANGE, TEAL, new_figure, own_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..planner import SentMotion

#: Colours of what happens to an object.
COLOURS = {"grasp": TEAL, "swing": BLUE, "release": ORANGE, "flight": GREEN, "on to the next": GREY}


@own_style()
def draw_cycle(motion: SentMotion) -> Figure:
    """A cycle's motion: timeline above, floor plan below."""
    count = len(motion.carries)
    title = f"{motion.name}: {count} objects in {motion.duration:.2f} s"
    figure = new_figure(9.5, 5.0 + 0.3 * count, title)
    above, below = figure.subplots(2, 1, height_ratios=[1.0 + 0.3 * count, 4.0])
    _draw_times(above, motion)
    _draw_floor(below, motion)
    return figure


def _draw_times(axes: Axes, motion: SentMotion) -> None:
    """A row for each object."""
    ends = [TICK * step.reach for step in motion.carries[1:]] + [motion.duration]
    for row, (step, end) in enumerate(zip(motion.carries, ends, strict=True)):
        pieces = {
            "grasp": (TICK * step.reach, TICK * step.held),
            "swing": (TICK * step.held, step.opening_time),
            "release": (step.opening_time, step.detach_time),
            "on to the next": (step.detach_time, end),
        }
        for name, (begin, until) in pieces.items():
            axes.barh(row, until - begin, 0.5, begin, color=COLOURS[name], zorder=2)
        begin = step.detach_time
        axes.barh(
            row + 0.33, step.landing_time - begin, 0.14, begin, color=COLOURS["flight"], zorder=2
        )
    labels = [f"{step.pick} → {step.bin}" for step in motion.carries]
    axes.set_yticks(range(len(labels)), labels, fontsize=8)
    for name, colour in COLOURS.items():
        axes.barh(0, 0.0, color=colour, label=name)
    # The first objects leave the upper right corner free.
    axes.legend(fontsize=7, loc="upper right")
    axes.invert_yaxis()
    axes.grid(axis="x", alpha=0.3, lw=0.6, zorder=0)
    axes.set(xlim=(0.0, motion.duration), xlabel="time [s]")


def _draw_floor(axes: Axes, motion: SentMotion) -> None:
    """Picks, bins, the way of the pads and the flights, from above."""
    q = motion.samples.q[::5]
    spatial = motion.carries[0].space.spatial
    x, y, _ = spatial.pads(q, 0.0 * q, 0.0 * q).pose[:, :3, 3].T
    axes.plot(x, y, color=GREY, lw=0.8, zorder=2, label="pads")
    bins, picks = dict[str, tuple[float, float]](), list[tuple[float, float, str]]()
    for step in motion.carries:
        throw = step.throw
        times = np.linspace(0.0, throw.landing.flight_time, 20)
        flown = throw.flight(times)
        points = throw.target.plane.points(flown[0], flown[1])
        axes.plot(points[:, 0], points[:, 1], color=GREEN, lw=1.2, zorder=3)
        axes.plot(*points[-1, :2], "o", color=BLACK, ms=5, zorder=4)
        bins[step.bin] = float(points[-1, 0]), float(points[-1, 1])
        k = step.reach // 5
        axes.plot(x[k], y[k], "s", color=TEAL, ms=5, zorder=4)
        picks.append((round(float(y[k]), 3), float(x[k]), step.pick))
    # Names of neighbours in a row stand below and above in turn.
    for number, (up, along, name) in enumerate(sorted(picks)):
        away = (0, (-10, 6)[number % 2])
        axes.annotate(name, (along, up), away, textcoords="offset points", ha="center", size=6)
    for name, place in bins.items():
        axes.annotate(name, place, xytext=(5, 5), textcoords="offset points", size=7)
    axes.plot(0.0, 0.0, "^", color=BLACK, ms=8, zorder=4)
    axes.set(xlabel="x [m]", ylabel="y [m]", aspect="equal")
    axes.margins(0.2, 0.12)
    axes.grid(alpha=0.3, lw=0.6, zorder=0)
