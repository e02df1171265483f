"""Makes the report: one section after the other, each written as soon as it is measured."""

from __future__ import annotations

import datetime
import os
import platform
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from throwplan.pictures import own_style
from throwplan.problems.files import filling

from . import models, parts, planner, reach, rest, robust, search, stability, summary, swings
from .page import APPENDIX, Effort, ReportSection, parts_of, write_page

#: Sections by their names for `--only`, in the page's order.
SECTIONS: dict[str, Callable[[Effort], ReportSection]] = {
    "example": summary.make,
    "models": models.make,
    "planner": planner.make,
    "stability": stability.make,
    "parts": parts.make,
    "reach": reach.make,
    "search": search.make,
    "rest": rest.make,
    "swings": swings.make,
    "robust": robust.make,
}
#: Sections of studies that are done, after the others on the page. Their text, tables and pictures
#: stay; their code is in the commit that they name.
FROZEN = ("tosses", "throws", "calibration", "pushes", "shapes")
#: Libraries whose versions the report names.
LIBRARIES = ("throwplan", "casadi", "numpy", "scipy", "ruckig")

Show = Callable[[str], Callable[[int, int], None]]


@own_style()
def make_report(
    folder: Path, only: Sequence[str] = (), quick: bool = False, show: Show | None = None
) -> list[ReportSection]:
    """Measure the sections `only` (all, if empty) and write them into `folder`.

    The page is written after each section, so that an interrupted report keeps what was
    measured. Sections of a page that is there stay until they are measured again. show: given a
    section's key, returns what is called with its progress.
    """
    made = []
    page = parts_of(folder)
    for key, make in SECTIONS.items():
        if only and key not in only:
            continue
        start = time.perf_counter()
        section = make(Effort(quick, None if show is None else show(key)))
        section.seconds, section.made = time.perf_counter() - start, _made(quick)
        made.append(section)
        page[key] = section.markdown()
        with filling(folder, (*section.files, APPENDIX)) as scratch:
            section.write(scratch)
            write_page(scratch, page, (*SECTIONS, *FROZEN))
        summary.write_summary(folder, page)
    return made


def _made(quick: bool) -> str:
    """Date, machine and versions, and a note on a quick run."""
    date = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    versions = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    machine = f"{_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    few = " A quick look (`--quick`): few samples." if quick else ""
    return f"{date}; {machine}, {versions}.{few}"


def _processor() -> str:
    """The processor's name if the system has it."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in text.splitlines() if "model name" in line]
    return names[0] if names else platform.machine()
