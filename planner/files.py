"""Plans as files: plan.json, motion.csv, throw.png, throw.gif. All or nothing."""

from __future__ import annotations

import json
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..models.hand import PlanarArm
from .folders import filling
from .motion import SampledMotion
from .plan import Plan
from .sent import document

Array = npt.NDArray[np.float64]


#: What a plan may leave in its folder.
FILES = ("motion.csv", "throw.png", "throw.gif", "plan.json")


def save_plan(plan: Plan, folder: Path, draw: bool) -> None:
    """Write a plan's files into `folder`, and take away those of an earlier plan."""
    with filling(folder, FILES) as scratch:
        _write(plan, scratch, draw)


def _write(plan: Plan, folder: Path, draw: bool) -> None:
    if plan.solved:
        write_motion(plan, folder / "motion.csv")
        if draw:
            from .picture import draw_throw, draw_throw_moving

            start = time.perf_counter()
            draw_throw(plan, folder / "throw.png")
            draw_throw_moving(plan, folder / "throw.gif")
            plan.time["draw"] = time.perf_counter() - start
    text = json.dumps(document(plan), indent=2, allow_nan=False)
    (folder / "plan.json").write_text(text + "\n", encoding="utf-8")


def write_motion(plan: Plan, path: Path) -> None:
    """motion.csv: launch, release and brake at 1 kHz, the joints or the hand."""
    assert plan.throw is not None
    samples = plan.throw.samples
    kinematics = plan.mover.kinematics
    if isinstance(kinematics, PlanarArm):
        header, table = _joint_table(plan, kinematics, samples)
    else:
        header, table = _hand_table(plan, samples)
    np.savetxt(path, table, delimiter=",", header=header, comments="", fmt="%.12g")


def _joint_table(plan: Plan, kinematics: PlanarArm, samples: SampledMotion) -> tuple[str, Array]:
    arm = kinematics.arm
    columns, names = [samples.times], ["t"]
    throwing = [j - 1 for j in kinematics.throwing_joints]
    for prefix, values in (("q", samples.q), ("dq", samples.dq), ("ddq", samples.ddq)):
        full = np.zeros((len(values), arm.joints))
        if prefix == "q":
            full[:] = arm.posture
            full[:, arm.azimuth_joint - 1] = plan.target.azimuth
        full[:, throwing] = values
        columns += list(full.T)
        names += [f"{prefix}{j + 1}" for j in range(arm.joints)]
    return ",".join(names), np.column_stack(columns)


def _hand_table(plan: Plan, samples: SampledMotion) -> tuple[str, Array]:
    outputs = plan.mover.motion(samples.q.T, samples.dq.T, samples.ddq.T)
    values = np.vstack([np.array(o) for o in outputs])
    names = "t,x,z,theta,vx,vz,omega,ax,az,alpha"
    return names, np.column_stack([samples.times, values.T])
