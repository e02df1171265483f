"""Plans and cycles for robot controllers: as CSV for libfranka or as a rosbag2."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from ..planner import TICK, Carry, Samples, SentMotion, Source, write_table
from ..problems import Arm, InputError, checked, filling, write_json
from .franka.connection import check_hand
from .franka.watch import GRASP_CHECK, find_stops
from .motions import (
    GripperCommand,
    arm_of,
    commands_of,
    grasp_of,
    is_franka,
    joint_motion,
    opening_due,
    opening_of,
)

#: Allowed gaps [m] of an opened gripper: a larger number is in millimetres.
WIDTHS = {"least": 0.001, "most": 0.5, "unit": "m"}
#: Program for libfranka that throws the files beside it.
FRANKA_PROGRAM = ("throw.cpp", "CMakeLists.txt")
#: Files for libfranka.
FRANKA_FILES = (
    *("joints.csv", "gripper.csv", "stops.csv", "franka.json", "franka.txt"),
    *FRANKA_PROGRAM,
)
#: Program for ROS 2 that throws the bag beside it.
ROS_PROGRAM = ("throw_node.py",)
#: Files of the bag.
BAG_FILES = ("metadata.yaml", "throw.mcap")
#: Files for ROS 2.
ROS_FILES = (*BAG_FILES, *ROS_PROGRAM)


def export(
    plan: Source,
    *,
    franka: str | Path | None = None,
    ros: str | Path | None = None,
    names: Sequence[str] | None = None,
    open_width: float | None = None,
) -> SentMotion:
    """Check an arm's plan or a cycle again and write it for robot controllers; returns the motion.

    plan: a plan, a throw, a cycle, a sent motion, or the path of their file or of its folder.
    franka, ros: folders for the files of libfranka and of ROS 2 (extra `ros`). names: of all joints
    in ROS;
    open_width [m]: gap of the opened gripper in its ROS commands, the arm's where left out. Raises
    InputError for a plan that must not be sent and for folders that cannot be written.
    """
    if franka is None and ros is None:
        raise InputError("give --franka DIR, --ros DIR or both")
    if ros is None and names is not None:
        raise InputError("--joint-names: only with --ros")
    if ros is None and open_width is not None:
        raise InputError("--open-width: only with --ros")
    width = checked("--open-width", open_width, float | None, WIDTHS)
    if ros is not None:
        # Refuse a missing extra before reading the plan.
        ros_typestore()
    motion = joint_motion(plan)
    arm = arm_of(motion)
    if franka is not None and not is_franka(arm):
        words = f"the plan's arm is {arm.name}, must be a Franka; --ros takes any arm"
        raise InputError(f"--franka: {words}")
    if franka is not None:
        check_hand("--franka", motion)
    joints, opened = joint_names(arm, names), arm.tool.open_width if width is None else width
    commands = [
        GripperCommand(command.time, 0.0 if command.force else opened, command.force)
        for command in commands_of(motion)
    ]
    with ExitStack() as stack:
        if franka is not None:
            folder = filling(Path(franka), FRANKA_FILES, "--franka")
            write_motion(motion, stack.enter_context(folder))
        if ros is not None:
            folder = filling(Path(ros), ROS_FILES, "--ros")
            write_ros(stack.enter_context(folder), joints, motion.samples, commands)
    return motion


# Files for libfranka.

FRANKA_TEXT = """\
{name}, thrown by {arm}.

throw.cpp    throws it: cmake -B build && cmake --build build && build/throw HOST
             (needs libfranka 0.9 or newer; `throwplan run` does the same from Python).
joints.csv   t and all joints, q [rad] and dq [rad/s], one row per control cycle of 1 ms.
gripper.csv  each command: t [s], the row of joints.csv (0 is the first) in whose cycle it goes
             out, how much of that cycle has passed then; check: the row at which it must be done.
             width and tolerance [m] of the gap, force [N] of a grasp, 0 of an opening; object: its
             name.
stops.csv    motions to rest: joints q [rad] that take the place of those of joints.csv from row
             `cycle` on, one row per control cycle. All keep the limits, and meet nothing with
             the object in the hand.
