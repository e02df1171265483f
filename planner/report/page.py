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


def shown(cell: Cell, digits: int = 2) -> str:
    """A cell as it is read, with so many significant digits of a float, or all before the point."""
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, float):
        whole = round(abs(cell)) >= 10**digits
        return f"{cell:.0f}" if whole else f"{cell:.{digits}g}"
    return str(cell)


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
        return shown(cell, self.digits)


@dataclass(frozen=True)
class Picture:
    """A figure: `draw` writes the PNG file it is given; name: its stem.

    data: what is drawn, where no table of the report has it; in a CSV file only.
    """

    name: str
    caption: str
    draw: Callable[[Path], None]
    data: Table | None = None

    def write(self, folder: Path) -> None:
        """The PNG file, in 256 colours: a third of the size, hardly another picture; its data."""
        from PIL import Image

        path = folder / f"{self.name}.png"
        self.draw(path)
        with Image.open(path) as drawn:
            few = drawn.convert("RGB").quantize(256, dither=Image.Dither.NONE)
        few.save(path, optimize=True)
        if self.data is not None:
            self.data.write(folder)


#: A paragraph, a table or a picture.
Part = str | Table | Picture


def files_of(part: Part) -> list[str]:
    """Names of the files that a part is written into."""
    if isinstance(part, Table):
        return [f"{part.name}.csv"]
    if isinstance(part, Picture):
        return [f"{part.name}.png", *(() if part.data is None else files_of(part.data))]
    return []


@dataclass
class Section:
    """One chapter. key: what `--only` calls it; seconds: how long it took to make; made: when,
    where and by what command, in words; short: what to take from it, for the page's top."""

    key: str
    title: str
    parts: list[Part] = field(default_factory=list)
    seconds: float = math.nan
    made: str = ""
    short: list[str] = field(default_factory=list)

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
