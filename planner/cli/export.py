"""`throwplan export`: a plan for robot controllers."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path

from ...problems import InputError, filling
from ..robot import (
    FRANKA_FILES,
    OPEN_WIDTH,
    ROS_FILES,
    joint_motion,
    joint_names,
    ros_typestore,
    write_franka,
    write_ros,
)
from .common import DONE, Add, add_plan, answer, number


def arguments(add: Add) -> None:
    """The command's options."""
    add_plan(add)
    add("--franka", metavar="DIR", help="write CSV files at 1 kHz for libfranka there")
    add("--ros", metavar="DIR", help="write a rosbag2 (MCAP) there: trajectory, gripper command")
    add("--joint-names", nargs="+", metavar="NAME", help="the joints' names in ROS, all of them")
    words = "gap of the opened gripper in its ROS command (default: 0.08)"
    add("--open-width", type=number(0), metavar="M", help=words)


def run(options: argparse.Namespace) -> int:
    """Writes the formats that are asked for."""
    if options.franka is None and options.ros is None:
        raise InputError("give --franka DIR, --ros DIR or both")
    if options.ros is None:
        for option in ("joint_names", "open_width"):
            if getattr(options, option) is not None:
                raise InputError(f"--{option.replace('_', '-')}: only with --ros")
    width = OPEN_WIDTH if options.open_width is None else options.open_width
    if options.ros is not None:
        # Before the plan is read: a missing extra is said at once.
        ros_typestore()
    motion = joint_motion(options.plan)
    names = joint_names(motion, options.joint_names)
    with ExitStack() as stack:
        if options.franka is not None:
            folder = filling(Path(options.franka), FRANKA_FILES, "--franka")
            write_franka(motion, stack.enter_context(folder))
        if options.ros is not None:
            folder = filling(Path(options.ros), ROS_FILES, "--ros")
            write_ros(motion, stack.enter_context(folder), names, width)
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
        f"{throw.scene.name}: {len(motion.times)} samples, {duration:.3f} s; the gripper's "
        f"command {1e3 * throw.command_time:.1f} ms after the first"
    ]
    lines += [f"  written to {name}" for name in (options.franka, options.ros) if name]
    answer(options, result, "\n".join(lines))
    return DONE