franka.json  the same as numbers.

The program moves slowly to the start pose, which is the first row,
   q = [{start}] rad,
and asks before each motion. It sends a row per cycle without libfranka's rate limiter and
low-pass filter, which would change the motion; it is within the limits as it is. {before}
It watches the gripper. If at a row `check` this does not hold its object, or has not opened; if it
loses the object on the way; or if its connection fails: it gets no further command, the arm follows
the next of the stops, and the program ends with one line. The last row is at rest, after
{duration:.3f} s. The plan takes the force to start falling {dwell:.1f} ms after the command to
open, and to be zero {opening:.1f} ms after that; what your gripper and network really need belongs
into the scene's [gripper] and [uncertainty] delay.

Checked: position, velocity, acceleration and jerk of every joint, and what the scene asks;
throwplan's README says what is not checked. Not checked: the way to the start pose.
"""
HELD = "The object is in the gripper before, held by its grasp command."
PICKED = """The
empty gripper opens before, grasps each object at its pick, where the arm waits, and opens for its
throw."""


def write_motion(motion: SentMotion, folder: Path) -> None:
    """Write joints.csv and gripper.csv into `folder`, of a Franka all `FRANKA_FILES`."""
    columns = {"t": motion.times, "q": motion.q, "dq": motion.samples.dq}
    write_table(folder / "joints.csv", columns)
    (folder / "gripper.csv").write_text("\n".join(_gripper_rows(motion)) + "\n", encoding="utf-8")
    if is_franka(arm_of(motion)):
        _write_franka(motion, folder)


def _write_franka(motion: SentMotion, folder: Path) -> None:
    """Write what a Franka's program needs beside joints.csv and gripper.csv."""
    write_json(folder / "franka.json", motion_facts(motion))
    stops, throw, arm = find_stops(motion), motion.throw, arm_of(motion)
    if not stops:
        raise InputError("export: the arm can stop clear of everything nowhere in this motion")
    rows = [np.vstack([motion.q[stop.sample], stop.q]) for stop in stops]
    begins = np.repeat([stop.sample for stop in stops], [len(q) for q in rows])
    write_table(folder / "stops.csv", {"cycle": begins, "q": np.vstack(rows)})
    words = FRANKA_TEXT.format(
        name=motion.name,
        arm=arm.description or arm.name,
        start=", ".join(f"{angle:.6f}" for angle in motion.q[0]),
        before=PICKED if motion.picks else HELD,
        duration=motion.duration,
        dwell=1e3 * (throw.opening_time - throw.command_time),
        opening=1e3 * throw.scene.gripper.profile().opening,
    )
    (folder / "franka.txt").write_text(words, encoding="utf-8")
    _write_programs(folder, FRANKA_PROGRAM)


def _gripper_rows(motion: SentMotion) -> Iterator[str]:
    """The lines of gripper.csv; the check after the last row is that at the end."""
    yield "t,command,cycle,fraction,check,width,tolerance,force,object"
    for number, carry in enumerate(motion.carries):
        due = opening_due(motion, number)
        checked = [(opening_of(carry), len(motion.q) if due is None else due)]
        if carry.pick:
            checked.insert(0, (grasp_of(carry), carry.held - GRASP_CHECK))
        for one, check in checked:
            kind = "grasp" if one.force else "open"
            row = f"{one.time:.12g},{kind},{one.cycle},{one.fraction:.6f},{check}"
            yield f"{row},{one.width:g},{one.tolerance:g},{one.force:g},{carry.name}"


def _write_programs(folder: Path, names: Sequence[str]) -> None:
    """Copy the programs that throw the files beside them."""
    programs = files("throwplan") / "robots" / "programs"
    for name in names:
        (folder / name).write_text((programs / name).read_text(encoding="utf-8"), encoding="utf-8")


def motion_facts(motion: SentMotion) -> dict[str, Any]:
    """Start and times as JSON: SI units, radians; of the gripper for each object."""
    return {
        "scene": motion.name,
        "robot": arm_of(motion).name,
        "start": motion.q[0].tolist(),
        "end": motion.q[-1].tolist(),
        "duration": motion.duration,
        "samples": len(motion.times),
        "gripper": [_gripper_facts(one) for one in motion.carries],
    }


