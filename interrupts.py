"""Signals that end a command: Ctrl-C, SIGTERM and SIGHUP.

`throwplan/__init__.py` imports this file before all others, so it imports little. Without
`INTERRUPTS.listen`, as in a user's program, Python handles signals as usual.
"""

from __future__ import annotations

import atexit
import contextlib
import io
import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from types import FrameType
from typing import Any

#: Signals that end a process.
ENDING = {getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if name in dir(signal)}
#: Exit status after such a signal.
INTERRUPTED = 130
#: A signal within this time [s] of the first one repeats it: `timeout` sends two.
REPEATED = 1.0
#: Longest time [s] of functions that are registered for the exit.
EXIT_TIME = 2.0


class Interrupts:
    """The signal handler of a command.

    While the command works, a signal raises KeyboardInterrupt, which ends the work and cleans up; a
    signal more than `REPEATED` after it ends the process at once. Before and after the work there
    is nothing to clean up: the first signal ends the process. Set `working` when the work starts
    and ends.
    """

    def __init__(self) -> None:
        self.working = False
        self._received, self._pending, self._accepted = 0.0, False, False
        self._program, self._printed = "throwplan", False
        #: Standard error while nothing is written to it.
        self._stderr: Any = None

    def listen(self, program: str) -> None:
        """Handle the signals of this process; messages begin with the program's name."""
        self._program = program
        for kind in ENDING:
            # A signal that the shell ignores, as under nohup, stays ignored.
            if signal.getsignal(kind) is not signal.SIG_IGN:
                signal.signal(kind, self)
        # After a signal, what other threads and destructors raise follows from it.
        sys.unraisablehook = self._unless_received(sys.__unraisablehook__)
        threading.excepthook = self._unless_received(threading.__excepthook__)
        sys.excepthook = self._uncaught

    def _uncaught(self, kind: type[BaseException], error: BaseException, where: Any) -> None:
        """Show an exception that nobody caught."""
        self._restore()
        sys.__excepthook__(kind, error, where)

    def _restore(self) -> None:
        """Write to standard error again."""
        if self._stderr is not None:
            sys.stderr, self._stderr = self._stderr, None

    def _unless_received(self, hook: Callable[..., object]) -> Callable[..., object]:
        return lambda error: None if self._received else hook(error)

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Raise KeyboardInterrupt, or end the process."""
        now = time.monotonic()
        if not self.working or (self._received and now > self._received + REPEATED):
            os._exit(self.end())
        if not self._received:
            self._received, self._pending = now, True
            # A solver that ends by this writes so.
            self._stderr, sys.stderr = sys.stderr, io.StringIO()
            raise KeyboardInterrupt

    def check(self) -> None:
        """Raise KeyboardInterrupt if a signal was lost; call this between steps of long work.

        CasADi drops exceptions of the Python code that it calls while it converts arguments, and
        Python those of destructors.
        """
        if self._pending and self.working and _is_main_thread():
            raise KeyboardInterrupt

    def accept(self) -> None:
        """`check` raises no more: the caller has caught KeyboardInterrupt and goes on."""
        self._pending, self._accepted = False, True
        self._restore()

    def is_cause(self, error: BaseException) -> bool:
        """Whether a signal caused the error; C code replaces KeyboardInterrupt by its own error."""
        received = self._received > 0.0 and not self._accepted
        return received or isinstance(error, KeyboardInterrupt)

    def end(self) -> int:
        """Print that the program was interrupted, once for a process; returns the exit status."""
        self.working = False
        if not self._printed:
            # In a user's program, which calls a command, no signal is received here.
            self._printed = self._received > 0.0
            with contextlib.suppress(OSError):
                os.write(2, f"{self._program}: interrupted\n".encode())
        return INTERRUPTED


INTERRUPTS = Interrupts()


def _is_main_thread() -> bool:
    return threading.current_thread() is threading.main_thread()


def started_as(program: str) -> bool:
    """Whether Python runs the command `program`, or the package of that name with -m."""
    first, second = [*sys.orig_argv[1:3], "", ""][:2]
    name = second if first == "-m" else os.path.basename(first)
    return name in (program, f"{program}.exe")


def leave(status: int) -> None:
    """End the process as `sys.exit` does, but without Python's own clean-up.

    A thread that comes back from C++ during that clean-up aborts the process. Functions that are
    registered for the exit have `EXIT_TIME`: those of a broken process pool wait forever.
    """
    ending = threading.Thread(target=atexit._run_exitfuncs, daemon=True)
    ending.start()
    ending.join(EXIT_TIME)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(status)
