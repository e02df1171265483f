"""Throws solved ahead, to targets all over a scene's reach."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

from ..search import (
    Problems,
    Releases,
    SolvedThrow,
    Task,
    attempts,
    release_start,
    spread_targets,
    starts,
)
from .maps import reach_map

#: Sampled states whose landings are the targets, and starts tried of each target.
SAMPLES, STARTS = 60_000, 3


def solved(
    problems: Problems,
    table: Callable[[], Releases],
    throws: int,
    progress: Callable[[int, int], None] | None,
) -> Iterator[SolvedThrow]:
    """Of `throws` targets all over the reach those that are soon solved.

    table: gives the sampled releases; progress(tried, all) is called before each and at the end.
    """
    scene = problems.scene
    reach, releases = reach_map(scene, samples=SAMPLES), table()
    wanted = spread_targets(scene, reach.x, reach.theta, throws)
    for number, target in enumerate(wanted):
        if progress is not None:
            progress(number, len(wanted))
        task = Task(scene.aimed_at(target), target, ("fatrop",))
        for index, goal, _ in starts(releases, scene, target, "exact", STARTS):
            start = release_start(problems, task, releases, index, goal)
            *_, last = attempts(problems, dataclasses.replace(start, light=True), task)
            if last.throw is not None and last.solved:
                yield SolvedThrow.of(last.throw, goal)
                break
    if progress is not None:
        progress(len(wanted), len(wanted))
