"""A planar model that is wrong sends nothing: the pads are where all joints hold them in space."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import pytest
from throwplan.models.robot import Arm, PlanarArm, hand_motion
from throwplan.planner.throw import Throw
from throwplan.planner.verdict import Code, verdict


def wrong(throw: Throw, part: str, value: object) -> list[Code]:
    """What a throw breaks where its planar model has another `part`."""
    kinematics = copy.copy(throw.manipulator.kinematics)
    assert isinstance(kinematics, PlanarArm)
    setattr(kinematics, part, value)
    vars(kinematics).pop("core", None)
    manipulator = replace(throw.manipulator, kinematics=kinematics, motion=hand_motion(kinematics))
    return [found.code for found in verdict(replace(throw, manipulator=manipulator)).broken]


@pytest.fixture(scope="module")
def sent(pose_planner) -> Throw:
    """A throw that is solved, beside the x axis."""
    plan = pose_planner.plan(replace(pose_planner.scene.target, x=0.75, y=0.6))
    assert plan.status == "solved" and plan.throw is not None
    return plan.throw.deciding


def test_the_arm_s_chain_is_evaluated_once_for_all_azimuths(sent, monkeypatch) -> None:
    """That takes longer than all the rest of the check."""
    assert verdict(sent).ok
    away = sent.target.plane_x
    count = []
    frames = Arm.frames
    monkeypatch.setattr(Arm, "frames", lambda arm, q: count.append(arm) or frames(arm, q))
    for turn in (-1.2, 0.3, 1.9):
        target = sent.target.changed(x=away * math.cos(turn), y=away * math.sin(turn))
        scene = sent.scene.aimed_at(target)
        assert verdict(replace(sent, scene=scene)).ok
    assert not count


@pytest.mark.parametrize("part", ["links", "origin", "theta", "throwing_joints", "signs"])
def test_a_wrong_model_is_seen(part: str, sent) -> None:
    arm = sent.manipulator.kinematics
    (along, up), *others = arm.links
    values = {
        "links": [(along + 1e-5, up), *others],
        "origin": (arm.origin[0], arm.origin[1] + 1e-5),
        "theta": arm.theta + math.radians(0.01),
        "throwing_joints": (2, 4, 7),
        "signs": [-arm.signs[0], *arm.signs[1:]],
    }
    found = wrong(sent, part, values[part])
    assert Code.KINEMATICS in found
