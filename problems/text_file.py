"""Text files that users write: TOML tables and columns of numbers."""

from __future__ import annotations

import csv
import math
import tomllib
from pathlib import Path
from typing import Any

from .errors import InputError


def read_text(path: Path) -> str:
    """The text of a file; InputError naming it."""
    try:
        # A byte-order mark, as spreadsheets write it, is no part of the first column.
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "is not a text file"
        raise InputError(f"{path}: {reason}") from None


def toml_tables(text: str, place: str) -> dict[str, Any]:
    """TOML as tables; InputError naming `place`."""
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        # Beside broken syntax: numbers too long to read, tables nested too deep.
        raise InputError(f"{place}: broken TOML: {error}") from None


def read_csv(
    key: str, name: str, folder: Path | None, columns: tuple[str, ...]
) -> list[list[float]]:
    """The named columns of a CSV file, row by row; InputError naming file and line."""
    try:
        rows = list(csv.reader(read_text((folder or Path()) / name).splitlines()))
    except (InputError, csv.Error) as error:
        raise InputError(f"{key} = {error}") from None
    header = [cell.strip() for cell in rows[0]] if rows else []
    missing = [column for column in columns if column not in header]
    if missing:
        named = f"{', '.join(columns[:-1])} and {columns[-1]}"
        raise InputError(
            f"{key} = {name}: the first line must name the columns {named} "
            f"({missing[0]} is missing)"
        )
    at = [header.index(column) for column in columns]
    found = []
    for number, row in enumerate(rows[1:], start=2):
        if not row:
            continue
        try:
            values = [float(row[i]) for i in at]
        except (ValueError, IndexError):
            raise InputError(f"{key} = {name}: line {number} is not {len(at)} numbers") from None
        if not all(map(math.isfinite, values)):
            raise InputError(f"{key} = {name}: line {number} has a value that is not finite")
        found.append(values)
    return found
