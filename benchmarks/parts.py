"""Section `parts`: size and solving time of the NLP with each optional part of a scene."""

from __future__ import annotations

import dataclasses
import json
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from throwplan import (
    Cost,
    Cup,
    Distribution,
    Landing,
    Planner,
    Robust,
    Scene,
    Uncertainty,
    Workspace,
    load_scene,
    scene_names,
)
from throwplan.pictures import BLUE, GREEN, Row, Table

from .measure import planning_time, without_machine_code
from .page import Effort, Picture, ReportSection, number, panels

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Bounds of the landing that are never active: they add constraints and change no throw.
WIDE_LANDING = Landing(speed_min=0.01, speed_max=100.0, rate_max=1e3)
#: Bounds of the workspace that are never active.
WIDE_WORKSPACE = Workspace(floor=-10.0, column_radius=0.01, column_height=0.01)
#: Openings up to 10 ms early or late.
DELAY = Uncertainty(delay=Distribution(uniform=0.010))
#: Name of the column with the time of a plan's solves.
SOLVE = "solve [ms]"
#: Number of the ladder's row with all parts of a free hand.
HAND = 5
#: Number of the ladder's row with a Panda instead of the hand.
ARM = 6
#: Names of modules that take long to import.
HEAVY = ("numpy", "casadi", "scipy", "ruckig", "matplotlib", "PIL", "distributed")
#: Time limit [s] of a process that plans once.
PATIENCE = 300.0
#: Program that plans the scene on its stdin and prints the modules that it imported.
PLAN_ONCE = """
import pickle, sys
before = set(sys.modules)
import throwplan as tp
plan = tp.Planner(pickle.load(sys.stdin.buffer), library=False).plan()
import json
print(json.dumps([plan.status, sorted(set(sys.modules) - before)]))
"""


@without_machine_code()
def measured(scene: Scene, repeats: int) -> Row:
    """Size of a scene's NLP and least times of a plan, with the solves that lead to it.

    Plans once to build, then `repeats` times. Ignores a library: a plan from there has no solves.
    """
    planner = Planner(scene, library=False)
    first = planner.plan()
    # A plan that fails takes long and fails again.
    plans = [planner.plan() for _ in range(repeats)] if first.solved else [first]
    full = plans[-1]
    return {
        "variables": full.variables,
        "constraints": full.constraints,
        "iterations": full.iterations,
        "build [ms]": 1e3 * first.time["build"],
        SOLVE: 1e3 * min(plan.time["solve"] for plan in plans),
        "plan [ms]": 1e3 * min(map(planning_time, plans)),
        "status": full.status if full.solved else f"{full.status}: {full.message}",
    }


def make(effort: Effort) -> ReportSection:
    """The ladder from a bare throw to one with all parts; all scenes with their imports."""
    names = [name for name in scene_names() if load_scene(name).motion is None]
    chosen = ["hand-box", "cup"] if effort.quick else names
    rungs = list(ladder(load_scene("hand-box").replace(cost=Cost(quiet=0.0))))
    if effort.quick:
        rungs = [rungs[i] for i in (0, HAND, ARM)]
    step, climbed = effort.counter(len(rungs) + len(chosen)), list[Row]()
    for words, scene in rungs:
        # Fewer robust plans, as they take longer.
        cost = measured(scene, effort.of(2, 3 if scene.robust else 5))
        first = climbed[0] if climbed else cost
        ratio: Row = {"solve, times the first": _time(cost) / _time(first)}
        climbed.append({"hand-box": words} | cost | ratio)
        step()
    every = list[Row]()
    for name in chosen:
        scene = load_scene(name)
        every.append({"scene": name} | measured(scene, effort.of(2, 5)) | imports_of(scene))
        step()
    solves = [_time(row) for row in climbed]
    bare, hand, arm = (solves[i] for i in ((0, 1, 2) if effort.quick else (0, HAND, ARM)))
    imports = {str(row["large ones"]): row["modules"] for row in every}
    modules = "; ".join(f"{count} modules ({large})" for large, count in imports.items())
    table = Table("parts-ladder", "One part more at a time", climbed)
    caption = "Every scene, and what a fresh process imports to plan it"
    words = "Variables and solving time, one part more at a time"
    return ReportSection(
        "parts",
        "What a scene leaves out",
        [
            "`hand-box` is a free hand that holds the bar at its centre of mass and throws it to a "
            "position. The same throw carries one part more in each line; bounds are so wide that "
            "they never decide. All are solved without machine code.",
            f"With a Panda for the free hand it takes {arm / hand:.2g} times as long to solve "
            f"({arm:.0f} and {hand:.0f} ms). The last line takes {solves[-1] / bare:.0f} times "
            f"as long as the bare throw ({bare:.1f} ms), with the solves that lead to it.",
            f"A fresh process that plans imports {modules}.",
        ],
        [table, Table("parts-scenes", caption, every)],
        [Picture("parts", words, _draw_ladder(table))],
    )


