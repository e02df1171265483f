"""What a report is made of: sections of sentences, tables and pictures, and the page they make.

The page is short: each section gives its main figures, at most one table and its pictures. Every
table is in a CSV file with all its digits; a section that is measured again replaces its own part
of the page, the others stay as they are.
"""

from __future__ import annotations

import csv
import itertools
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

#: One cell: words, a number, or None where there is no value.
Cell = str | float | int | None

TITLE = "throwplan: error against run time, stability, and what a scene leaves out"
HEAD = """Landings are those of models: nothing here is measured on real throws, where the published
error of the sliding pivot is 2.4 cm and 15° (Liu and Billard, the paper). Times belong to the
machine and run that a section names at its end; compare times within one table only. A scaled
error is |Δx| + |Δθ| l/2, with the length l of the object. All random draws have fixed seeds."""
#: The page, which every report has.
PAGE = "index.md"


#: One row of a table: cells by the name of their column, which holds the unit.
Row = dict[str, Cell]


@dataclass(frozen=True)
class ReportTable:
    """Rows of named cells.

    name: stem of the CSV file; caption: what the table holds, in a few words; short: the page
    shows it, with `digits` significant digits of a float.
    """

    name: str
    caption: str
    rows: Sequence[Row]
    short: bool = False
    digits: int = 3

    @property
    def columns(self) -> list[str]:
        """The names of all cells, in the order in which they come first."""
        return list(dict.fromkeys(name for row in self.rows for name in row))

    def column(self, name: str) -> list[Cell]:
        """The cells under a name."""
        return [row.get(name) for row in self.rows]

    def where(self, **cells: Cell) -> list[Row]:
        """The rows that hold these cells."""
        return [row for row in self.rows if cells.items() <= row.items()]

    def write(self, folder: Path) -> None:
        """The CSV file; None is an empty cell."""
        with (folder / f"{self.name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, self.columns)
            writer.writeheader()
            writer.writerows(self.rows)

    def markdown(self) -> list[str]:
        """The lines of a Markdown table; columns of numbers are aligned to the right."""
        columns = self.columns
        words = [any(isinstance(cell, str) for cell in self.column(name)) for name in columns]
        align = ["---" if word else "---:" for word in words]
        cells = [
            [shown(row.get(name), self.digits).replace("|", "\\|") for name in columns]
            for row in self.rows
        ]
        return ["| " + " | ".join(row) + " |" for row in (columns, align, *cells)]


def shown(cell: Cell, digits: int = 3) -> str:
    """A cell as the page shows it: a float with so many digits, or all those before the point."""
    if cell is None or (isinstance(cell, float) and math.isnan(cell)):
        return "–"
    if isinstance(cell, float):
        return f"{cell:.0f}" if round(abs(cell)) >= 10**digits else f"{cell:.{digits}g}"
    return str(cell)


@dataclass(frozen=True)
class Picture:
    """A figure: `draw` writes the PNG file that it is given; name: its stem."""

    name: str
    caption: str
    draw: Callable[[Path], None]

    def write(self, folder: Path) -> None:
        """The PNG file, reduced to 256 colours, which makes it three times smaller."""
        from PIL import Image

        path = folder / f"{self.name}.png"
        self.draw(path)
        with Image.open(path) as drawn:
            reduced = drawn.convert("RGB").quantize(256, dither=Image.Dither.NONE)
        reduced.save(path, optimize=True)


@dataclass
class ReportSection:
    """One chapter. key: what `--only` calls it; seconds: the time it took to measure.

    figures: sentences with the main results; made: machine, versions and date.
    """

    key: str
    title: str
    figures: list[str] = field(default_factory=list)
    tables: list[ReportTable] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    seconds: float = math.nan
    made: str = ""

    @property
    def files(self) -> tuple[str, ...]:
        """Names of its tables' and pictures' files."""
        return (
            *(f"{table.name}.csv" for table in self.tables),
            *(f"{picture.name}.png" for picture in self.pictures),
        )

    def write(self, folder: Path) -> None:
        """The tables and the pictures."""
        for table in self.tables:
            table.write(folder)
        for picture in self.pictures:
            picture.write(folder)

    def markdown(self) -> str:
        """Its part of the page."""
        lines = [_anchor(self.key), "", f"## {self.title}", ""]
        lines += [f"- {figure}" for figure in self.figures]
        for table in self.tables:
            if table.short:
                lines += ["", f"{table.caption}:", "", *table.markdown()]
        if self.pictures:
            lines.append("")
            lines += [
                f'<img src="{picture.name}.png" width="560" alt="{picture.caption}">'
                for picture in self.pictures
            ]
        links = [f"[{table.caption}]({table.name}.csv)" for table in self.tables]
        command = f"`throwplan report --only {self.key}`"
        lines += ["", f"Tables: {'; '.join(links)}.", ""]
        lines += [f"{command}: {self.seconds:.0f} s, {self.made}", ""]
        return "\n".join(lines)


def write_page(folder: Path, parts: dict[str, str], order: Sequence[str]) -> None:
    """The page of the sections' parts, by key, in that order."""
    known = [parts[key] for key in order if key in parts]
    (folder / PAGE).write_text("\n".join([f"# {TITLE}", "", HEAD, "", *known]), encoding="utf-8")


def parts_of(folder: Path) -> dict[str, str]:
    """The parts of a page that is there, by section; none where there is no page."""
    try:
        text = (folder / PAGE).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return {}
    pieces = re.split(r'^(<a id="\w+"></a>)$', text, flags=re.MULTILINE)
    keys = [piece[len('<a id="') : -len('"></a>')] for piece in pieces[1::2]]
    return {
        key: f"{_anchor(key)}{text.rstrip()}\n"
        for key, text in zip(keys, pieces[2::2], strict=True)
    }


def _anchor(key: str) -> str:
    return f'<a id="{key}"></a>'


@dataclass(frozen=True)
class Effort:
    """How much is measured: `quick` for a first look, full for figures to rely on.

    progress: called with (done, total) of the section's own steps.
    """

    quick: bool = False
    progress: Callable[[int, int], None] | None = None

    def of(self, quick: int, full: int) -> int:
        """One of two sizes."""
        return quick if self.quick else full

    def counter(self, total: int) -> Callable[[], None]:
        """What a section calls after each of its `total` steps."""
        steps = itertools.count(1)

        def step() -> None:
            if self.progress is not None:
                self.progress(next(steps), total)

        return step
