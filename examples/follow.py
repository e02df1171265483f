"""Follows a moving target: a new plan every 10 ms, each started from the last.

    python examples/follow.py [--scene cup] [--seconds 2] [--prepare]

The target swings by 6 cm and turns by 0.2 rad about the scene's own, up to 0.2 m/s. Every
plan is a whole one: solved, sent through Ruckig, thrown by the exact model, corrected,
checked. Printed: how many were solved, within 10 ms, and their errors.
"""

from __future__ import annotations

import argparse
import math

import numpy as np
import throwplan as tp
from throwplan.planner.report import TICK, follow


def main() -> None:
    """Runs the demonstration."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scene", default="cup")
    parser.add_argument("--seconds", type=float, default=2.0)
    parser.add_argument("--prepare", action="store_true", help="solve throws beforehand")
    options = parser.parse_args()
    planner = tp.Planner(tp.load_scene(options.scene))
    if options.prepare:
        planner.prepare()
    found = follow(planner, round(options.seconds / TICK))
    for name, values in (("solve", found.solves), ("whole plan", found.totals)):
        figures = np.percentile(values, [50, 95, 99])
        print(f"{name:10} median {figures[0]:.2f}, 95 % {figures[1]:.2f}, 99 % {figures[2]:.2f} ms")
    x, theta = found.worst
    count = len(found.totals)
    print(
        f"{count} targets, {count - len(found.errors)} not solved, {found.in_time} planned within "
        f"{1e3 * TICK:.0f} ms; worst error {1e3 * x:.3f} mm, {math.degrees(theta):.3f} deg"
    )


if __name__ == "__main__":
    main()
