"""C source to a shared library, where a C compiler is there; kept in the cache folder."""

from __future__ import annotations

import ctypes
import os
import platform
import shutil
import subprocess
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


def shared_library(source: str, flags: tuple[str, ...] = ("-O2",)) -> Path | None:
    """The compiled `source`, from the cache if it is there and sound.

    None where there is no compiler, no cache folder, or the compilation fails: callers
    go on without. `flags` may hold -march=native, so the machine is part of the name.
    """
    path, made = library_path(source, flags), None
    if path is None:
        return None
    if path.exists() and _loads(path):
        return path
    command, folder = compiler(), path.parent
    assert command is not None

    def write(target: Path) -> None:
        code = target.with_suffix(".c")
        code.write_text(source, encoding="utf-8")
        order = [command, *flags, "-fPIC", "-shared", "-o", str(target), str(code), "-lm"]
        done = subprocess.run(
            order, capture_output=True, timeout=PATIENCE, check=False, stdin=subprocess.DEVNULL
        )
        if done.returncode != 0:
            raise OSError(done.stderr.decode(errors="replace")[:200])

    try:
        made = publish(folder, path.name, write)
    except subprocess.TimeoutExpired:
        return None
    return made if made is not None and _loads(made) else None


def library_path(source: str, flags: tuple[str, ...] = ("-O2",)) -> Path | None:
    """Where the compiled `source` is or would be; None without compiler or cache folder."""
    command, folder = compiler(), cache_folder()
    if command is None or folder is None:
        return None
    return folder / f"{digest(source, *flags, _version(command), _machine())}.so"


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


def _loads(path: Path) -> bool:
    """Whether the file is a library; a truncated one is not."""
    try:
        ctypes.CDLL(str(path))
    except OSError:
        return False
    return True
