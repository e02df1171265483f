"""`python -m benchmarks`: measures, and writes docs/performance.md."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from throwplan import InputError
from throwplan.cli import Parser, Progress, leave
from throwplan.interrupts import INTERRUPTED
from throwplan.problems.files import prepare_folder

from . import PAGE, SECTIONS, make_report

#: Folder of the kept page, which a whole run writes when it is complete.
KEPT = "docs"
#: Default folder of all runs.
OUT = "out/report"


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status."""
    parser = Parser(
        prog="python -m benchmarks",
        description="Measure error against run time, stability, reach and robustness.",
        epilog=f"A complete run without --quick, --only and --out also writes {KEPT}/{PAGE}.",
    )
    add = parser.add_argument
    add("--quick", action="store_true", help="few samples: under 3 minutes")
    keys = f"these sections only: {', '.join(SECTIONS)}"
    add("--only", nargs="+", action="extend", default=[], metavar="SECTION", help=keys)
    add("--out", metavar="DIR", help=f"where to write (default: {OUT})")
    try:
        options = parser.parse_args(words)
        whole = not (options.out or options.only or options.quick)
        _run(Path(options.out or OUT), options.only, options.quick, whole)
    except KeyboardInterrupt:
        print("benchmarks: interrupted", file=sys.stderr)
        return INTERRUPTED
    except InputError as error:
        print(f"benchmarks: {error}", file=sys.stderr)
        return 2
    return 0


def _run(out: Path, only: Sequence[str], quick: bool, whole: bool) -> None:
    """Measures and writes."""
    for key in only:
        if key not in SECTIONS:
            raise InputError(f"--only {key}: must be one of {', '.join(SECTIONS)}")
    folder = prepare_folder(out, (PAGE,))
    kept = Path(KEPT) if whole else None
    with Progress(unit="steps") as progress:
        seconds = make_report(folder, only, quick, progress.about, kept)
    folder = kept or folder
    print(f"{len(seconds)} sections in {sum(seconds.values()):.0f} s; {folder / PAGE}")


if __name__ == "__main__":
    leave(main())
