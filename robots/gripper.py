"""A Franka Hand by libfranka's Python binding, in a process of its own.

A call of the binding holds Python's lock until the hand has ended its motion; in one process the
arm would miss its cycles meanwhile. The hand takes one call at a time, so nobody sees its width
while it moves.
"""

from __future__ import annotations

import multiprocessing
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

from ..problems import InputError
from ..workers import set_up_worker, sigint_blocked

#: TCP port of the gripper.
PORT = 1338
#: Largest speed [m/s] of the gripper's width in commands.
SPEED = 0.2
#: Gap [m] of the opened Franka Hand.
OPEN_WIDTH = 0.08
#: Time [s] in which a gripper answers, and in which it ends a motion.
PATIENCE = 20.0
#: Change of the width [m] that counts as motion, above its noise.
MOVED = 2e-3
#: Largest grip force [N] of the Franka Hand for long, and at most, by its data sheet.
FORCES = 70.0, 140.0
#: Allowed difference [m] of a grasped width from the expected one, smaller and larger.
GRASP_TOLERANCE = 0.005


def load_franka() -> Any:
    """The binding; InputError without it."""
    try:
        import pylibfranka
    except ImportError:
        raise InputError("--robot: needs pylibfranka: pip install pylibfranka") from None
    return pylibfranka


@dataclass(frozen=True)
class GripperState:
    """width, max_width [m] (0 before homing), and whether it holds something."""

    width: float
    max_width: float
    holds: bool


@dataclass(frozen=True)
class GripperReply:
    """The end of a call: a state of `read_once`, else whether the command succeeded. late [s]: how
    much later than asked for the call began."""

    name: str
    value: GripperState | bool
    late: float = 0.0


class GripperLink:
    """The gripper at an address; `close` ends the connection. pending: calls without a reply."""

    def __init__(self, host: str) -> None:
        self.host, self.pending = host, 0
        context = multiprocessing.get_context("spawn")
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(host, other), daemon=True)
        with sigint_blocked():
            self._process.start()
        other.close()

    def call(self, name: str, *values: float, after: float = 0.0) -> None:
        """Call `read_once`, `move` (width, speed) or `grasp` (width, speed, force, inner and outer
        tolerance) of the binding in `after` [s], once earlier calls have ended."""
        self.pending += 1
        try:
            self._pipe.send((time.monotonic() + after, name, values))
        except OSError:
            raise self._failure("the connection ended") from None

    def reply(self, patience: float = 0.0) -> GripperReply | None:
        """The next reply, if it comes within `patience` [s]; InputError if the connection failed"""
        if not self._pipe.poll(patience):
            return None
        try:
            reply = self._pipe.recv()
        except (EOFError, ConnectionError):
            reply = "the connection ended"
        if isinstance(reply, str):
            raise self._failure(reply)
        self.pending -= 1
        assert isinstance(reply, GripperReply)
        return reply

    def _failure(self, words: str) -> InputError:
        return InputError(f"{self.host}: gripper: {words}: see Desk for its state")

    def result(self, name: str, *values: float) -> GripperState | bool:
        """Call and wait for the reply; InputError if none comes."""
        self.call(name, *values)
        while (reply := self.reply(PATIENCE)) is not None:
            if not self.pending:
                return reply.value
        raise InputError(
            f"{self.host}: port {PORT} is open and does not answer: check that it is a Franka's "
            "address, and that nothing else uses the gripper"
        )

    def state(self) -> GripperState:
        """The state now; InputError if it is not told."""
        state = self.result("read_once")
        assert isinstance(state, GripperState)
        return state

    def close(self) -> None:
        """End its process."""
        self._process.terminate()
        self._process.join()


def _serve(host: str, pipe: Connection) -> None:
    """The gripper's process: makes calls in turn, each when it is due, until the pipe ends."""
    set_up_worker()
    binding = load_franka()
    try:
        hand = binding.Gripper(host)
        while True:
            due, name, values = pipe.recv()
            time.sleep(max(due - time.monotonic(), 0.0))
            late = time.monotonic() - due
            try:
                value = getattr(hand, name)(*values)
            except binding.CommandException:
                value = False
            if name == "read_once":
                value = GripperState(value.width, value.max_width, value.is_grasped)
            pipe.send(GripperReply(name, value, late))
    except (EOFError, BrokenPipeError):
        pass
    except (RuntimeError, binding.FrankaException) as error:
        pipe.send(" ".join(str(error).split()).removeprefix("libfranka: "))
