"""`throwplan export`: a plan for robot controllers."""

from __future__ import annotations

import argparse

from ..robot import export
from .common import DONE, Add, Progress, add_plan, number, print_result


def arguments(add: Add) -> None:
    """The command's options."""
    add_plan(add)
    add("--franka", metavar="DIR", help="write CSV files at 1 kHz for libfranka to this folder")
    add(
        "--ros",
        metavar="DIR",
        help="write a rosbag2 (MCAP) with trajectory and gripper command to this folder",
    )
    add("--joint-names", nargs="+", metavar="NAME", help="names of all joints in ROS")
    words = "width [m] of the open gripper in its ROS command (default: 0.08)"
    add("--open-width", type=number(0), metavar="M", help=words)


def run(options: argparse.Namespace) -> int:
    """Write the requested formats."""
    with Progress("writing the plan for controllers"):
        motion = export(
            options.plan,
            franka=options.franka,
            ros=options.ros,
            names=options.joint_names,
            open_width=options.open_width,
        )
    throw, duration = motion.throw, float(motion.times[-1])
    result = {
        "franka": options.franka,
        "ros": options.ros,
        "duration": duration,
        "command_time": throw.command_time,
        "cycle": motion.cycle,
        "fraction": motion.fraction,
    }
    lines = [
        f"{throw.scene.name}: {len(motion.times)} samples, {duration:.3f} s; gripper command "
        f"{throw.command_time:.3f} s after the first"
    ]
    lines += [f"  written to {name}" for name in (options.franka, options.ros) if name]
    print_result(options, result, "\n".join(lines))
    return DONE
