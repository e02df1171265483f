"""A folder for what is costly to make and easy to make again: compiled functions, tables.

Entries are named by a hash of all that they depend on. They are written whole, by renaming, so that
processes may share the folder; whoever finds one that is damaged, or that another user could have
written, makes it again. Losing the folder costs time only.
"""

from __future__ import annotations

import functools
import hashlib
import os
import secrets
import shutil
import stat
import sys
import time
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

#: Characters of a sum.
SUM = 24
#: What reading a damaged NPZ file may raise.
DAMAGED = (
    *(OSError, ValueError, KeyError, IndexError, TypeError, EOFError, RuntimeError),
    *(zipfile.BadZipFile, zlib.error, SyntaxError, tokenize.TokenError),
)


def cache_folder() -> Path | None:
    """THROWPLAN_CACHE, or `throwplan` in the user's cache folder; None if not to be had.

    An empty THROWPLAN_CACHE turns the cache off.
    """
    given = os.environ.get("THROWPLAN_CACHE")
    if given == "":
        return None
    usual = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    folder = Path(given) if given else Path(usual) / "throwplan"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        with scratch_folder(folder):
            pass
        _delete_abandoned(folder)
    except (OSError, RuntimeError):
        return None
    return folder


@functools.cache
def _delete_abandoned(folder: Path) -> None:
    """Deletes what killed processes left more than a day ago; once in this process."""
    for scratch in (*folder.glob("tmp-*"), *folder.glob("*/tmp-*")):
        with suppress(OSError):
            if time.time() - scratch.stat().st_mtime > 86_400:
                shutil.rmtree(scratch, ignore_errors=True)


@contextmanager
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


def digest(*parts: str | bytes) -> str:
    """A name for what is made from `parts`."""
    total = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        total.update(len(data).to_bytes(8, "little") + data)
    return total.hexdigest()[:SUM]


def source_of(*makers: object) -> bytes:
    """The code of the modules that define `makers`, so that a change of it makes a new entry."""
    names = dict.fromkeys(str(maker.__module__) for maker in makers)
    return b"".join(Path(str(sys.modules[name].__file__)).read_bytes() for name in names)


def publish(folder: Path, name: str, write: Callable[[Path], object]) -> Path | None:
    """Entry `name`, made by `write(path)` beside it and then renamed; None if that fails."""
    target = folder / name
    try:
        with scratch_folder(folder) as scratch:
            path = scratch / name
            write(path)
            os.replace(path, target)
    except OSError:
        return None
    return target


def keep(folder: Path, name: str, data: bytes) -> bool:
    """Whether entry `name` could be written, for `kept` to read: `data`, then a sum of both."""

    def write(path: Path) -> None:
        path.write_bytes(data + digest(name, data).encode())
        path.chmod(0o600)

    return publish(folder, name, write) is not None


def kept(path: Path) -> bytes | None:
    """The data of an entry; None unless it is as `keep` wrote it."""
    try:
        if not only_ours(path):
            return None
        whole = path.read_bytes()
    except OSError:
        return None
    data, total = whole[:-SUM], whole[-SUM:]
    return data if digest(path.name, data).encode() == total else None


def only_ours(path: Path) -> bool:
    """Whether it is a file or folder, no pipe or device, that this user alone can write.

    Windows knows no such bits: all that one may write has them. Profiles there are the user's own.
    """
    known = path.stat()
    shared = stat.S_IWGRP | stat.S_IWOTH
    own = os.name != "posix" or (known.st_uid == os.getuid() and not known.st_mode & shared)
    return own and (stat.S_ISREG(known.st_mode) or stat.S_ISDIR(known.st_mode))
