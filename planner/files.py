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
from .plan import Draw, Plan
from .sent import document

Array = npt.NDArray[np.float64]


#: What a plan may leave in its folder.
FILES = ("motion.csv", "throw.png", "throw.gif", "plan.json")


def save_plan(plan: Plan, folder: Path, draw: Draw) -> None:
    """Write a plan's files into `folder`, and take away those of an earlier plan.

    draw: "png" for throw.png alone.
    """
    with filling(folder, FILES) as scratch:
        _write(plan, scratch, draw)


def _write(plan: Plan, folder: Path, draw: Draw) -> None:
    if plan.solved:
        write_motion(plan, folder / "motion.csv")
        if draw:
            from .picture import draw_throw

            start = time.perf_counter()
            draw_throw(plan, folder / "throw.png")
            if draw != "png":
                from .moving_picture import draw_throw_moving

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
        values = joint_samples(kinematics, plan.target.azimuth, samples)
        columns = dict(zip(("q", "dq", "ddq"), values, strict=True))
    else:
        columns = _hand_columns(plan, samples)
    write_table(path, {"t": samples.times} | columns)


def joint_samples(
    kinematics: PlanarArm, azimuth: float, samples: SampledMotion
) -> tuple[Array, Array, Array]:
    """q, dq, ddq of all joints of the arm, each (N, joints): posture and azimuth [rad] held."""
    arm = kinematics.arm
    throwing = [j - 1 for j in kinematics.throwing_joints]
    q, dq, ddq = (np.zeros((len(samples.q), arm.joints)) for _ in range(3))
    q[:] = arm.posture
    q[:, arm.azimuth_joint - 1] = azimuth
    q[:, throwing], dq[:, throwing], ddq[:, throwing] = samples.q, samples.dq, samples.ddq
    return q, dq, ddq


def write_table(path: Path, columns: dict[str, Array]) -> None:
    """A CSV of columns (N,) or (N, n), which become name1, name2, ... ."""
    names: list[str] = []
    for name, values in columns.items():
        names += [name] if values.ndim == 1 else [f"{name}{j + 1}" for j in range(values.shape[1])]
    table = np.column_stack(list(columns.values()))
    np.savetxt(path, table, delimiter=",", header=",".join(names), comments="", fmt="%.12g")


def _hand_columns(plan: Plan, samples: SampledMotion) -> dict[str, Array]:
    outputs = plan.mover.motion(samples.q.T, samples.dq.T, samples.ddq.T)
    values = np.vstack([np.array(o) for o in outputs])
    names = ("x", "z", "theta", "vx", "vz", "omega", "ax", "az", "alpha")
    return dict(zip(names, values, strict=True))
