"""Section `parts`: what a scene leaves out is not in its problem, and what that saves."""

from __future__ import annotations

import dataclasses
import json
import os
import pickle
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

from ...problems import (
    Cup,
    Distribution,
    Landing,
    Robust,
    Scene,
    Uncertainty,
    Workspace,
    load_scene,
    scene_names,
)
from ..plan import Planner
from .drawing import draw_ladder
from .page import Cell, Effort, Picture, Section, Table

#: Sections whose bounds never decide: they cost their variables and rows and change no throw.
WIDE_LANDING = Landing(speed_min=0.01, speed_max=100.0, rate_max=1e3)
WIDE_WORKSPACE = Workspace(floor=-10.0, column_radius=0.01, column_height=0.01)
DELAY = Uncertainty(delay=Distribution(uniform=0.010))
#: Lines of the ladder that are compared: a free hand with all its parts, and a Panda in its place.
HAND, ARM = 5, 6
#: Libraries that take long to import, by the name of their module.
HEAVY = ("numpy", "casadi", "scipy", "ruckig", "matplotlib", "PIL", "distributed")
#: Longest process that plans once [s].
PATIENCE = 300.0
#: A fresh process that plans the scene it is given, and tells what it imported.
PLAN_ONCE = """
import pickle, sys
before = set(sys.modules)
import throwplan as tp
plan = tp.Planner(pickle.load(sys.stdin.buffer), compiling="no").plan()
import json
print(json.dumps([plan.status, sorted(set(sys.modules) - before)]))
"""


@dataclass(frozen=True)
class Measured:
    """Size of a scene's NLP and times [s] of a plan, with the solves that lead to it."""

    variables: int
    constraints: int
    iterations: int
    build: float
    solve: float
    plan: float
    status: str

    def row(self, other: Measured) -> list[Cell]:
        """Its cells in a table; the last number is its solving time over another's."""
        times = [1e3 * seconds for seconds in (self.build, self.solve, self.plan)]
        sizes = (self.variables, self.constraints, self.iterations)
        return [*sizes, *times, self.solve / other.solve, self.status]


#: Of `Measured.row`.
COLUMNS = (
    *("variables", "constraints", "iterations", "build [ms]", "solve [ms]", "plan [ms]"),
    *("solve, times the first", "status"),
)


def measured(scene: Scene, repeats: int) -> Measured:
    """Plans a scene once to build, then `repeats` times: the least times. Nothing is compiled."""
    planner = Planner(scene, compiling="no")
    first = planner.plan()
    # A plan that fails does so slowly, and again.
    plans = [planner.plan() for _ in range(repeats)] if first.solved else [first]
    last = plans[-1]
    return Measured(
        *(last.variables, last.constraints, last.iterations, first.time["build"]),
        min(plan.time["solve"] for plan in plans),
        min(plan.time["total"] - plan.time["build"] for plan in plans),
        last.status if last.solved else f"{last.status}: {last.message}",
    )


def make(effort: Effort) -> Section:
    """The ladder from a bare throw to one with everything; every scene, with its imports."""
    section = Section("parts", "What a scene leaves out")
    names = [name for name in scene_names() if load_scene(name).motion is None]
    chosen = ["hand-box", "cup"] if effort.quick else names
    rungs = list(ladder(load_scene("hand-box")))
    if effort.quick:
        rungs = [rungs[i] for i in (0, HAND, ARM)]
    total = len(rungs) + 2 * len(chosen)
    steps = iter(range(1, total + 1))

    def next_of(scene: Scene) -> Measured:
        # Robust plans take longer: fewer of them.
        found = measured(scene, effort.of(2, 3 if scene.robust else 5))
        effort.tell(next(steps), total)
        return found

    climbed = [(words, next_of(scene)) for words, scene in rungs]
    bare = climbed[0][1]
    rows: list[list[Cell]] = [[words, *one.row(bare)] for words, one in climbed]
    every: list[list[Cell]] = []
    for name in chosen:
        own = next_of(load_scene(name))
        every.append([name, *own.row(own), *imports_of(load_scene(name))])
        effort.tell(next(steps), total)
    arm, hand = climbed[2 if effort.quick else ARM][1], climbed[1 if effort.quick else HAND][1]
    section.figures += [
        "`hand-box` is a free hand that holds the bar at its centre of mass and throws it to a "
        "position. The same throw carries one part more in each line; bounds are so wide that "
        "they never decide. Nothing is compiled.",
        f"With a Panda for the free hand it takes {arm.solve / hand.solve:.2g} times as long to "
        f"solve ({1e3 * arm.solve:.0f} and {1e3 * hand.solve:.0f} ms). The last line takes "
        f"{climbed[-1][1].solve / bare.solve:.0f} times as long as the bare throw "
        f"({1e3 * bare.solve:.1f} ms).",
        f"A fresh process that plans imports {_modules(every)}.",
    ]
    table = Table("parts-ladder", "One part more at a time", ("hand-box", *COLUMNS), rows)
    columns = ("scene", *COLUMNS, "modules", "large ones", "fresh process [s]")
    words = "Every scene, and what a fresh process imports to plan it"
    section.tables += [table, Table("parts-scenes", words, columns, every)]
    words = "Variables and solving time, one part more at a time"
    section.pictures.append(Picture("parts", words, lambda path: draw_ladder(table, path)))
    return section


