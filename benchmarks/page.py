"""What a report is made of: sections of sentences, tables and pictures; their page.

The page is short: each section gives its main figures, at most one table and its pictures. Every
table is in a CSV file with all its digits; a section that is measured again replaces its own part
of the page, the others stay as they are.
"""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from throwplan.pictures import Table, new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

T = TypeVar("T")

TITLE = "Appendix: everything that was measured"
HEAD = """Landings are those of models: nothing here is measured on real throws, where the published
error of the sliding pivot is 2.4 cm and 15° (Liu and Billard, the paper). Times belong to the
machine and run that a section names at its end; compare times within one table only. A scaled
error is |Δx| + |Δθ| l/2, with the length l of the object. All random draws have fixed seeds."""
#: File of the page with all sections; `summary` makes a page for anyone from them.
APPENDIX = "appendix.md"


@dataclass(frozen=True)
class Picture:
    """A figure; name: the stem of its PNG file."""

    name: str
    caption: str
    figure: Figure

    def write(self, folder: Path) -> None:
        """The PNG file, reduced to 256 colours, which makes it three times smaller."""
        from PIL import Image

        path = folder / f"{self.name}.png"
        for axes in self.figure.axes:
            axes.grid(alpha=0.3)
            _label(axes.xaxis, *axes.get_xlim())
            _label(axes.yaxis, *axes.get_ylim())
        save_figure(self.figure, path)
        with Image.open(path) as drawn:
            reduced = drawn.convert("RGB").quantize(256, dither=Image.Dither.NONE)
        reduced.save(path, optimize=True)


def _label(axis: Axis, low: float, high: float) -> None:
    """Labels between the powers of ten on a logarithmic axis of less than two decades."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    if axis.get_scale() == "log" and 0 < high < 100 * low:
        axis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))
        for formatter in (axis.set_minor_formatter, axis.set_major_formatter):
            formatter(StrMethodFormatter("{x:g}"))


def panels(
    width: float, height: float, lines: int = 1, columns: int = 1, **share: Any
) -> tuple[Figure, Any]:
    """A figure of so many inches, and its axes in lines and columns."""
    figure = new_figure(width, height)
    return figure, figure.subplots(lines, columns, squeeze=False, **share)


@dataclass
class ReportSection:
    """One chapter. key: what `--only` calls it; seconds: the time it took to measure.

    figures: sentences with the main results; made: machine, versions and date.
    """

    key: str
    title: str
    figures: list[str] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    seconds: float = math.nan
    made: str = ""

    @property
    def files(self) -> tuple[str, ...]:
        """Names of its tables' and pictures' files."""
        tables = [f"{table.name}.csv" for table in self.tables]
        return (*tables, *(f"{picture.name}.png" for picture in self.pictures))

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
        command = f"`python -m benchmarks --only {self.key}`"
        lines += ["", f"Tables: {'; '.join(links)}.", ""]
        lines += [f"{command}: {self.seconds:.0f} s, {self.made}", ""]
        return "\n".join(lines)


def number(cell: object, otherwise: float = math.nan) -> float:
    """A cell's number, `otherwise` if it has none."""
    return float(cell) if isinstance(cell, float | int) else otherwise


def write_page(folder: Path, parts: dict[str, str], order: Sequence[str]) -> None:
    """The appendix: the sections' parts, by key, in that order."""
    known = [parts[key] for key in order if key in parts]
    text = "\n".join([f"# {TITLE}", "", HEAD, "", *known])
    (folder / APPENDIX).write_text(text, encoding="utf-8")


def parts_of(folder: Path) -> dict[str, str]:
    """The parts of a page that is there, by section; none where there is no page."""
    try:
        text = (folder / APPENDIX).read_text(encoding="utf-8")
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
