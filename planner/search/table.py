"""Search for throws from nothing but a target: starts from the release table, then the edge."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ...problems import Pose
from ..check import Guard
from ..ocp import USUAL, Asked, ThrowNlp
from .attempt import Attempt, Start, attempts
from .choice import distinct
from .guess import guess_from
from .nearest import Binding, Reach, from_elastic, in_column
from .nlps import Problems, Task
from .release_table import Releases, Turns, past_column, starts
from .sampling import ReleaseSampler, closer

#: Starts tried with FATROP, then with IPOPT.
STARTS = {"fatrop": 6, "ipopt": 4}
#: Starts tried first, without heavy guards.
LIGHT_STARTS = 4
#: NLPs tried from one release, each asked for what the check of the last one found broken.
TRIES = 4
#: Beyond the first distance [m, scaled error] from every landing of the table nearer releases are
#: sampled; where these stay beyond the second the question what is possible at all comes before
#: any start. Targets in reach are seldom more than 0.04 m from the table's landings.
FAR, STILL_FAR = 0.08, 0.05
#: A goal a full turn off counts too where its nearest landing is at most this times as far.
RIVAL = 2.0


@dataclass(frozen=True)
class Outcome:
    """What a search comes to: its attempts, and what is possible at all where that was asked.

    answer: of the last elastic solve, None without one; iterations: of the elastic solves;
    releases: the table, with those sampled near the target.
    """

    attempts: list[Attempt]
    answer: Binding | None
    iterations: int
    releases: Releases

    @property
    def solved(self) -> list[Attempt]:
        """The attempts that led to a throw."""
        return [attempt for attempt in self.attempts if attempt.solved]


@dataclass(frozen=True)
class _Round:
    """Some starts from a table by one solver; light: without heavy guards."""

    solver: str
    count: int
    light: bool


class TableSearch:
    """Searches of one scene; `table` gives its release table."""

    def __init__(
        self,
        problems: Problems,
        sampler: ReleaseSampler,
        reach: Reach,
        table: Callable[[], Releases],
    ) -> None:
        self._problems, self._sampler, self._reach, self._table = problems, sampler, reach, table

    def run(self, task: Task, turns: Turns, wanted: int) -> Outcome:
        """At most `wanted` distinct throws, by the task's solvers one after the other."""
        search = _Search(self._problems, self._sampler, self._reach, task, turns, wanted)
        with task.clock("guess"):
            search.use(self._table())
        answer = search.run()
        return Outcome(search.attempts, answer, search.iterations, search.releases)


