"""Plans as files: plan.json, motion.csv, throw.png, throw.gif. All or nothing."""

from __future__ import annotations

import os
import tempfile
import time
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..models.hand import PlanarArm
from ..problems.errors import InputError
from .motion import SampledMotion
from .plan import Plan

Array = npt.NDArray[np.float64]


#: What a plan may leave in its folder.
FILES = ("motion.csv", "throw.png", "throw.gif", "plan.json")


def prepare_folder(folder: Path) -> Path:
    """Make `folder` if need be and make sure it can be written; InputError if not."""
    if str(folder) in ("", "."):
        raise InputError("--out: needs a folder's name")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror or error}") from None
    return folder


def save_plan(plan: Plan, folder: Path, draw: bool) -> None:
    """Write a plan's files into `folder`: into a folder of their own first, then moved."""
    folder = prepare_folder(folder)
    for name in FILES:
        if (folder / name).is_dir():
            raise InputError(f"--out {folder}: {name} is a folder there")
    try:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            _write(plan, Path(scratch), draw)
            written = {path.name for path in Path(scratch).iterdir()}
            # Nothing of an earlier plan stays beside this one's plan.json.
            for name in FILES:
                if name in written:
                    os.replace(Path(scratch) / name, folder / name)
                else:
                    (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror or error}") from None


def _write(plan: Plan, folder: Path, draw: bool) -> None:
    if plan.solved:
        write_motion(plan, folder / "motion.csv")
        if draw:
            from .picture import draw_throw, draw_throw_moving

            start = time.perf_counter()
            draw_throw(plan, folder / "throw.png")
            draw_throw_moving(plan, folder / "throw.gif")
            plan.time["draw"] = time.perf_counter() - start
    (folder / "plan.json").write_text(plan.json() + "\n", encoding="utf-8")


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


def save_text(text: str, folder: Path, name: str) -> None:
    """Write `name` into `folder`, whole or not at all."""
    folder = prepare_folder(folder)
    _replace(text, folder / name, f"--out {folder}")


def copy_out(text: str, path: Path) -> None:
    """Write a text file that is not there yet; InputError otherwise."""
    if path.exists():
        raise InputError(f"{path}: exists already, not overwritten")
    _replace(text, path, str(path))


def _replace(text: str, path: Path, place: str) -> None:
    scratch = path.with_suffix(".part")
    try:
        scratch.write_text(text, encoding="utf-8")
        os.replace(scratch, path)
    except OSError as error:
        scratch.unlink(missing_ok=True)
        raise InputError(f"{place}: {error.strerror or error}") from None
