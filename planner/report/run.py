"""Makes the report: section after section, written as soon as each is there."""

from __future__ import annotations

import datetime
import importlib
import os
import platform
import time
from collections.abc import Callable, Sequence
from importlib.metadata import version
from pathlib import Path

from ...problems import filling
from .kept import NAME, keep, kept
from .page import Effort, Section, files_of
from .render import markdown, page

TITLE = "throwplan: error against run time, stability, and what a scene leaves out"
#: Sections by what `--only` calls them; each is a module here with `make(effort)`.
SECTIONS = ("models", "planner", "stability", "parts", "reach", "robust", "throws")
#: Head of a report in which sections were measured anew.
MIXED = "Put together from sections that were made one by one; each says when and by what command."
#: Files of every report, beside the tables' and pictures'.
FILES = ("index.md", "index.html", NAME)
#: Libraries whose versions decide the figures.
LIBRARIES = ("throwplan", "casadi", "numpy", "scipy", "ruckig")

Show = Callable[[str], Callable[[int, int], None]]


def make_report(
    folder: Path, only: Sequence[str] = (), quick: bool = False, show: Show | None = None
) -> list[Section]:
    """Measure and write the sections `only` (all, if empty) into `folder`.

    The page is written anew after each section, so what was made stays if the next is
    interrupted. With `only` the other sections of a report that is there stay. show: given
    a section's key, says who hears of its progress.
    """
    head, made = _head(quick, only), []
    before = [section for section in kept(folder) if only and section.key not in only]
    for key in SECTIONS:
        if only and key not in only:
            continue
        progress = None if show is None else show(key)
        start = time.perf_counter()
        section = importlib.import_module(f".{key}", __package__).make(Effort(quick, progress))
        section.seconds, section.made = time.perf_counter() - start, head[0] + " " + head[1]
        made.append(section)
        write(folder, [MIXED, *head[1:]] if before else head, section, [*before, *made])
    return made


def write(folder: Path, head: Sequence[str], section: Section, sections: Sequence[Section]) -> None:
    """The page of all sections, and the files of one of them."""
    new = tuple(name for part in section.parts for name in files_of(part))
    with filling(folder, new) as scratch:
        for part in section.parts:
            if not isinstance(part, str):
                part.write(scratch)
    with filling(folder, FILES) as scratch:
        sections = sorted(sections, key=lambda one: SECTIONS.index(one.key))
        text = markdown(TITLE, head, sections)
        (scratch / "index.md").write_text(text, encoding="utf-8")
        whole = page(TITLE, head, sections, folder)
        (scratch / "index.html").write_text(whole, encoding="utf-8")
        keep(scratch, sections)


def _head(quick: bool, only: Sequence[str]) -> list[str]:
    """Machine, versions, date, command."""
    versions = ", ".join(f"{name} {version(name)}" for name in LIBRARIES)
    begun = datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%d, begun %H:%M UTC,")
    command = " ".join(["throwplan report", *["--quick"] * quick, *["--only"] * bool(only), *only])
    return [
        f"Made on {begun} by `{command}`" + (": a quick look, few samples." if quick else "."),
        f"Machine: {_processor()}, {os.cpu_count()} cores, {platform.system()} "
        f"{platform.release()}; Python {platform.python_version()}; {versions}.",
        "Times are of this machine and this run; ratios are between rows of one table.",
        "Landings are those of models: none of this is measured on real throws. The published "
        "error of the sliding pivot on these is 2.4 cm and 15° (Liu and Billard, the paper).",
        "Every random draw has a fixed seed, named where it matters.",
    ]


def _processor() -> str:
    """The processor's name, as far as the system tells."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in text.splitlines() if "model name" in line]
    return names[0] if names else platform.machine()
