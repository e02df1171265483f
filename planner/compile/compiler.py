"""C source to a shared library, where a C compiler is there; kept in the cache folder.

python -m throwplan.planner.compile.compiler NAME FLAG...    compiles NAME.c in that folder
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import tempfile
import time
from functools import cache
from pathlib import Path

from .cache import cache_folder, digest, publish

#: Longest time [s] that a compilation may take before it is given up.
PATIENCE = 300.0


@cache
def compiler() -> str | None:
    """The C compiler (CC, or cc, gcc, clang), None where there is none or
    THROWPLAN_COMPILE is 0."""
    if os.environ.get("THROWPLAN_COMPILE") == "0":
        return None
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        path = shutil.which(name) if name else None
        if path is not None:
            return path
    return None


def shared_library(
    source: str, flags: tuple[str, ...] = ("-O2",), *, wait: bool = True
) -> Path | None:
    """The compiled `source`, from the cache if it is there and sound.

    wait: whether to compile here and now what is not there; otherwise a process of its
    own is started for that and None returned. None too where there is no compiler, no
    cache folder, or the compilation fails: callers go on without. `flags` may hold
    -march=native, so the machine is part of the name.
    """
    path = library_path(source, flags)
    if path is None or sound(path):
        return path
    folder, name = path.parent, path.stem
    if wait:
        return path if _compile(folder, name, flags, source) and sound(path) else None
    if publish(folder, f"{name}.c", lambda to: _write(to, source)) is not None:
        _start(folder, name, flags)
    return None


def library_path(source: str, flags: tuple[str, ...] = ("-O2",)) -> Path | None:
    """Where the compiled `source` is or will be; None without compiler or cache folder."""
    command, folder = compiler(), cache_folder()
    if command is None or folder is None:
        return None
    return folder / f"{digest(source, *flags, _version(command), _machine())}.so"


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


#: Processes at work; they go on when this one ends.
_started: list[subprocess.Popen[bytes]] = []
# Any later they would tell the user that they are still running: the filters are gone by then.
atexit.register(_started.clear)


def _start(folder: Path, name: str, flags: tuple[str, ...]) -> None:
    """A process that compiles and outlives this one, unless one is at work already."""
    mark = folder / f"{name}.busy"
    try:
        if mark.exists() and time.time() - mark.stat().st_mtime < PATIENCE:
            return
        mark.touch()
        _started[:] = [process for process in _started if process.poll() is None]
        process = subprocess.Popen(
            [sys.executable, "-m", "throwplan.planner.compile.compiler", name, *flags],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        _started.append(process)
    except OSError:
        return


def _compile(folder: Path, name: str, flags: tuple[str, ...], source: str) -> bool:
    """Makes NAME.so, and NAME.sum that tells a damaged library from a sound one."""
    command = compiler()
    if command is None:
        return False
    output = f"{name}.so"
    try:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            made, code = Path(scratch) / output, Path(scratch) / f"{name}.c"
            _write(code, source)
            order = [command, *flags, "-fPIC", "-shared", "-o", str(made), str(code), "-lm"]
            done = subprocess.run(
                order,
                capture_output=True,
                timeout=PATIENCE,
                check=False,
                stdin=subprocess.DEVNULL,
            )
            if done.returncode != 0:
                return False
            total = hashlib.sha256(made.read_bytes()).hexdigest()
            publish(folder, f"{name}.sum", lambda to: _write(to, total))
            os.replace(made, folder / output)
    except (OSError, subprocess.TimeoutExpired):
        return False
    finally:
        (folder / f"{name}.busy").unlink(missing_ok=True)
    return True


def sound(path: Path) -> bool:
    """Whether the library is as it was made, and loads."""
    try:
        total = path.with_suffix(".sum").read_text(encoding="utf-8")
        if hashlib.sha256(path.read_bytes()).hexdigest() != total:
            return False
        ctypes.CDLL(str(path))
    except (OSError, ValueError):
        return False
    return True


@cache
def _version(command: str) -> str:
    try:
        done = subprocess.run([command, "--version"], capture_output=True, timeout=20, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return command
    return command + done.stdout.decode(errors="replace").split("\n")[0]


@cache
def _machine() -> str:
    """What -march=native depends on, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        kind = sorted({line for line in lines if line.startswith(("model name", "flags"))})
    except OSError:
        kind = [platform.processor()]
    return platform.machine() + "".join(kind)


if __name__ == "__main__":
    os.nice(10)  # those who plan meanwhile come first
    home = cache_folder()
    if home is not None:
        given = home / f"{sys.argv[1]}.c"
        _compile(home, sys.argv[1], tuple(sys.argv[2:]), given.read_text(encoding="utf-8"))
        given.unlink(missing_ok=True)
