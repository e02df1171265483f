"""Search for throws from nothing but a target: starts from the release table, then the edge."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from ..problems.scene import Pose, Scene
from .alternatives import Found, distinct
from .closer import closer
from .correction import Search
from .from_elastic import from_elastic
from .from_release import from_release
from .reach import Binding, Reach, in_column
from .releases import Releases, ReleaseSampler
from .starts import Turns, past_column, starts
from .workbench import HEAVY, Workbench

#: Starts tried with FATROP, then with IPOPT.
STARTS = {"fatrop": 6, "ipopt": 4}
#: Starts tried first, without guards that cost much.
LIGHT_STARTS = 4
#: Beyond the first distance [m, scaled error] from every landing of the table nearer ones are
#: looked for; where these stay beyond the second the question what is possible at all comes
#: before any start. Targets in reach are seldom more than 0.04 m from the table's landings.
FAR, STILL_FAR = 0.08, 0.05

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


@dataclass
class _Candidates:
    """Releases to start from, the nearest first; coarse: nearer ones may be looked for."""

    releases: Releases
    first: list[Start]
    coarse: bool = True

    @property
    def distance(self) -> float:
        """How far the nearest lands [m, scaled error]."""
        return self.first[0][2]


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
        most, answer = max(STARTS.values()) * wanted, None
        candidates = self._nearest(target, turns, most, search)
        releases = candidates.releases
        if not candidates.first:
            return Outcome([], None, releases)
        if blocked := in_column(self._scene, target):
            search.guards |= {"passing"}
        far = not candidates.coarse and candidates.distance > STILL_FAR
        if blocked or far:
            # Nothing like it, or no room there: ask first what is possible at all.
            answer, last = self._at_the_edge(candidates, search)
            if answer.outside or (last is not None and wanted == 1):
                return Outcome([] if last is None else [last], answer, releases)
        asked, found = search.asked, list[Found]()
        for rounds in _rounds(names):
            for throw in self._throws(candidates, target, turns, rounds, search):
                found.append(throw)
                if len(distinct(found)) >= wanted:
                    break
            if found:
                return Outcome(found, None, releases)
            if candidates.coarse and not search.late:
                self._look_closer(candidates, target, turns, search)
        if not search.late and (answer is None or search.asked != asked):
            answer, last = self._at_the_edge(candidates, search)
            found = [] if last is None else [last]
        return Outcome(found, answer, candidates.releases)

    def _nearest(self, target: Pose, turns: Turns, most: int, search: Search) -> _Candidates:
        """The table's releases that land nearest, and nearer ones where all are far."""
        with search.clock("guess"):
            releases = self._table()
            found = starts(releases, self._scene, target, turns, most)
        candidates = _Candidates(releases, found)
        if found and candidates.distance > FAR:
            self._look_closer(candidates, target, turns, search)
        return candidates

    def _look_closer(
        self, candidates: _Candidates, target: Pose, turns: Turns, search: Search
    ) -> None:
        """Adds releases that land nearer than those there are."""
        with search.clock("guess"):
            goal, most = candidates.first[0][1], len(candidates.first)
            candidates.releases = closer(self._sampler, candidates.releases, goal)
            candidates.first = starts(candidates.releases, self._scene, target, turns, most)
            candidates.coarse = False

    def _throws(
        self,
        candidates: _Candidates,
        target: Pose,
        turns: Turns,
        rounds: list[Round],
        search: Search,
    ) -> Iterator[Found]:
        """Throws that the rounds of starts lead to."""
        first, table = candidates.first, candidates.releases
        share = len(first) / max(STARTS.values())
        # Heavy guards cost more than other starts, which often do without.
        for name, count, light in rounds:
            if name != rounds[0][0] and search.guards & HEAVY:
                # The starts have had IPOPT already.
                return
            number = 0
            while number < min(count * share, len(first)) and not search.late:
                index, goal, _ = first[number]
                number += 1
                found = from_release(self._bench, name, index, goal, table, search, light)
                if found is not None:
                    yield found
                if "passing" in search.guards and table is candidates.releases:
                    # Now from the nearest of those that fly past the column.
                    number, table = 0, past_column(table, self._scene, target.z)
                    first = starts(table, self._scene, target, turns, len(first))

    def _at_the_edge(self, candidates: _Candidates, search: Search) -> tuple[Binding, Found | None]:
        """What is possible nearest the goal, and the throw to the goal that this leads to.

        From the table and the elastic solve; asked anew with what that throw's check has seen
        to be missing.
        """
        goal, releases = candidates.first[0][1], candidates.releases
        while True:
            asked = search.asked
            with search.clock("solve"):
                answer = self._reach.nearest_possible(search.scene, releases, goal, search.guards)
            search.iterations += answer.iterations
            found = None if search.late else from_elastic(self._bench, answer, search)
            if found is not None or search.asked == asked or search.late:
                return answer, found


def _rounds(names: tuple[str, ...]) -> list[list[Round]]:
    """Rounds of starts from the table, and from the releases that are looked for then."""
    first, rest = names[0], names[1:]
    table = [(first, LIGHT_STARTS, True), (first, STARTS[first], False)]
    return [table, [(first, LIGHT_STARTS, False), *((name, STARTS[name], False) for name in rest)]]
