"""The search, whole: one loop over starts of three kinds; attempts from each."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter, itemgetter

import numpy as np

from ...interrupts import interrupts_deferred
from ...problems import Pose
from ..ocp import Optimum, Refinement
from ..result import Bound, PlannedThrow
from ..throw import Manipulator
from .attempts import Elastic, Exact, Outcome, attempt, quieted
from .bounds import bound_of
from .decision_vectors import guess_of
from .library import Library, Neighbour
from .move import Corrector, optimum_of
from .nlp_cache import NlpCache, Task
from .releases import Releases
from .starts import Starts


@dataclass(frozen=True)
class SearchSettings:
    """Settings of the search.

    prices [1/m]: of an elastic landing's pose error, one after the other. close [m]: pose error
    from which the NLP for the target itself is tried. vain: the search ends after so many elastic
    starts that came no nearer, twice as many while none led to a motion. known: solved throws of a
    library that are tried; beside [m]: how near to the target these, or a warm plan, land.
    """

    prices: tuple[float, ...] = (100.0, 1000.0)
    close: float = 0.03
    vain: int = 4
    known: int = 4
    beside: float = 0.15


SETTINGS = SearchSettings()
#: Throws differ if their coordinates or rates at the opening's start do by more than this share.
DIFFERENT_SHARE = 0.1
#: Throws differ if their flight times do by more than this [s].
DIFFERENT_FLIGHT = 0.05
#: Sampled releases of each sort that the NLP for the target starts from, for each throw wanted.
SAMPLED = 2
#: Share of the time in which throws are looked for; the rest is for making them quiet.
SEARCHED = 0.6
#: Throws into a region of which the cheapest is taken.
IN_REGION = 3
#: A warm plan's solution needs few iterations for a target within this pose error [m] of its own.
NEAR = 0.005


@dataclass(frozen=True)
class Moved:
    """A solved throw, moved along its slope."""

    near: Neighbour


Start = Moved | Exact | Elastic


@dataclass(frozen=True, eq=False)
class SearchContext:
    """What the searches of one scene share; table: gives its release table; keep: whether the
    library is in the cache, or stays empty."""

    problems: NlpCache
    table: Callable[[], Releases]
    keep: bool = True

    def from_state(self, manipulator: Manipulator) -> SearchContext:
        """The context of a manipulator that begins in another state of motion.

        It shares NLPs and table, but has no library, whose throws begin at rest.
        """
        return replace(self, problems=self.problems.from_state(manipulator), keep=False)

    @cached_property
    def library(self) -> Library:
        """The scene's solved throws that the cache has."""
        return Library(self.problems.scene, self.problems.manipulator, keep=self.keep)

    @cached_property
    def corrector(self) -> Corrector:
        """Moves solved throws."""
        return Corrector(self.library.controls, self.problems)


