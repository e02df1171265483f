"""A thread that works on the latest request and leaves out those before it."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Request = TypeVar("Request")


class OutdatedError(Exception):
    """Raised by work for an outdated request."""


class LatestOnlyWorker(Generic[Request]):
    """A thread that calls `work(request)` for the latest request and skips older ones.

    work: raises nothing but OutdatedError. ended: whether the worker is to end.
    """

    def __init__(self, work: Callable[[Request], None]) -> None:
        self._work, self.ended = work, False
        self._requests: queue.Queue[Request | None] = queue.Queue()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def submit(self, request: Request) -> None:
        """Make this the next request."""
        self._requests.put(request)

    @property
    def waiting(self) -> bool:
        """Whether a newer request waits, or the worker is to end."""
        return not self._requests.empty() or self.ended

    def finish(self) -> None:
        """Wait until there is no work."""
        self._requests.join()

    def end(self, seconds: float) -> None:
        """Take no more requests, and wait at most `seconds` [s] for current work."""
        self.ended = True
        self._requests.put(None)
        self._thread.join(seconds)

    def _run(self) -> None:
        while not self.ended:
            request = self._requests.get()
            try:
                if request is not None and not self.waiting:
                    self._work(request)
            except OutdatedError:
                pass
            finally:
                self._requests.task_done()
