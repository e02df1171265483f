"""CasADi functions as machine code, by the C compiler at hand."""

from __future__ import annotations

import atexit
import os
import platform
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from multiprocessing import parent_process
from pathlib import Path

import casadi as ca

from .cache import cache_folder, digest, keep, kept, only_ours, scratch_folder

#: More optimisation compiles twice as long and runs no faster.
#: No fused multiply-add, which would round otherwise than CasADi's own evaluation.
FLAGS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")
#: Runs a command until it ends, or kills its process group when standard input closes.
SUPERVISED = """
exec 3<&0
"$@" </dev/null 3<&- & command=$!
{ read -r _ <&3; kill -9 0; } & watch=$!
wait $command; status=$?
kill $watch
exit $status
"""
#: Runs a command at the least priority. On Linux a session's share of a busy core is that of its
#: group.
IDLE = 'echo 19 2>/dev/null >/proc/self/autogroup; exec nice -n 19 "$@"'
#: Longest time [s] that a compilation may take before it is given up; one beside other work waits.
PATIENCE = 900.0
#: Time [s] between two looks at a compiler.
POLL = 0.05
#: Code longer than this (bytes), that of scenarios, takes minutes and gigabytes to compile.
LARGEST = 8_000_000

#: Held while a compilation is under way beside other work.
_ONE_LATER = threading.Lock()
#: Set when the process ends.
_ENDING = threading.Event()

Functions = dict[str, ca.Function]


def c_compiler() -> str | None:
    """CC, or cc, gcc, clang; None where none is there or THROWPLAN_COMPILE is 0."""
    if os.environ.get("THROWPLAN_COMPILE") == "0":
        return None
    found = (shutil.which(name) for name in (os.environ.get("CC", "cc"), "cc", "gcc", "clang"))
    return next(filter(None, found), None)


def compiled(
    key: str, names: Sequence[str], derive: Callable[[], Functions], *, make: bool
) -> Functions:
    """The functions `names` as machine code, from the cache; plain ones where that cannot be.

    key: all that they depend on; derive: makes the plain ones; make: compile, in some seconds,
    what is not in the cache. Nothing is loaded from a folder that another user can write to.
    """
    target = _library(key)
    if target is None or (kept(target) is None and not (make and _compile(target, derive()))):
        return derive()
    try:
        return {name: ca.external(name, str(target)) for name in names}
    except RuntimeError:
        return derive()


def compiled_later(key: str, functions: Functions) -> Future[bool] | None:
    """Begins to compile for `compiled` to find, at the least priority beside other work.

    Returns what tells whether the library is there; None while another such compilation is under
    way, so that one may ask again. It ends with the process, without a library if it is not done.
    Workers compile nothing: many would compile the same.
    """
    only_one = _ONE_LATER
    if only_one.locked():
        return None
    future, target = Future[bool](), _library(key)
    there = target is not None and kept(target) is not None
    if target is None or there or c_compiler() is None or parent_process() is not None:
        future.set_result(there)
        return future
    if not only_one.acquire(blocking=False):
        return None

    def work() -> None:
        made = False
        try:
            made = _make(target, source, idle=True)
        finally:
            only_one.release()
            future.set_result(made)

    try:
        # CasADi may not be used by two threads: the code is made here.
        source = _source(functions)
        thread = threading.Thread(target=work, name="throwplan-compiler", daemon=True)
        thread.start()
    except BaseException:
        only_one.release()
        raise
    atexit.register(_end, thread)
    return future


def _end(thread: threading.Thread) -> None:
    """Ends a compilation with the process, and has it delete its files."""
    _ENDING.set()
    thread.join(1.0)


def _library(key: str) -> Path | None:
    """The file of the functions of a key; None where there is no folder that is safe."""
    folder = cache_folder()
    if folder is None or not only_ours(folder) or os.environ.get("THROWPLAN_COMPILE") == "0":
        return None
    return folder / f"{digest(key, ca.CasadiMeta.version(), platform.machine())}.so"


def _compile(target: Path, functions: Functions) -> bool:
    """Whether it could make the library."""
    return c_compiler() is not None and _make(target, _source(functions))


def _source(functions: Functions) -> str:
    generator = ca.CodeGenerator("throw")
    for function in functions.values():
        generator.add(function)
    return str(generator.dump())


def _make(target: Path, source: str, idle: bool = False) -> bool:
    """Whether a compiler made the library of C code."""
    command = c_compiler()
    if command is None or len(source) > LARGEST:
        return False
    try:
        with scratch_folder(target.parent) as scratch:
            code, made = scratch / "code.c", scratch / target.name
            code.write_text(source, encoding="utf-8")
            order = [command, *FLAGS, "-o", str(made), str(code), "-lm"]
            if idle and os.name == "posix":
                order = ["sh", "-c", IDLE, "sh", *order]
            # What stands behind its end does not matter to a library.
            return _run(order, scratch) and keep(target.parent, target.name, made.read_bytes())
    except (OSError, subprocess.SubprocessError):
        return False


def _run(command: Sequence[str], scratch: Path) -> bool:
    """Whether a compiler succeeded. It ends, with the programs that it starts, before `_run` does,
    and where this process is killed."""
    # A compiler that is ended leaves its own temporary files.
    own = os.environ | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(scratch))
    order = ["sh", "-c", SUPERVISED, "sh", *command] if os.name == "posix" else command
    none = subprocess.DEVNULL
    with subprocess.Popen(
        order, stdin=subprocess.PIPE, stdout=none, stderr=none, env=own, start_new_session=True
    ) as process:
        assert process.stdin is not None
        try:
            end = time.monotonic() + PATIENCE
            while process.poll() is None:
                if time.monotonic() > end or _ENDING.wait(POLL):
                    return False
            return process.returncode == 0
        finally:
            process.stdin.close()
            if os.name != "posix":
                process.kill()