@dataclass
class Search:
    """The search for throws to one target; warm: a solved throw to a target nearby.

    found: throws to the target that differ, see `distinct`; short: those that keep their limits
    beside it, nearest first; broken: how often a limit ended a start without either; elastic:
    number of elastic starts.
    """

    context: SearchContext
    task: Task
    warm: PlannedThrow | None = None
    found: list[Outcome] = field(default_factory=list)
    short: list[Outcome] = field(default_factory=list)
    broken: Counter[str] = field(default_factory=Counter)
    elastic: int = 0

    @cached_property
    def bound(self) -> Bound | None:
        """What proves that nothing reaches the target, if anything does."""
        return bound_of(self.task.scene, self.context.problems.manipulator, self.task.target)

    def run(self) -> None:
        """Tries starts until there are enough throws, or starts are in vain, or time is over."""
        task, vain, as_warm = self.task, 0, None
        # A throw that was found leaves time to make it quiet.
        for_search = task.budget.part(SEARCHED) if task.quiet else task.budget
        for start in self.starts():
            if (for_search if self.found else task.budget).late:
                break
            with interrupts_deferred():
                one = self.attempt(start)
            task.budget.counts["starts"] += 1
            before, miss = len(self.found), self.least_miss
            if one.hits:
                self.found = distinct([*self.found, one])
                as_warm = one if self._is_warm(start) else as_warm
            elif isinstance(start, Elastic) and one.ok:
                self.short = sorted([*self.short, one], key=attrgetter("missed"))
            else:
                self.broken.update(one.broken)
            if isinstance(start, Elastic):
                gained = len(self.found) > before or self.least_miss < miss
                vain = 0 if gained else vain + 1
            # Two starts that lead to one throw into a bin have found the best of it.
            if one.hits and len(self.found) == before and task.scene.bin is not None:
                break
            # Asked before the next start is made, which takes a third of an easy plan's time.
            if self.is_over(vain):
                break
        if task.quiet:
            self._quieten(as_warm)

    def _quieten(self, kept: Outcome | None) -> None:
        """Makes the throws that were asked for quiet, each unless it is then like one before.

        kept: that of a warm plan's solution, which stays as loud as that plan's.
        """
        loud, self.found = self.found[: self.task.wanted], []
        for one in loud:
            with interrupts_deferred():
                quiet = one if one is kept else quieted(self.context.problems, one, self.task)
            known = len(self.found)
            for throw in (quiet, one):
                if len(self.found) == known or self.task.loud:
                    self.found = distinct([*self.found, throw])

    def _is_warm(self, start: Start) -> bool:
        """Whether a start is the warm plan's solution, for a target not far from that plan's."""
        warm, half = self.warm, self.task.scene.object.half_length
        if warm is None or warm.solution is None or not isinstance(start, Exact):
            return False
        away = self.task.target.distance(warm.deciding.target, half)
        return start.warm is warm.solution and away < SETTINGS.beside

    @property
    def least_miss(self) -> float:
        """Pose error [m] of the nearest landing; inf without one."""
        return self.short[0].missed if self.short else math.inf

    def is_over(self, vain: int) -> bool:
        """Whether there are enough throws, or further starts seem in vain."""
        # Without any motion another start is worth more.
        most = SETTINGS.vain if self.short or self.found else 2 * SETTINGS.vain
        return len(self.found) >= self.wanted or vain >= most

    @property
    def wanted(self) -> int:
        """Number of throws to look for; local optima of a region differ in cost."""
        is_new = self.task.target.is_region and self.warm is None
        return max(self.task.wanted, IN_REGION) if is_new else self.task.wanted

    # Starts.

    def starts(self) -> Iterator[Start]:
        """Known throws near the target; sampled ones that land near it; then throws of each kind of
        motion that are brought to it, or as near as limits let them."""
        problems, task, wanted = self.context.problems, self.task, self.wanted
        if self.bound is None:
            yield from self.from_known()
        with task.budget("build"):
            table = self.context.table()
        every = Starts(table, task, problems.manipulator)
        arriving = every.arriving
        if self.bound is None:
            tried = set[bytes]()
            for starts, near in ((every, every.nearest), (arriving, arriving.by_kind)):
                for index, goal, _ in near[: SAMPLED * wanted]:
                    if (key := starts.releases.key(index)) not in tried:
                        tried.add(key)
                        yield Exact(goal, starts.guess(index))
        drawn = every.drawn
        for index, goal, _ in sorted(drawn.nearest, key=itemgetter(0)):
            yield Elastic(goal, drawn.guess(index), drawn.home(index, goal))

    def from_known(self) -> Iterator[Start]:
        """The warm plan's throw and those of the library near the target, each moved, then solved
        anew."""
        task = self.task
        # A moved throw keeps its place in a region, and its time: another may cost less.
        may_move = not task.target.is_region and task.scene.weights.usual
        may_move = may_move and task.solver == "fatrop" and task.scene.release is None
        # What moves a throw knows no constraints; their checks refuse what breaks them.
        may_move = may_move and all(one.check is not None for one in task.scene.constraints)
        if self.warm is not None:
            optimum = self._optimum(self.warm) if may_move else None
            if optimum is not None:
                near = Neighbour.of(optimum, self._goal_of(self.warm), task.scene)
                if near.distance < SETTINGS.beside:
                    yield Moved(near)
            yield self.from_warm(self.warm)
        known = SETTINGS.known, SETTINGS.beside
        for near in self.context.library.nearest_throws(task.target, task.turns, *known):
            if may_move:
                yield Moved(near)
            yield self.context.corrector.start(near, task)

    def _goal_of(self, warm: PlannedThrow) -> Pose:
        """The target, with the full turns of a warm plan's throw where turns do not count."""
        target, theta = self.task.target, warm.deciding.landing.theta
        if target.theta is None or self.task.turns == "exact":
            return target
        return target.turned(2 * math.pi * round((theta - target.theta) / (2 * math.pi)))

    def _optimum(self, warm: PlannedThrow) -> Optimum | None:
        """The warm plan's optimum, with its slope; None without a solution of an NLP for a pose."""
        if warm.optimum is not None or warm.solution is None:
            return warm.optimum
        problems, target = self.context.problems, warm.deciding.target
        program = problems.problem(target, warm.refinement, "fatrop", self.task.budget)
        return optimum_of(self.context.library.controls, program, warm)

    def from_warm(self, warm: PlannedThrow) -> Exact:
        """The NLP from a warm plan's throw; from its solution where that is of the same NLP."""
        target, scene = self._goal_of(warm), self.task.scene
        solution, own = warm.solution, warm.deciding.target
        if solution is None or own.kind != target.kind:
            return Exact(target, guess_of(warm), Refinement(quiet=warm.refinement.quiet))
        near = target.distance(own, scene.object.half_length) < NEAR
        return Exact(target, lambda _: solution.x, warm.refinement, warm.aim, solution, near)

    # Attempts.

    def attempt(self, start: Start) -> Outcome:
        """The throw that a start leads to."""
        problems, task = self.context.problems, self.task
        if isinstance(start, Moved):
            return self.context.corrector.attempt(start.near, task)
        if isinstance(start, Exact):
            return attempt(problems, start, task)
        self.elastic += 1
        return self.approached(start, from_home=self.elastic % 2 == 0)

    def approached(self, start: Elastic, *, from_home: bool) -> Outcome:
        """The throw of a start brought as near to the goal as limits let it, price by price.

        from_home: from the optimum at its own landing, which is easy to find; else only if the
        start itself leads to no motion.
        """
        problems, task, best = self.context.problems, self.task, Outcome(start.goal)
        if from_home:
            start = self.at_home(start)
        for price in SETTINGS.prices:
            one = attempt(problems, start, task, price=price)
            if one.throw is None and best.throw is None and not from_home:
                start = self.at_home(start)
                one = attempt(problems, start, task, price=price)
            if not one.ok or one.throw is None:
                best = one if best.throw is None else best
                break
            if one.missed >= best.missed:
                break
            best = one
            guess = guess_of(one.throw)
            if one.missed < SETTINGS.close:
                exact = attempt(problems, Exact(start.goal, guess, one.refinement), task)
                if exact.hits:
                    return exact
            if best.hits:
                break
            start = replace(start, guess=guess, refinement=one.refinement, from_miss=True)
        return best.without_nlp

    def at_home(self, start: Elastic) -> Elastic:
        """The start from the optimum at its own landing."""
        home, task = start.home, self.task.aimed_at(start.home)
        own = Exact(home, start.guess, start.refinement)
        one = attempt(self.context.problems, own, task, rounds=2, corrections=1)
        if one.throw is None:
            return start
        guess = guess_of(one.throw)
        return replace(start, guess=guess, refinement=one.refinement, from_miss=True)


# Several throws to one target: which of them differ.


def distinct(found: list[Outcome]) -> list[Outcome]:
    """The throws that differ from all before them, quiet ones first, the cheapest first."""
    kept: list[Outcome] = []
    for one in sorted(found, key=lambda one: (not one.refinement.quiet, _throw_of(one).effort)):
        if all(_differ(_throw_of(one), _throw_of(other)) for other in kept):
            kept.append(one)
    return kept


def _throw_of(found: Outcome) -> PlannedThrow:
    assert found.throw is not None
    return found.throw


def _differ(one: PlannedThrow, other: PlannedThrow) -> bool:
    """Whether coordinates or rates at the opening's start, or flight times, do."""
    states = [thrown.planned.at(np.array([thrown.opening_time])) for thrown in (one, other)]
    for a, b in zip(*((state.pose, state.twist) for state in states), strict=True):
        most = DIFFERENT_SHARE * max(np.linalg.norm(a), np.linalg.norm(b))
        if np.linalg.norm(a - b) > most:
            return True
    flown = [thrown.deciding.landing.flight_time for thrown in (one, other)]
    return abs(flown[0] - flown[1]) > DIFFERENT_FLIGHT
