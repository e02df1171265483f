"""What a report is made of: sections of words, tables and pictures, and where they are written.

A table is shown with few digits and kept whole in a CSV file; a picture is drawn into a PNG.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

#: One cell: words, a number, or None for what is not there.
Cell = str | float | int | None


@dataclass(frozen=True)
class Table:
    """Rows under named columns, with units in the names.

    name: stem of the CSV file, unique in the report; caption: what is to be seen, one
    sentence; digits: significant ones shown of a float.
    """

    name: str
    caption: str
    columns: Sequence[str]
    rows: Sequence[Sequence[Cell]]
    digits: int = 3

    def write(self, folder: Path) -> None:
        """The CSV file, all digits, empty where there is nothing."""
        with (folder / f"{self.name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(self.columns)
            writer.writerows([["" if c is None else c for c in row] for row in self.rows])

    def shown(self, cell: Cell) -> str:
        """A cell as it is read."""
        if cell is None or (isinstance(cell, float) and math.isnan(cell)):
            return "–"
        if isinstance(cell, float):
            whole = round(abs(cell)) >= 10**self.digits
            return f"{cell:.0f}" if whole else f"{cell:.{self.digits}g}"
        return str(cell)


@dataclass(frozen=True)
class Picture:
    """A figure: `draw` writes the PNG file it is given; name: its stem."""

    name: str
    caption: str
    draw: Callable[[Path], None]

    def write(self, folder: Path) -> None:
        """The PNG file."""
        self.draw(folder / f"{self.name}.png")


#: A paragraph, a table or a picture.
Part = str | Table | Picture


@dataclass
class Section:
    """One chapter. key: what `--only` calls it; seconds: how long it took to make; made: when,
    where and by what command, in words."""

    key: str
    title: str
    parts: list[Part] = field(default_factory=list)
    seconds: float = math.nan
    made: str = ""

    def add(self, *parts: Part) -> None:
        """More of it."""
        self.parts += parts


@dataclass(frozen=True)
class Effort:
    """How much is measured: `quick` for a look, full for figures to believe.

    progress: told (done, total) of the section's own steps.
    """

    quick: bool = False
    progress: Callable[[int, int], None] | None = None

    def of(self, quick: int, full: int) -> int:
        """One of two sizes."""
        return quick if self.quick else full

    def tell(self, done: int, total: int) -> None:
        """Report progress."""
        if self.progress is not None:
            self.progress(done, total)
