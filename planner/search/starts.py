"""Sampled releases as starts: those that land nearest to a target, of all kinds of motion."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...models import Array, Flags
from ...problems import Pose
from ..ocp import ThrowNlp
from ..result import PlannedThrow
from ..throw import Manipulator, column_of
from ..verdict import lands_well
from .decision_vectors import guess_of
from .library import landing_errors
from .nlp_cache import Task
from .releases import (
    UNMET,
    Releases,
    ReleaseSampler,
    drawn_towards,
    flies_past_column,
    kinds,
    nearest_releases,
    sampled_throw,
)

#: Number of nearest sampled releases of which starts are chosen.
NEAR = 400


@dataclass(frozen=True, eq=False)
class Starts:
    """A table's releases as starts for a task."""

    releases: Releases
    task: Task
    manipulator: Manipulator

    @cached_property
    def nearest(self) -> list[tuple[int, Pose, float]]:
        """(release, goal, pose error [m]) of the nearest landings, nearest first."""
        task = self.task
        with task.budget("guess"):
            return nearest_releases(self.releases, task.scene, task.target, task.turns, NEAR)

    @cached_property
    def arriving(self) -> Starts:
        """The releases that keep `_arrivals`; a condition that none keeps is ignored."""
        landing = self.releases.landings(self.task.target.z, self.task.scene.flight).T
        good = np.flatnonzero(np.isfinite(landing[:, 2]))
        for holds in _arrivals(self.task):
            kept = good[holds(self.releases.picked(good), landing[good])]
            good = kept if len(kept) else good
        return replace(self, releases=self.releases.picked(good))

    @cached_property
    def by_kind(self) -> list[tuple[int, Pose, float]]:
        """As `nearest`: first of each kind of motion the nearest, then the others."""
        near = self.nearest
        first = kinds(self.releases.q[[index for index, *_ in near]])
        return [near[k] for k in (*first, *sorted(set(range(len(near))) - set(first)))]

    @cached_property
    def drawn(self) -> Starts:
        """Releases drawn towards the target beside those that arrive: the nearest of each kind of
        motion, first the nearest of all, then that which differs most from all before it."""
        with self.task.budget("guess"):
            sampler = ReleaseSampler(self.task.scene, self.manipulator)
            table, chosen = drawn_towards(sampler, self.arriving.releases, self._away)
            return replace(self, releases=table.picked(np.array(chosen, int)))

    def _away(self, releases: Releases) -> Array:
        """Pose errors (N,) [m] of releases' landings, and what `drawn_towards` adds."""
        task = self.task
        landings = releases.landings(task.target.z, task.scene.flight)
        errors, _ = landing_errors(task.scene, task.target, task.turns, landings)
        unmet = (~holds(releases, landings.T) for holds in _arrivals(task))
        return errors + UNMET * sum(unmet, np.zeros(len(errors)))

    def guess(self, index: int) -> Callable[[ThrowNlp], Array]:
        """The decision vector of a release's throw, for any NLP."""
        scene = self.task.scene
        thrown = sampled_throw(scene, self.manipulator, self.releases, index)
        return guess_of(PlannedThrow(thrown.path, thrown, 0.0, (0, 0)))

    def home(self, index: int, goal: Pose) -> Pose:
        """Where a release lands, in the goal's plane."""
        x, theta, _ = self.releases.landings(goal.z, self.task.scene.flight)[:, index]
        return goal.in_plane(float(x), None if goal.theta is None else float(theta))


def same_end(task: Task, landed: Array, theta: float) -> Flags:
    """Whether a bar at angles `landed` (N,) [rad] enters a cup with the end that is lower at
    `theta`, after as many half turns where turns count."""
    off = np.floor(landed / math.pi) - math.floor(theta / math.pi)
    alike: Flags = (off % 2 if task.turns == "any" else off) == 0
    return alike


def _arrivals(task: Task) -> Iterator[Callable[[Releases, Array], Flags]]:
    """Conditions on the way to the target: releases enter a cup with the end first that the target
    has, land on the target's side of the base column, enter cup or bin at their landing, and clear
    arm and column.

    Each gives the flags (N,) of the releases that keep it, for these and landing (N, 3): x [m],
    theta [rad] and flight time [s].
    """
    scene, target, has_column = task.scene, task.target, column_of(task.scene) is not None
    theta = target.theta
    if scene.cup is not None and theta is not None:
        yield lambda _, landing: same_end(task, landing[:, 1], theta)
    if has_column:
        yield lambda _, landing: np.sign(landing[:, 0]) == np.sign(target.plane_x)
    if scene.opening is not None:
        yield lambda releases, landing: lands_well(scene, releases.detach, landing)
    yield lambda releases, _: releases.clear
    if has_column:
        yield lambda releases, landing: flies_past_column(scene, releases.detach, landing[:, 2])
