"""`throwplan report`: error against run time, stability, what scenes leave out."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...problems import InputError, prepare_folder
from ..report import PAGE, SECTIONS, make_report
from .common import DONE, Add, Progress, add_words, answer


def arguments(add: Add) -> None:
    """The command's options."""
    add("--quick", action="store_true", help="few samples: under 3 minutes")
    add_words(add, "--only", "SECTION", f"these sections only: {', '.join(SECTIONS)}")
    add("--out", metavar="DIR", default="report", help="where to write (default: report)")


def run(options: argparse.Namespace) -> int:
    """Measures and writes."""
    for key in options.only:
        if key not in SECTIONS:
            raise InputError(f"--only {key}: must be one of {', '.join(SECTIONS)}")
    folder = prepare_folder(Path(options.out), (PAGE,))
    with Progress(unit="steps") as progress:
        made = make_report(folder, options.only, options.quick, progress.about)
    seconds = {section.key: section.seconds for section in made}
    total = sum(seconds.values())
    text = f"report: {len(made)} sections in {total:.0f} s; {folder / PAGE}"
    answer(options, {"folder": str(folder), "sections": seconds}, text)
    return DONE
