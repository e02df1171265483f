"""The releases of a table as starts for one target: the nearest landings, and near ones of
different motions."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from operator import itemgetter

import numpy as np

from ...models import Array, Flags
from ...problems import Pose
from ..library import landing_errors, nearest_landings
from ..result import PlannedThrow
from ..samples import (
    UNMET,
    Releases,
    ReleaseSampler,
    drawn_towards,
    flies_past_column,
    in_obstacles,
    kinds,
    sampled_throw,
    starts,
)
from ..throw import Manipulator, column_of
from ..verdict import lands_well, verdict
from .attempt import Start
from .guess import guess_of
from .nlp_cache import NlpCache, Task

#: Number of sampled releases, and of those that arrive well, from which a solver starts for each
#: wanted throw.
STARTS = {"fatrop": 4, "ipopt": 2}
#: The same of FATROP among obstacles, each of which parts the motions into those on its one side
#: and other; and of a hand, whose NLPs take a third of an arm's time.
MANY_STARTS = 16
#: Most sampled releases from which throws to a region are solved, to find the cheapest.
REGION_STARTS = 8
#: Nearest sampled throws of which starts are chosen, and of which collisions with obstacles are
#: checked.
NEAR, CLEARED = 400, 40
#: Most sampled throws that are judged.
JUDGED = 30
#: Judging ends with this number of sampled throws that break nothing.
SOUND = 2
#: Most NLPs solved from one release, each refined by the check of the one before.
TRIES = 4


@dataclass(frozen=True, eq=False)
class Candidates:
    """Releases for a task."""

    releases: Releases
    task: Task
    manipulator: Manipulator

    @cached_property
    def nearest(self) -> list[tuple[int, Pose, float]]:
        """(release, goal, pose error [m]) of the nearest landings."""
        task, most = self.task, 2 * max(STARTS.values())
        most = (REGION_STARTS if task.target.is_region else most) * task.wanted
        return starts(self.releases, task.scene, task.target, task.turns, most)

    @cached_property
    def different(self) -> list[tuple[int, Pose, float]]:
        """Near landings, first of releases whose coordinates differ, as different motions reach a
        target.

        With obstacles, of the first `CLEARED` those that are least deep in one come first.
        """
        task, scene = self.task, self.task.scene
        found = starts(self.releases, scene, task.target, task.turns, NEAR)
        q = self.releases.q[[index for index, *_ in found]]
        chosen = kinds(q)
        others = sorted(set(range(len(found))) - set(chosen))
        found = [found[k] for k in (*chosen, *others)]
        if not scene.obstacle:
            return found
        with task.clock("guess"):
            near = found[:CLEARED]
            depths = [in_obstacles(scene, self.manipulator, self.releases, i) for i, *_ in near]
        deep = [far + depth for (*_, far), depth in zip(near, depths, strict=True)]
        return [*(near[i] for i in np.argsort(deep)), *found[CLEARED:]]

    @cached_property
    def arriving(self) -> Candidates:
        """The releases that keep `_arrivals`; a condition that none keeps is ignored."""
        landing = self.releases.landings(self.task.target.z, self.task.scene.flight).T
        good = np.flatnonzero(np.isfinite(landing[:, 2]))
        for holds in _arrivals(self.task):
            kept = good[holds(self.releases.picked(good), landing[good])]
            good = kept if len(kept) else good
        return replace(self, releases=self.releases.picked(good))

    @cached_property
    def drawn(self) -> list[tuple[Releases, int, Pose, float]]:
        """(table, release, goal, pose error [m]) of releases drawn towards the target, each of
        another kind of motion, that which differs most from all before it next.

        They are drawn without regard to obstacles; throws that touch one are left out.
        """
        task, scene = self.task, self.task.scene
        with task.clock("guess"):
            sampler = ReleaseSampler(scene, self.manipulator)
            table, chosen = drawn_towards(sampler, self.arriving.releases, self._away)
            landings = table.landings(task.target.z, scene.flight)[:, chosen]
            near = nearest_landings(scene, task.target, task.turns, landings, len(chosen))
            found = [
                (table, chosen[k], goal, away) for k, goal, away in sorted(near, key=itemgetter(0))
            ]
            if not scene.obstacle:
                return found
            manipulator = self.manipulator
            return [one for one in found if not in_obstacles(scene, manipulator, *one[:2])]

    def _away(self, releases: Releases) -> Array:
        """Pose errors (N,) [m] of releases' landings, and what `drawn_towards` adds."""
        task = self.task
        landings = releases.landings(task.target.z, task.scene.flight)
        errors, _ = landing_errors(task.scene, task.target, task.turns, landings)
        unmet = (~holds(releases, landings.T) for holds in _arrivals(task))
        return errors + UNMET * sum(unmet, np.zeros(len(errors)))

    @cached_property
    def judged(self) -> list[tuple[int, Pose, Pose]]:
        """(release of `arriving`, goal, landing) of near throws that differ and break nothing where
        they land."""
        arriving, sound = self.arriving, list[tuple[int, Pose, Pose]]()
        for index, goal, _ in arriving.different[:JUDGED]:
            with self.task.clock("guess"):
                pose = arriving._sound_landing(index, goal)
            if pose is not None:
                sound.append((index, goal, pose))
            if len(sound) == SOUND:
                break
        return sound

    def _sound_landing(self, index: int, goal: Pose) -> Pose | None:
        """A release's landing; None if its throw breaks a limit."""
        thrown = sampled_throw(self.task.scene, self.manipulator, self.releases, index)
        landing = thrown.landing
        if not math.isfinite(landing.flight_time):
            return None
        pose = goal.in_plane(landing.x, None if goal.theta is None else landing.theta)
        thrown = replace(thrown, scene=self.task.aimed_at(pose).scene)
        return pose if verdict(thrown, pose).ok else None


def same_end(task: Task, landed: Array, theta: float) -> Flags:
    """Whether a bar at angles `landed` (N,) [rad] enters a cup with the end that is lower at
    `theta`, after as many half turns where turns count."""
    off = np.floor(landed / math.pi) - math.floor(theta / math.pi)
    alike: Flags = (off % 2 if task.turns == "any" else off) == 0
    return alike


def _arrivals(task: Task) -> Iterator[Callable[[Releases, Array], Flags]]:
    """Conditions on the way to the target: releases enter a cup with the end first that the target
    has, land on the target's side of the base column, enter the cup at their landing, and clear arm
    and column.

    Each gives the flags (N,) of the releases that keep it, for these and landing (N, 3): x [m],
    theta [rad] and flight time [s].
    """
    scene, target, has_column = task.scene, task.target, column_of(task.scene) is not None
    theta = target.theta
    if scene.cup is not None and theta is not None:
        yield lambda _, landing: same_end(task, landing[:, 1], theta)
    if has_column:
        yield lambda _, landing: np.sign(landing[:, 0]) == np.sign(target.plane_x)
    if scene.cup is not None:
        yield lambda releases, landing: lands_well(scene, releases.detach, landing)
    yield lambda releases, _: releases.clear
    if has_column:
        yield lambda releases, landing: flies_past_column(scene, releases.detach, landing[:, 2])


def release_start(problems: NlpCache, task: Task, table: Releases, index: int, goal: Pose) -> Start:
    """A start from release `index` of a table."""
    scene, manipulator = task.scene, problems.manipulator
    thrown = sampled_throw(scene, manipulator, table, index)
    throw = PlannedThrow(thrown.path, thrown, 0.0, (0, 0))
    return Start(goal, guess_of(throw, scene), task.solvers[0], tries=TRIES)