def _gripper_facts(carry: Carry) -> dict[str, Any]:
    """Times of the gripper for an object, on the motion's clock."""
    scene, opening, grasp = carry.throw.scene, opening_of(carry), grasp_of(carry)
    profile = scene.gripper.profile()
    found = {
        "command_time": opening.time,
        "cycle": opening.cycle,
        "fraction": opening.fraction,
        "dwell": profile.dwell,
        "mean_delay": scene.mean_delay,
        "opening_time": carry.opening_time,
        "opening": profile.opening,
        "detach_time": carry.detach_time,
    }
    picked = {"pick": carry.pick, "close_time": grasp.time, "width": grasp.width}
    return (picked if carry.pick else {}) | found


# ROS 2.

#: Topics of the bag.
TRAJECTORY = "/joint_trajectory"
GRIPPER = "/gripper_command"
TRAJECTORY_TYPE = "trajectory_msgs/msg/JointTrajectory"
GRIPPER_TYPE = "control_msgs/msg/GripperCommand"
#: Nanoseconds of a second.
SECOND = 1_000_000_000


def ros_typestore() -> Any:
    """The message types of the bag; InputError without rosbags."""
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise InputError("--ros: needs rosbags: pip install rosbags") from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    # As control_msgs defines it: rosbags does not have it.
    store.register(get_types_from_msg("float64 position\nfloat64 max_effort\n", GRIPPER_TYPE))
    return store


def joint_names(arm: Arm, given: Sequence[str] | None) -> list[str]:
    """Names of all joints, the given ones, the arm's or NAME_joint1, ...; InputError if wrong."""
    count = arm.joints
    if given is None:
        own = (f"{arm.name}_joint{j + 1}" for j in range(count))
        return list(arm.joint_names or own)
    if len(given) != count or len(set(given)) != count:
        raise InputError(f"--joint-names {' '.join(given)}: must be {count} different names")
    return list(given)


def write_ros(
    folder: Path, names: list[str], samples: Samples, commands: Sequence[GripperCommand]
) -> None:
    """Write `ROS_FILES`, a bag, into `folder`. The motion's start is at 0 s on the bag's clock.

    names, samples: of all joints; commands: in order of time.
    """
    store = ros_typestore()
    from rosbags.rosbag2 import StoragePlugin, Writer

    # rosbags makes a folder, which names the storage file in it.
    bag, kind = folder / "throw", store.types[GRIPPER_TYPE]
    with Writer(bag, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        arm = writer.add_connection(TRAJECTORY, TRAJECTORY_TYPE, typestore=store)
        message = _trajectory(store, samples, names)
        writer.write(arm, 0, store.serialize_cdr(message, TRAJECTORY_TYPE))
        gripper = writer.add_connection(GRIPPER, GRIPPER_TYPE, typestore=store)
        for command in commands:
            message = kind(position=command.width, max_effort=command.force)
            time = max(round(command.time * SECOND), 0)
            writer.write(gripper, time, store.serialize_cdr(message, GRIPPER_TYPE))
    for name in BAG_FILES:
        os.replace(bag / name, folder / name)
    _write_programs(folder, ROS_PROGRAM)


def _trajectory(store: Any, samples: Samples, names: list[str]) -> Any:
    """JointTrajectory with all samples; stamp 0 starts it on arrival."""
    point = store.types["trajectory_msgs/msg/JointTrajectoryPoint"]
    duration = store.types["builtin_interfaces/msg/Duration"]
    points = [
        point(
            positions=q,
            velocities=dq,
            accelerations=ddq,
            effort=np.zeros(0),
            time_from_start=duration(*divmod(i * round(TICK * SECOND), SECOND)),
        )
        for i, (q, dq, ddq) in enumerate(zip(samples.q, samples.dq, samples.ddq, strict=True))
    ]
    stamp = store.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
    return store.types[TRAJECTORY_TYPE](header=header, joint_names=names, points=points)
