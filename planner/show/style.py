"""The style of all pictures: colours, resolution, figures, titles."""

from __future__ import annotations

import textwrap
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GREY = "#8a8f98"
BLUE = "#4c78a8"
ORANGE = "#f2a33a"
RED = "#d1495b"
GREEN = "#2a9d6f"
TEAL = "#2a788e"
PURPLE = "#8b6bb1"
BLACK = "#222222"
#: Colour of arm and hand.
ARM = "#3d4450"
#: Colours of the phases of a throw, in their order.
PHASES = {
    "carry": GREY,
    "stick": BLUE,
    "pivot": ORANGE,
    "slide": RED,
    "flight": GREEN,
    "landed": PURPLE,
}


def new_figure(width: float, height: float) -> Figure:
    """An empty figure of `width` x `height` [in], with no window and no global state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def put_title(figure: Figure, words: str, size: float = 11.0) -> None:
    """A title at the upper left, at most as wide as the figure: longer lines are broken."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font = FontProperties(size=size)
    room, characters = 72 * (0.98 * figure.get_figwidth() - 0.1), 200

    def width(line: str) -> float:
        return float(text_to_path.get_text_width_height_descent(line, font, ismath=False)[0])

    while True:
        lines = [part for line in words.split("\n") for part in textwrap.wrap(line, characters)]
        if characters < 20 or max(map(width, lines), default=0.0) <= room:
            break
        characters = int(0.95 * characters)
    figure.suptitle("\n".join(lines), x=0.01, ha="left", fontsize=size)


def save(figure: Figure, path: Path) -> None:
    """Write the figure as PNG with literal texts.

    `$` starts no formula, and a character without a glyph is a box.
    """
    from matplotlib.text import Text

    for text in figure.findobj(Text):
        # Matplotlib writes the ticks of logarithmic axes as formulas.
        if "$" in text.get_text() and "mathdefault" not in text.get_text():
            text.set_parse_math(False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        figure.savefig(path, dpi=110)
