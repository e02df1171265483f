"""Planners whose plans are timed: all is built, and no compiler works beside them."""

from __future__ import annotations

import time
from collections.abc import Sequence

from ...problems import Pose, Scene
from ..compile import Compile
from ..plan import Planner, SolverName

#: The longest time [s] to wait for what a compiler makes in the background.
LONGEST = 150.0


def warmed(
    scene: Scene, targets: Sequence[Pose], compiling: Compile, solver: SolverName = "auto"
) -> Planner:
    """A planner that has built and drawn what a plan needs; with 'wait' also compiled.

    targets: plans to these show what rows they ask for, and these are compiled before too.
    Rows that no target asked for run as they are when one does later, 'cached': a compiler that
    starts then would double the times of the plans beside it.
    """
    if compiling == "wait":
        first = Planner(scene, compiling=compiling)
        for target in targets:
            first.plan(target, solver=solver)
        until = time.perf_counter() + LONGEST
        while first.problems.awaited and time.perf_counter() < until:
            time.sleep(0.2)
        compiling = "cached"
    planner = Planner(scene, compiling=compiling)
    for target in targets:
        planner.plan(target, solver=solver)
    return planner
