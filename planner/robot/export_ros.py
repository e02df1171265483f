"""A motion as ROS 2 messages in a rosbag2 folder (MCAP): trajectory and gripper command."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from ...problems import InputError
from ..check import TICK
from .export import JointMotion

#: What is written.
FILES = ("metadata.yaml", "throw.mcap")
TRAJECTORY, GRIPPER = "/joint_trajectory", "/gripper_command"
TRAJECTORY_TYPE = "trajectory_msgs/msg/JointTrajectory"
GRIPPER_TYPE = "control_msgs/msg/GripperCommand"
#: As control_msgs defines it; it is not among the types that rosbags knows.
GRIPPER_DEFINITION = "float64 position\nfloat64 max_effort\n"
#: Nanoseconds of a second and of a sample.
SECOND = 1_000_000_000
SAMPLE = round(TICK * SECOND)
#: Gap [m] of an opened gripper where nothing else is asked for: the Franka Hand's.
WIDTH = 0.08


def ros_typestore() -> Any:
    """The message types of the bag; InputError where rosbags is not installed."""
    try:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore
    except ImportError:
        raise InputError("--ros: needs rosbags: pip install 'throwplan[ros]'") from None
    store = get_typestore(Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(GRIPPER_DEFINITION, GRIPPER_TYPE))
    return store


def joint_names(motion: JointMotion, given: list[str] | None) -> list[str]:
    """Names of all joints, the given ones or NAME_joint1, ...; InputError if they do not fit."""
    count = motion.arm.joints
    if given is None:
        return [f"{motion.arm.name}_joint{j + 1}" for j in range(count)]
    if len(given) != count or len(set(given)) != count:
        raise InputError(f"--joint-names {' '.join(given)}: must be {count} different names")
    return given


def write_ros(motion: JointMotion, folder: Path, names: list[str], width: float) -> None:
    """Write `FILES`, a bag, into `folder`. The motion's start is at 0 s on the bag's clock.

    width [m]: gap of the opened gripper, for the gripper's command.
    """
    store = ros_typestore()
    from rosbags.rosbag2 import StoragePlugin, Writer

    # The library makes a folder of its own, named like the storage in it.
    bag = folder / "throw"
    command = store.types[GRIPPER_TYPE](position=width, max_effort=0.0)
    with Writer(bag, version=8, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, kind, time, message in (
            (TRAJECTORY, TRAJECTORY_TYPE, 0, _trajectory(store, motion, names)),
            (GRIPPER, GRIPPER_TYPE, round(motion.throw.command_time * SECOND), command),
        ):
            connection = writer.add_connection(topic, kind, typestore=store)
            writer.write(connection, max(time, 0), store.serialize_cdr(message, kind))
    for name in FILES:
        os.replace(bag / name, folder / name)


def _trajectory(store: Any, motion: JointMotion, names: list[str]) -> Any:
    """JointTrajectory with all samples, to be started when it arrives (stamp 0)."""
    types = store.types
    point, duration = (
        types["trajectory_msgs/msg/JointTrajectoryPoint"],
        types["builtin_interfaces/msg/Duration"],
    )
    rows = zip(motion.q, motion.dq, motion.ddq, strict=True)
    points = [
        point(
            positions=q,
            velocities=dq,
            accelerations=ddq,
            effort=np.zeros(0),
            time_from_start=duration(*_seconds(i * SAMPLE)),
        )
        for i, (q, dq, ddq) in enumerate(rows)
    ]
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
    return types[TRAJECTORY_TYPE](header=header, joint_names=names, points=points)


def _seconds(nanoseconds: int) -> tuple[int, int]:
    return nanoseconds // SECOND, nanoseconds % SECOND
