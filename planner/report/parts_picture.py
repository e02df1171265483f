"""The picture of the section "parts"."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .part_sizes import Measured


def draw(words: Sequence[str], found: Sequence[Measured], path: Path) -> None:
    """Two bar charts side by side: operations, and times to solve; one line for each word."""
    from matplotlib.figure import Figure

    from ..sweep import BLUE, GREEN, GREY

    figure = Figure(figsize=(11, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    operations = [float(one.operations) for one in found]
    own, whole = ([1e3 * getattr(one, name) for one in found] for name in ("solve", "whole"))
    lines = range(len(found))
    bars = left.barh(lines, operations, color=BLUE)
    left.bar_label(bars, [f"{value:.0f}" for value in operations], padding=3, fontsize=8)
    left.set(xlabel="operations of one iteration's functions")
    left.set_yticks(lines, words)
    for shift, values, colour, label in (
        (-0.2, own, GREEN, "own NLP"),
        (0.2, whole, GREY, "with the NLPs that lead to it"),
    ):
        bars = right.barh([i + shift for i in lines], values, 0.4, color=colour, label=label)
        right.bar_label(bars, [f"{value:.1f}" for value in values], padding=3, fontsize=8)
    right.set(xlabel="solve [ms], nothing compiled")
    right.legend(frameon=False, fontsize=8, loc="upper right")
    for axis, values in ((left, operations), (right, own + whole)):
        axis.set(xscale="log", xlim=(min(values) / 2, 4 * max(values)))
        axis.grid(axis="x", alpha=0.3)
    left.invert_yaxis()
    figure.savefig(path, dpi=120)
