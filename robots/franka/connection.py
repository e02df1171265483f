"""A Franka robot over libfranka's Python binding: its connection and readiness."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array
from ...planner import TICK, SentMotion
from ...problems import Arm, InputError, load_arm
from ...workers import check_host
from ..gripper import FORCES, OPEN_WIDTH, SPEED, GripperLink, GripperState, load_franka
from ..gripper import PORT as GRIPPER_PORT
from ..motions import arm_of, grasp_of, is_franka
from .watch import GRASP_CHECK

#: TCP ports of robot and gripper.
PORTS = (1337, GRIPPER_PORT)
#: The only arm that the binding's protocol supports.
ARM = "fr3"
#: A robot is at rest if no joint is faster than this [rad/s].
STILL = 0.01
#: Cures for error words of the controller, by parts of the word.
CURES = {
    "UserStopped": "release the user stop",
    "Guiding": "let go of the guiding buttons",
    "Reflex": "find out why it stopped, then unlock it in Desk",
    "Other": "activate FCI in Desk",
    "communication_constraints": "use a real-time kernel and a direct cable",
    "reflex": "clear its way, or raise its collision thresholds",
    "start_pose_invalid": "try again",
    "collision": "clear its way",
    "Timeout": "check the cable, and its state in Desk",
    "discontinuity": "use a real-time kernel, and plan it again with larger margins",
    "violation": "plan it again with larger margins",
}


def cure_of(word: str) -> str:
    """The cure for an error word of the controller."""
    return next((cure for part, cure in CURES.items() if part in word), "see Desk for its state")


@dataclass(frozen=True)
class Franka:
    """A robot that is connected; `connected` makes it. binding: libfranka's, which has made it."""

    host: str
    robot: Any
    gripper: GripperLink
    binding: Any

    def check(self, arm: Arm) -> tuple[Array, GripperState]:
        """The current joints [rad] and the gripper; InputError unless the robot is ready.

        Ready: of the plan's arm, idle, without errors, at rest, with a homed gripper.
        """
        with binding_errors(self.host, self.binding):
            state = self.robot.read_once()
        mode, errors = state.robot_mode.name, str(state.current_errors)
        if state.current_errors:
            raise InputError(f"{self.host}: is in error, {errors}: {cure_of(errors)}")
        if mode != "Idle":
            raise InputError(f"{self.host}: its mode is {mode}, must be Idle: {cure_of(mode)}")
        q, moving = np.array(state.q_d), np.abs(state.dq).max()
        if moving > STILL:
            raise InputError(f"{self.host}: moves ({moving:.2f} rad/s), must be at rest: wait")
        check_arm(self.host, arm)
        _check_flange(self.host, arm, state)
        gripper = self.gripper.state()
        if gripper.max_width < OPEN_WIDTH / 2:
            width = 1e3 * gripper.max_width
            raise InputError(
                f"{self.host}: its gripper is not homed, or opens by {width:.0f} mm only: home it "
                "in Desk"
            )
        return q, gripper


@contextmanager
def binding_errors(host: str, binding: Any) -> Iterator[None]:
    """Turn errors of the binding into InputError: the controller's word and its cure."""
    names = ("Franka", "Network", "Control", "Command", "InvalidOperation", "Realtime")
    try:
        yield
    except tuple(getattr(binding, f"{name}Exception") for name in names) as error:
        word = " ".join(str(error).split()).removeprefix("libfranka: ")
        raise InputError(f"{host}: {word}: {cure_of(word)}") from None


@contextmanager
def connected(host: str) -> Iterator[Franka]:
    """Robot and gripper at an address; InputError if they do not answer."""
    binding = load_franka()
    for port in PORTS:
        check_port(host, port)
    real_time = Path("/sys/kernel/realtime").exists()
    config = binding.RealtimeConfig.kEnforce if real_time else binding.RealtimeConfig.kIgnore
    gripper = GripperLink(host)
    try:
        # The gripper first: its process can be ended.
        gripper.state()
        with binding_errors(host, binding):
            yield Franka(host, binding.Robot(host, config), gripper, binding)
    finally:
        gripper.close()


def check_port(host: str, port: int) -> None:
    """InputError unless something listens there; the binding would wait for a minute and ignore
    interrupts."""
    check_host(f"--robot {host}", host)
    try:
        socket.create_connection((host, port), timeout=5.0).close()
    except OSError as error:
        why = error.strerror or str(error)
        raise InputError(
            f"--robot {host}: does not answer on port {port} ({why}): check the address, the "
            "cable, and that FCI is active in Desk"
        ) from None


def check_arm(where: str | Path, arm: Arm) -> None:
    """InputError, naming `where`, unless an FR3 has the arm's flange and limits."""
    robot = f"the robot of `throwplan run` is an {ARM}"
    if not is_franka(arm):
        raise InputError(
            f'{where}: the plan\'s arm is {arm.name}, {robot}: plan it with arm = "{ARM}", or '
            "export it with --ros"
        )
    ours, theirs = vars(arm.limits), vars(load_arm(ARM).limits)
    for name in ("velocity", "acceleration", "jerk"):
        for j, (mine, its) in enumerate(zip(ours[name], theirs[name], strict=True), start=1):
            if mine > its:
                raise InputError(
                    f"{where}: {robot}, whose limit of joint {j} {name} is {its:g}; the plan's "
                    f'arm {arm.name} has {mine:g}: plan it with arm = "{ARM}"'
                )


def check_motion(where: str | Path, motion: SentMotion) -> None:
    """InputError, naming `where`, unless an FR3 with its hand can send the motion."""
    check_arm(where, arm_of(motion))
    check_hand(where, motion)


def check_hand(where: str | Path, motion: SentMotion) -> None:
    """InputError, naming `where`, unless a Franka Hand opens as wide as the plan's, has the scene's
    force and closes at a cycle's picks in time."""
    if (width := arm_of(motion).tool.open_width) > OPEN_WIDTH:
        raise InputError(
            f"{where}: the plan's hand opens by {width:g} m, a Franka Hand by {OPEN_WIDTH:g} m at "
            'most: export it with --ros, or plan it with [gripper] file = "franka-hand"'
        )
    for carry in motion.carries:
        scene, close = carry.throw.scene, grasp_of(carry)
        if close.force > FORCES[1]:
            raise InputError(
                f"{where}: {carry.name}: the grip force is {close.force:g} N, a Franka Hand has "
                f"{FORCES[1]:g} N at most: plan it with a smaller [gripper] force"
            )
        if not carry.pick:
            continue
        delay = scene.gripper.profile().dwell + scene.mean_delay
        way = OPEN_WIDTH - close.width - close.tolerance
        least = delay + way / SPEED + TICK * GRASP_CHECK
        given = TICK * (carry.held - carry.reach)
        if given < least:
            raise InputError(
                f"{where}: {carry.pick}: the hand closes at {SPEED:g} m/s at most, and needs "
                f"{least:.2f} s until it holds the object; the arm waits {given:.2f} s: plan it "
                "with a longer grasp_time"
            )


def _check_flange(host: str, arm: Arm, state: Any) -> None:
    """InputError unless robot and plan's arm have the flange in one place."""
    flange = arm.placed(state.q)[-2]
    hand, tool = (np.reshape(pose, (4, 4)).T for pose in (state.O_T_EE, state.F_T_EE))
    off = np.linalg.norm((hand @ np.linalg.inv(tool) - flange)[:3, 3])
    if off > 1e-3:
        raise InputError(
            f"{host}: its flange is {1e3 * off:.0f} mm from where the plan's arm {arm.name} has "
            "it: plan it with the robot's own arm file"
        )
