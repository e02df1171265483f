"""Work in a thread of its own, of which only what was asked for last is done."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

Wish = TypeVar("Wish")


class OutdatedError(Exception):
    """Work is given up, for there is a newer wish, or no more of it."""


class Newest(Generic[Wish]):
    """Does `work(wish)` for the newest of the wishes; what comes meanwhile replaces what waits.

    work: raises nothing but OutdatedError.
    """

    def __init__(self, work: Callable[[Wish], None]) -> None:
        self._work = work
        self._changed = threading.Condition()
        self._waits: list[Wish] = []
        self._busy = self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def ask(self, wish: Wish) -> None:
        """Have this done next."""
        with self._changed:
            self._waits = [wish]
            self._changed.notify_all()

    @property
    def waiting(self) -> bool:
        """Whether there is a newer wish than the one that is worked on, or the end."""
        return bool(self._waits) or self._ended

    def finish(self, seconds: float | None = None) -> None:
        """Waits until nothing is left to do, `seconds` [s] at most."""
        with self._changed:
            self._changed.wait_for(lambda: not (self._busy or self._waits), seconds)

    def end(self, seconds: float) -> None:
        """Takes no more wishes, and waits `seconds` [s] at most for the work under way."""
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
                wish, self._waits, self._busy = self._waits[0], [], True
            try:
                self._work(wish)
            except OutdatedError:
                pass
            finally:
                with self._changed:
                    self._busy = False
                    self._changed.notify_all()
