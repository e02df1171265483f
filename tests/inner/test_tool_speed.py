"""Fails if flange or pads of what is sent break the limit on tool speed, or need not keep it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.models.robot import SpatialArm
from throwplan.planner.verdict import Code, measures_of, verdict_on

#: Interval [s] of the differences.
STEP = 2e-4
#: Below the speed of `pose` without a limit.
SLOW = 1.2


def fastest(plan: tp.Plan) -> float:
    """Highest speed [m/s] of flange and pads' centre of what is sent, by differences.

    Their places come from the arm's whole chain of frames, not from the planar one.
    """
    motion, arm = plan.throw.samples.path, plan.scene.arm
    q = plan.manipulator.kinematics.all_joints(motion.at(np.arange(0.0, motion.end, STEP)).pose.T)
    flange = SpatialArm(arm).frames(q)[-1]
    pads = flange[:, :3, 3] + arm.tool.tcp * flange[:, :3, 2]
    moved = np.diff([flange[:, :3, 3], pads], axis=1) / STEP
    return float(np.linalg.norm(moved, axis=2).max())


def test_a_slower_tool_changes_the_throw(plan_of) -> None:
    faster = plan_of("pose")
    assert fastest(faster) > 1.1 * SLOW
    final = faster.throw.deciding
    slow = varied(final.scene, {"tool_speed": 2.0}, robot={"tool_speed": SLOW})
    assert Code.TOOL_SPEED in verdict_on(dataclasses.replace(final, scene=slow)).codes
    plan = tp.plan(varied(tp.load_scene("pose"), robot={"tool_speed": SLOW}))
    assert plan.solved
    assert 0.95 * SLOW < fastest(plan) <= SLOW


def test_far_throws_keep_the_pandas_limit(pose_planner) -> None:
    """Without the limit it would be thrown faster."""
    plan = pose_planner.plan(tp.Pose(x=1.4, z=0.1, theta=-1.2))
    assert plan.solved
    assert 1.95 < fastest(plan) <= 2.0
    speed = measures_of(plan.throw.deciding).value("speed")[0]
    assert speed == pytest.approx(fastest(plan), abs=1e-3)