def _modules(rows: list[list[Cell]]) -> str:
    """How many modules scenes import, by the large ones among them."""
    found = {str(row[-2]): row[-3] for row in rows}
    return "; ".join(f"{count} modules ({large})" for large, count in found.items())


def imports_of(scene: Scene) -> list[Cell]:
    """Modules that a fresh process imports to plan a scene, large ones among them, its time [s]."""
    start = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", PLAN_ONCE],
        input=pickle.dumps(scene),
        capture_output=True,
        check=True,
        timeout=PATIENCE,
        env=os.environ | {"THROWPLAN_COMPILE": "0"},
    )
    seconds = time.perf_counter() - start
    _, modules = json.loads(done.stdout)
    return [len(modules), ", ".join(name for name in HEAVY if name in modules), seconds]


def ladder(scene: Scene) -> Iterator[tuple[str, Scene]]:
    """A throw of a free hand to a position, and one part more at a time, in words."""
    yield "as it is", scene
    aside = dataclasses.replace(scene.grasp, offset=0.8 * scene.object.com)
    scene = scene.replace(grasp=aside)
    yield "+ held aside of the CoM: it pivots", scene
    scene = with_angle(scene)
    yield "+ θ asked for", scene
    scene = scene.replace(landing=WIDE_LANDING)
    yield "+ landing bounds", scene
    scene = with_cup(scene)
    yield "+ cup", scene
    scene = with_workspace(scene)
    yield "+ floor and column", scene
    scene = with_workspace(with_cup(with_angle(with_arm(scene))))
    yield "+ Panda for the hand, held at the end", scene
    yield "+ four other openings", with_scenarios(scene)


def with_angle(scene: Scene) -> Scene:
    """The scene asked for the angle at which it lands anyway."""
    assert scene.target is not None
    if scene.target.theta is not None:
        return scene
    plan = Planner(scene, compiling="no").plan()
    if plan.throw is None:
        return scene
    theta = plan.throw.final.landing.theta
    return scene.replace(target=dataclasses.replace(scene.target, theta=theta))


def with_cup(scene: Scene) -> Scene:
    """A cup so far below and so wide that the bar falls in anyhow."""
    target = scene.target
    if scene.cup is not None or target is None:
        return scene
    rim = target.z - 0.1 - scene.object.length
    return scene.replace(cup=Cup(x=target.plane_x, rim=rim, radius=50.0, depth=0.1))


def with_workspace(scene: Scene) -> Scene:
    """A floor, a base column and, for an arm, a palm that are never touched."""
    if scene.workspace is not None:
        return scene
    palm = None if scene.robot is None else 0.0
    return scene.replace(workspace=dataclasses.replace(WIDE_WORKSPACE, palm_clearance=palm))


def with_arm(scene: Scene) -> Scene:
    """A Panda in place of a free hand: its own angle at landing, the bar held at its end.

    What sticks out behind the grasp would be in the Panda's hand.
    """
    if scene.robot is not None or scene.target is None:
        return scene
    arm = load_scene("box")
    target = dataclasses.replace(scene.target, theta=None)
    grasp = dataclasses.replace(scene.grasp, offset=0.0)
    bare = scene.replace(hand=None, robot=arm.robot, arm=arm.arm, grasp=grasp)
    return bare.replace(target=target, cup=None, workspace=None)


def with_scenarios(scene: Scene) -> Scene:
    """An opening up to 10 ms early or late, and a plan against that."""
    return scene.replace(uncertainty=scene.uncertainty or DELAY, robust=Robust("scenarios"))
