"""Fails if throws with disturbances succeed or fail otherwise than by the oracle, wherever its own
error cannot change that."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import throwplan as tp
from builders import loud
from throwplan.planner.throw import ThrowBatch
from throwplan.planner.uncertainty import sampler_of
from throwplan.planner.verdict import Code, Judge, Verdicts, measures_of
from throwplan.problems import Distribution, Obstacle, Uncertainty

from oracle import read_oracle

#: Samples of each scene.
COUNT = 50
replace = dataclasses.replace


def spread(width: float, *, relative: bool = False) -> Distribution:
    return Distribution(uniform=width, relative=relative)


#: Everything that may be uncertain, openings up to 20 ms off among it.
ALL = Uncertainty(
    delay=spread(0.02),
    opening=spread(0.1, relative=True),
    friction=spread(0.15, relative=True),
    patch_radius=spread(0.1, relative=True),
    mass=spread(0.1, relative=True),
    com_offset=spread(0.002),
    inertia=spread(0.05, relative=True),
    grasp_offset=spread(0.003),
    grasp_angle=spread(0.05),
    hand_x=spread(0.002),
    hand_z=spread(0.002),
    hand_theta=spread(0.005),
    hand_vx=spread(0.02),
    hand_vz=spread(0.02),
    hand_omega=spread(0.03),
)


def hard(name: str) -> tp.Scene:
    """An arm that brakes as hard as it can, whose joints are weak."""
    scene = loud(name)
    robot = replace(scene.robot, acceleration_margin=0.0, jerk_margin=0.0)
    return scene.replace(robot=robot)


def walled(name: str) -> tp.Scene:
    """A wall below the throw."""
    wall = Obstacle("wall", "box", (0.06, 0.5, 0.3), (0.75, 0.0, 0.15))
    return loud(name).replace(obstacle=(wall,))


#: Hard braking, a target that moves, a wall, a CoM grasp.
SCENES: dict[str, Callable[[], tp.Scene]] = {
    "hard braking": lambda: hard("pose"),
    "moving": lambda: loud("conveyor"),
    "wall": lambda: walled("fr3"),
    "com grasp": lambda: tp.load_scene("hand-box"),
}


def scattered(plan: tp.Plan, seed: int = 1) -> tuple[Judge, np.ndarray]:
    """A plan's throws with samples of all that is uncertain."""
    assert plan.solved and plan.throw is not None
    bare = plan.scene.without_reserves().aimed_at(plan.goal)
    sampler = sampler_of(plan.scene, seed)
    batch = ThrowBatch.of(
        plan.throw.deciding.in_scene(bare), plan.goal, sampler.names, (-0.03, 0.03, 0.06)
    )
    return Judge(batch), sampler.draw(0, COUNT)


def compare(plan: tp.Plan, folder: Path) -> Verdicts:
    """Verdicts on a plan's throws, the oracle's where no limit is nearer than its accuracy."""
    judge, values = scattered(plan)
    together = judge.verdicts(values)
    plan.save(folder)
    rows = dict(zip(judge.batch.names, values.T, strict=True))
    true = read_oracle(folder).judge(rows)
    differ = (together.succeeds != true.success) & true.sure
    assert not differ.any(), [true.broken()[i] for i in np.flatnonzero(differ)]
    assert true.sure.mean() > 0.9
    # Some fail and some do not, or nothing is compared.
    assert together.breaks(Code.LANDING, Code.CUP_WALL).any()
    return together


@pytest.mark.parametrize("name", ["near-cup", "hand-flip"])
def test_throws_of_a_weak_grip_are_judged_as_the_oracle_judges_them(
    name: str, plan_of, tmp_path
) -> None:
    plan = plan_of(name)
    grip, use = plan.scene.gripper, measures_of(plan.throw.deciding).value("grip")[0]
    weak = replace(grip, force=1.02 * use * grip.force, sticking_margin=0.0)
    together = compare(
        replace(plan, scene=plan.scene.replace(gripper=weak, uncertainty=ALL)), tmp_path
    )
    assert 0 < together.breaks(Code.SLIP_BEFORE_OPENING).sum() < COUNT


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_throws_are_judged_as_the_oracle_judges_them(name: str, tmp_path) -> None:
    plan = tp.plan(SCENES[name]().replace(uncertainty=ALL, robust=None))
    compare(plan.nearest or plan, tmp_path)
