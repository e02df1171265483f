"""A Franka Hand over its network interface: orders, and its width as it reports it.

libfranka's binding waits for the end of a motion and holds Python's lock meanwhile, so that nobody
can watch the width. The interface (libfranka-common, `research_interface/gripper/types.h`) takes
orders over TCP and reports states over UDP, about ten times a second on the real hand. A process of
its own serves it: an order goes out on time while this process streams joints.
"""

from __future__ import annotations

import multiprocessing
import select
import socket
import struct
import sys
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from ...problems import InputError
from ..workers import set_up_worker, signals_deferred

#: TCP port of the gripper.
PORT = 1338
#: Version of its protocol.
VERSION = 3
#: Largest speed [m/s] of the gripper's width in orders.
SPEED = 0.2
#: Gap [m] of the opened Franka Hand.
OPEN_WIDTH = 0.08
#: Time [s] in which a gripper that answers sends its first state.
PATIENCE = 20.0
#: Change of the width [m] that counts as motion, above its noise.
MOVED = 2e-3
#: Largest grip force [N] of the Franka Hand for long, and at most, by its data sheet.
FORCES = 70.0, 140.0
#: Allowed difference [m] of a grasped width from the expected one, smaller and larger.
GRASP_TOLERANCE = 0.005
#: Numbers of the commands, and the layout of their arguments: all float64.
COMMANDS = {"connect": 0, "grasp": 2, "move": 3}
#: Command, its number, length of the message with this header.
HEADER = struct.Struct("<HII")
#: Number of the message, width, largest width, whether it holds something, temperature.
STATE = struct.Struct("<IddBH")
#: Linux's SO_TIMESTAMPNS: the kernel says when each datagram arrived, however late this process
#: reads it.
TIMESTAMPNS = 35
#: Results of an order; 0 is success.
RESULTS = ("done", "failed", "missed its width", "was aborted")


@dataclass(frozen=True)
class GripperState:
    """width, max_width [m] (0 before homing), and whether it holds something; time [s]: of its
    arrival, by `time.monotonic`."""

    width: float
    max_width: float
    holds: bool
    time: float = 0.0


class GripperLink:
    """The gripper at an address; `close` ends the connection.

    states: all that arrived since the last order, the last one before it first. ordered [s]: when
    the last order went out, by `time.monotonic`; None while it has not.
    """

    def __init__(self, host: str) -> None:
        self.host, context = host, multiprocessing.get_context("spawn")
        self.states: list[GripperState] = []
        self.ordered: float | None = None
        self._due, self._number = 0.0, 0
        self._result: int | None = None
        self._pipe, other = context.Pipe()
        self._process = context.Process(target=_serve, args=(host, other), daemon=True)
        with signals_deferred():
            self._process.start()
        other.close()

    def order(self, command: str, *values: float, after: float = 0.0) -> None:
        """Send `grasp` (width, inner and outer tolerance, speed, force) or `move` (width, speed)
        in `after` [s]."""
        self.states, self.ordered, self._result = self.states[-1:], None, None
        self._number += 1
        self._due = time.monotonic() + after
        try:
            self._pipe.send((self._due, command, values))
        except OSError:
            raise self._failure("the connection ended") from None

    @property
    def late(self) -> float:
        """How much later than asked for the last order went out [s]; 0 while that is not known."""
        return 0.0 if self.ordered is None else self.ordered - self._due

    def _failure(self, words: str) -> InputError:
        if "timed out" in words and not self.states:
            return self._silent()
        return InputError(f"{self.host}: gripper: {words}: see Desk for its state")

    def _silent(self) -> InputError:
        return InputError(
            f"{self.host}: port {PORT} is open and sends nothing: check that it is a "
            "Franka's address"
        )

    def update(self, patience: float = 0.0) -> bool:
        """Take what has arrived, and wait up to `patience` [s] for the first; whether there was
        anything. InputError if the gripper or its connection failed."""
        found = False
        while self._pipe.poll(0.0 if found else patience):
            found = True
            try:
                kind, value = self._pipe.recv()
            except (EOFError, ConnectionError):
                kind, value = "error", "the connection ended"
            if kind == "error":
                raise self._failure(value)
            if kind == "state":
                self.states.append(value)
                continue
            number, value = value
            if number != self._number:
                continue  # Of an order before.
            if kind == "ordered":
                self.ordered = value
            else:
                self._result = value
        return found

    def state(self) -> GripperState:
        """The next state that arrives; InputError if none does."""
        begin = time.monotonic()
        while not self.states or self.states[-1].time < begin:
            if not self.update(PATIENCE):
                raise self._silent()
        return self.states[-1]

    def homed_state(self) -> GripperState:
        """The next state that arrives; InputError for a gripper that is not homed."""
        now = self.state()
        if now.max_width < OPEN_WIDTH / 2:
            width = 1e3 * now.max_width
            raise InputError(
                f"{self.host}: its gripper is not homed, or opens by {width:.0f} mm only: home it "
                "in Desk"
            )
        return now

    def result(self, patience: float) -> str:
        """What became of the last order, empty while it goes on after `patience` [s]."""
        end = time.monotonic() + patience
        while self._result is None:
            if not self.update(max(end - time.monotonic(), 0.0)):
                return ""
        return RESULTS[self._result]

    def close(self) -> None:
        """End its process."""
        self._process.terminate()
        self._process.join()


