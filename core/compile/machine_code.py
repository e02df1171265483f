"""CasADi functions as machine code, by the C compiler at hand."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
from collections.abc import Callable, Sequence
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
    folder = cache_folder()
    if folder is None or not only_ours(folder) or os.environ.get("THROWPLAN_COMPILE") == "0":
        return derive()
    target = folder / f"{digest(key, ca.CasadiMeta.version(), platform.machine())}.so"
    if kept(target) is None and not (make and _compile(target, derive())):
        return derive()
    try:
        return {name: ca.external(name, str(target)) for name in names}
    except RuntimeError:
        return derive()


def _compile(target: Path, functions: Functions) -> bool:
    """Whether it could make the library."""
    command, generator = c_compiler(), ca.CodeGenerator("throw")
    if command is None:
        return False
    for function in functions.values():
        generator.add(function)
    source = str(generator.dump())
    if len(source) > LARGEST:
        return False
    try:
        with scratch_folder(target.parent) as scratch:
            code, made = scratch / "code.c", scratch / target.name
            code.write_text(source, encoding="utf-8")
            order = [command, *FLAGS, "-o", str(made), str(code), "-lm"]
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
