"""Throws solved ahead, to targets all over a scene's reach."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ..search import Releases, Search, SolvedThrow, Workbench, from_release, starts, targets
from .reach_map import reach_map

#: Sampled states whose landings are the targets, and starts tried of each target.
SAMPLES, STARTS = 60_000, 3


def solved(
    bench: Workbench,
    table: Callable[[], Releases],
    throws: int,
    progress: Callable[[int, int], None] | None,
) -> Iterator[SolvedThrow]:
    """Of `throws` targets all over the reach those that are soon solved.

    table: gives the sampled releases; progress(tried, all) is called before each and at the end.
    """
    scene = bench.scene
    reach, releases = reach_map(scene, samples=SAMPLES), table()
    wanted = targets(scene, reach.x, reach.theta, throws)
    for number, target in enumerate(wanted):
        if progress is not None:
            progress(number, len(wanted))
        search = Search(scene.aimed_at(target))
        for index, goal, _ in starts(releases, scene, target, "exact", STARTS):
            found = from_release(bench, "fatrop", index, goal, releases, search, True)
            if found is not None:
                yield SolvedThrow.of(found.thrown, goal, search.guards)
                break
    if progress is not None:
        progress(len(wanted), len(wanted))
