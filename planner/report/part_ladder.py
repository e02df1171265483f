"""The same throw with more and more in it."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

from ...problems import (
    Cup,
    Distribution,
    Landing,
    Robust,
    Scene,
    Uncertainty,
    Workspace,
    load_scene,
)
from ..check import Guard
from ..plan import Planner
from .part_sizes import Posed

GUARDS: frozenset[Guard] = frozenset({"carry", "flight", "passing"})
#: Sections at values that never bind: they cost their rows and variables and change nothing.
WIDE_LANDING = Landing(speed_min=0.01, speed_max=100.0, rate_max=1e3)
WIDE_WORKSPACE = Workspace(floor=-10.0, column_radius=0.01, column_height=0.01)
DELAY = Uncertainty(delay=Distribution(uniform=0.010))
#: The ladder's last line with a free hand, and the one with a Panda in its place.
HAND, ARM = 5, 6


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
    assert target is not None
    if scene.cup is not None:
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

    What stuck out behind the grasp would be in the Panda's hand.
    """
    if scene.robot is not None or scene.target is None:
        return scene
    arm = load_scene("box")
    target = dataclasses.replace(scene.target, theta=None)
    grasp = dataclasses.replace(scene.grasp, offset=0.0)
    bare = scene.replace(hand=None, robot=arm.robot, arm=arm.arm, grasp=grasp)
    return bare.replace(target=target, cup=None, workspace=None)


def with_uncertainty(scene: Scene) -> Scene:
    """An opening up to 10 ms early or late, and a plan against that."""
    uncertainty = scene.uncertainty or DELAY
    return scene.replace(uncertainty=uncertainty, robust=Robust("scenarios"))


def with_everything(scene: Scene) -> Posed:
    """The same throw with everything that an NLP can have; a free hand becomes a Panda."""
    changes: tuple[Callable[[Scene], Scene], ...]
    changes = (with_arm, with_angle, with_cup, with_workspace, with_uncertainty)
    scene = scene.replace(landing=scene.landing or WIDE_LANDING)
    for change in changes:
        scene = change(scene)
    return Posed("everything", scene, GUARDS, robust=True)


def ladder(scene: Scene) -> Iterator[Posed]:
    """A position-only throw of a free hand, and one thing more at a time."""
    yield Posed("as it is", scene)
    beside = dataclasses.replace(scene.grasp, offset=0.8 * scene.object.com)
    scene = scene.replace(grasp=beside)
    yield Posed("+ held beside the CoM: it pivots", scene)
    scene = with_angle(scene)
    yield Posed("+ θ asked for", scene)
    scene = scene.replace(landing=WIDE_LANDING)
    yield Posed("+ landing bounds", scene)
    scene = with_cup(scene)
    yield Posed("+ cup", scene)
    scene = with_workspace(scene)
    yield Posed("+ floor and column", scene)
    scene = with_workspace(with_cup(with_angle(with_arm(scene))))
    yield Posed("+ Panda for the hand, held at the end", scene)
    yield Posed("+ all guards", scene, GUARDS)
    yield Posed("+ four other openings", with_uncertainty(scene), GUARDS, robust=True)
