"""What tests of several files build alike: scenes with other values, NLPs, edited plan files."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import numpy as np
import throwplan as tp
from throwplan import lab
from throwplan.models.robot import LinkInertia
from throwplan.planner.ocp import Request, ThrowNlp, build_nlp
from throwplan.planner.result import SentMotion
from throwplan.planner.throw import TICK, make_manipulator
from throwplan.planner.verdict import grip_use
from throwplan.problems import Distribution, Uncertainty

from oracle.motion import ArmMotion, Samples

#: The data set of 90 made throws, and its true product of friction and patch radius [m].
MADE_THROWS = Path(__file__).parents[1] / "examples" / "throws"
MADE_PRODUCT = 0.8 * 0.0031


def made_throws() -> lab.ThrowData:
    """One of the made throws for each of their 18 conditions."""
    return lab.load_throws(MADE_THROWS).picked(list(range(0, 90, 5)))


def varied(scene: tp.Scene, limits: dict[str, Any] | None = None, **sections: Any) -> tp.Scene:
    """The scene with other values in its sections, and in its arm's limits."""
    if limits is not None:
        assert scene.arm is not None
        other = dataclasses.replace(scene.arm.limits, **limits)
        sections["arm"] = sections.get("arm", {}) | {"limits": other}
    for name, values in sections.items():
        if isinstance(values, dict):
            sections[name] = dataclasses.replace(getattr(scene, name), **values)
    return scene.replace(**sections)


def loud(name: str) -> tp.Scene:
    """A built-in scene whose load on the pads costs nothing, so that the release has an effect."""
    return tp.load_scene(name).replace(cost=tp.Cost(quiet=0.0))


def only(correlation: tuple = (), **spreads: Distribution) -> Uncertainty:
    """These values are uncertain; delay and opening are not if they are not among them."""
    none = Distribution(uniform=0.0)
    return Uncertainty(**{"delay": none, "opening": none} | spreads, correlation=correlation)


def request_of(scene: tp.Scene) -> Request:
    """The scene's own target, planned as usual."""
    return Request(scene, make_manipulator(scene), scene.target)


def nlp_of(scene: tp.Scene) -> ThrowNlp:
    return build_nlp(request_of(scene))


def inertia_matrix(link: LinkInertia) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = link.inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def merged(table: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    both = {
        name: merged(table[name], value)
        for name, value in changes.items()
        if isinstance(value, dict) and isinstance(table.get(name), dict)
    }
    return table | changes | both


def edit_plan(folder: Path, **changes: Any) -> Path:
    """Values of a plan.json, or of tables in it, changed; the folder."""
    path = folder / "plan.json"
    path.write_text(json.dumps(merged(json.loads(path.read_text()), changes)))
    return folder


def with_grip(motion: SentMotion, share: float) -> SentMotion:
    """The motion with a share of the grip force that each carry needs by the verdict."""
    throws = []
    for one in motion.carries:
        carried = motion.samples[one.held : int(one.opening_time / TICK) + 1]
        scene = one.throw.scene
        force = share * scene.gripper.profile().full * grip_use(one.space, carried).use.max()
        throws.append(one.throw.in_scene(varied(scene, gripper={"force": force, "peak": None})))
    return motion.in_throws(*throws)


def swinging(name: str, every: bool = False) -> ArmMotion:
    """An arm of a scene whose throwing joints, or all of them, swing."""
    scene = tp.load_scene(name)
    arm, times = scene.arm, 1e-3 * np.arange(401)
    joints = range(1, arm.joints + 1) if every else arm.throwing_joints
    throwing = [j - 1 for j in joints]
    low, high = np.array(arm.limits.position_min), np.array(arm.limits.position_max)
    q, dq, ddq = (np.zeros((len(times), arm.joints)) for _ in range(3))
    q[:] = arm.posture
    for k, j in enumerate(throwing):
        middle, wide, rate = (low[j] + high[j]) / 2, min(0.5, (high[j] - low[j]) / 4), 6.0 + k
        q[:, j] = middle + wide * np.sin(rate * times + k)
        dq[:, j] = wide * rate * np.cos(rate * times + k)
        ddq[:, j] = -wide * rate**2 * np.sin(rate * times + k)
    return ArmMotion(arm, throwing, Samples(times, q, dq, ddq))
