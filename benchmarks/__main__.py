"""`python -m benchmarks`: measures, and writes the report."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path

from throwplan import InputError
from throwplan.cli import Parser, Progress, leave
from throwplan.interrupts import INTERRUPTED
from throwplan.problems.files import prepare_folder

from . import PAGE, SECTIONS, make_report

#: Default folder of the report.
KEPT = "docs/report"
#: Default folder with --quick.
QUICK = "out/report"


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    parser = Parser(
        prog="python -m benchmarks",
        description="Measure error against run time, stability, reach and robustness.",
    )
    add = parser.add_argument
    add("--quick", action="store_true", help="few samples: under 3 minutes")
    keys = f"these sections only: {', '.join(SECTIONS)}"
    add("--only", nargs="+", action="extend", default=[], metavar="SECTION", help=keys)
    add("--out", metavar="DIR", help=f"where to write (default: {KEPT}; with --quick {QUICK})")
    add("--json", action="store_true", help="print one JSON object, nothing else")
    try:
        options = parser.parse_args(words)
        out = options.out or (QUICK if options.quick else KEPT)
        return _run(Path(out), options.only, options.quick, options.json)
    except KeyboardInterrupt:
        print("benchmarks: interrupted", file=sys.stderr)
        return INTERRUPTED
    except InputError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        return 2


def _run(out: Path, only: Sequence[str], quick: bool, as_json: bool) -> int:
    """Measures and writes."""
    for key in only:
        if key not in SECTIONS:
            raise InputError(f"--only {key}: must be one of {', '.join(SECTIONS)}")
    folder = prepare_folder(out, (PAGE,))
    with Progress(unit="steps") as progress:
        made = make_report(folder, only, quick, progress.about)
    seconds = {section.key: section.seconds for section in made}
    total = sum(seconds.values())
    text = f"{len(made)} sections in {total:.0f} s; {folder / PAGE}"
    print(json.dumps({"folder": str(folder), "sections": seconds}) if as_json else text)
    return 0


if __name__ == "__main__":
    leave(main())
