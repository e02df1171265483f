"""Files: reading with errors that name file, line and value; writing completely or not at all."""

from __future__ import annotations

import contextlib
import csv
import json
import math
import os
import re
import stat
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np

from ..interrupts import interrupts_deferred, scratch_folder
from ..models import Array
from .checks import LARGEST, InputError, within

#: Largest magnitude and unit of a number in a CSV file, by its column; clocks may count from 1970.
COLUMNS = {
    column: (LARGEST[unit], unit)
    for unit, columns in {
        "m": ("x", "z", "width", "grasp_offset"),
        "rad": ("theta", "q", "sent"),
        "degrees": ("grasp_angle_deg",),
        "m/s": ("vx", "vz"),
        "rad/s": ("omega", "dq"),
        "m/s²": ("ax", "az"),
        "rad/s²": ("alpha", "ddq"),
        "N": ("f_N",),
    }.items()
    for column in columns
}
COLUMNS |= dict.fromkeys(("t", "command", "since_command"), (1e10, "s")) | {"gripper": (1.0, "")}
#: A number with a decimal comma.
DECIMAL_COMMA = re.compile(r"^([-+]?\d*),(\d+(?:[eE][-+]?\d+)?)$")

#: The package whose files are shipped.
HOME = "throwplan.problems"
#: What an unknown name of a shipped file is, by its folder.
UNKNOWN = {"scenes": "no scene '{}'", "arms": "unknown robot", "grippers": "unknown gripper"}


def read_text(path: Path) -> str:
    """The text of a regular file of at most 200 MB; InputError naming it."""
    try:
        known = path.stat()
        if not (stat.S_ISREG(known.st_mode) or stat.S_ISDIR(known.st_mode)):
            raise InputError(f"{path}: is no regular file")
        if known.st_size > 200_000_000:
            raise InputError(f"{path}: must be at most 200 MB")
        # Spreadsheets write a byte-order mark; it is no part of the first column.
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "is not a text file"
        raise InputError(f"{path}: {reason}") from None


def read_json(path: Path) -> Any:
    """The value in a JSON file; InputError naming it for other text, as of `read_text`."""
    text = read_text(path)
    try:
        return json.loads(text)
    except RecursionError:
        raise InputError(f"{path}: is not JSON: nested too deep") from None
    except ValueError as error:
        place = f" (line {error.lineno})" if isinstance(error, json.JSONDecodeError) else ""
        raise InputError(f"{path}: is not JSON{place}") from None


def shipped(kind: str, package: str = HOME) -> dict[str, Traversable]:
    """The TOML files in a package's folder `kind`, by name."""
    entries = sorted((resources.files(package) / kind).iterdir(), key=lambda e: e.name)
    return {e.name.removesuffix(".toml"): e for e in entries if e.name.endswith(".toml")}


def shipped_text(kind: str, name: str, package: str = HOME) -> str:
    """The text of a file of `shipped`; InputError for an unknown name."""
    known = shipped(kind, package)
    if name in known:
        return known[name].read_text(encoding="utf-8")
    hint = InputError.hint(name, known)
    unknown = UNKNOWN.get(kind, f"no {kind} '{{}}'").format(name) + hint
    raise InputError(f"{unknown} (shipped: {', '.join(known)}; or a .toml file)")


def text_of(
    kind: str, source: str, folder: Path | None = None, package: str = HOME
) -> tuple[str, Path | None]:
    """The text of a file of `shipped`, or of a user's, relative to `folder`, and the latter's path.

    InputError for neither.
    """
    path = (folder or Path()) / source
    if source not in shipped(kind, package) and (path.suffix == ".toml" or os.path.exists(path)):
        return read_text(path), path
    return shipped_text(kind, source, package), None


