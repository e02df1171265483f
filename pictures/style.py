"""The style of all pictures: colours, resolution, figures, titles."""

from __future__ import annotations

import contextlib
import textwrap
import threading
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from .. import planner
from ..problems import InputError

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
#: Size [pt] of a picture's title.
TITLE = 10
#: Colour of arm and hand.
ARM = "#3d4450"
#: Colours of the phases of a throw.
PHASES = dict(zip(planner.PHASES, (GREY, BLUE, ORANGE, RED, GREEN, PURPLE), strict=True))

#: Matplotlib's settings belong to the process, so one picture is drawn at a time.
_DRAWING = threading.RLock()


@contextlib.contextmanager
def own_style() -> Iterator[None]:
    """Draw by Matplotlib's defaults, whatever a user's matplotlibrc says.

    InputError for one that is no text, with which Matplotlib cannot be imported.
    """
    try:
        from matplotlib import style
    except UnicodeDecodeError as error:
        raise InputError(f"matplotlibrc: is no text file: {error}") from None
    with _DRAWING, style.context("default"):
        yield


def new_figure(width: float, height: float, title: str = "") -> Figure:
    """A figure of `width` x `height` [in], with no window and no global state.

    title: at the upper left; lines longer than the figure is wide are broken.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    if title:
        with literal_texts():
            words = _broken(title, 72 * (width - 0.3))
        figure.suptitle(words, x=0.01, ha="left", fontsize=TITLE)
    return figure


def _broken(words: str, room: float) -> str:
    """The words of a title on lines of at most `room` [pt]."""
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import text_to_path

    font, characters = FontProperties(size=TITLE), 200
    while True:
        lines = [part for line in words.split("\n") for part in textwrap.wrap(line, characters)]
        widths = [
            text_to_path.get_text_width_height_descent(line, font, False)[0] for line in lines
        ]
        if characters < 10 or max(widths, default=0.0) <= room:
            return "\n".join(lines)
        characters = int(0.95 * characters)


@contextlib.contextmanager
def literal_texts(figure: Figure | None = None) -> Iterator[None]:
    """Draw a figure's texts as they are written: `$` starts no formula, and a character without a
    glyph is a box."""
    from matplotlib.text import Text

    for text in [] if figure is None else figure.findobj(Text):
        # Matplotlib writes the ticks of logarithmic axes as formulas.
        if "$" in text.get_text() and "mathdefault" not in text.get_text():
            text.set_parse_math(False)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph")
        # The best place of a legend takes a second on a busy machine.
        warnings.filterwarnings("ignore", message="Creating legend")
        yield


@own_style()
def save_figure(figure: Figure, path: Path) -> None:
    """Write the figure as PNG with literal texts."""
    with literal_texts(figure):
        figure.savefig(path, dpi=110)
