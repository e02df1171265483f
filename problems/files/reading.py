"""Reading the files of users, with errors that name file, line and value."""

from __future__ import annotations

import csv
import math
import re
import stat
import tomllib
from importlib import resources
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

import numpy as np

from ...models import Array
from ..section import LARGEST, InputError

#: Largest readable file [bytes].
MOST_BYTES = 200_000_000
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
} | dict.fromkeys(("t", "command", "since_command"), (1e10, "s"))
#: Longest TOML text [characters], parsed in a second. `DEEP`: dotted keys that take longer.
LARGEST_TOML = 1_000_000
DEEP = re.compile(r"""(?<![\w-])(?:(?:[\w-]+|"[^"\n]*"|'[^'\n]*')[ \t]*\.[ \t]*){50}""")


def read_text(path: Path) -> str:
    """The text of a regular file of at most MOST_BYTES; InputError naming it."""
    try:
        known = path.stat()
        if not (stat.S_ISREG(known.st_mode) or stat.S_ISDIR(known.st_mode)):
            raise InputError(f"{path}: is no regular file")
        if known.st_size > MOST_BYTES:
            raise InputError(f"{path}: must be at most {MOST_BYTES / 1e6:g} MB")
        # Spreadsheets write a byte-order mark; it is no part of the first column.
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except InputError:
        raise
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "is not a text file"
        raise InputError(f"{path}: {reason}") from None


def shipped(kind: str) -> dict[str, Traversable]:
    """The TOML files in the package's folder `kind`, by name."""
    entries = sorted((resources.files("throwplan.problems") / kind).iterdir(), key=lambda e: e.name)
    return {e.name.removesuffix(".toml"): e for e in entries if e.name.endswith(".toml")}


def toml_tables(text: str, place: str) -> dict[str, Any]:
    """TOML as tables; InputError naming `place`."""
    if len(text) > LARGEST_TOML:
        raise InputError(f"{place}: must be at most {LARGEST_TOML / 1e6:g} MB")
    if DEEP.search(text):
        raise InputError(f"{place}: broken TOML: tables nested too deep")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise InputError(f"{place}: broken TOML: tables nested too deep") from None
    except ValueError as error:
        reason = "a number has too many digits" if "digits" in str(error) else error
        raise InputError(f"{place}: broken TOML: {reason}") from None


def read_csv(key: str, name: str, folder: Path | None, columns: tuple[str, ...]) -> Array:
    """The named columns of a CSV file (K, n); InputError naming file, line, column and value."""
    try:
        rows = list(csv.reader(read_text((folder or Path()) / name).splitlines()))
    except (InputError, csv.Error) as error:
        raise InputError(f"{key} = {error}") from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    missing = [column for column in columns if column not in header]
    if missing:
        named = f"{', '.join(columns[:-1])} and {columns[-1]}"
        named += ", parted by commas" if len(header) == 1 else ""
        raise InputError(
            f"{key} = {name}: the first line must name the columns {named} "
            f"({missing[0]} is missing)"
        )
    at, most = (
        [header.index(column) for column in columns],
        [_allowed(column)[0] for column in columns],
    )
    found = []
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        try:
            values = [float(row[i]) for i in at]
            right = all(-limit <= value <= limit for value, limit in zip(values, most, strict=True))
        except (ValueError, IndexError):
            right = False
        if not right:
            try:
                cells = row + [""] * (max(at) + 1 - len(row))
                values = [table_number(c, cells[i]) for c, i in zip(columns, at, strict=True)]
            except InputError as error:
                raise error.within(f"{key} = {name}: line {number}") from None
        found.append(values)
    return np.array(found, float).reshape(-1, len(columns))


def _allowed(column: str) -> tuple[float, str]:
    return COLUMNS[column.rstrip("0123456789")]  # Joints are numbered.


def table_number(column: str, word: str) -> float:
    """A number in a column of a CSV file; InputError outside the range of throws."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"{column} = {word!r}: must be a finite number")
    most, unit = _allowed(column)
    if abs(value) > most:
        raise InputError(f"{column} = {value:g}: must be within -{most:g} and {most:g} {unit}")
    return value
