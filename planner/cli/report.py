"""`throwplan report`: error against run time, stability, what scenes leave out."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

from .command import DONE, command


def add_report(commands: Any) -> None:
    """Adds `throwplan report`."""
    words = "measure error against run time, stability, and what scenes leave out"
    example = "throwplan report --quick --out report"
    parser = command(commands, "report", _report, words, example)
    parser.add_argument("--quick", action="store_true", help="few samples: under 3 minutes")
    parser.add_argument(
        "--only",
        nargs="+",
        action="extend",
        metavar="SECTION",
        default=[],
        help="these sections only: models, planner, stability, parts, reach, robust, throws",
    )
    parser.add_argument(
        "--out", metavar="DIR", default="report", help="where to write (default: report)"
    )


def _report(options: argparse.Namespace) -> int:
    from ...problems import InputError, prepare_folder
    from ..report import FILES, SECTIONS, make_report
    from .progress import ProgressLine

    for key in options.only:
        if key not in SECTIONS:
            raise InputError(f"--only {key}: must be one of {', '.join(SECTIONS)}")
    folder = prepare_folder(Path(options.out), FILES)
    line = ProgressLine("", "steps")
    with line:
        made = make_report(folder, options.only, options.quick, line.about)
    if options.json:
        found = {section.key: section.seconds for section in made}
        print(json.dumps({"folder": str(folder), "sections": found}, indent=2, allow_nan=False))
    else:
        seconds = sum(section.seconds for section in made)
        print(f"report: {len(made)} sections in {seconds:.0f} s; {folder / 'index.md'}")
    sys.stdout.flush()
    return DONE
