"""A motion for a libfranka motion generator: CSV files at its 1 kHz, and what to know."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from ..result import write_table
from .export import JointMotion

#: What is written.
FILES = ("joints.csv", "gripper.csv", "franka.json", "franka.txt")

TEXT = """\
{scene}, thrown by {arm}.

joints.csv   t and all joints, q [rad] and dq [rad/s], one row per control cycle of 1 ms.
gripper.csv  the opening command: t [s], the row of joints.csv (0 is the first) in whose cycle
             it goes out, and how much of that cycle has passed then.
franka.json  the same as numbers, and what the motion uses of the robot's limits.

1. Move slowly to the start pose and stop there; it is the first row:
   q = [{start}] rad
2. Send row after row, one per cycle, as joint positions (or dq as joint velocities). The motion
   is within the limits as it is: switch libfranka's rate limiter off and its low-pass filter
   too (cutoff_frequency = franka::kMaxCutoffFrequency), for they would change it.
3. Send the gripper's opening command {command:.1f} ms after the first row, in row {cycle},
   from another thread: the call blocks. The plan takes the force to start falling
   {dwell:.1f} ms later and to be zero {opening:.1f} ms after that; what your gripper and
   network really need belongs into the scene's [gripper] and [uncertainty] delay.
4. The last row is at rest, after {duration:.3f} s. Finish the motion there.

Checked: position, velocity, acceleration and jerk of every joint, and what the scene asks;
throwplan's README says what is not checked.
"""


def write_franka(motion: JointMotion, folder: Path) -> dict[str, Any]:
    """Write `FILES` into `folder`; returns what franka.json holds."""
    write_table(folder / "joints.csv", {"t": motion.times, "q": motion.q, "dq": motion.dq})
    throw = motion.throw
    row = f"{throw.command_time:.12g},open,{motion.cycle},{motion.fraction:.6f}"
    (folder / "gripper.csv").write_text(f"t,command,cycle,fraction\n{row}\n", encoding="utf-8")
    facts = _facts(motion)
    text = json.dumps(facts, indent=2, allow_nan=False)
    (folder / "franka.json").write_text(text + "\n", encoding="utf-8")
    profile = throw.scene.gripper.profile()
    words = TEXT.format(
        scene=throw.scene.name,
        arm=motion.arm.description or motion.arm.name,
        start=", ".join(f"{angle:.6f}" for angle in motion.q[0]),
        command=1e3 * throw.command_time,
        cycle=motion.cycle,
        dwell=1e3 * (throw.opening_time - throw.command_time),
        opening=1e3 * profile.opening,
        duration=motion.times[-1],
    )
    (folder / "franka.txt").write_text(words, encoding="utf-8")
    return facts


def _facts(motion: JointMotion) -> dict[str, Any]:
    """Start, times and limits used as JSON: SI units, radians."""
    throw = motion.throw
    profile = throw.scene.gripper.profile()
    return {
        "scene": throw.scene.name,
        "robot": motion.arm.name,
        "start": motion.q[0].tolist(),
        "end": motion.q[-1].tolist(),
        "duration": float(motion.times[-1]),
        "samples": len(motion.times),
        "gripper": {
            "command_time": throw.command_time,
            "cycle": motion.cycle,
            "fraction": motion.fraction,
            "dwell": profile.dwell,
            "mean_delay": throw.scene.mean_delay,
            "opening_time": throw.opening_time,
            "opening": profile.opening,
            "detach_time": throw.detach_time,
        },
        "limits_used": {name: values.tolist() for name, values in motion.uses.items()},
    }
