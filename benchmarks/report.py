"""Makes the report: one section after the other; the page is written after each."""

from __future__ import annotations

import datetime
import os
import platform
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from throwplan import InputError
from throwplan.pictures import own_style
from throwplan.problems.files import filling

from . import models, parts, reach, robust, scenes, search, simulated, stability
from .page import FILES, Effort, Section, paragraph

#: Sections by their names for `--only`, in the page's order.
SECTIONS: dict[str, Callable[[Effort], Section]] = {
    "scenes": scenes.make,
    "models": models.make,
    "stability": stability.make,
    "reach": reach.make,
    "robust": robust.make,
    "parts": parts.make,
    "search": search.make,
    "mujoco": simulated.make,
}
#: File of the page.
PAGE = "performance.md"
#: Libraries whose versions the page names.
LIBRARIES = ("throwplan", "casadi", "numpy", "scipy", "ruckig", "mujoco")
#: Environment of all sections: machine code would come in the middle of some.
SETTINGS = {"THROWPLAN_COMPILE": "0"}
ROOT = Path(__file__).parent.parent
HEAD = """# Performance

For engineers who want to know how long a plan takes, how near it lands, and when there is none.

**Not validated: nothing here was thrown by a robot.** All landings are computed, with friction,
pads and gripper taken as known; MuJoCo, too, has rigid bodies and Coulomb friction. On real throws
the published error of the sliding pivot is 2.4 cm and 15° (Liu and Billard).

A *pose error* is the position error plus the angle error times half the object's length. Times
are of this machine, without machine code (`THROWPLAN_COMPILE=0`) and with nothing cached before:
compare them within one table. All random draws have fixed seeds."""

Show = Callable[[str], Callable[[int, int], None]]


@own_style()
def make_report(
    folder: Path,
    only: Sequence[str] = (),
    quick: bool = False,
    show: Show | None = None,
    kept: Path | None = None,
) -> dict[str, float]:
    """Measure the sections `only` (all, if empty); returns their times [s].

    The page is written into `folder` after each section, with the sections of this run only, and
    at the end into `kept`, too. Each section begins with an empty cache. InputError if the commit
    changes meanwhile. show: given a section's key, returns what is called with its progress.
    """
    made, seconds, commit = list[Section](), dict[str, float](), commit_of_checkout()
    for key, make in SECTIONS.items():
        if only and key not in only:
            continue
        start = time.perf_counter()
        with (
            TemporaryDirectory() as cache,
            patch.dict(os.environ, SETTINGS | {"THROWPLAN_CACHE": cache}),
        ):
            section = make(Effort(quick, None if show is None else show(key)))
        seconds[key] = time.perf_counter() - start
        if (now := commit_of_checkout()).split()[0] != commit.split()[0]:
            raise InputError(f"commit {commit} became {now} during the run: run it again")
        made.append(section)
        write_report(folder, made, _made(commit, quick, seconds))
    if kept is not None:
        write_report(kept, made, _made(commit, quick, seconds))
    return seconds


def write_report(folder: Path, sections: Sequence[Section], made: str) -> None:
    """Write page, CSV files and pictures of the sections, with the line that says how."""
    names = tuple(name for section in sections for name in section.files)
    with filling(folder / FILES, names) as scratch:
        for section in sections:
            section.write(scratch)
    with filling(folder, (PAGE,)) as scratch:
        parts = [HEAD, paragraph(made), *(section.markdown() for section in sections)]
        (scratch / PAGE).write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _made(commit: str, quick: bool, seconds: Mapping[str, float]) -> str:
    """Commit, date, machine, versions and times."""
    date = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d %H:%M UTC")
    versions = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    machine = f"{_processor()}, {os.cpu_count()} cores, Python {platform.python_version()}"
    times = ", ".join(f"{key} {value:.0f} s" for key, value in seconds.items())
    command = "python -m benchmarks --quick` (few samples)" if quick else "make report`"
    return f"`{command}, commit {commit}, {date}. {machine}, {versions}. Sections: {times}."


def commit_of_checkout() -> str:
    """The commit of this checkout in 8 digits, "(changed)" with files that are not in it."""
    outputs = [f":!docs/{name}" for name in (PAGE, FILES)]
    try:
        commit, changes = (
            subprocess.run(
                ["git", *words], cwd=ROOT, check=True, capture_output=True, text=True
            ).stdout.strip()
            for words in (
                ["rev-parse", "--short=8", "HEAD"],
                ["status", "--porcelain", "--untracked-files=no", "--", ".", *outputs],
            )
        )
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
    return f"{commit} (changed)" if changes else commit


def _processor() -> str:
    """The processor's name if the system has it."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in text.splitlines() if "model name" in line]
    return names[0] if names else platform.machine()
