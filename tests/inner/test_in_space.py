"""A planar model that is wrong sends nothing: the pads are where all joints hold them in space."""

from __future__ import annotations

import copy
import math
from dataclasses import replace

import pytest
import throwplan as tp
from throwplan.models import PlanarArm, hand_motion
from throwplan.planner.check import Throw, throw_violations


def wrong(throw: Throw, part: str, value: object) -> list[str]:
    """What a throw breaks where its planar model has another `part`."""
    kinematics = copy.copy(throw.mover.kinematics)
    assert isinstance(kinematics, PlanarArm)
    setattr(kinematics, part, value)
    mover = replace(throw.mover, kinematics=kinematics, motion=hand_motion(kinematics))
    return [found.words for found in throw_violations(replace(throw, mover=mover))]


@pytest.fixture(scope="module")
def sent() -> Throw:
    """A throw that is solved, beside the x axis."""
    target = replace(tp.load_scene("pose").target, x=0.75, y=0.6)
    plan = tp.plan("pose", target)
    assert plan.status == "solved" and plan.throw is not None
    return plan.throw.final


def test_a_right_model_breaks_nothing(sent) -> None:
    assert throw_violations(sent) == []


@pytest.mark.parametrize("part", ["links", "origin", "theta", "throwing_joints", "signs"])
def test_a_wrong_model_is_seen(part: str, sent) -> None:
    arm = sent.mover.kinematics
    (along, up), *others = arm.links
    values = {
        "links": [(along + 1e-5, up), *others],
        "origin": (arm.origin[0], arm.origin[1] + 1e-5),
        "theta": arm.theta + math.radians(0.01),
        "throwing_joints": (2, 4, 7),
        "signs": [-arm.signs[0], *arm.signs[1:]],
    }
    found = wrong(sent, part, values[part])
    assert any("where the planar model has it" in words for words in found), found
