"""A worker thread that carries out only the latest request."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Request = TypeVar("Request")


class OutdatedError(Exception):
    """Raised by work for an outdated request."""


class LatestOnlyWorker(Generic[Request]):
    """Calls `work(request)` for the latest request; a new request replaces the one that waits.

    work: raises nothing but OutdatedError.
    """

    def __init__(self, work: Callable[[Request], None]) -> None:
        self._work = work
        self._changed = threading.Condition()
        self._waits: list[Request] = []
        self._busy = self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def submit(self, request: Request) -> None:
        """Make this the next request."""
        with self._changed:
            self._waits = [request]
            self._changed.notify_all()

    @property
    def waiting(self) -> bool:
        """Whether a newer request waits, or the worker is to end."""
        return bool(self._waits) or self._ended

    def finish(self, seconds: float | None = None) -> None:
        """Wait until there is no work, at most `seconds` [s]."""
        with self._changed:
            self._changed.wait_for(lambda: not (self._busy or self._waits), seconds)

    def end(self, seconds: float) -> None:
        """Take no more requests, and wait at most `seconds` [s] for current work."""
        with self._changed:
            self._ended = True
            self._changed.notify_all()
        self._thread.join(seconds)

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waits or self._ended)
                if self._ended:
                    return
                request, self._waits, self._busy = self._waits[0], [], True
            try:
                self._work(request)
            except OutdatedError:
                pass
            finally:
                with self._changed:
                    self._busy = False
                    self._changed.notify_all()
