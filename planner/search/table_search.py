"""Search for throws from nothing but a target: starts from the release table, then the edge."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ...problems import Pose, Scene
from ..ocp import HEAVY
from .alternatives import Found, distinct
from .closer import closer
from .correction import Search
from .from_elastic import from_elastic
from .from_release import from_release
from .nearest_possible import Binding, Reach, in_column
from .releases import Releases, ReleaseSampler
from .starts import Turns, past_column, starts
from .workbench import Workbench

#: Starts tried with FATROP, then with IPOPT.
STARTS = {"fatrop": 6, "ipopt": 4}
#: Starts tried first, without guards that cost much.
LIGHT_STARTS = 4
#: Beyond the first distance [m, scaled error] from every landing of the table nearer ones are
#: looked for; where these stay beyond the second the question what is possible at all comes
#: before any start. Targets in reach are seldom more than 0.04 m from the table's landings.
FAR, STILL_FAR = 0.08, 0.05
#: A goal a full turn off counts too where its nearest landing is at most so much farther.
RIVAL = 2.0

#: Solver, number of starts and whether without heavy guards.
Round = tuple[str, int, bool]
#: A release's number, the goal, and how far [m, scaled error] it lands from that.
Start = tuple[int, Pose, float]


@dataclass(frozen=True)
class Outcome:
    """What a search comes to: throws; or else what is possible, if that could be told.

    releases: the table, with what was looked for nearer to the target.
    """

    found: list[Found]
    answer: Binding | None
    releases: Releases


@dataclass(frozen=True)
class _Aim:
    """What is looked for: so many distinct throws to the target."""

    target: Pose
    turns: Turns
    wanted: int

    def starts(self, releases: Releases, scene: Scene) -> list[Start]:
        """The releases that land nearest."""
        most = max(STARTS.values()) * self.wanted
        return starts(releases, scene, self.target, self.turns, most)


@dataclass
class _Candidates:
    """Releases to start from, the nearest first; coarse: nearer ones may be looked for."""

    releases: Releases
    first: list[Start]
    coarse: bool = True

    @property
    def goal(self) -> Pose:
        """Of the turns that are allowed the one with the nearest landing."""
        return self.first[0][1]

    @property
    def distance(self) -> float:
        """How far from its goal the nearest lands [m, scaled error]."""
        return self.first[0][2]

    @property
    def undisputed(self) -> bool:
        """Whether no other goal has a landing about as near."""
        near = (goal for _, goal, away in self.first if away < RIVAL * self.distance)
        return all(goal == self.goal for goal in near)


class TableSearch:
    """Searches of one scene; `table` gives its release table."""

    def __init__(
        self, bench: Workbench, sampler: ReleaseSampler, reach: Reach, table: Callable[[], Releases]
    ) -> None:
        self._bench, self._sampler, self._reach, self._table = bench, sampler, reach, table

    @property
    def _scene(self) -> Scene:
        return self._bench.scene

    def run(
        self, target: Pose, turns: Turns, names: tuple[str, ...], wanted: int, search: Search
    ) -> Outcome:
        """At most `wanted` distinct throws by the solvers `names`, one after the other."""
        aim = _Aim(target, turns, wanted)
        candidates = self._nearest(aim, search)
        if not candidates.first:
            return Outcome([], None, candidates.releases)
        answer, found, settled = self._asked_first(candidates, target, search)
        if len(found) >= wanted or settled:
            return Outcome(found, answer, candidates.releases)
        asked = search.guards
        for rounds in _rounds(names):
            for throw in self._throws(candidates, aim, rounds, search):
                found.append(throw)
                if len(distinct(found)) >= wanted:
                    return Outcome(found, None, candidates.releases)
            if candidates.coarse and not search.late:
                self._look_closer(candidates, aim, search)
        if not found and not search.late and (answer is None or search.guards != asked):
            answer, found = self._at_the_edge(candidates, search)
        return Outcome(found, answer, candidates.releases)

    def _nearest(self, aim: _Aim, search: Search) -> _Candidates:
        """The table's releases that land nearest, and nearer ones where all are far."""
        with search.clock("guess"):
            releases = self._table()
            candidates = _Candidates(releases, aim.starts(releases, self._scene))
        if candidates.first and candidates.distance > FAR:
            self._look_closer(candidates, aim, search)
        return candidates

    def _look_closer(self, candidates: _Candidates, aim: _Aim, search: Search) -> None:
        """Adds releases that land nearer than those there are."""
        with search.clock("guess"):
            candidates.releases = closer(self._sampler, candidates.releases, candidates.goal)
            candidates.first = aim.starts(candidates.releases, self._scene)
            candidates.coarse = False

    def _asked_first(
        self, candidates: _Candidates, target: Pose, search: Search
    ) -> tuple[Binding | None, list[Found], bool]:
        """Where nothing lands near, or there is no room: what is possible at all.

        And whether that settles it: then it comes as near as any release, but not to the goal.
        """
        blocked = in_column(self._scene, target)
        if blocked:
            search.guards |= {"passing"}
        if not blocked and (candidates.coarse or candidates.distance <= STILL_FAR):
            return None, [], False
        answer, found = self._at_the_edge(candidates, search)
        as_near = answer.missed <= candidates.distance + self._scene.tolerance.position
        settled = answer.outside and (blocked or (as_near and candidates.undisputed))
        return answer, found, settled

    def _throws(
        self, candidates: _Candidates, aim: _Aim, rounds: list[Round], search: Search
    ) -> Iterator[Found]:
        """Throws that the rounds of starts lead to."""
        first, table, passing = candidates.first, candidates.releases, False
        # Heavy guards cost more than other starts, which often do without.
        for name, count, light in rounds:
            if name != rounds[0][0] and search.guards & HEAVY:
                # The starts have had IPOPT already.
                return
            number = 0
            while not search.late:
                if "passing" in search.guards and not passing:
                    # From now on from the nearest of those that fly past the column.
                    number, passing = 0, True
                    table = past_column(table, self._scene, aim.target.z)
                    first = aim.starts(table, self._scene)
                if number >= min(count * aim.wanted, len(first)):
                    break
                index, goal, _ = first[number]
                number += 1
                found = from_release(self._bench, name, index, goal, table, search, light)
                if found is not None:
                    yield found

    def _at_the_edge(self, candidates: _Candidates, search: Search) -> tuple[Binding, list[Found]]:
        """What is possible nearest the goal, and the throw to the goal that this leads to.

        From the table and the elastic solve; asked anew with the rows that that throw's check
        has seen to be missing.
        """
        while True:
            guards = search.guards
            with search.clock("solve"):
                answer = self._reach.nearest_possible(
                    search.scene, candidates.releases, candidates.goal, guards
                )
            search.iterations += answer.iterations
            found = None if search.late else from_elastic(self._bench, answer, search)
            if found is not None:
                return answer, [found]
            if search.guards == guards or search.late:
                return answer, []


def _rounds(names: tuple[str, ...]) -> list[list[Round]]:
    """Rounds of starts from the table, and from the releases that are looked for then."""
    first, rest = names[0], names[1:]
    table = [(first, LIGHT_STARTS, True), (first, STARTS[first], False)]
    return [table, [(first, LIGHT_STARTS, False), *((name, STARTS[name], False) for name in rest)]]
