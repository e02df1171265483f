"""Plans as files: plan.json, motion.csv, throw.png, throw.gif, written whole; and read back."""

from __future__ import annotations

import dataclasses
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ...models import Array, PlanarArm
from ...problems import InputError, filling, read_csv, read_text, scene_from_table, scene_table
from ..check import TICK, Mover, Samples, Throw, make_mover
from ..ocp import load_curve
from ..show import (
    draw_throw,
    draw_throw_moving,
    over_time,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .plan import Plan, Status


#: Which pictures of a plan are drawn: both, none, or throw.png alone.
Draw = bool | Literal["png"]
#: Version of plan.json. Another one is refused: what its keys mean may differ.
FORMAT = 1
#: What a plan may leave in its folder.
FILES = ("motion.csv", "throw.png", "throw.gif", "plan.json")


def save_plan(plan: Plan, folder: Path, draw: Draw) -> Plan:
    """Write a plan's files into `folder`, and take away those of an earlier plan.

    draw: "png" for throw.png alone. Returns the plan with the time of drawing.
    """
    undrawn = None
    with filling(folder, FILES) as scratch:
        if plan.solved:
            write_motion(plan, scratch / "motion.csv")
        if plan.solved and draw:
            start, throw = time.perf_counter(), sent_throw(plan)
            try:
                draw_plan(plan, scratch / "throw.png")
                if draw != "png":
                    draw_throw_moving(throw, scratch / "throw.gif")
            except Exception as error:  # A user's settings make Matplotlib raise anything.
                undrawn = " ".join(str(error).split()) or type(error).__name__
            seconds = time.perf_counter() - start
            plan = dataclasses.replace(plan, time=plan.time | {"draw": seconds})
        text = json.dumps(document(plan), indent=2, allow_nan=False)
        (scratch / "plan.json").write_text(text + "\n", encoding="utf-8")
    if undrawn is not None:
        raise InputError(f"--out {folder}: the plan is there, but not its pictures: {undrawn}")
    return plan


def draw_plan(plan: Plan, path: Path | None) -> Figure:
    """The picture of a solved plan, written to `path` if that is given."""
    throw = sent_throw(plan)
    return draw_throw(throw, path, load_curve(throw) if plan.robust else None)


def write_motion(plan: Plan, path: Path) -> None:
    """motion.csv: launch, release and brake at 1 kHz, the joints or the hand."""
    assert plan.throw is not None
    samples = plan.throw.samples
    kinematics = plan.mover.kinematics
    if isinstance(kinematics, PlanarArm):
        values = joint_samples(kinematics, plan.target.plane.azimuth, samples)
        columns = dict(zip(("q", "dq", "ddq"), values, strict=True))
    else:
        columns = _hand_columns(plan, samples)
    write_table(path, {"t": samples.times} | columns)


def joint_samples(
    kinematics: PlanarArm, azimuth: float, samples: Samples
) -> tuple[Array, Array, Array]:
    """q, dq, ddq of all joints of the arm, each (N, joints), in the plane at `azimuth` [rad]."""
    arm = kinematics.arm
    throwing = [j - 1 for j in kinematics.throwing_joints]
    q, dq, ddq = (np.zeros((len(samples.q), arm.joints)) for _ in range(3))
    q[:] = arm.posture
    q[:, arm.azimuth_joint - 1] = arm.azimuth_angle(azimuth)
    q[:, throwing], dq[:, throwing], ddq[:, throwing] = samples.q, samples.dq, samples.ddq
    return q, dq, ddq


def write_table(path: Path, columns: dict[str, Array]) -> None:
    """A CSV of columns (N,) or (N, n), which become name1, name2, ... ."""
    names: list[str] = []
    for name, values in columns.items():
        names += [name] if values.ndim == 1 else [f"{name}{j + 1}" for j in range(values.shape[1])]
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.12g")


def _hand_columns(plan: Plan, samples: Samples) -> dict[str, Array]:
    outputs = plan.mover.motion(samples.q.T, samples.dq.T, samples.ddq.T)
    values = np.vstack([np.array(o) for o in outputs])
    names = ("x", "z", "theta", "vx", "vz", "omega", "ax", "az", "alpha")
    return dict(zip(names, values, strict=True))


def sent_throw(plan: Plan) -> Throw:
    """The throw of a solved plan; InputError for a plan without one."""
    if plan.throw is None or not plan.solved:
        raise InputError(f"the plan is {plan.status}: it holds no throw")
    throw, scene = plan.throw.final, plan.scene.aimed_at(plan.goal)
    return throw if throw.scene == scene else dataclasses.replace(throw, scene=scene)


@dataclass(frozen=True, repr=False, eq=False)
class SavedThrow(Throw):
    """A throw that was read back; status and message: what its plan.json says."""

    status: Status = "solved"
    message: str = ""


def throw_of(plan: Plan | Throw | str | Path) -> Throw:
    """The throw of a solved plan, of a plan.json or of its folder; InputError where is none."""
    if isinstance(plan, str | Path):
        return read_plan(plan)
    return plan if isinstance(plan, Throw) else sent_throw(plan)


@dataclass(frozen=True, repr=False, eq=False)
class PlanPath:
    """A throw over time, from rest until the object lands.

    times (N,) [s], every millisecond; poses (N, 3): x, z [m], theta [rad] of the object's CoM in
    the throw's vertical plane, hand: the same of the pads' centre; joints (N, joints) [rad]: all of
    an arm's, None for a free hand. After its motion the arm keeps still.
    """

    times: Array
    poses: Array
    hand: Array
    joints: Array | None


def path_of(throw: Throw) -> PlanPath:
    """The throw every millisecond."""
    line, kinematics = over_time(throw, TICK), throw.mover.kinematics
    joints = None
    if isinstance(kinematics, PlanarArm):
        at = throw.to_rest.at(line.times)
        samples = Samples(at.pose.T, at.twist.T, at.acceleration.T)
        joints = joint_samples(kinematics, throw.target.plane.azimuth, samples)[0]
    return PlanPath(line.times, line.com.T, line.hand.T, joints)


def document(plan: Plan) -> dict[str, Any]:
    """What plan.json holds: `Plan.to_dict`, and the scene that `read_plan` needs."""
    scene = plan.scene.aimed_at(plan.target)
    return {"format": FORMAT, **plan.to_dict(), "definition": scene_table(scene)}


def read_plan(path: str | Path) -> SavedThrow:
    """The throw of a plan.json (or its folder) with the motion.csv beside it, thrown again.

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
    said = {key: str(plan.get(key, "")) for key in ("status", "message")}
    throw = SavedThrow(scene, mover, samples.path, opening_time, samples, **said)  # type: ignore[arg-type]
    if scene.target is None or scene.target.velocity is None:
        return throw
    return dataclasses.replace(throw, scene=scene.aimed_at(scene.target.at(throw.landing_time)))


def _plan_object(path: Path) -> dict[str, Any]:
    """The JSON object of a solved plan of this version."""
    text = read_text(path)
    try:
        plan = json.loads(text)
    except RecursionError:
        raise InputError(f"{path}: is not JSON: nested too deep") from None
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


def _samples(path: Path, mover: Mover) -> Samples:
    """The planned coordinates in motion.csv."""
    kinematics = mover.kinematics
    if isinstance(kinematics, PlanarArm):
        joints = kinematics.throwing_joints
        names = [f"{prefix}{j}" for prefix in ("q", "dq", "ddq") for j in joints]
    else:
        columns = (("x", "z", "theta"), ("vx", "vz", "omega"), ("ax", "az", "alpha"))
        names = [name for row in columns for name in row[: mover.size]]
    rows = read_csv("motion", str(path), None, ("t", *names))
    if len(rows) < 2 or np.abs(rows[:, 0] - TICK * np.arange(len(rows))).max() > 1e-6:
        raise InputError(f"{path}: t must go from 0 in steps of {TICK:g}")
    return Samples(*np.split(rows[:, 1:], 3, axis=1))
