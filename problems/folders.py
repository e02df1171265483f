"""Folders for results, and files in them: whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .errors import InputError


def prepare_folder(folder: Path, names: tuple[str, ...] = ()) -> Path:
    """Make `folder` if need be and make sure it takes files `names`; InputError if not."""
    if str(folder) in ("", "."):
        raise InputError("--out: needs a folder's name")
    if folder.is_file():
        raise InputError(f"--out {folder}: is a file; must be a folder")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror or error}") from None
    for name in names:
        if (folder / name).is_dir():
            raise InputError(f"--out {folder}: {name} is a folder there")
    return folder


@contextmanager
def filling(folder: Path, names: tuple[str, ...]) -> Iterator[Path]:
    """A folder to write files `names` into, which are then moved to `folder` together.

    Of the names, those not written are taken away there: nothing of an earlier result
    stays beside this one. If anything fails, nothing changes.
    """
    folder = prepare_folder(folder, names)
    try:
        with tempfile.TemporaryDirectory(dir=folder) as scratch:
            yield Path(scratch)
            written = {path.name for path in Path(scratch).iterdir()}
            for name in names:
                if name in written:
                    os.replace(Path(scratch) / name, folder / name)
                else:
                    (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"--out {folder}: {error.strerror or error}") from None


def save_text(text: str, folder: Path, name: str) -> None:
    """Write `name` into `folder`, whole or not at all."""
    folder = prepare_folder(folder)
    _replace(text, folder / name, f"--out {folder}")


def copy_out(text: str, path: Path) -> None:
    """Write a text file that is not there yet; InputError otherwise."""
    if path.exists():
        raise InputError(f"{path}: exists already, not overwritten")
    _replace(text, path, str(path))


def _replace(text: str, path: Path, place: str) -> None:
    scratch = path.with_suffix(".part")
    try:
        scratch.write_text(text, encoding="utf-8")
        os.replace(scratch, path)
    except OSError as error:
        scratch.unlink(missing_ok=True)
        raise InputError(f"{place}: {error.strerror or error}") from None
