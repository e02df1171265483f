"""Motions that are sent as files: plan.json or cycle.json, and their motion.csv."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array
from ...models.robot import PlanarArm
from ...problems import InputError, Scene
from ...problems.files import read_json
from ...problems.scene_files import scene_from_table
from ..throw import TICK, Manipulator, Samples, State, Throw, braked, make_manipulator
from .motion import Carry, SentMotion
from .plan_files import HAND_COLUMNS, complete, read_plan, read_samples

#: Version of cycle.json; `read_motion` refuses other versions.
FORMAT = 1
#: Samples of a carry, in their order in time, in cycle.json as `samples`.
MOMENTS = ("reach", "held", "join", "free")


def part_thrown(
    scene: Scene,
    manipulator: Manipulator,
    samples: Samples,
    begin: int,
    end: int,
    opening_time: float,
) -> Throw:
    """The throw by a part of a motion of all joints, then a brake of its own: what follows may
    leave the throw's plane.

    opening_time [s]: on the motion's clock; the throw's begins at sample `begin`.
    """
    kinematics = manipulator.kinematics
    assert isinstance(kinematics, PlanarArm)
    own = samples[begin : end + 1, [j - 1 for j in kinematics.throwing_joints]]
    arm = manipulator.from_state(State(own.q[0], own.dq[0], own.ddq[0]))
    sent = braked(arm.hard, own)
    return Throw.sent(scene, arm, sent, opening_time - TICK * begin)


def carry_entries(carry: Carry) -> dict[str, Any]:
    """An object of a cycle as JSON, in `steps` of cycle.json."""
    dx, dtheta = carry.throw.miss()
    x, z, theta = carry.throw.landing.pose
    target = carry.throw.target
    moments = {f"{name}_time": TICK * getattr(carry, name) for name in MOMENTS}
    return {
        "pick": carry.pick,
        "bin": carry.bin,
        "command_time": carry.command_time,
        "opening_time": carry.opening_time,
        "detach_time": carry.detach_time,
        "landing_time": carry.landing_time,
        "target": target.table,
        "landing": dict(zip("xyz", target.plane.points(x, z), strict=True)) | {"theta": theta},
        "error": {"position": abs(dx), "angle": abs(dtheta)},
    } | moments


def saved_entries(motion: SentMotion | None, document: dict[str, Any]) -> dict[str, Any]:
    """cycle.json of a cycle's `to_dict`, with what `read_motion` needs."""
    found = {"format": FORMAT, **document}
    if motion is None:
        return found
    for one, entry in zip(motion.carries, found["steps"], strict=True):
        table = one.throw.scene.table()
        found["arm"] = table.pop("arm")
        entry["samples"] = [getattr(one, moment) for moment in MOMENTS]
        entry["definition"] = table
    return found


def write_motion(motion: SentMotion, path: Path) -> None:
    """motion.csv: what is sent at 1 kHz, and `gripper`: 1 while it is to be closed, 0 open."""
    samples, kinematics = motion.samples, motion.throw.manipulator.kinematics
    columns = {"q": samples.q, "dq": samples.dq, "ddq": samples.ddq}
    if not isinstance(kinematics, PlanarArm):
        poses = motion.throw.manipulator.motion(*(rows.T for rows in samples.rows))
        names = (name for row in HAND_COLUMNS for name in row)
        columns = dict(zip(names, np.vstack([np.array(rows) for rows in poses]), strict=True))
    write_table(path, {"t": samples.times} | columns | {"gripper": motion.closed})


def write_table(path: Path, columns: dict[str, Array]) -> None:
    """Write a CSV of columns (N,), or (N, n) as name1, name2, ... ."""
    names = list[str]()
    for name, values in columns.items():
        names += [name] if values.ndim == 1 else [f"{name}{j + 1}" for j in range(values.shape[1])]
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.12g")


def is_cycle(path: str | Path) -> bool:
    """Whether a path names a cycle.json, or a folder with one and without a plan.json."""
    path = Path(path)
    if path.name == "cycle.json":
        return True
    return (path / "cycle.json").is_file() and not (path / "plan.json").exists()


def read_motion(path: str | Path) -> SentMotion:
    """The motion of a plan.json or cycle.json (or its folder) and its motion.csv.

    InputError for what `read_plan` refuses, and likewise for a file that is no cycle, another
    version, a cycle that is not solved, and times that do not fit its motion.
    """
    path = Path(path)
    if not is_cycle(path):
        return SentMotion.of(read_plan(path))
    path = path / "cycle.json" if path.is_dir() else path
    found = read_json(path)
    if not isinstance(found, dict) or "steps" not in found:
        raise InputError(f"{path}: is not a cycle file")
    if found.get("format") != FORMAT:
        version = found.get("format")
        raise InputError(f"{path}: a cycle file of version {version!r}, must be {FORMAT}")
    if found.get("status") != "solved":
        raise InputError(f"{path}: the cycle is not solved: it holds no motion")
    with complete(path, "is not a complete cycle file"):
        arm, steps = found["arm"], enumerate(found["steps"], start=1)
        scenes = [_scene(number, entry, arm) for number, entry in steps]
        joints = range(1, len(arm.get("dh") or arm["joints"]) + 1)
        names = [f"{kind}{j}" for kind in ("q", "dq", "ddq") for j in joints]
        samples = read_samples(path.parent / "motion.csv", names)
        each = zip(scenes, found["steps"], strict=True)
        carries = tuple(_carry(scene, entry, samples) for scene, entry in each)
        motion = SentMotion(str(found["jobs"]), samples, carries)
    moments = [getattr(one, moment) for one in carries for moment in MOMENTS]
    rising = all(a <= b for a, b in itertools.pairwise([0, *moments, len(samples.q) - 1]))
    if not carries or not rising:
        raise InputError(f"{path}: its times must rise and be within motion.csv")
    for number, one in enumerate(carries, start=1):
        if not one.throw.lands or one.detach_time > motion.duration:
            words = "its pads must be open before the motion ends, and its object must land"
            raise InputError(f"{path}: step {number}: {words}")
    return motion


def _scene(number: int, entry: dict[str, Any], arm: dict[str, Any]) -> Scene:
    try:
        return scene_from_table({**entry["definition"], "arm": arm})
    except InputError as error:
        raise error.within(f"step {number}") from None


def _carry(scene: Scene, entry: dict[str, Any], samples: Samples) -> Carry:
    """The carry of its table."""
    moments = dict(zip(MOMENTS, entry["samples"], strict=True))
    opening, last = float(entry["opening_time"]), len(samples.q) - 1
    if not all(type(k) is int and 0 <= k <= last for k in moments.values()):
        raise ValueError("samples")
    if not TICK * moments["join"] <= opening <= TICK * moments["free"]:
        raise ValueError("opening_time")
    part = moments["join"], moments["free"], opening
    throw = part_thrown(scene, make_manipulator(scene), samples, *part)
    return Carry(throw, pick=str(entry["pick"]), bin=str(entry["bin"]), **moments)
