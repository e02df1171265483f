"""`throwplan prepare`: a library of solved throws over the map, kept in the cache."""

from __future__ import annotations

import argparse
import sys
import time

from ...problems import load_scene
from ..planner import MOST_PREPARED, PREPARED, Planner
from .common import DONE, INTERRUPTED, NO_THROW, Add, Progress, add_scene, integer, print_result

#: Message without a cache folder.
NOT_KEPT = "not kept: there is no cache folder"
#: Message for a reach without room for all requested throws.
FEWER = (
    "fewer than the {requested:,} requested: no places are left between them, or no throw reaches "
    "them; nothing to do: a plan starts from the nearest throw"
)


def arguments(add: Add) -> None:
    """The command's options."""
    add_scene(add)
    words = f"number of throws; fewer if the reach has no room (default: {PREPARED})"
    kind = integer(1, MOST_PREPARED)
    add("--throws", type=kind, metavar="N", default=PREPARED, help=words)
    words = "processes on this machine (default: 2 for 400 throws or more)"
    add("--workers", type=integer(), metavar="N", help=words)
    add("--scheduler", metavar="ADDRESS", help="address of a Dask scheduler to use instead")


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
    result = {
        "scene": name,
        "throws": count,
        "added": count - before,
        "edge": len(library.records) - count,
        "bytes": library.records.nbytes,
        "folder": None if library.folder is None else str(library.folder),
        "time": seconds,
    }
    if not count:
        words = "throwplan: no throw found: no solve from the sampled starts succeeded"
        print(words, file=sys.stderr)
    where = NOT_KEPT if library.folder is None else library.folder
    new = f"{count - before:,}" if count > before else "none"
    text = (
        f"{name}: {count:,} solved throws, {new} of them new, {result['edge']:,} places out of "
        f"reach, {library.records.nbytes / 1e6:.1f} MB, in {seconds:.0f} s\n  {where}"
    )
    if 0 < count < requested:
        text += f"\n  {FEWER.format(requested=requested)}"
    print_result(options, result, text)
    return DONE if count else NO_THROW


def _interrupted(planner: Planner) -> int:
    """Prints the number of stored throws."""
    kept = f"{planner.prepared:,} throws are kept; run the command again to continue"
    words = NOT_KEPT if planner.library.folder is None else kept
    print(f"throwplan: interrupted: {words}", file=sys.stderr)
    return INTERRUPTED
