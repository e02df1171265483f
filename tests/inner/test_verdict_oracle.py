"""Fails if the verdict on a throw that breaks rules of all kinds is not the oracle's."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import throwplan as tp
from builders import varied
from throwplan.models.robot import LinkCapsule
from throwplan.planner.throw import Throw, make_manipulator
from throwplan.planner.verdict import Code, Finding, verdict_on
from throwplan.problems import Landing, Obstacle, Scene, Torque, Workspace

from oracle import Oracle, read_oracle

SCENES = ["near-cup", "box", "fr3", "hand-flip"]
#: Changes of each plan that are judged.
CHANGES = 12
#: Between samples the verdict takes bodies to be nearer by up to half of what they move [m].
MOVED = 3e-3
#: Codes by the beginning of the oracle's names; a bar's distance from an obstacle is a collision.
CODES = {
    "comes down": Code.NO_LANDING,
    "falls": Code.GRAZING,
    "position": Code.LANDING,
    "angle": Code.LANDING,
    "landing speed": Code.LANDING_SPEED,
    "landing rate": Code.LANDING_RATE,
    "grip": Code.SLIP_BEFORE_OPENING,
    "torque": Code.TORQUE,
    "tool speed": Code.TOOL_SPEED,
    "cup": Code.CUP_WALL,
    "bar, floor": Code.FLOOR,
    "held bar, column": Code.COLUMN,
    "flying bar, column": Code.COLUMN,
    "flying bar, palm": Code.PALM,
}


def code_of(name: str) -> Code:
    return next((code for start, code in CODES.items() if name.startswith(start)), Code.COLLISION)


def code_of_finding(found: Finding) -> Code:
    """The bar misses a cup or meets it; the arm meets the floor with a frame or a capsule."""
    if found.code is Code.CUP_MISSED:
        return Code.CUP_WALL
    arm = found.code is Code.FLOOR and found.body in ("arm", "hand")
    return Code.COLLISION if arm else found.code


def changed(scene: Scene, random: np.random.Generator) -> Scene:
    """A scene in which a plan for another one breaks some of the rules."""

    def now(share: float = 0.4) -> bool:
        return bool(random.random() < share)

    bar, contact, changes = scene.object, scene.contact, {}
    if now():
        heavier = random.uniform(0.8, 4.0)
        changes["object"] = bar.changed(mass=heavier * bar.mass, inertia=heavier * bar.inertia)
    if now():
        changes["contact"] = contact.changed(friction=contact.friction * random.uniform(0.3, 1.0))
    if now(0.3):
        angle = random.normal(0.0, 0.1)
        changes["grasp"] = scene.grasp.changed(offset=random.uniform(0.0, 0.02), angle=angle)
    changes["tolerance"] = scene.tolerance.changed(
        position=random.uniform(0.001, 0.3), angle=random.uniform(0.01, 1.0)
    )
    if now():
        low, high = sorted(random.uniform(0.0, 8.0, 2))
        rate = random.uniform(1.0, 20.0)
        changes["landing"] = Landing(speed_min=low, speed_max=high, rate_max=rate)
    if scene.workspace is not None and now(0.6):
        size = random.uniform(0.1, 0.6), random.uniform(0.3, 1.0)
        changes["workspace"] = Workspace(
            random.uniform(0.0, 0.6), *size, palm_clearance=random.uniform(0.0, 0.08)
        )
    if scene.robot is not None and now():
        changes["torque"] = Torque(limits=tuple(random.uniform(10.0, 80.0, 3)))
    if scene.robot is not None and scene.tool_speed is not None and now():
        changes["robot"] = scene.robot.changed(tool_speed=random.uniform(0.3, 2.0))
    if scene.cup is not None and now():
        radius, room = random.uniform(0.02, 0.07), random.uniform(0.0, 0.008)
        changes["cup"] = scene.cup.changed(radius=radius, clearance=room)
    kinds = {"box": random.uniform(0.05, 0.4, 3), "sphere": random.uniform(0.02, 0.2, 1)}
    kinds["capsule"] = random.uniform(0.03, 0.3, 2)
    obstacles = []
    for name, size in kinds.items():
        if now(0.3):
            at = random.uniform((0.1, -0.4, 0.0), (1.2, 0.4, 1.3))
            turn = random.uniform(-math.pi, math.pi, 2) * (name != "sphere")
            near = random.uniform(0.0, 0.03)
            obstacles.append(Obstacle(name, name, tuple(size), tuple(at), *turn, near))
    return replace(scene, obstacle=tuple(obstacles), **changes)


def compared(throw: Throw, oracle: Oracle, random: np.random.Generator) -> set[Code]:
    """What both say of one change; they differ nowhere but where one of them is not sure."""
    scene = changed(throw.scene, random)
    late = random.uniform(-0.02, 0.03)
    other = replace(throw, scene=scene, path=throw.path).delayed(late)
    judged = Oracle(scene, oracle.samples, other.opening_time).judge(planned=True)
    found = {name: f for name, f in judged.found.items() if not name.startswith(("joint", "in "))}
    near = {name for name, f in found.items() if abs(f.value[0] - f.limit[0]) < MOVED}
    near = {name for name in near if code_of(name) is Code.COLLISION}
    doubt = {code_of(name) for name, f in found.items() if f.doubtful[0] or name in near}
    # The oracle judges no torque rate.
    doubt.add(Code.TORQUE_RATE)
    true = {code_of(name) for name, f in found.items() if f.broken[0]}
    said = {code_of_finding(each) for each in verdict_on(other).broken}
    if Code.NO_LANDING in true:
        assert Code.NO_LANDING in said
        return true
    assert said - doubt == true - doubt, verdict_on(other).words
    return true


@pytest.mark.parametrize(
    ("name", "changes"),
    [("pose", 6), *(pytest.param(name, CHANGES, marks=pytest.mark.slow) for name in SCENES)],
)
def test_verdicts_are_the_oracles(name: str, changes: int, plan_of, saved) -> None:
    throw, oracle = plan_of(name).throw.deciding, read_oracle(saved(name))
    assert len(codes_of(throw, oracle, len(name), changes)) > 2


def test_a_hand_without_a_palm_keeps_its_clearance_by_its_capsules(plan_of, saved) -> None:
    """One of them stands at a side of the held bar, nearer or farther."""
    throw, oracle, said = plan_of("pose").throw.deciding, read_oracle(saved("pose")), set()
    arm = throw.scene.arm
    for aside in (-0.2, -0.07, 0.05, 0.1):
        shape = LinkCapsule(8, (aside, 0.0, 0.1), (aside, 0.0, 0.25), 0.01)
        other = {"tool": replace(arm.tool, palm_half_width=0.0), "capsules": (*arm.capsules, shape)}
        scene = varied(throw.scene, workspace={"palm_clearance": 0.02}, arm=other)
        again = replace(throw, scene=scene, manipulator=make_manipulator(scene), path=throw.path)
        judged = Oracle(scene, oracle.samples, again.opening_time).judge(planned=True)
        links = judged.found["flying bar, links"]
        if abs(links.value[0] - links.limit[0]) > MOVED:
            found = [each for each in verdict_on(again).broken if each.other == "hand"]
            assert bool(found) == links.broken[0], aside
            said.add(bool(found))
            for each in found:
                assert each.value == pytest.approx(links.value[0], abs=MOVED)
                assert each.limit == 0.02
    assert said == {False, True}


def codes_of(throw: Throw, oracle: Oracle, seed: int, changes: int) -> set[Code]:
    """What is broken in many changes, by both."""
    random, seen = np.random.default_rng(seed), set[Code]()
    for _ in range(changes):
        try:
            seen |= compared(throw, oracle, random)
        except tp.InputError:
            continue  # A cup that is too narrow for the bar.
    return seen
