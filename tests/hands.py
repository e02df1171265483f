"""A Franka Hand's server for tests, on port 1338 of an address of this machine."""

from __future__ import annotations

import socket
import struct
import threading
import time
from collections.abc import Sequence

HEADER = struct.Struct("<HII")
MOVE, GRASP = 3, 2


class FakeHand:
    """Moves at `speed` [m/s] after a delay, and reports its width every `interval` [s].

    delays [s]: of its openings in turn, closings take the first; stuck: openings move nothing.
    late [s]: how much later than due, or than its width was read, a report went out at worst, since
    the machine had other work;
    silent: numbers of the openings in which it reports nothing while it moves; served: the delays
    of its openings until now. grasps: how many grasps find an object of 20 mm; drops: the number of
    the grasp whose object it loses, and how long after it holds it [s].
    """

    def __init__(
        self,
        host: str,
        delays: Sequence[float],
        *,
        speed: float = 0.4,
        interval: float = 0.002,
        ramp: float = 0.0,
        width: float = 0.04,
        holds: bool = False,
        most: float = 0.08,
        stuck: bool = False,
        silent: Sequence[int] = (),
        grasps: float = 0,
        drops: tuple[float, float] = (0, 0.0),
    ) -> None:
        self.delays, self.speed, self.interval, self.ramp = list(delays), speed, interval, ramp
        self.start = self.goal = width
        self.begin, self.stuck, self.holds, self.most = 0.0, stuck, holds, most
        self._held_since = 0.0
        self.late, self.silent = 0.0, silent
        self.grasps, self.drops, self.grasped = grasps, drops, 0
        self.served: list[float] = []
        self._server = socket.create_server((host, 1338))
        self._server.settimeout(0.1)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def width(self) -> float:
        """The width now [m]."""
        since = max(time.monotonic() - self.begin, 0.0)
        short = min(since, self.ramp)
        way = self.speed * (short**2 / (2 * self.ramp or 1.0) + max(since - self.ramp, 0.0))
        far = self.goal - self.start
        return self.start + (min(way, abs(far)) if far > 0 else -min(way, abs(far)))

    def _hides(self) -> bool:
        moves = min(abs(self.width() - self.start), abs(self.width() - self.goal)) > 1e-9
        return moves and len(self.served) - 1 in self.silent

    def _serve(self) -> None:
        while not self._over.is_set():
            try:
                orders, peer = self._server.accept()
            except TimeoutError:
                continue
            with orders:
                self._speak(orders, peer[0])
        self._server.close()

    def _speak(self, orders: socket.socket, peer: str) -> None:
        """Serve one client until it goes."""
        states, port, sent, number = socket.socket(socket.AF_INET, socket.SOCK_DGRAM), 0, 0.0, 0
        orders.settimeout(self.interval / 4)
        pending: tuple[int, int] | None = None
        with states:
            while not self._over.is_set():
                now = time.monotonic()
                if port and now - sent > self.interval and not self._hides():
                    # It wakes up four times in each interval.
                    self.late = max(self.late, now - sent - 1.25 * self.interval if sent else 0.0)
                    number, sent = number + 1, now
                    seen = time.monotonic()
                    row = (number, self.width(), self.most, self.holds, 30)
                    states.sendto(struct.pack("<IddBH", *row), (peer, port))
                    self.late = max(self.late, time.monotonic() - seen)
                if pending and abs(self.width() - self.goal) < 1e-9:
                    orders.sendall(HEADER.pack(*pending, 12) + b"\0\0")
                    self.holds, pending = pending[0] == GRASP and self.goal > 0.0, None
                    self._held_since = now
                dropped, after = self.drops
                if self.holds and 0 < self.grasped == dropped and now > self._held_since + after:
                    self.holds = False
                    self._begin(0.0)
                try:
                    head = orders.recv(HEADER.size)
                except TimeoutError:
                    continue
                except ConnectionError:
                    return
                if not head:
                    return
                command, order, size = HEADER.unpack(head)
                payload = orders.recv(size - HEADER.size)
                if command == 0:
                    port = struct.unpack("<HH", payload)[1]
                    orders.sendall(HEADER.pack(0, order, 14) + struct.pack("<HH", 0, 3))
                else:
                    goal = struct.unpack_from("<d", payload)[0]
                    if command == GRASP:
                        self.grasped += 1
                        goal = 0.02 if self.grasped <= self.grasps else 0.0
                    self._begin(goal)
                    pending = command, order

    def _begin(self, goal: float) -> None:
        """Begin to move to a width [m]."""
        self.start, opens = self.width(), goal > self.width() + 1e-6
        delay = self.delays[len(self.served) % len(self.delays)] if opens else self.delays[0]
        if opens:
            self.served.append(delay)
        self.begin = time.monotonic() + delay
        self.goal = self.start if self.stuck and opens else goal

    def close(self) -> None:
        """End it."""
        self._over.set()
        self._thread.join()
