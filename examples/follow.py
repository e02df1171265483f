"""Follows a moving target: a new plan every 10 ms, each started from the last.

    python examples/follow.py [--scene cup] [--seconds 2] [--compile wait|no]

The target swings by 6 cm and turns by 0.2 rad about the scene's own, up to 0.2 m/s. Every
plan is a whole one: solved, sent through Ruckig, thrown by the exact model, corrected,
checked. Printed: how many were solved, within 10 ms, and their errors.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
import throwplan as tp

#: A plan is due every 10 ms.
PERIOD = 0.01


def main() -> None:
    """Runs the demonstration."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="cup")
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--compile", choices=("wait", "no"), default="wait")
    options = parser.parse_args()
    scene = tp.load_scene(options.scene)
    planner = tp.Planner(scene, compiling=options.compile)
    plan = planner.plan()
    # The second plan builds what only warm plans need.
    plan = planner.plan(warm=plan)
    target, solves, totals, errors, lost = plan.target, [], [], [], 0
    for k in range(round(options.seconds / PERIOD)):
        phase = 2 * math.pi * k * PERIOD / 2.0
        theta = None if target.theta is None else target.theta + 0.2 * math.sin(phase)
        moved = target.in_plane(target.plane_x - 0.06 * math.sin(phase), theta)
        after = planner.plan(moved, warm=plan)
        solves.append(1e3 * after.time["solve"])
        totals.append(1e3 * after.time["total"])
        if after.solved:
            plan = after
            errors.append(after.error_sent())
        else:
            lost += 1
    worst = np.max(errors, axis=0)
    for name, values in (("solve", solves), ("whole plan", totals)):
        figures = np.percentile(values, [50, 95, 99])
        print(f"{name:10} median {figures[0]:.2f}, 95 % {figures[1]:.2f}, 99 % {figures[2]:.2f} ms")
    inside = sum(total <= 1e3 * PERIOD for total in totals)
    print(
        f"{len(totals)} targets, {lost} not solved, {inside} planned within {1e3 * PERIOD:.0f} ms; "
        f"worst error {1e3 * worst[0]:.3f} mm, {math.degrees(worst[1]):.3f} deg"
    )


if __name__ == "__main__":
    main()
