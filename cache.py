"""A folder for what is costly to make and easy to make again: compiled functions, tables.

Entries are named by a hash of all that they depend on. They are written whole, by renaming, so that
processes may share the folder; whoever finds one that is damaged, or that another user could have
written, makes it again. Losing the folder costs time only.
"""

from __future__ import annotations

import hashlib
import os
import stat
from pathlib import Path

from .interrupts import scratch_folder

#: Characters of a sum.
SUM = 24


def cache_folder() -> Path | None:
    """THROWPLAN_CACHE, or `throwplan` in the user's cache folder; None if not to be had.

    An empty THROWPLAN_CACHE turns the cache off.
    """
    given = os.environ.get("THROWPLAN_CACHE")
    if given == "":
        return None
    try:
        usual = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(given) if given else Path(usual) / "throwplan"
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        return None
    return folder


def digest(*parts: str | bytes) -> str:
    """A name for what is made from `parts`."""
    total = hashlib.sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        total.update(len(data).to_bytes(8, "little") + data)
    return total.hexdigest()[:SUM]


def publish(folder: Path, name: str, data: bytes) -> bool:
    """Whether entry `name` could be written."""
    try:
        with scratch_folder(folder) as scratch:
            path = scratch / name
            path.write_bytes(data)
            path.chmod(0o600)
            os.replace(path, folder / name)
    except OSError:
        return False
    return True


def keep(folder: Path, name: str, data: bytes) -> bool:
    """Whether entry `name` could be written, for `kept` to read: `data`, then a sum of both."""
    return publish(folder, name, data + digest(name, data).encode())


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
