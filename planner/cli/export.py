"""`throwplan export`: a plan for robot controllers."""

from __future__ import annotations

import argparse
from contextlib import ExitStack

from ...problems import InputError
from ..robot import FILES, export_ros, joint_motion, option_folder, write_franka
from .common import DONE, answer, number

EXAMPLE = "throwplan export out/cup/plan.json --franka out/franka"


def arguments(parser: argparse.ArgumentParser) -> None:
    """The command's options."""
    parser.add_argument("plan", metavar="PLAN", help="a plan.json, or the folder that it is in")
    parser.add_argument(
        "--franka", metavar="DIR", help="write CSV files at 1 kHz for libfranka there"
    )
    parser.add_argument(
        "--ros", metavar="DIR", help="write a rosbag2 (MCAP) there: trajectory, gripper command"
    )
    parser.add_argument(
        "--joint-names", nargs="+", metavar="NAME", help="the joints' names in ROS, all of them"
    )
    parser.add_argument(
        "--open-width",
        metavar="M",
        help="gap of the opened gripper in its ROS command (default: 0.08)",
    )


def run(options: argparse.Namespace) -> int:
    """Writes the formats that are asked for."""
    if options.franka is None and options.ros is None:
        raise InputError("give --franka DIR, --ros DIR or both")
    if options.ros is None:
        for option in ("joint_names", "open_width"):
            if getattr(options, option) is not None:
                raise InputError(f"--{option.replace('_', '-')}: only with --ros")
    width = export_ros.WIDTH
    if options.open_width is not None:
        width = number("--open-width", options.open_width)
        if width < 0:
            raise InputError(f"--open-width {options.open_width}: must be at least 0")
    if options.ros is not None:
        # Before the plan is read: a missing extra is said at once.
        export_ros.ros_typestore()
    motion = joint_motion(options.plan)
    names = export_ros.joint_names(motion, options.joint_names)
    with ExitStack() as stack:
        if options.franka is not None:
            folder = option_folder("--franka", options.franka, FILES)
            write_franka(motion, stack.enter_context(folder))
        if options.ros is not None:
            folder = option_folder("--ros", options.ros, export_ros.FILES)
            export_ros.write_ros(motion, stack.enter_context(folder), names, width)
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
    lines += [f"  written to {folder}" for folder in (options.franka, options.ros) if folder]
    answer(options, result, "\n".join(lines))
    return DONE
