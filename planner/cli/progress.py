"""How far long work is."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable


class ProgressLine:
    """How far long work is and how long it will take, on a terminal's stderr; else nothing."""

    def __init__(self, name: str, unit: str = "throws") -> None:
        self._name, self._unit = name, unit
        self._shown = sys.stderr.isatty()
        self._first: tuple[float, int] | None = None

    def show(self, done: int, total: int) -> None:
        """Write the line anew."""
        if not self._shown:
            return
        words = f"{self._name}: {done:,} of {total:,} {self._unit}, {100 * done / total:.0f} %"
        now = time.perf_counter()
        if self._first is None:
            # What came before the first throws tells nothing about the others.
            self._first = now, done
        elif done > self._first[1]:
            started, before = self._first
            words += f", {(now - started) * (total - done) / (done - before):.0f} s left"
        print(f"\r\033[K{words}", end="", file=sys.stderr, flush=True)

    def about(self, name: str) -> Callable[[int, int], None]:
        """Goes over to other work; returns `show`."""
        self._name, self._first = name, None
        if self._shown:
            print(f"\r\033[K{name}", end="", file=sys.stderr, flush=True)
        return self.show

    def __enter__(self) -> Callable[[int, int], None]:
        return self.show

    def __exit__(self, *error: object) -> None:
        """Takes the line away."""
        if self._shown:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
