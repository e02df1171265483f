"""`throwplan prepare`: a library of solved throws over the map, kept in the cache."""

from __future__ import annotations

import argparse
import sys
import time

from ...problems import load_scene
from ..planner import MOST_PREPARED, PREPARED, Planner
from .common import DONE, INTERRUPTED, NO_THROW, Add, Progress, add_scene, integer, print_result

#: Messages without a cache folder, and for fewer throws than requested.
NOT_KEPT = "not kept: there is no cache folder"
FEWER = (
    "fewer than the {requested:,} requested: no places are left between them, or no throw reaches "
    "them; there is nothing to do, a plan starts from the nearest throw"
)


def arguments(add: Add) -> None:
    """The command's options."""
    add_scene(add)
    words = f"about how many throws, where the reach has room for them (default: {PREPARED})"
    kind = integer(1, MOST_PREPARED)
    add("--throws", type=kind, metavar="N", default=PREPARED, help=words)
    words = "processes on this machine (default: 2 for 400 throws or more)"
    add("--workers", type=integer(), metavar="N", help=words)
    add("--scheduler", metavar="ADDRESS", help="a Dask scheduler that spreads the work")


def run(options: argparse.Namespace) -> int:
    """Grow the library and print its size."""
    scene = load_scene(options.scene)
    name, requested, started = scene.name, options.throws, time.perf_counter()
    planner = Planner(scene)
    library, before = planner.library, planner.prepared
    try:
        with Progress(name) as progress:
            count = planner.prepare(
                requested, progress, workers=options.workers, scheduler=options.scheduler
            )
    except KeyboardInterrupt:
        return _interrupted(planner)
    seconds = time.perf_counter() - started
    found = {
        "scene": name,
        "throws": count,
        "added": count - before,
        "edge": len(library.records) - count,
        "bytes": library.records.nbytes,
        "folder": None if library.folder is None else str(library.folder),
        "time": seconds,
    }
    if not count:
        print("throwplan: no throw found: none of the seeds is solved", file=sys.stderr)
    where = NOT_KEPT if library.folder is None else library.folder
    new = f"{count - before:,}" if count > before else "none"
    text = (
        f"{name}: {count:,} solved throws, {new} of them new, {found['edge']:,} places beyond the "
        f"edge of the reach, {library.records.nbytes / 1e6:.1f} MB, in {seconds:.0f} s\n  {where}"
    )
    if 0 < count < requested:
        text += f"\n  {FEWER.format(requested=requested)}"
    print_result(options, found, text)
    return DONE if count else NO_THROW


def _interrupted(planner: Planner) -> int:
    """Print the number of throws kept."""
    kept = f"{planner.prepared:,} throws are kept; the same command goes on from there"
    words = NOT_KEPT if planner.library.folder is None else kept
    print(f"throwplan: interrupted: {words}", file=sys.stderr)
    return INTERRUPTED