def _time(row: Row) -> float:
    solve = row[SOLVE]
    assert isinstance(solve, float)
    return solve


def imports_of(scene: Scene) -> Row:
    """Modules that a fresh process imports to plan a scene, large ones among them, its time [s]."""
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", PLAN_ONCE],
        input=pickle.dumps(scene),
        capture_output=True,
        check=True,
        timeout=PATIENCE,
    )
    seconds = time.perf_counter() - start
    _, modules = json.loads(done.stdout)
    large = ", ".join(name for name in HEAVY if name in modules)
    return {"modules": len(modules), "large ones": large, "fresh process [s]": seconds}


def ladder(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """A throw of a free hand to a position, and one part more at a time, in words."""
    yield "as it is", scene
    target = scene.aim
    aside = dataclasses.replace(scene.grasp, offset=0.8 * scene.object.com)
    scene = scene.replace(grasp=aside)
    yield "+ held aside of the CoM: it pivots", scene
    scene = at_own_angle(scene)
    yield "+ θ of the target", scene
    scene = scene.replace(landing=WIDE_LANDING)
    yield "+ landing bounds", scene
    # A cup that is low and wide enough for any throw to enter it.
    cup = Cup(x=target.plane_x, rim=target.z - 0.1 - scene.object.length, radius=50.0, depth=0.1)
    scene = scene.replace(cup=cup)
    yield "+ cup", scene
    scene = scene.replace(workspace=WIDE_WORKSPACE)
    yield "+ floor and column", scene
    # The Panda holds the bar's end, since its hand has no room behind the grasp.
    arm, end = load_scene("box"), dataclasses.replace(scene.grasp, offset=0.0)
    bare = {"hand": None, "robot": arm.robot, "arm": arm.arm, "cup": None, "workspace": None}
    scene = at_own_angle(scene.replace(grasp=end, target=target, **bare))
    palm = dataclasses.replace(WIDE_WORKSPACE, palm_clearance=0.0)
    scene = scene.replace(cup=cup, workspace=palm)
    yield "+ Panda for the hand, held at the end", scene
    # An uncertain opening and a robust plan.
    yield "+ four other openings", scene.replace(uncertainty=DELAY, robust=Robust())


def at_own_angle(scene: Scene) -> Scene:
    """The scene with the angle of a plain throw's landing as the target's."""
    plan = Planner(scene, library=False).plan()
    assert plan.throw is not None
    theta = plan.throw.deciding.landing.theta
    return scene.replace(target=dataclasses.replace(scene.aim, theta=theta))


def _draw_ladder(rows: Table) -> Figure:
    """Variables and solving time of a throw over the number of the scene's parts."""
    figure, ((left, right),) = panels(10.0, 4.0, 1, 2, sharey=True)
    names = [str(name) for name in rows.column("hand-box")]
    for axis, column, colour in ((left, "variables", BLUE), (right, "solve [ms]", GREEN)):
        values = [number(cell) for cell in rows.column(column)]
        bars = axis.barh(names, values, color=colour)
        axis.bar_label(bars, [f"{value:.3g}" for value in values], padding=3, fontsize=8)
        axis.set(xlabel=column, xscale="log", xlim=(min(values) / 2, 3 * max(values)))
    left.invert_yaxis()
    return figure
