"""A table whose numbers may carry a spread: as text, Markdown and CSV."""

from __future__ import annotations

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Spread:
    """A mean with a standard deviation, or with an interval's ends; best: the lowest of
    its column."""

    mean: float
    std: float | None = None
    ends: tuple[float, float] | None = None
    best: bool = False

    def shown(self, digits: int, bold: bool = False) -> str:
        """As it is read; the lowest with a star, or bold."""
        if math.isnan(self.mean):
            return "–"
        words = f"{self.mean:.{digits}f}"
        if self.std is not None:
            words += f" ± {self.std:.{digits}f}"
        if self.ends is not None:
            words += f" ({self.ends[0]:.{digits}f} to {self.ends[1]:.{digits}f})"
        if not self.best:
            return words
        return f"**{words}**" if bold else f"{words} *"

    @property
    def cells(self) -> list[float]:
        """As numbers: mean, then std or the two ends."""
        more = [] if self.std is None else [self.std]
        return [self.mean, *more, *(self.ends or ())]

    def more(self, name: str) -> list[str]:
        """Names of the columns after the mean's; empty words for an empty name."""
        ends = ("std",) if self.std is not None else ("low", "high")
        return [f"{name} {end}" if name else "" for end in ends]


#: One cell: words, a number, or a number with its spread.
Cell = str | int | float | Spread | None


@dataclass(frozen=True)
class Table:
    """name: stem of its CSV file; columns with their decimals; rows."""

    name: str
    caption: str
    columns: Sequence[tuple[str, int]]
    rows: Sequence[Sequence[Cell]]

    def _words(self, cell: Cell, digits: int, bold: bool) -> str:
        if _nothing(cell):
            return "–"
        if isinstance(cell, Spread):
            return cell.shown(digits, bold)
        return f"{cell:.{digits}f}" if isinstance(cell, float) else str(cell)

    def words(self, bold: bool = False) -> list[list[str]]:
        """Header and rows as they are read."""
        digits = [digits for _, digits in self.columns]
        rows = [
            [self._words(c, d, bold) for c, d in zip(row, digits, strict=True)] for row in self.rows
        ]
        return [[name for name, _ in self.columns], *rows]

    def text(self) -> str:
        """Columns under each other."""
        words = self.words()
        widths = [max(len(row[i]) for row in words) for i in range(len(self.columns))]
        lines = [self.caption]
        for row in words:
            pairs = zip(row, widths, strict=True)
            cells = [w.ljust(n) if i == 0 else w.rjust(n) for i, (w, n) in enumerate(pairs)]
            lines.append("  " + "  ".join(cells).rstrip())
        return "\n".join(lines)

    def markdown(self) -> str:
        """The same for a page; the lowest of a column bold."""
        words = [[cell.replace("|", "\\|") for cell in row] for row in self.words(bold=True)]
        align = ["---", *["---:"] * (len(self.columns) - 1)]
        lines = [f"**{self.caption}** ([{self.name}.csv]({self.name}.csv))", ""]
        for row in (words[0], align, *words[1:]):
            lines.append("| " + " | ".join(row) + " |")
        return "\n".join(lines)

    def write(self, folder: Path) -> None:
        """The CSV file: numbers in full, a spread in columns of its own."""
        header: list[str] = []
        rows: list[list[object]] = [[] for _ in self.rows]
        for i, (name, _) in enumerate(self.columns):
            column = [row[i] for row in self.rows]
            spread = next((cell for cell in column if isinstance(cell, Spread)), None)
            header += [name, *([] if spread is None else spread.more(name))]
            for cells, cell in zip(rows, column, strict=True):
                if isinstance(cell, Spread):
                    cells.extend(cell.cells)
                else:
                    cells.extend([cell, *([] if spread is None else spread.more(""))])
        with (folder / f"{self.name}.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            for cells in rows:
                writer.writerow(["" if _nothing(cell) else cell for cell in cells])


def _nothing(cell: object) -> bool:
    return cell is None or (isinstance(cell, float) and not math.isfinite(cell))
