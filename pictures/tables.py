"""Tables of named cells: CSV files with all digits, and Markdown."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

#: One cell: text, a number, a mean with deviation or interval, or None if empty.
Cell = str | float | int | tuple[float, ...] | None
#: One row of a table: cells by the name of their column, which holds the unit.
Row = dict[str, Cell]
#: Suffixes of the CSV columns of a cell with one, two or three numbers.
ENDS = {1: ("",), 2: ("", " std"), 3: ("", " low", " high")}


@dataclass(frozen=True)
class Table:
    """Rows of named cells.

    name: stem of the CSV file; caption: contents of the table; digits:
    significant digits of a float.
    """

    name: str
    caption: str
    rows: Sequence[Row]
    digits: int = 3

    @property
    def columns(self) -> list[str]:
        """The names of all cells, in order of first occurrence."""
        return list(dict.fromkeys(name for row in self.rows for name in row))

    def column(self, name: str) -> list[Cell]:
        """The cells under a name."""
        return [row.get(name) for row in self.rows]

    def where(self, **cells: Cell) -> list[Row]:
        """The rows with these cells."""
        return [row for row in self.rows if cells.items() <= row.items()]

    def write(self, folder: Path) -> None:
        """Write the CSV file; None is an empty cell, deviations and intervals are columns."""
        columns = list[list[Cell]]()
        for name in self.columns:
            cells = [c if isinstance(c, tuple) else (c,) for c in self.column(name)]
            for k, end in enumerate(ENDS[max(map(len, cells))]):
                columns.append([name + end, *(c[k] if k < len(c) else None for c in cells)])
        with (folder / f"{self.name}.csv").open("w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows(zip(*columns, strict=True))

    def markdown(self) -> list[str]:
        """The lines of a Markdown table; columns of numbers are aligned to the right."""
        columns = self.columns
        text = [any(isinstance(cell, str) for cell in self.column(name)) for name in columns]
        lines = [columns]
        for row in self.rows:
            lines.append([shown(row.get(c), self.digits).replace("|", "\\|") for c in columns])
        widths = [max(3, *map(len, cells)) for cells in zip(*lines, strict=True)]
        rule = ["-" * n if t else "-" * (n - 1) + ":" for t, n in zip(text, widths, strict=True)]
        lines.insert(1, rule)
        rows = (
            [c.ljust(n) if t else c.rjust(n) for c, t, n in zip(line, text, widths, strict=True)]
            for line in lines
        )
        return ["| " + " | ".join(row) + " |" for row in rows]


def shown(cell: Cell, digits: int = 3) -> str:
    """A cell as text: floats with `digits` significant digits, or all before the point."""
    if isinstance(cell, tuple):
        parts = [shown(number, digits) for number in cell]
        return f"{parts[0]} ({parts[1]} to {parts[2]})" if len(parts) == 3 else " ± ".join(parts)
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, float) and math.isfinite(cell):
        return f"{cell:.0f}" if round(abs(cell)) >= 10**digits else f"{cell:.{digits}g}"
    return str(cell)