@dataclass
class _Search:
    """One search: the releases to start from, and what its attempts have learned so far.

    asked: what the next NLP is asked; coarse: whether no releases near the target were sampled
    yet; tried: releases that led nowhere, with solver and what was asked.
    """

    problems: Problems
    sampler: ReleaseSampler
    reach: Reach
    task: Task
    turns: Turns
    wanted: int
    attempts: list[Attempt] = field(default_factory=list)
    iterations: int = 0
    asked: Asked = USUAL
    coarse: bool = True
    tried: set[tuple[object, ...]] = field(default_factory=set)

    def use(self, releases: Releases) -> None:
        """Takes a table: (release, goal, scaled distance [m]) of the nearest landings."""
        self.releases = releases
        self.nearest = self._starts(releases)

    def _starts(self, releases: Releases) -> list[tuple[int, Pose, float]]:
        most = max(STARTS.values()) * self.wanted
        return starts(releases, self.task.scene, self.task.target, self.turns, most)

    @property
    def _goal(self) -> Pose:
        """Of the turns that are allowed the one with the nearest landing."""
        return self.nearest[0][1]

    @property
    def _done(self) -> bool:
        solved = [attempt for attempt in self.attempts if attempt.solved]
        return len(solved) >= self.wanted and len(distinct(solved)) >= self.wanted

    @property
    def _none(self) -> bool:
        return not any(attempt.solved for attempt in self.attempts)

    def run(self) -> Binding | None:
        """Searches; what is possible at all, where that was asked."""
        late, answer = self.task.clock, None
        if self.nearest and self.nearest[0][2] > FAR:
            self._sample_near()
        if not self.nearest:
            return None
        blocked = in_column(self.task.scene, self.task.target)
        if blocked:
            self._ask("passing")
        if blocked or (not self.coarse and self.nearest[0][2] > STILL_FAR):
            answer = self._at_the_edge()
            if self._done or self._settled(answer, blocked):
                return answer
        guards = self.asked.guards
        for rounds in _rounds(self.task.solvers):
            for _ in self._from_releases(rounds):
                if self._done:
                    return None
            if self.coarse and not late.late:
                self._sample_near()
        if self._none and not late.late and (answer is None or self.asked.guards != guards):
            answer = self._at_the_edge()
        return answer

    def _ask(self, guard: Guard) -> None:
        self.asked = dataclasses.replace(self.asked, guards=self.asked.guards | {guard})

    def _sample_near(self) -> None:
        """Adds releases that land nearer the goal than those of the table."""
        with self.task.clock("guess"):
            self.use(closer(self.sampler, self.releases, self._goal))
        self.coarse = False

    def _settled(self, answer: Binding, blocked: bool) -> bool:
        """Whether the elastic answer proves the target out of reach.

        It must come as near as any sampled release, and no other goal may be about as near.
        """
        goal, distance = self.nearest[0][1:]
        as_near = answer.missed <= distance + self.task.scene.tolerance.position
        rivals = (other for _, other, away in self.nearest if away < RIVAL * distance)
        undisputed = all(other == goal for other in rivals)
        return answer.outside and (blocked or (as_near and undisputed))

    def _from_releases(self, rounds: list[_Round]) -> Iterator[Attempt]:
        """Attempts from the releases that land nearest, round after round."""
        table, nearest, passing = self.releases, self.nearest, False
        for current in rounds:
            if current.solver != rounds[0].solver and self.asked.heavy:
                # These starts have had IPOPT already.
                return
            number = 0
            while not self.task.clock.late:
                if "passing" in self.asked.guards and not passing:
                    # From now on from the nearest of those that fly past the column.
                    number, passing = 0, True
                    table = past_column(table, self.task.scene, self.task.target.z)
                    nearest = self._starts(table)
                if number >= min(current.count * self.wanted, len(nearest)):
                    break
                index, goal, _ = nearest[number]
                number += 1
                yield from self._from_release(table, index, goal, current)

    def _from_release(
        self, table: Releases, index: int, goal: Pose, current: _Round
    ) -> Iterator[Attempt]:
        """Attempts from one release, unless it was tried with the same solver and constraints."""
        start = release_start(self.problems, self.task, table, index, goal)
        start = dataclasses.replace(
            start, solver=current.solver, asked=self.asked, light=current.light
        )
        release = table.q[index].tobytes(), table.detach[index].tobytes(), goal
        if (current.solver, *release, self.asked) in self.tried:
            return
        last = None
        for last in attempts(self.problems, start, self.task):
            self.attempts.append(last)
            yield last
        if last is None:
            return
        after = last.after
        if start.light and after.heavy:
            # Not counted as tried: it comes again when heavy guards may come in.
            after = last.asked
        elif not last.solved:
            self.tried.add((current.solver, *release, start.asked))
        if "carry" not in after.guards:
            # Where one throw's corners needed a margin another's may not.
            margins = dataclasses.replace(after.margins, held=start.asked.margins.held)
            after = dataclasses.replace(after, margins=margins)
        self.asked = after

    def _at_the_edge(self) -> Binding:
        """What is possible nearest the goal, and attempts at the goal from there.

        Asked again with the constraints that these attempts' checks found missing.
        """
        while True:
            guards = self.asked.guards
            with self.task.clock("solve"):
                answer = self.reach.nearest_possible(
                    self.task.scene, self.releases, self._goal, guards
                )
            self.iterations += answer.iterations
            if self.task.clock.late:
                return answer
            margins = self.asked.margins
            for attempt in from_elastic(self.problems, answer, self.task, self.asked):
                self.attempts.append(attempt)
                self.asked = Asked(attempt.after.guards, margins)
                if attempt.solved:
                    return answer
            if self.asked.guards == guards or self.task.clock.late:
                return answer


def release_start(problems: Problems, task: Task, table: Releases, index: int, goal: Pose) -> Start:
    """A start from release `index` of a table."""
    scene, mover = task.scene, problems.mover
    flight = table.flight_time(index, goal.z, scene.gravity)

    def guess(nlp: ThrowNlp) -> np.ndarray:
        return guess_from(nlp, scene, mover, table, index, flight)

    def again(asked: Asked) -> bool:
        # A release that clears column and hand leads there sooner than a throw that does not;
        # for all else the throw is nearer.
        return asked.guards == {"flight"} and bool(table.clear[index])

    return Start(goal, guess, task.solvers[0], tries=TRIES, again=again)


def _rounds(names: tuple[str, ...]) -> list[list[_Round]]:
    """Rounds of starts from the table, and from the releases sampled near the target then."""
    first, rest = names[0], names[1:]
    table = [_Round(first, LIGHT_STARTS, True), _Round(first, STARTS[first], False)]
    near = [_Round(first, LIGHT_STARTS, False), *(_Round(n, STARTS[n], False) for n in rest)]
    return [table, near]
