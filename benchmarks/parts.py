"""Section `parts`: size and solving time of the NLP with each optional part of a scene."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

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
)
from throwplan.pictures import Row, Table

from .measure import planning_time
from .page import Effort, Section

#: Bounds of the landing that are never active: they add constraints and change no throw.
WIDE_LANDING = Landing(speed_min=0.01, speed_max=100.0, rate_max=1e3)
#: Bounds of the workspace that are never active.
WIDE_WORKSPACE = Workspace(floor=-10.0, column_radius=0.01, column_height=0.01)
#: Openings up to 10 ms early or late.
DELAY = Uncertainty(delay=Distribution(uniform=0.010))
#: Number of the ladder's row with all parts of a free hand.
HAND = 5
#: Number of the ladder's row with a Panda instead of the hand.
ARM = 6


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
        "solve [ms]": 1e3 * min(plan.time["solve"] for plan in plans),
        "plan [ms]": 1e3 * min(map(planning_time, plans)),
        "status": full.status if full.solved else f"{full.status}: {full.message}",
    }


def make(effort: Effort) -> Section:
    """The ladder from a bare throw to one with all parts."""
    rungs = list(ladder(load_scene("hand-box").replace(cost=Cost(quiet=0.0))))
    if effort.quick:
        rungs = [rungs[i] for i in (0, HAND, ARM)]
    step, rows = effort.counter(len(rungs)), list[Row]()
    for words, scene in rungs:
        # Fewer robust plans, as they take longer.
        row: Row = {"`hand-box`": words}
        rows.append(row | measured(scene, effort.of(1, 2 if scene.robust else 5)))
        step()
    return Section(
        "What a scene leaves out",
        "`hand-box` is a free hand that holds the bar at its centre of mass and throws it to a "
        "position. Each row adds one section or key to the row before; bounds are so wide that "
        "they never decide. Size of the NLP, least times of repeated plans with all solves that "
        "lead to them, without library and price of the load on the pads.",
        [Table("parts", "One part more at a time", rows)],
    )


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
