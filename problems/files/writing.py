"""Writing files: complete, or not at all."""

from __future__ import annotations

import json
import math
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..section import InputError


def toml_lines(
    table: Mapping[str, Any], meanings: Mapping[str, Mapping[str, str]], place: str = ""
) -> list[str]:
    """A table and those in it as lines of TOML, each key with its meaning as a comment.

    meanings: by the name of the section, then by key; "" is the meaning of the section itself.
    place: name of the table's section, empty at the top.
    """
    about, lines, inner = meanings.get(place, {}), list[str](), list[str]()
    for key, value in table.items():
        name = f"{place}.{toml_key(key)}" if place else toml_key(key)
        rows = value if isinstance(value, list) and isinstance((value or [0])[0], dict) else []
        heading = f"[[{name}]]" if rows else f"[{name}]"
        for row in rows or ([value] if isinstance(value, dict) else []):
            said = meanings.get(name, {}).get("")
            inner += ["", _remarked(heading, said), *toml_lines(row, meanings, name)]
        if not rows and not isinstance(value, dict):
            # TOML's texts have JSON's escapes; repr keeps every digit of a number.
            text = json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
            lines.append(_remarked(f"{toml_key(key)} = {text}", about.get(key)))
    return lines + inner


def _remarked(line: str, remark: str | None) -> str:
    return f"{line} # {remark}" if remark else line


def toml_key(name: str) -> str:
    """A key of TOML, quoted if need be."""
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else json.dumps(name, ensure_ascii=False)


def prepare_folder(folder: Path, names: tuple[str, ...] = (), option: str = "--out") -> Path:
    """Checks that `folder` exists or can be made and accepts files `names`; InputError if not.

    option: the option for the folder on the command line, for messages.
    """
    if str(folder) in ("", "."):
        raise InputError(f"{option}: needs a folder's name")
    try:
        if folder.is_file():
            raise InputError(f"{option} {folder}: is a file; must be a folder")
        with _make_folders(folder), tempfile.TemporaryFile(dir=folder):
            pass
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise InputError(f"{option} {folder}: {reason}") from None
    for name in names:
        if (folder / name).is_dir():
            raise InputError(f"{option} {folder}: {name} is a folder there")
    return folder


@contextmanager
def _make_folders(folder: Path) -> Iterator[None]:
    """Makes `folder` and its parents; removes new ones afterwards if they are empty."""
    new = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    finally:
        for path in new:
            with suppress(OSError):
                path.rmdir()


@contextmanager
def filling(folder: Path, names: tuple[str, ...], option: str = "--out") -> Iterator[Path]:
    """A scratch folder for files `names`, which are moved to `folder` together.

    Files of these names that the block does not write are deleted from `folder`: they belong to an
    earlier result. After an error nothing has changed. A name without a suffix is a folder's.
    """
    folder = prepare_folder(folder, tuple(name for name in names if "." in name), option)
    try:
        with _make_folders(folder), tempfile.TemporaryDirectory(dir=folder) as scratch:
            yield Path(scratch)
            written = {path.name for path in Path(scratch).iterdir()}
            for name in names:
                if (folder / name).is_dir():
                    shutil.rmtree(folder / name)
                if name in written:
                    os.replace(Path(scratch) / name, folder / name)
                else:
                    (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{option} {folder}: {error.strerror or error}") from None


def copy_out(text: str, path: Path, *, force: bool = False) -> None:
    """Writes a text file completely or not at all; InputError if it exists, unless `force`."""
    if path.exists() and not force:
        raise InputError(f"{path}: exists already, not overwritten; --force does it")
    scratch = path.with_suffix(".part")
    try:
        scratch.write_text(text, encoding="utf-8")
        os.replace(scratch, path)
    except OSError as error:
        scratch.unlink(missing_ok=True)
        raise InputError(f"{path}: {error.strerror or error}") from None


def plain(value: Any) -> Any:
    """A value in the types of JSON; None for a number that is not finite."""
    if isinstance(value, Mapping):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def write_json(path: Path, value: Any) -> None:
    """Write a value that `plain` has made."""
    text = json.dumps(value, indent=2, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
