"""A relay in front of a simulated Franka that spoils what its gripper hears, or takes its place.

`relay.py HOST SERVER deaf`, `relay.py HOST SERVER DELAY ...` or `relay.py HOST SERVER hand GRASPS
DROPPED AFTER`, with another hand: see `FakeHand`. A process of its own, since the binding of
libfranka holds Python's lock while it connects.
"""

from __future__ import annotations

import contextlib
import itertools
import socket
import struct
import sys
import threading
import time
from collections.abc import Sequence

from hands import FakeHand

HEADER = struct.Struct("<HII")
MOVE = 3


class Relay:
    """At `host`, passes connections to robot and gripper at `server`.

    delays [s]: by which openings reach the gripper, in turn; deaf: they never do. States go
    directly, by UDP.
    """

    def __init__(
        self,
        host: str,
        server: str,
        delays: Sequence[float] = (0.0,),
        *,
        deaf: bool = False,
        ports: Sequence[int] = (1337, 1338),
    ) -> None:
        self.server, self.delays, self.deaf = server, itertools.cycle(delays), deaf
        # The simulated gripper's at first.
        self.goal = 0.04
        self._ports = [socket.create_server((host, port)) for port in ports]
        for port in self._ports:
            threading.Thread(target=self._accept, args=(port,), daemon=True).start()

    def _accept(self, port: socket.socket) -> None:
        number = port.getsockname()[1]
        while True:
            try:
                client = port.accept()[0]
            except OSError:
                return
            # The server takes one client: it may still see the last one.
            robot = socket.create_connection((self.server, number))
            for end in (client, robot):
                end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            orders = self._orders if number == 1338 else self._bytes
            threading.Thread(target=orders, args=(client, robot), daemon=True).start()
            threading.Thread(target=self._bytes, args=(robot, client), daemon=True).start()

    @staticmethod
    def _bytes(source: socket.socket, goal: socket.socket) -> None:
        try:
            while data := source.recv(65536):
                goal.sendall(data)
        except OSError:
            pass
        _end(source, goal)

    def _orders(self, client: socket.socket, robot: socket.socket) -> None:
        """Messages to the gripper, one by one."""
        try:
            while len(head := client.recv(HEADER.size, socket.MSG_WAITALL)) == HEADER.size:
                command, _, size = HEADER.unpack(head)
                payload = client.recv(size - HEADER.size, socket.MSG_WAITALL)
                if command == MOVE:
                    goal = struct.unpack_from("<d", payload)[0]
                    opens = goal > self.goal
                    self.goal = goal
                    if opens and self.deaf:
                        continue
                    if opens:
                        time.sleep(next(self.delays))
                robot.sendall(head + payload)
        except OSError:
            pass
        _end(client, robot)

    def close(self) -> None:
        """Take no more connections."""
        for port in self._ports:
            port.close()


def _end(*sockets: socket.socket) -> None:
    """End connections, also for a thread that waits for their data."""
    for one in sockets:
        with contextlib.suppress(OSError):
            one.shutdown(socket.SHUT_RDWR)
        one.close()


if __name__ == "__main__":
    (host, server, kind), numbers = sys.argv[1:4], [float(word) for word in sys.argv[4:]]
    if kind == "hand":
        grasps, *drops = numbers
        FakeHand(host, [0.05], width=0.08, grasps=grasps, drops=(drops[0], drops[1]))
        Relay(host, server, ports=[1337])
    elif kind == "deaf":
        Relay(host, server, deaf=True)
    else:
        Relay(host, server, [float(kind), *numbers])
    print("ready", flush=True)
    threading.Event().wait()