def toml_tables(text: str, place: str) -> dict[str, Any]:
    """TOML as tables; InputError naming `place`."""
    # A text of this length is parsed in a second, unless dotted keys are nested deep.
    if len(text) > 1_000_000:
        raise InputError(f"{place}: must be at most 1 MB")
    too_deep = InputError(f"{place}: broken TOML: tables nested too deep")
    if re.search(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){50}""", text):
        raise too_deep
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise too_deep from None
    except ValueError as error:
        reason = "a number has too many digits" if "digits" in str(error) else error
        raise InputError(f"{place}: broken TOML: {reason}{_toml_hint(text, str(error))}") from None


def _toml_hint(text: str, reason: str) -> str:
    """What the mistake in TOML may be, in words; empty for others than these."""
    twice = re.search(r"Cannot declare \('(\w+)',\) twice", reason)
    if twice and twice[1] == "obstacle":
        return ": for several write [[obstacle]]"
    line = re.search(r"at line (\d+)", reason)
    comma = line and re.search(r"=\s*([-+]?\d+),(\d+)", text.splitlines()[int(line[1]) - 1])
    return f": is it {comma[1]}.{comma[2]}? TOML has decimal points" if comma else ""


def csv_lines(path: Path) -> tuple[list[str], list[tuple[int, list[str]]]]:
    """The first line's cells, and the number and cells of the others that are not empty.

    Cells are parted by commas, semicolons or tabs; the first line says by which. Beside semicolons
    and tabs a number may have a decimal comma.
    """
    text = read_text(path).splitlines()
    separator = max(",;\t", key=text[0].count) if text else ","
    try:
        lines = list(csv.reader(text, delimiter=separator)) or [[]]
    except csv.Error as error:
        raise InputError(f"{path}: {error}") from None
    if separator != ",":
        lines = [[DECIMAL_COMMA.sub(r"\1.\2", cell.strip()) for cell in line] for line in lines]
    rows = [(number, line) for number, line in enumerate(lines[1:], start=2) if line]
    for number, line in rows:
        if any(line[len(lines[0]) :]):  # decimal commas, for example
            raise InputError(f"{path}: line {number} has {len(line)} cells, not {len(lines[0])}")
    return [cell.strip() for cell in lines[0]], rows


def read_csv(key: str, name: str, folder: Path | None, columns: tuple[str, ...]) -> Array:
    """The named columns of a CSV file (K, n); InputError naming file, line, column and value."""
    with within(f"{key} = ", ""):
        header, rows = csv_lines((folder or Path()) / name)
    missing = [column for column in columns if column not in header]
    if missing:
        named = f"{', '.join(columns[:-1])} and {columns[-1]}"
        named += ", parted by commas" if len(header) == 1 else ""
        raise InputError(
            f"{key} = {name}: the first line must name the columns {named} "
            f"({missing[0]} is missing)"
        )
    found = []
    for number, row in rows:
        cells = row + [""] * (len(header) - len(row))
        with within(f"{key} = {name}: line {number}"):
            found.append([table_number(c, cells[header.index(c)]) for c in columns])
    return np.array(found, float).reshape(-1, len(columns))


def table_number(column: str, word: str) -> float:
    """A number in a column of a CSV file; InputError outside the range of throws."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{column} = {word!r}: must be a finite number")
    most, unit = COLUMNS[column.rstrip("0123456789")]  # Joints are numbered.
    if abs(value) > most:
        raise InputError(f"{column} = {value:g}: must be within -{most:g} and {most:g} {unit}")
    return value


def toml_lines(
    table: Mapping[str, Any], meanings: Mapping[str, Mapping[str, str]], place: str = ""
) -> list[str]:
    """A table and those in it as lines of TOML, each key with its meaning as a comment.

    meanings: by the name of the section, then by key; "" is the meaning of the section itself.
    place: name of the table's section, empty at the top.
    """

    def remarked(line: str, remark: str | None) -> str:
        return f"{line} # {remark}" if remark else line

    about, lines, inner = meanings.get(place, {}), list[str](), list[str]()
    for key, value in table.items():
        name = f"{place}.{toml_key(key)}" if place else toml_key(key)
        rows = value if isinstance(value, list) and isinstance((value or [0])[0], dict) else []
        heading = f"[[{name}]]" if rows else f"[{name}]"
        for row in rows or ([value] if isinstance(value, dict) else []):
            said = meanings.get(name, {}).get("")
            inner += ["", remarked(heading, said), *toml_lines(row, meanings, name)]
        if not rows and not isinstance(value, dict):
            # TOML's texts, truths and lists of them are JSON's; repr keeps every digit of a number.
            parts = value if isinstance(value, list | tuple) else [value]
            as_json = any(isinstance(part, str | bool) for part in parts)
            text = json.dumps(value, ensure_ascii=False) if as_json else repr(value)
            lines.append(remarked(f"{toml_key(key)} = {text}", about.get(key)))
    return lines + inner


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
        with interrupts_deferred(), _make_folders(folder), scratch_folder(folder):
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
        for _ in range(10):  # Another process may remove them at this moment.
            with suppress(FileNotFoundError):
                folder.mkdir(parents=True, exist_ok=True)
            if folder.is_dir():
                break
        yield
    finally:
        for path in new:
            with suppress(OSError):
                path.rmdir()


@contextmanager
def filling(folder: Path, names: tuple[str, ...], option: str = "--out") -> Iterator[Path]:
    """A scratch folder for files `names`, which are moved to `folder` together. Ctrl-C waits.

    Files of these names that the block does not write are deleted from `folder`: they belong to an
    earlier result. After an error nothing has changed. A name without a suffix is a folder's, of
    which only files of these names are deleted.
    """
    folder = prepare_folder(folder, tuple(name for name in names if "." in name), option)
    try:
        with interrupts_deferred(), _make_folders(folder), scratch_folder(folder) as scratch:
            yield scratch
            written = {path.name for path in scratch.iterdir()}
            for name in names:
                if (folder / name).is_dir():
                    _empty(folder / name, names)
                if name in written and (folder / name).is_dir():
                    for item in (scratch / name).iterdir():
                        os.replace(item, folder / name / item.name)
                elif name in written:
                    os.replace(scratch / name, folder / name)
                elif not (folder / name).is_dir():
                    (folder / name).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(f"{option} {folder}: {error.strerror or error}") from None


def _empty(folder: Path, names: tuple[str, ...]) -> None:
    """Deletes files of these names from a folder, and the folder if nothing else is in it."""
    for name in names:
        if not (folder / name).is_dir():
            (folder / name).unlink(missing_ok=True)
    with contextlib.suppress(OSError):
        folder.rmdir()


def copy_out(text: str, path: Path, *, force: bool = False) -> None:
    """Writes a text file completely or not at all; InputError if it exists, unless `force`."""
    if path.exists() and not force:
        raise InputError(f"{path}: exists already, not overwritten; --force does it")
    try:
        with scratch_folder(path.parent) as scratch:
            (scratch / path.name).write_text(text, encoding="utf-8")
            os.replace(scratch / path.name, path)
    except OSError as error:
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
