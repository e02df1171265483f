"""Calls that are given up after some processor time.

FATROP 1.1 raises its regularisation until a factorisation succeeds, without an end: at rare
points, with nothing unusual about them, none does. Nothing ends a call inside a library, but the
thread that never comes back need not be the caller's.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import signal
import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any, TypeVar

Answer = TypeVar("Answer")

#: How much longer than its processor time a call may take by the clock, on a busy machine.
BUSY = 20.0


class GivenUpError(Exception):
    """The call took longer than it may."""


class _Worker:
    """A thread that makes one call after the other."""

    def __init__(self) -> None:
        self._calls: SimpleQueue[Callable[[], Any]] = SimpleQueue()
        self._answers: SimpleQueue[tuple[Any, BaseException | None]] = SimpleQueue()
        self._thread = threading.Thread(target=self._work, name="throwplan-solver", daemon=True)
        self._thread.start()

    def call(self, made: Callable[[], Answer], limit: float) -> Answer:
        """What the call gives; GivenUpError after `limit` [s], and the thread is lost."""
        begun, worked = time.perf_counter(), self._worked()
        self._calls.put(made)
        left = limit
        while True:
            try:
                answer, error = self._answers.get(timeout=left)
            except Empty:
                left = limit - (self._worked() - worked)
                if left > 0.0 and time.perf_counter() - begun < BUSY * limit:
                    continue
                self._put_to_sleep()
                raise GivenUpError(f"no end after {limit:.0f} s") from None
            if error is not None:
                raise error
            return answer  # type: ignore[no-any-return]

    def _work(self) -> None:
        while True:
            made = self._calls.get()
            try:
                answer: tuple[Any, BaseException | None] = made(), None
            except BaseException as error:
                answer = None, error
            del made
            self._answers.put(answer)
            del answer

    def _worked(self) -> float:
        """Processor time of the thread [s]; the clock's where that is not known."""
        ident = self._thread.ident
        if ident is not None and hasattr(time, "pthread_getcpuclockid"):
            with contextlib.suppress(OSError):
                return time.clock_gettime(time.pthread_getcpuclockid(ident))
        return time.perf_counter()

    def _put_to_sleep(self) -> None:
        """Takes the lost thread off the processor, where the system can."""
        ident, number = self._thread.ident, _free_signal()
        if ident is None or number is None:
            return
        # A signal runs its handler in the thread it is sent to, whatever that is busy with:
        # here the C library's own pause, which returns after the next signal only.
        library = ctypes.CDLL(None)
        pause = ctypes.cast(library.pause, ctypes.c_void_p)
        library.signal.argtypes, library.signal.restype = (
            (ctypes.c_int, ctypes.c_void_p),
            ctypes.c_void_p,
        )
        library.signal(number, pause)
        signal.pthread_kill(ident, number)


def _free_signal() -> int | None:
    """A real-time signal that Python code here does not use, None where there is none."""
    first, last = getattr(signal, "SIGRTMIN", 0), getattr(signal, "SIGRTMAX", -1)
    free = (n for n in range(last, first, -1) if signal.getsignal(n) in (signal.SIG_DFL, None))
    return next(free, None)


#: Threads that wait for a call. A forked process has none of its parent's.
_idle: list[_Worker] = []
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)


def watched(made: Callable[[], Answer], limit: float) -> Answer:
    """made(), in another thread; GivenUpError after `limit` [s] of its processor time.

    Whatever the call raises is raised here. A thread that is given up keeps its memory until the
    process ends, and sleeps where the system has real-time signals (elsewhere it goes on).
    """
    try:
        worker = _idle.pop()
    except IndexError:
        worker = _Worker()
    busy = True
    try:
        answer = worker.call(made, limit)
        busy = False
        return answer
    except (GivenUpError, KeyboardInterrupt):
        raise
    except Exception:
        busy = False
        raise
    finally:
        if not busy:
            _idle.append(worker)
