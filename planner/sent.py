"""A throw as it is sent, from a plan or read back from its files."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..models.hand import PlanarArm
from ..problems.errors import InputError
from ..problems.scene import Pose, Scene
from ..problems.scene_table import scene_from_table, scene_table
from ..problems.text_file import read_csv, read_text
from .check import Thrown, limit_surface_throw, throw
from .motion import TICK, PiecewiseMotion, SampledMotion
from .mover import Mover, make_mover
from .plan import Plan

#: Version of plan.json. Another one is refused: what its keys mean may differ.
FORMAT = 1


@dataclass(frozen=True, repr=False)
class SentThrow:
    """The throw that goes to the robot.

    scene: aimed at the target (a cup comes along); motion: what counts, until `until` [s]:
    the samples for an arm, the planned motion for a hand; samples: at 1 kHz from rest to
    rest; opening_time [s] on their clock; final: by the model of the tolerance.
    """

    scene: Scene
    mover: Mover
    motion: PiecewiseMotion
    until: float
    samples: SampledMotion
    opening_time: float
    final: Thrown

    def __repr__(self) -> str:
        """A line: its arrays would fill a screen."""
        return f"SentThrow({self.scene.name}, landing at {self.landing_time:.3f} s)"

    @property
    def target(self) -> Pose:
        """Where it should land."""
        assert self.scene.target is not None
        return self.scene.target

    @cached_property
    def limit_surface(self) -> Thrown:
        """The same motion thrown by the time-stepping limit surface."""
        return limit_surface_throw(
            self.scene, self.mover, self.motion, self.opening_time, self.target.z
        )

    @property
    def detach_time(self) -> float:
        """When the grip force is zero [s]."""
        return self.opening_time + self.scene.gripper.profile().opening

    @property
    def command_time(self) -> float:
        """When the opening command is sent [s]."""
        return self.opening_time - self.scene.gripper.profile().dwell - self.scene.mean_delay

    @property
    def landing_time(self) -> float:
        """When the CoM comes down through the target's height [s]."""
        return self.detach_time + self.final.landing.flight_time


def sent_throw(plan: Plan) -> SentThrow:
    """The throw of a solved plan; InputError for a plan without one."""
    if plan.throw is None or not plan.solved:
        raise InputError(f"the plan is {plan.status}: it holds no throw")
    throw = plan.throw
    scene = plan.scene.aimed_at(plan.target)
    planned = throw.sent is None
    return SentThrow(
        scene,
        plan.mover,
        throw.planned if planned else throw.samples,
        float(throw.planned.times[-1] if planned else throw.samples.times[-1]),
        throw.samples,
        throw.opening_time,
        throw.final,
    )


def document(plan: Plan) -> dict[str, Any]:
    """What plan.json holds: `Plan.to_dict`, and the scene that `read_plan` needs."""
    scene = plan.scene.aimed_at(plan.target)
    return {"format": FORMAT, **plan.to_dict(), "definition": scene_table(scene)}


def read_plan(path: str | Path) -> SentThrow:
    """The throw of a plan.json with the motion.csv beside it, thrown again.

    InputError for a file that is not there, is no plan, is of another version or holds no
    throw, and for samples that do not fit its scene.
    """
    path = Path(path)
    if path.is_dir():
        path = path / "plan.json"
    plan = _plan_object(path)
    try:
        scene = scene_from_table(plan["definition"])
        opening_time = float(plan["release"]["opening_time"])
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise InputError(f"{path}: is not a whole plan file ({error!r})") from None
    mover = make_mover(scene)
    samples = _samples(path.parent / "motion.csv", mover)
    end = float(samples.times[-1])
    if not 0.0 <= opening_time <= end:
        raise InputError(f"{path}: opening_time = {opening_time:g}: must be within motion.csv")
    assert scene.target is not None
    model = limit_surface_throw if scene.tolerance.model == "ls-step" else throw
    final = model(scene, mover, samples, opening_time, scene.target.z)
    return SentThrow(scene, mover, samples, end, samples, opening_time, final)


def _plan_object(path: Path) -> dict[str, Any]:
    """The JSON object of a solved plan of this version."""
    text = read_text(path)
    try:
        plan = json.loads(text)
    except ValueError as error:
        raise InputError(f"{path}: is not JSON: {error}") from None
    if not isinstance(plan, dict) or "status" not in plan:
        raise InputError(f"{path}: is not a plan file")
    version = plan.get("format")
    if version != FORMAT:
        made = "an older version" if version is None else f"version {version!r}"
        raise InputError(f"{path}: a plan file of {made}, must be {FORMAT}: plan it again")
    if plan["status"] != "solved":
        raise InputError(f"{path}: the plan is {plan['status']}: it holds no throw")
    return plan


def _samples(path: Path, mover: Mover) -> SampledMotion:
    """The planned coordinates in motion.csv."""
    kinematics = mover.kinematics
    if isinstance(kinematics, PlanarArm):
        joints = kinematics.throwing_joints
        names = [f"{prefix}{j}" for prefix in ("q", "dq", "ddq") for j in joints]
    else:
        columns = (("x", "z", "theta"), ("vx", "vz", "omega"), ("ax", "az", "alpha"))
        names = [name for row in columns for name in row[: mover.size]]
    rows = np.array(read_csv("motion", str(path), None, ("t", *names)))
    if len(rows) < 2 or np.abs(rows[:, 0] - TICK * np.arange(len(rows))).max() > 1e-6:
        raise InputError(f"{path}: t must go from 0 in steps of {TICK:g}")
    return SampledMotion(*np.split(rows[:, 1:], 3, axis=1))
