"""`throwplan prepare`: a library of solved throws over the map, kept in the cache."""

from __future__ import annotations

import argparse
import sys
import time

from ...problems import load_scene
from ..plan import MOST_PREPARED, PREPARED, Planner
from .common import DONE, NO_THROW, Add, Progress, add_scene, answer, whole


def arguments(add: Add) -> None:
    """The command's options."""
    add_scene(add)
    words = f"about how many throws, where the reach has room for them (default: {PREPARED})"
    kind = whole(1, MOST_PREPARED)
    add("--throws", type=kind, metavar="N", default=PREPARED, help=words)


def run(options: argparse.Namespace) -> int:
    """Grows the library and prints how large it is."""
    scene = load_scene(options.scene)
    name = scene.name
    with Progress(name) as progress:
        planner, started = Planner(scene), time.perf_counter()
        count = planner.prepare(options.throws, progress)
    library, seconds = planner.library, time.perf_counter() - started
    found = {
        "scene": name,
        "throws": count,
        "edge": len(library.records) - count,
        "bytes": library.records.nbytes,
        "folder": None if library.folder is None else str(library.folder),
        "time": seconds,
    }
    if not count:
        print("throwplan: no throw found: none of the seeds is solved", file=sys.stderr)
    where = "not kept: there is no cache folder" if library.folder is None else library.folder
    text = (
        f"{name}: {count:,} solved throws, {found['edge']:,} places beyond the edge of the reach, "
        f"{library.records.nbytes / 1e6:.1f} MB, in {seconds:.0f} s\n  {where}"
    )
    answer(options, found, text)
    return DONE if count else NO_THROW
