"""CasADi functions as machine code, by the C compiler at hand.

Compiler and cache may be missing: functions then run slower and give the same answers.
"""

from __future__ import annotations

import atexit
import os
import platform
import shutil
import subprocess
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from multiprocessing import parent_process
from pathlib import Path

import casadi as ca

from ...cache import cache_folder, digest, keep, kept, only_ours
from ...interrupts import scratch_folder

#: More optimisation compiles twice as long and runs no faster.
#: No fused multiply-add, which would round otherwise than CasADi's own evaluation.
FLAGS = ("-O1", "-ffp-contract=off", "-fPIC", "-shared")
#: Runs a command until it ends; when standard input closes, kills its process group and deletes its
#: temporary files. `idle`: at the least priority; on Linux a session's share of a busy core is that
#: of its group.
SUPERVISED = """
[ "$0" = idle ] && { echo 19 >/proc/self/autogroup; renice -n 19 $$; }
exec 3<&0
"$@" </dev/null 3<&- & command=$!
{ read -r _ <&3; rm -rf "$TMPDIR"; kill -9 0; } & watch=$!
wait $command; status=$?
kill $watch
exit $status
"""
#: Code longer than this (bytes), that of scenarios, takes minutes and gigabytes to compile.
LARGEST = 8_000_000

#: What tells whether a library is made; None while the compiler works.
Made = Callable[[], bool | None]
#: The last compilation beside other work.
_LATER: list[Made] = []

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
    if target is not None and make and kept(target) is None:
        with suppress(OSError), _compiling(target, derive()) as made:
            made(wait=True)
    if target is None or kept(target) is None:
        return derive()
    try:
        return {name: ca.external(name, str(target)) for name in names}
    except RuntimeError:
        return derive()


def compiled_later(key: str, functions: Functions) -> Made | None:
    """Begins to compile for `compiled` to find, at the least priority beside other work.

    None while another such compilation is under way, so that one may ask again. It ends with the
    process, without a library if it is not done. Workers compile nothing: many would compile the
    same.
    """
    if _LATER and _LATER[0]() is None:
        return None
    target, stack = _library(key), ExitStack()
    found = target is not None and kept(target) is not None
    if target is None or found or parent_process() is not None:
        return lambda: found
    try:
        made = stack.enter_context(_compiling(target, functions, idle=True))
    except OSError:
        return lambda: False
    result = None

    def done() -> bool | None:
        nonlocal result
        if result is None and (result := made()) is not None:
            stack.close()
        return result

    _LATER[:] = [done]
    atexit.register(stack.close)
    atexit.register(done)
    return done


def _library(key: str) -> Path | None:
    """The file of the functions of a key; None where there is no folder that is safe."""
    folder = cache_folder()
    if folder is None or not only_ours(folder) or os.environ.get("THROWPLAN_COMPILE") == "0":
        return None
    return folder / f"{digest(key, ca.CasadiMeta.version(), platform.machine())}.so"


@contextmanager
def _compiling(
    target: Path, functions: Functions, idle: bool = False
) -> Iterator[Callable[..., bool | None]]:
    """A compiler at work, which ends, with the programs that it starts, with the block, and where
    this process is killed. Gives `Made`, which may wait."""
    command, generator = c_compiler(), ca.CodeGenerator("throw")
    for function in functions.values():
        generator.add(function)
    source = str(generator.dump())
    if command is None or len(source) > LARGEST:
        yield lambda wait=False: False
        return
    with scratch_folder(target.parent) as scratch:
        code, library = scratch / "code.c", scratch / target.name
        code.write_text(source, encoding="utf-8")
        order = [command, *FLAGS, "-o", str(library), str(code), "-lm"]
        if os.name == "posix":
            order = ["sh", "-c", SUPERVISED, "idle" if idle else "now", *order]
        # A compiler that is ended leaves its own temporary files.
        own = os.environ | dict.fromkeys(("TMPDIR", "TMP", "TEMP"), str(scratch))
        none = subprocess.DEVNULL
        process = subprocess.Popen(
            order, stdin=subprocess.PIPE, stdout=none, stderr=none, env=own, start_new_session=True
        )
        assert process.stdin is not None

        def made(wait: bool = False) -> bool | None:
            if (process.wait() if wait else process.poll()) is None:
                return None
            with suppress(OSError):
                # What stands behind its end does not matter to a library.
                if process.returncode == 0:
                    return keep(target.parent, target.name, library.read_bytes())
            return False

        with process:
            try:
                yield made
            finally:
                process.stdin.close()
                if os.name != "posix":
                    process.kill()
