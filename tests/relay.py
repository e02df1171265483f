"""A simulated Franka with another hand: connections to the arm go on to a server, the hand is
franka-sim's server with parts to grasp.

`relay.py HOST SERVER WIDTH GRASPS DROPPED AFTER`: see `PartsHand`. A process of its own, since the
binding of libfranka holds Python's lock while it connects.
"""

from __future__ import annotations

import contextlib
import math
import socket
import sys
import threading
import time

from franka_sim.gripper.backend import GripperBackend, GripperStateData
from franka_sim.gripper.server import FrankaGripperServer


class PartsHand(GripperBackend):
    """Moves 50 ms after a command.

    width [m]: at first; grasps: how many find an object of 20 mm, below 0: it never opens; dropped,
    after [s]: the number of the grasp whose object it loses, and how long after it holds it.
    """

    def __init__(self, width: float, grasps: float, dropped: float, after: float) -> None:
        self.width, self.grasps, self.dropped, self.after = width, grasps, dropped, after
        self.grasped, self.drop = 0, math.inf

    def _go(self, goal: float, speed: float) -> bool:
        time.sleep(0.05)
        begin, start = time.monotonic(), self.width
        while (way := speed * (time.monotonic() - begin)) < abs(goal - start):
            self.width = start + math.copysign(way, goal - start)
            time.sleep(1e-3)
        self.width = goal
        return True

    def homing(self) -> bool:
        """Not asked for."""
        return False

    stop = homing

    def move(self, width: float, speed: float) -> bool:
        """Open or close."""
        if self.grasps < 0:
            threading.Event().wait()
        self.drop = math.inf
        return self._go(width, speed)

    def grasp(self, width: float, inner: float, outer: float, speed: float, force: float) -> bool:
        """Close on an object, or on nothing."""
        self.grasped += 1
        self._go(0.02 if self.grasped <= self.grasps else 0.0, speed)
        self.drop = time.monotonic() + (self.after if self.grasped == self.dropped else math.inf)
        return width - inner < self.width < width + outer

    def get_state(self) -> GripperStateData:
        """The state now."""
        if time.monotonic() > self.drop:
            self.width = 0.0
        return GripperStateData(self.width, 0.08, self.width == 0.02, 30)


def forward(host: str, server: str, number: int) -> None:
    """Pass connections to a port of `host` on to `server`."""
    port = socket.create_server((host, number))
    while True:
        client = port.accept()[0]
        robot = socket.create_connection((server, number))
        for one in (client, robot):
            one.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        for ends in ((client, robot), (robot, client)):
            threading.Thread(target=_pass_on, args=ends, daemon=True).start()


def _pass_on(source: socket.socket, goal: socket.socket) -> None:
    with contextlib.suppress(OSError):
        while data := source.recv(65536):
            goal.sendall(data)
    for one in (source, goal):
        with contextlib.suppress(OSError):
            one.shutdown(socket.SHUT_RDWR)
        one.close()


if __name__ == "__main__":
    host, server = sys.argv[1:3]
    hand = FrankaGripperServer(host, backend=PartsHand(*map(float, sys.argv[3:])))
    threading.Thread(target=hand.run_server, daemon=True).start()
    while not hand.running:
        time.sleep(0.01)
    print("ready", flush=True)
    forward(host, server, 1337)
