#!/usr/bin/env python3
"""Throws the plan, or the cycle, of the bag in this folder: a ROS 2 node.

python3 throw_node.py --ros-args -p gripper_action:=/my_gripper/gripper_cmd

It moves the arm slowly to the start pose, asks, sends the trajectory as a goal that starts half a
second later, and sends the gripper's goals at their times. Needs rclpy, control_msgs and rosbag2_py
with its plugin for MCAP. Nothing is checked for collisions on the way to the start pose.
"""

import sys
import time
from pathlib import Path

import rclpy
import rosbag2_py
from control_msgs.action import FollowJointTrajectory, GripperCommand
from control_msgs.msg import GripperCommand as GripperCommandMessage
from rclpy.action import ActionClient
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.serialization import deserialize_message
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

#: Message types of the bag by topic.
TYPES = {"/joint_trajectory": JointTrajectory, "/gripper_command": GripperCommandMessage}
#: Time [s] from sending the goal to the start of the motion.
LEAD = 0.5


def read_bag(folder):
    """The bag's messages and their times [s] by topic, each topic's in order of time."""
    reader = rosbag2_py.SequentialReader()
    storage = rosbag2_py.StorageOptions(uri=str(folder), storage_id="mcap")
    reader.open(storage, rosbag2_py.ConverterOptions("", ""))
    found = {}
    while reader.has_next():
        topic, data, stamp = reader.read_next()
        message = deserialize_message(data, TYPES[topic])
        found.setdefault(topic, []).append((message, 1e-9 * stamp))
    return found


class ThrowNode(Node):
    """Clients of the two actions."""

    def __init__(self):
        super().__init__("thrower")
        self.declare_parameter(
            "trajectory_action", "/joint_trajectory_controller/follow_joint_trajectory"
        )
        self.declare_parameter("gripper_action", "/gripper_controller/gripper_cmd")
        self.declare_parameter("to_start", 5.0)  # s
        self.arm = self._client(FollowJointTrajectory, "trajectory_action")
        self.gripper = self._client(GripperCommand, "gripper_action")

    def _client(self, kind, parameter):
        name = self.get_parameter(parameter).value
        client = ActionClient(self, kind, name)
        if not client.wait_for_server(timeout_sec=5.0):
            raise RuntimeError(f"no action server at {name}: set the parameter {parameter}")
        return client

    def _accepted(self, trajectory):
        """The goal's handle; RuntimeError if the controller refuses it."""
        goal = FollowJointTrajectory.Goal()
        goal.trajectory = trajectory
        sending = self.arm.send_goal_async(goal)
        rclpy.spin_until_future_complete(self, sending)
        if not sending.result().accepted:
            raise RuntimeError("the controller refuses the trajectory")
        return sending.result()

    def _wait(self, handle):
        """Wait for the end of a motion; RuntimeError if it failed."""
        ending = handle.get_result_async()
        rclpy.spin_until_future_complete(self, ending)
        result = ending.result().result
        if result.error_code != FollowJointTrajectory.Result.SUCCESSFUL:
            raise RuntimeError(f"the controller gave up: {result.error_string}")

    def move_to_start(self, trajectory):
        """Move from rest to rest, in `to_start` seconds, to the trajectory's first point."""
        start = JointTrajectoryPoint()
        start.positions = trajectory.points[0].positions
        start.velocities = [0.0] * len(trajectory.joint_names)
        start.time_from_start = Duration(seconds=self.get_parameter("to_start").value).to_msg()
        way = JointTrajectory(joint_names=trajectory.joint_names, points=[start])
        self._wait(self._accepted(way))

    def throw(self, trajectory, commands):
        """Send the trajectory, and the gripper's commands at their times [s] after its start."""
        start = self.get_clock().now() + Duration(seconds=LEAD)
        trajectory.header.stamp = start.to_msg()
        handle = self._accepted(trajectory)
        if self.get_clock().now() > start:
            handle.cancel_goal_async()
            raise RuntimeError("the controller took too long to accept the trajectory")
        for command, command_time in commands:
            due = start + Duration(seconds=command_time)
            goal = GripperCommand.Goal()
            goal.command = command
            while self.get_clock().now() < due:
                time.sleep(2e-4)
            self.gripper.send_goal_async(goal)
        self._wait(handle)


def main():
    """Read, ask, throw."""
    bag = read_bag(Path(__file__).resolve().parent)
    ((trajectory, _),) = bag["/joint_trajectory"]
    rclpy.init()
    try:
        node = ThrowNode()
        input("The arm moves to the start pose. Is the way clear? Enter goes on, Ctrl-C ends. ")
        node.move_to_start(trajectory)
        input("The arm throws. Is everybody out of the way? Enter goes on, Ctrl-C ends. ")
        node.throw(trajectory, bag["/gripper_command"])
    except (RuntimeError, EOFError) as error:
        sys.exit(f"throw_node: {error}")
    finally:
        rclpy.shutdown()


if __name__ == "__main__":
    main()
