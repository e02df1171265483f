"""Section `regions`: plans into bins, to a region of landings and to a grid of its poses."""

from __future__ import annotations

import math

import numpy as np
from throwplan import InputError, Planner
from throwplan.planner.show import Row, Table

from .page import Effort, ReportSection
from .processes import shared
from .rest import bin_scene

#: Poses of a grid over a region: of x, of theta.
GRID = (5, 3)
#: Costs are equal within this share: the solver's and the correction's accuracy.
EQUAL = 1e-3


def make(effort: Effort) -> ReportSection:
    """The bars and bins of the section `rest`."""
    jobs, rows = range(effort.of(1, 30)), list[Row]()
    step, columns = effort.counter(len(jobs)), [effort.of(2, GRID[0])] * len(jobs)
    for found in shared(_compared, jobs, columns, quick=effort.quick):
        rows.append(found)
        step()
    table = Table("regions", "Plans to a region of landings and to a grid of its poses", rows)
    return ReportSection("regions", "Targets that are regions", _figures(table), [table])


def _figures(table: Table) -> list[str]:
    """The results as sentences."""
    reached = [row for row in table.rows if row["poses solved"]]
    solved = sum(row["status"] == "solved" for row in reached)
    ratios = [row["cost over best pose's"] for row in reached if row["status"] == "solved"]
    costs = np.array([ratio for ratio in ratios if isinstance(ratio, float)])
    more = f"in {int((costs > 1 + EQUAL).sum())} it costs more than there"
    least = f", the median costs {np.median(costs):.3f} of it" if costs.size else ""
    return [
        f"{len(table.rows)} random bars and bins, each in one place. Into {len(reached)} of them a "
        f"throw to one of {math.prod(GRID)} poses is found. The plan to the region of these poses "
        f"is solved in {solved} of these {len(reached)}; {more}{least}."
    ]


def _compared(number: int, columns: int) -> Row:
    """The plans of one scene."""
    scene = bin_scene(number).replace(rest=None)
    region = scene.aim
    assert scene.cup is not None
    plan = Planner(scene, library=False).plan()
    costs, count = list[float](), 0
    for x in np.linspace(-1.0, 1.0, columns) * region.half_widths[0]:
        for theta in np.linspace(-1.0, 1.0, GRID[1]) * region.half_widths[1]:
            pose = region.middle.shifted(x, theta)
            try:
                found = Planner(scene.replace(target=pose), library=False).plan()
            except InputError:
                # At this pose the bar is outside the bin.
                continue
            count += 1
            if found.solved and found.throw is not None:
                costs.append(found.throw.effort)
    best = min(costs, default=math.nan)
    own = math.nan if plan.throw is None or not plan.solved else plan.throw.effort
    return {
        "scene": scene.name,
        "bar [m]": scene.object.length,
        "bin at x [m]": scene.cup.x,
        "status": plan.status,
        "poses": count,
        "poses solved": len(costs),
        "cost": own,
        "cost over best pose's": own / best,
        "planning time [s]": plan.time["total"] - plan.time["build"],
    }
