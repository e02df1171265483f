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
#: Signals of a thread's own mistakes, which are not to be blocked.
FAULTS = {
    getattr(signal, name)
    for name in ("SIGSEGV", "SIGBUS", "SIGFPE", "SIGILL", "SIGABRT", "SIGTRAP", "SIGSYS")
    if hasattr(signal, name)
}


class GivenUpError(Exception):
    """The call took longer than it may."""


class _Worker:
    """A thread that makes one call after the other."""

    def __init__(self) -> None:
        self._calls: SimpleQueue[Callable[[], Any]] = SimpleQueue()
        self._answers: SimpleQueue[tuple[Any, BaseException | None]] = SimpleQueue()
        self._sleep_signal = _free_signal()
        self._thread = threading.Thread(target=self._work, name="throwplan-solver", daemon=True)
        self._thread.start()

    def call(self, made: Callable[[], Answer], limit: float) -> tuple[Any, BaseException | None]:
        """What the call gives and what it raises; GivenUpError after `limit` [s].

        After an exception here, that one or Ctrl-C's, the thread is lost.
        """
        self._calls.put(made)
        try:
            return self._answer(limit)
        except BaseException:
            self._put_to_sleep()
            raise

    def _answer(self, limit: float) -> tuple[Any, BaseException | None]:
        begun, worked, left = time.perf_counter(), self._worked(), limit
        while True:
            with contextlib.suppress(Empty):
                return self._answers.get(timeout=left)
            left = limit - (self._worked() - worked)
            if left > 0.0 and time.perf_counter() - begun < BUSY * limit:
                continue
            with contextlib.suppress(Empty):
                return self._answers.get_nowait()
            raise GivenUpError(f"no end after {limit:.0f} s")

    def _work(self) -> None:
        if hasattr(signal, "pthread_sigmask"):
            # Signals are for other threads: one would wake this one from its sleep.
            others = signal.valid_signals() - FAULTS
            signal.pthread_sigmask(signal.SIG_BLOCK, others)
            if self._sleep_signal is not None:
                signal.pthread_sigmask(signal.SIG_UNBLOCK, [self._sleep_signal])
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
        ident, number = self._thread.ident, self._sleep_signal
        if ident is None or number is None:
            return
        # A signal runs its handler in the thread it is sent to, whatever that is busy with:
        # here the C library's own pause, which returns after the next signal only.
        library = ctypes.CDLL(None)
        pause = ctypes.cast(library.pause, ctypes.c_void_p)
        library.signal.argtypes = (ctypes.c_int, ctypes.c_void_p)
        library.signal.restype = ctypes.c_void_p
        library.signal(number, pause)
        signal.pthread_kill(ident, number)


def _free_signal() -> int | None:
    """A real-time signal that nothing here uses, None where there is none."""
    first, last = getattr(signal, "SIGRTMIN", 0), getattr(signal, "SIGRTMAX", -1)
    free = (n for n in range(last, first, -1) if signal.getsignal(n) == signal.SIG_DFL)
    return next(free, None)


#: Threads that wait for a call. A forked process has none of its parent's.
_idle: list[_Worker] = []
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_idle.clear)


def watched(made: Callable[[], Answer], limit: float) -> Answer:
    """made(), in another thread; GivenUpError after `limit` [s] of its processor time.

    Whatever the call raises is raised here. A thread that is given up, or left by Ctrl-C, keeps
    its memory until the process ends, and sleeps where the system has real-time signals
    (elsewhere it goes on).
    """
    try:
        worker = _idle.pop()
    except IndexError:
        worker = _Worker()
    answer, error = worker.call(made, limit)
    # Only here is the thread known to wait for the next call.
    _idle.append(worker)
    if error is not None:
        raise error
    return answer  # type: ignore[no-any-return]
