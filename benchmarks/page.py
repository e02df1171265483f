"""What the report's page is made of: sections with a sentence or two, tables and a picture."""

from __future__ import annotations

import itertools
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from throwplan.pictures import Table, save_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

T = TypeVar("T")
#: Folder of the CSV files and pictures, beside the page.
FILES = "report"
#: Longest line of a paragraph.
WIDTH = 100


@dataclass(frozen=True)
class Picture:
    """A figure; name: the stem of its PNG file."""

    name: str
    caption: str
    figure: Figure


@dataclass(frozen=True)
class Section:
    """One section of the page.

    text: what is measured and how; tables: on the page; data: tables of which those on the page are
    a condensation, as CSV files.
    """

    title: str
    text: str
    tables: Sequence[Table]
    data: Sequence[Table] = ()
    picture: Picture | None = None
    notes: Sequence[str] = field(default=())

    @property
    def files(self) -> list[str]:
        """Names of its files."""
        names = [f"{table.name}.csv" for table in self.data]
        return names + ([f"{self.picture.name}.png"] if self.picture else [])

    def write(self, folder: Path) -> None:
        """Write the CSV files and the picture."""
        for table in self.data:
            table.write(folder)
        if self.picture:
            save_figure(self.picture.figure, folder / f"{self.picture.name}.png")

    def markdown(self) -> str:
        """Its part of the page."""
        parts = [f"## {self.title}", paragraph(self.text)]
        for table in self.tables:
            lines = [paragraph(f"{table.caption}:"), ""] if len(self.tables) > 1 else []
            parts.append("\n".join([*lines, *table.markdown()]))
        parts += [paragraph(note) for note in self.notes]
        if self.picture:
            parts.append(f"![{self.picture.caption}]({FILES}/{self.picture.name}.png)")
        links = ", ".join(f"[{table.caption}]({FILES}/{table.name}.csv)" for table in self.data)
        return "\n\n".join([*parts, f"All: {links}."] if links else parts)


def paragraph(text: str) -> str:
    """Text in lines."""
    return textwrap.fill(text, WIDTH, break_long_words=False, break_on_hyphens=False)


@dataclass(frozen=True)
class Effort:
    """How much is measured: `quick` for a look, full for figures to rely on.

    progress: called with (done, total) of the section's own steps.
    """

    quick: bool = False
    progress: Callable[[int, int], None] | None = None

    def of(self, quick: T, full: T) -> T:
        """One of two sizes, or of two lists."""
        return quick if self.quick else full

    def counter(self, total: int) -> Callable[[], None]:
        """What a section calls after each of its `total` steps."""
        steps = itertools.count(1)

        def step() -> None:
            if self.progress is not None:
                self.progress(next(steps), total)

        return step
