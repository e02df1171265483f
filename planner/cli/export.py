"""`throwplan export`: a plan for robot controllers."""

from __future__ import annotations

import argparse
import json
from contextlib import ExitStack
from typing import Any

from ...problems import InputError
from .command import DONE, command, number


def add_export(commands: Any) -> None:
    """Adds `throwplan export`."""
    example = "throwplan export out/cup/plan.json --franka out/franka"
    parser = command(commands, "export", _export, "write a plan for a robot controller", example)
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


def _export(options: argparse.Namespace) -> int:
    if options.franka is None and options.ros is None:
        raise InputError("give --franka DIR, --ros DIR or both")
    if options.ros is None:
        for option in ("joint_names", "open_width"):
            if getattr(options, option) is not None:
                raise InputError(f"--{option.replace('_', '-')}: only with --ros")
    from ..robot import FILES, export_ros, joint_motion, option_folder, write_franka

    width = export_ros.WIDTH
    if options.open_width is not None:
        width = number("--open-width", options.open_width)
        if width < 0:
            raise InputError(f"--open-width {options.open_width}: must be at least 0")
    if options.ros is not None:
        # Before the plan is read: what is missing is said at once.
        export_ros.ros_typestore()
    motion = joint_motion(options.plan)
    names = export_ros.joint_names(motion, options.joint_names)
    with ExitStack() as stack:
        if options.franka is not None:
            write_franka(
                motion, stack.enter_context(option_folder("--franka", options.franka, FILES))
            )
        if options.ros is not None:
            folder = option_folder("--ros", options.ros, export_ros.FILES)
            export_ros.write_ros(motion, stack.enter_context(folder), names, width)
    throw = motion.throw
    if options.json:
        written = {
            "franka": options.franka,
            "ros": options.ros,
            "duration": float(motion.times[-1]),
            "command_time": throw.command_time,
            "cycle": motion.cycle,
            "fraction": motion.fraction,
        }
        print(json.dumps(written))
        return DONE
    print(
        f"{throw.scene.name}: {len(motion.times)} samples, {motion.times[-1]:.3f} s; the gripper's "
        f"command {1e3 * throw.command_time:.1f} ms after the first"
    )
    for folder in (options.franka, options.ros):
        if folder is not None:
            print(f"  written to {folder}")
    return DONE
