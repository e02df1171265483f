"""Search for throws from nothing but a target: starts from the release table, then the edge."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...problems import Pose
from ..ocp import USUAL, Asked, ThrowNlp
from .attempt import Attempt, Start
from .guess import guess_from
from .launch import in_obstacles
from .nearest import CLEARLY, Binding, Reach, elastic_starts, in_column
from .nlps import Problems, Task
from .release_table import Releases, Turns, past_column, starts
from .sampling import ReleaseSampler, closer

#: Starts tried with FATROP, then with IPOPT.
STARTS = {"fatrop": 6, "ipopt": 4}
#: Starts tried before the question what is possible at all, and after the answer: not the target.
#: Of two in the latter case a cup in reach was called out of reach; four find its throw.
FIRST_STARTS, EDGE_STARTS = 2, 4
#: Throws of the table that are held against obstacles.
CLEARED = 40
#: NLPs tried from one release, each asked for what the check of the last one found broken.
TRIES = 4
#: Beyond the first distance [m, scaled error] from every landing of the table nearer releases are
#: sampled; where these stay beyond the second the question what is possible at all comes before
#: any start. Targets in reach are seldom more than 0.04 m from the table's landings.
FAR, STILL_FAR = 0.08, 0.05
#: A goal a full turn off counts too where its nearest landing is at most this times as far.
RIVAL = 2.0


@dataclass(frozen=True)
class Sources:
    """What searches of one scene start from; `table` gives its release table."""

    problems: Problems
    sampler: ReleaseSampler
    reach: Reach
    table: Callable[[], Releases]


class Search:
    """The starts of one plan, from nothing but its target: releases of the table, then the edge.

    wanted: how many distinct throws are looked for. tried: the attempts made so far, to which the
    caller adds those from each start before it asks for the next one; what their checks found
    broken decides what that one is asked. answer: what is possible nearest the goal, once that
    was solved for; iterations: of these solves; releases: the table, with those sampled nearby.
    solved: starts from the library's nearest throws with how far off these land [m], nearest first.
    """

    def __init__(
        self,
        sources: Sources,
        task: Task,
        turns: Turns,
        wanted: int,
        tried: list[Attempt],
        solved: Sequence[tuple[Start, float]] = (),
    ) -> None:
        self._solved = solved
        self._sources, self._task, self.turns, self._wanted = sources, task, turns, wanted
        self._tried = tried
        self._asked, self._coarse = USUAL, True
        self._clear: list[tuple[int, Pose, float]] | None = None
        self._led_nowhere: set[tuple[object, ...]] = set()
        self.answer: Binding | None = None
        self.iterations = 0
        with task.clock("build"):
            table = sources.table()
        with task.clock("guess"):
            self._use(table)

    def _use(self, releases: Releases) -> None:
        """Takes a table: (release, goal, scaled distance [m]) of the nearest landings."""
        self.releases, self._clear = releases, None
        self._nearest = self._landing_nearest(releases)

    def _landing_nearest(self, releases: Releases) -> list[tuple[int, Pose, float]]:
        most = max(STARTS.values()) * self._wanted
        return starts(releases, self._task.scene, self._task.target, self.turns, most)

    @property
    def _clearest(self) -> list[tuple[int, Pose, float]]:
        """The nearest landings; with obstacles, of more of them those whose throws clear these."""
        scene = self._task.scene
        if not scene.obstacle:
            return self._nearest
        if self._clear is None:
            found = starts(self.releases, scene, self._task.target, self.turns, CLEARED)
            mover = self._sources.problems.mover
            with self._task.clock("guess"):
                meets = [in_obstacles(scene, mover, self.releases, i) for i, _, _ in found]
            order = np.argsort([far + deep for (*_, far), deep in zip(found, meets, strict=True)])
            self._clear = [found[i] for i in order]
        return self._clear

    @property
    def _goal(self) -> Pose:
        """Of the turns that are allowed the one with the nearest landing."""
        if self._solved and not (self._nearest and self._nearest[0][2] < self._solved[0][1]):
            return self._solved[0][0].goal
        return self._nearest[0][1]

    def starts(self) -> Iterator[Start]:
        """Starts until nothing more is worth a try."""
        clock, first = self._task.clock, len(self._tried)
        # A library goes to the edge of the reach: what is far from it all is beyond.
        beyond = bool(self._solved) and self._solved[0][1] > STILL_FAR
        if not beyond and self._nearest and self._nearest[0][2] > FAR:
            self._sample_near()
        if not self._nearest:
            return
        blocked = in_column(self._task.scene, self._task.target)
        if blocked:
            self._asked = dataclasses.replace(self._asked, guards=frozenset({"passing"}))
        if blocked or beyond or (not self._coarse and self._nearest[0][2] > STILL_FAR):
            yield from self._at_the_edge(blocked)
            if self._settled(blocked):
                return
        guards = self._asked.guards
        solvers = self._task.solvers
        yield from self._from_releases(solvers[0], FIRST_STARTS)
        if self.answer is None and not self._found(first):
            yield from self._at_the_edge()
            if self._settled(blocked):
                return
        if self._coarse and not clock.late:
            self._sample_near()
        if self._outside:
            # A target at the very edge: some other starts, no more.
            yield from self._from_releases(solvers[0], EDGE_STARTS)
            return
        for solver in solvers:
            yield from self._from_releases(solver, STARTS[solver])
        if not self._found(first) and self._asked.guards != guards:
            yield from self._at_the_edge()

    @property
    def _outside(self) -> bool:
        """Whether the nearest possible landing is known, and is not the goal."""
        return self.answer is not None and self.answer.outside

    def _found(self, first: int) -> bool:
        """Whether any attempt from `first` on gave a solved throw."""
        return any(attempt.solved for attempt in self._tried[first:])

    def _sample_near(self) -> None:
        """Adds releases that land nearer the goal than those of the table."""
        with self._task.clock("guess"):
            self._use(closer(self._sources.sampler, self.releases, self._goal))
        self._coarse = False

    def _settled(self, blocked: bool) -> bool:
        """Whether the answer says that the target is out of reach.

        Clearly, that is, and no other goal may be about as near.
        """
        answer = self.answer
        if answer is None or not answer.outside:
            return False
        goal = self._goal
        distance = self._nearest[0][2] if self._nearest else 0.0
        rivals = (other for _, other, away in self._nearest if away < RIVAL * distance)
        return blocked or (answer.missed > CLEARLY and all(other == goal for other in rivals))

    def _from_releases(self, solver: str, count: int) -> Iterator[Start]:
        """Starts from the releases that land nearest, for each throw that is wanted."""
        table, nearest, number, passing = self.releases, self._clearest, 0, False
        while not self._task.clock.late:
            if "passing" in self._asked.guards and not passing:
                # From now on from the nearest of those that fly past the column.
                number, passing = 0, True
                table = past_column(table, self._task.scene, self._task.target.z)
                nearest = self._landing_nearest(table)
            if number >= min(count * self._wanted, len(nearest)):
                break
            index, goal, _ = nearest[number]
            number += 1
            yield from self._from_release(table, index, goal, solver)

    def _from_release(
        self, table: Releases, index: int, goal: Pose, solver: str
    ) -> Iterator[Start]:
        """A start from one release, unless it led nowhere with the same solver and constraints."""
        release = table.q[index].tobytes(), table.detach[index].tobytes(), goal
        if (solver, *release, self._asked) in self._led_nowhere:
            return
        start = release_start(self._sources.problems, self._task, table, index, goal)
        before = len(self._tried)
        yield dataclasses.replace(start, solver=solver, asked=self._asked)
        if len(self._tried) == before:
            return
        last = self._tried[-1]
        if not last.solved:
            self._led_nowhere.add((solver, *release, self._asked))
        after = last.after
        if "carry" not in after.guards:
            # Where one throw's corners needed a margin another's may not.
            margins = after.margins.replace(held=self._asked.margins["held"])
            after = dataclasses.replace(after, margins=margins)
        self._asked = after.elsewhere

    def _at_the_edge(self, blocked: bool = False) -> Iterator[Start]:
        """Solves for what is possible nearest the goal; starts from there.

        Again with the constraints that the attempts' checks found missing.
        """
        while not self._task.clock.late:
            guards, margins = self._asked.guards, self._asked.margins
            self.answer = self._sources.reach.nearest_possible(
                self._task, self.releases, self._goal, guards, self._solved
            )
            self.iterations += self.answer.iterations
            if blocked and self.answer.outside:
                return
            for variant in elastic_starts(self.answer, self._task, self._asked):
                if self._task.clock.late:
                    return
                before = len(self._tried)
                wanted = variant.asked.guards | self._asked.guards
                asked = Asked(wanted, variant.asked.margins, self._asked.near)
                yield dataclasses.replace(variant, asked=asked)
                if len(self._tried) > before:
                    after = self._tried[-1].after
                    self._asked = Asked(after.guards, margins, after.near).elsewhere
                    if self._tried[-1].solved:
                        return
                    again = self._asked.guards != guards and not self.answer.outside
                    if again and variant.solver != self._task.solvers[0]:
                        # Both solvers have failed with them: an edge that knows them comes first.
                        break
            if self._asked.guards == guards or self.answer.outside:
                return


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
