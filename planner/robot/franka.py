"""A Franka robot over libfranka's Python binding: its connection, readiness and gripper.

The binding holds Python's lock while a gripper moves, so a process of its own serves the gripper:
the stream of joint commands must not wait.
"""

from __future__ import annotations

import multiprocessing
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from ...models import Array
from ...models.robot import Arm
from ...problems import InputError, load_arm
from ..workers import set_up_worker, signals_deferred
from .controller_files import OPEN_WIDTH, is_franka

#: TCP ports of robot and gripper.
PORTS = (1337, 1338)
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


def load_franka() -> Any:
    """The binding; InputError without it."""
    try:
        import pylibfranka
    except ImportError:
        raise InputError("--robot: needs pylibfranka: pip install pylibfranka") from None
    return pylibfranka


def cure_of(word: str) -> str:
    """The cure for an error word of the controller."""
    return next((cure for part, cure in CURES.items() if part in word), "see Desk for its state")


@contextmanager
def controller_errors(host: str) -> Iterator[None]:
    """Turn errors of the binding into InputError: the controller's word and its cure."""
    binding = load_franka()
    names = ("Franka", "Network", "Control", "Command", "InvalidOperation", "Realtime")
    try:
        yield
    except tuple(getattr(binding, f"{name}Exception") for name in names) as error:
        word = " ".join(str(error).split()).removeprefix("libfranka: ")
        raise InputError(f"{host}: {word}: {cure_of(word)}") from None


@dataclass(frozen=True)
class GripperState:
    """width, max_width [m] (0 before homing), and whether it holds something."""

    width: float
    max_width: float
    holds: bool


class GripperLink:
    """The gripper in a process of its own, which answers orders one after the other."""

    def __init__(self, host: str) -> None:
        self.host, context = host, multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(host, other), daemon=True)
        with signals_deferred():
            self._process.start()
        other.close()

    def order(self, name: str, *values: float, after: float = 0.0) -> None:
        """Send an order: a method of the binding's gripper, to be called `after` [s]."""
        self._pipe.send((name, values, after))

    def has_answer(self, patience: float = 0.0) -> bool:
        """Whether an answer is there, or comes within `patience` [s]."""
        return self._pipe.poll(patience)

    def answer(self) -> GripperState:
        """The state after the oldest order; InputError if it failed."""
        try:
            found = self._pipe.recv()
        except (EOFError, ConnectionError):
            found = "the connection to the gripper ended"
        if isinstance(found, str):
            word = " ".join(found.split()).removeprefix("libfranka").removeprefix(" gripper")
            raise InputError(f"{self.host}: gripper{word}: see Desk for its state")
        return GripperState(*found)

    def state(self) -> GripperState:
        """The current state."""
        self.order("read_once")
        return self.answer()

    def close(self) -> None:
        """End its process."""
        self._process.terminate()
        self._process.join()


def _serve(host: str, pipe: Connection) -> None:
    """The gripper's process: carries out orders from the pipe and answers with the state."""
    set_up_worker()
    import pylibfranka

    try:
        gripper = pylibfranka.Gripper(host)
        while True:
            name, values, after = pipe.recv()
            time.sleep(after)
            getattr(gripper, name)(*values)
            state = gripper.read_once()
            pipe.send((state.width, state.max_width, state.is_grasped))
    except EOFError:
        pass
    except (RuntimeError, pylibfranka.FrankaException) as error:
        pipe.send(str(error))


@dataclass(frozen=True)
class Franka:
    """A robot that is connected; `connected` makes it."""

    host: str
    robot: Any
    gripper: GripperLink

    def check(self, arm: Arm) -> tuple[Array, GripperState]:
        """The current joints [rad] and the gripper; InputError unless the robot is ready.

        Ready: of the plan's arm, idle, without errors, at rest, with a homed gripper.
        """
        with controller_errors(self.host):
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
def connected(host: str) -> Iterator[Franka]:
    """Robot and gripper at an address; InputError if they do not answer."""
    binding = load_franka()
    for port in PORTS:
        # The binding would wait for a minute and ignore interrupts.
        try:
            socket.create_connection((host, port), timeout=5.0).close()
        except OSError as error:
            why = error.strerror or str(error)
            raise InputError(
                f"--robot {host}: does not answer on port {port} ({why}): check the address, the "
                "cable, and that FCI is active in Desk"
            ) from None
    real_time = Path("/sys/kernel/realtime").exists()
    config = binding.RealtimeConfig.kEnforce if real_time else binding.RealtimeConfig.kIgnore
    gripper = GripperLink(host)
    try:
        # The gripper first: its process can be ended.
        gripper.order("read_once")
        if not gripper.has_answer(patience=20.0):
            raise InputError(
                f"--robot {host}: port {PORTS[1]} is open and sends nothing: check that it is a "
                "Franka's address"
            )
        gripper.answer()
        with controller_errors(host):
            yield Franka(host, binding.Robot(host, config), gripper)
    finally:
        gripper.close()


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


def _check_flange(host: str, arm: Arm, state: Any) -> None:
    """InputError unless robot and plan's arm have the flange in one place."""
    q = ca.SX.sym("q", arm.joints)
    flange = np.array(ca.Function("flange", [q], [arm.frames(q)[-2]])(state.q))
    hand, tool = (np.reshape(pose, (4, 4)).T for pose in (state.O_T_EE, state.F_T_EE))
    off = np.linalg.norm((hand @ np.linalg.inv(tool) - flange)[:3, 3])
    if off > 1e-3:
        raise InputError(
            f"{host}: its flange is {1e3 * off:.0f} mm from where the plan's arm {arm.name} has "
            "it: plan it with the robot's own arm file"
        )
