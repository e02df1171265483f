"""CasADi functions as machine code, by the C compiler at hand."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from pathlib import Path

import casadi as ca

from .cache import cache_folder, digest, keep, kept, only_ours, scratch_folder

#: More optimisation compiles twice as long and runs no faster.
FLAGS = ("-O1", "-fPIC", "-shared")
#: Runs a command until it ends, or kills its process group when standard input closes.
SUPERVISED = """
exec 3<&0
"$@" </dev/null 3<&- & command=$!
{ read -r _ <&3; kill -9 0; } & watch=$!
wait $command; status=$?
kill $watch
exit $status
"""
#: Longest time [s] that a compilation may take before it is given up.
PATIENCE = 300.0
#: Code longer than this (bytes), that of scenarios, takes minutes and gigabytes to compile.
LARGEST = 8_000_000

#: Held while a compilation is under way beside other work.
_ONE_LATER = threading.Lock()

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

    Returns what tells whether it worked; None without compiler or folder, and while another such
    compilation is under way. It ends with the process, without a library if it is not done.
    """
    target, future = _library(key), Future[bool]()
    if target is None or c_compiler() is None or not _ONE_LATER.acquire(blocking=False):
        return None
    # CasADi may not be used by two threads: the code is made here.
    source = _source(functions)

    def work() -> None:
        try:
            future.set_result(_make(target, source, idle=True))
        finally:
            _ONE_LATER.release()

    threading.Thread(target=work, name="throwplan-compiler", daemon=True).start()
    return future


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
            if idle and shutil.which("nice"):
                order = ["nice", "-n", "19", *order]
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
            return process.wait(PATIENCE) == 0
        finally:
            process.stdin.close()
            if os.name != "posix":
                process.kill()
