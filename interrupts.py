"""Ctrl-C is Python's KeyboardInterrupt; some work is finished first."""

from __future__ import annotations

import contextlib
import secrets
import shutil
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

#: Exit status of a command that was interrupted.
INTERRUPTED = 130


@contextlib.contextmanager
def interrupts_deferred() -> Iterator[None]:
    """SIGINT and SIGTERM wait until the block ends, if Python handles them.

    For files that belong together, and for calls of CasADi: IPOPT takes KeyboardInterrupt for an
    error of the NLP and goes on, and conversions of arguments drop it.
    """
    received, handlers = list[int](), {}

    def defer(number: int, frame: FrameType | None) -> None:
        received.append(number)

    try:
        # Python runs handlers in the main thread only.
        if threading.current_thread() is threading.main_thread():
            for kind in (signal.SIGINT, signal.SIGTERM):
                handler = signal.getsignal(kind)
                if callable(handler):
                    handlers[kind] = handler
                    signal.signal(kind, defer)
        yield
    finally:
        for kind, handler in handlers.items():
            signal.signal(kind, handler)
        for number in received[:1]:
            signal.raise_signal(number)


@contextlib.contextmanager
def scratch_folder(parent: Path) -> Iterator[Path]:
    """A new folder in `parent` that is deleted after the block, also where a signal interrupts.

    `tempfile.TemporaryDirectory` leaves its folder if a signal meets it while it deletes.
    """
    scratch = parent / f"tmp-{secrets.token_hex(6)}"
    try:
        try:
            scratch.mkdir(0o700)
            yield scratch
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    finally:
        # Again, for the case that the first call was interrupted.
        shutil.rmtree(scratch, ignore_errors=True)
