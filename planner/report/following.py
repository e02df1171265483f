"""Warm plans that follow a moving target, as `examples/follow.py` shows them."""

from __future__ import annotations

import math

import numpy as np

from ...problems.load import load_scene
from .page import Effort, Table
from .warmed import warmed

#: How far a followed target moves: x [m], theta [rad], and in what time and steps [s].
SWING, PERIOD, TICK = (0.06, 0.2), 2.0, 0.01


def following(effort: Effort) -> Table:
    """Warm plans that follow a moving target."""
    rows = []
    for name in ("pose", "cup"):
        scene = load_scene(name)
        assert scene.target is not None
        planner = warmed(scene, [scene.target], "wait")
        plan = planner.plan()
        plan = planner.plan(warm=plan)
        target, solves, totals, errors = plan.target, [], [], []
        count = effort.of(20, 200)
        for k in range(count):
            swing = math.sin(2 * math.pi * k * TICK / PERIOD)
            theta = None if target.theta is None else target.theta + SWING[1] * swing
            moved = target.in_plane(target.plane_x - SWING[0] * swing, theta)
            after = planner.plan(moved, warm=plan)
            solves.append(1e3 * after.time["solve"])
            totals.append(1e3 * after.time["total"])
            if after.solved:
                plan = after
                errors.append(after.error_sent())
        worst = np.max(errors, axis=0)
        inside = sum(total <= 1e3 * TICK for total in totals)
        figures = [float(v) for v in np.percentile(solves, [50, 95])]
        rows.append(
            [
                *(name, count, len(errors), inside, *figures, float(np.median(totals))),
                *(1e3 * float(worst[0]), math.degrees(float(worst[1]))),
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
