"""Warm plans that follow a moving target."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...problems import load_scene
from ..plan import Planner
from .page import Effort, Table
from .warmed import warmed

#: How far a followed target moves: x [m], theta [rad], and in what time and steps [s].
SWING, PERIOD, TICK = (0.06, 0.2), 2.0, 0.01


@dataclass(frozen=True)
class Followed:
    """Plans one after the other.

    solves, totals [ms]: times of each plan's solves and of the whole; errors [m, rad] of what
    is sent, of the solved ones.
    """

    solves: list[float]
    totals: list[float]
    errors: list[tuple[float, float]]

    @property
    def inside(self) -> int:
        """How many plans were there when the next was due."""
        return sum(total <= 1e3 * TICK for total in self.totals)

    @property
    def worst(self) -> tuple[float, float]:
        """Largest errors [m, rad]; NaN without a solved plan."""
        x, theta = np.max(self.errors or [(math.nan, math.nan)], axis=0)
        return float(x), float(theta)


def follow(planner: Planner, count: int) -> Followed:
    """`count` plans to the planner's own target that swings, each from the last solved one."""
    plan = planner.plan()
    # The second plan builds what only warm plans need.
    plan = planner.plan(warm=plan)
    target, found = plan.target, Followed([], [], [])
    for k in range(count):
        swing = math.sin(2 * math.pi * k * TICK / PERIOD)
        theta = None if target.theta is None else target.theta + SWING[1] * swing
        moved = target.in_plane(target.plane_x - SWING[0] * swing, theta)
        after = planner.plan(moved, warm=plan)
        found.solves.append(1e3 * after.time["solve"])
        found.totals.append(1e3 * after.time["total"])
        if after.solved:
            plan = after
            found.errors.append(after.error_sent())
    return found


def following(effort: Effort) -> Table:
    """Warm plans that follow a moving target."""
    rows = []
    for name in ("pose", "cup"):
        scene = load_scene(name)
        assert scene.target is not None
        count = effort.of(20, 200)
        found = follow(warmed(scene, [scene.target], "wait"), count)
        figures = [float(v) for v in np.percentile(found.solves, [50, 95])]
        x, theta = found.worst
        rows.append(
            [
                *(name, count, len(found.errors), found.inside, *figures),
                *(float(np.median(found.totals)), 1e3 * x, math.degrees(theta)),
            ]
        )
    return Table(
        "reach-following",
        f"Warm plans after a target that swings by {100 * SWING[0]:.0f} cm and {SWING[1]:g} rad, "
        f"a plan every {1e3 * TICK:.0f} ms",
        (
            *("scene", "plans", "solved", f"within {1e3 * TICK:.0f} ms", "solve, median [ms]"),
            *("solve, 95 % [ms]", "plan, median [ms]", "worst error [mm]", "worst error [deg]"),
        ),
        rows,
    )