class _ProtocolError(Exception):
    """The gripper's server does not do what its protocol says."""


def _serve(host: str, pipe: Connection) -> None:
    """The gripper's process: sends orders on time, and states and results to the pipe."""
    set_up_worker()
    try:
        with (
            socket.create_connection((host, PORT), timeout=PATIENCE) as orders,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as states,
        ):
            orders.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            states.bind(("", 0))
            states.setblocking(False)
            if sys.platform == "linux":
                states.setsockopt(socket.SOL_SOCKET, TIMESTAMPNS, 1)
            _connect(orders, states.getsockname()[1])
            _forward(pipe, orders, states)
    except EOFError:
        pass
    except ConnectionError:
        pipe.send(("error", "it closed the connection"))
    except (OSError, _ProtocolError) as error:
        words = error.strerror if isinstance(error, OSError) and error.strerror else error
        pipe.send(("error", str(words)))


def _connect(orders: socket.socket, port: int) -> None:
    """Say to which UDP port states go; _ProtocolError by a gripper of another protocol."""
    orders.sendall(_message("connect", 0, struct.pack("<HH", VERSION, port)))
    _, payload = _received(orders)
    status, version = struct.unpack_from("<HH", payload.ljust(4, b"\xff"))
    if status:
        raise _ProtocolError(f"its protocol has version {version}, must be {VERSION}")


def _forward(pipe: Connection, orders: socket.socket, states: socket.socket) -> None:
    """Serve until the pipe ends (EOFError)."""
    waiting: list[tuple[float, int, bytes]] = []
    number = 0
    inputs: list[Any] = [pipe, orders, states]
    while True:
        # `wait` rounds its time up to a millisecond: the last one is slept.
        left = max(waiting[0][0] - time.monotonic() - 1e-3, 0.0) if waiting else None
        ready: list[Any] = wait(inputs, left)
        now = time.monotonic()
        if waiting and waiting[0][0] < now + 1e-3:
            time.sleep(max(waiting[0][0] - now, 0.0))
            now = time.monotonic()
        if waiting and waiting[0][0] <= now:
            _, sent, message = waiting.pop(0)
            orders.sendall(message)
            pipe.send(("ordered", (sent, now)))
        if states in ready:
            newest = _newest(states)
            # A parent that does not look must not stop the orders: it misses states.
            if newest is not None and select.select([], [pipe], [], 0.0)[1]:
                pipe.send(("state", newest))
        if orders in ready:
            answered, payload = _received(orders)
            # A later order has taken the place of an earlier one.
            if answered == number:
                code = min(struct.unpack_from("<H", payload)[0], len(RESULTS) - 1)
                pipe.send(("result", (number, code)))
        if pipe in ready:
            due, command, values = pipe.recv()
            number += 1
            payload = struct.pack(f"<{len(values)}d", *values)
            waiting.append((due, number, _message(command, number, payload)))


def _newest(states: socket.socket) -> GripperState | None:
    """The last of the states that have arrived."""
    found = None
    while True:
        try:
            data, stamps, _, _ = states.recvmsg(65536, 64)
        except BlockingIOError:
            return found
        arrival = time.monotonic()
        for level, kind, stamp in stamps:
            if (level, kind) == (socket.SOL_SOCKET, TIMESTAMPNS):
                seconds, nanoseconds = struct.unpack("@ll", stamp)
                arrival -= max(time.time() - seconds - 1e-9 * nanoseconds, 0.0)
        if len(data) == STATE.size:
            _, width, most, holds, _ = STATE.unpack(data)
            found = GripperState(width, most, bool(holds), arrival)


def _message(command: str, number: int, payload: bytes) -> bytes:
    return HEADER.pack(COMMANDS[command], number, HEADER.size + len(payload)) + payload


def _received(orders: socket.socket) -> tuple[int, bytes]:
    """Number and payload of the next message from the gripper."""
    _, number, size = HEADER.unpack(_bytes(orders, HEADER.size))
    if not HEADER.size + 2 <= size <= 4096:
        raise _ProtocolError("it does not speak a gripper's protocol")
    return number, _bytes(orders, size - HEADER.size)


def _bytes(orders: socket.socket, count: int) -> bytes:
    found = b""
    while len(found) < count:
        more = orders.recv(count - len(found))
        if not more:
            raise ConnectionError
        found += more
    return found
