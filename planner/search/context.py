"""What searches of one scene share: settings, NLPs, library, and the throws of earlier plans."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property

from ...problems import Pose
from ..library import Library, Turns
from ..samples import Releases
from ..throw import Manipulator
from .attempt import Attempt
from .move import Corrector, fixed_optimum
from .nlp_cache import NlpCache, Task


@dataclass(frozen=True)
class SearchSettings:
    """Numbers of throws, and distances as pose errors [m] from a landing to the target.

    moves, moves_for_choice: most solved throws moved, for one throw and for each of several.
    max_distance, warm_distance: largest distance of a throw that is moved, and of a warm plan.
    near_distance: within it a warm plan's solution needs few iterations. comparable: further
    solutions for a region are corrected up to this multiple of the least cost. first_starts:
    sampled starts, and those of them that arrive well, solved before throws beside the target are
    brought to it; also throws of the library that are brought near with all constraints.
    approaches: solved throws, brought as near to the target as limits allow; leads: of the library,
    moved towards it before. found_distance: within it a
    solver starts from a throw of an earlier plan. same_distance: a throw within it of one that is
    kept is not kept; a target within it of the nearest landing is not called out of reach, with a
    cup within `close_distance` not for sampled throws that lead nowhere, as one of two such answers
    over the map of `cup` was false. A target is out of reach if no sampled throw that was drawn
    towards it leads there, and a landing short of it is new. It is far if the nearest of these
    lands more than `far_distance` off, of a hand `far_of_hand` (one threw to targets 0.7 m from all
    drawn ones); then a throw that lands `farther` than that one does not count: none of 214 led
    nearer. Near a hand's target, and among obstacles, many sampled starts must lead nowhere (beside
    the reach of `hand-flip` 5 of 39 answers after 6 starts were false, none of 34 after 16); with a
    library of `dense` throws or more a target is out of reach also if one start leads nowhere and
    the nearest landing agrees with another: their distances are within a factor of `equal_ratio`,
    and they are nearer to each other than `same_side` of that; nearer than `close_distance` also
    the drawn throws lead nowhere (4 of 17 were false there), of a hand nearer than `close_of_hand`
    also many sampled ones (two of 46 such answers were false, 25 and 95 mm off). Inside the base
    column the search ends with a landing of a led throw, or after `column_approaches`. An approach
    that limits hold farther off than `hopeless` times the nearest landing of an NLP ends, and of
    two landings that are evidence the second is nearer than that. dense: throws of a library whose
    reach is known by them; dense_in_x: with theta open. beyond_share: of the distance between a
    target out of reach and its nearest landing, within which other targets are out of reach, too.
    """

    moves: int = 4
    moves_for_choice: int = 6
    max_distance: float = 0.15
    warm_distance: float = 0.06
    near_distance: float = 0.005
    comparable: float = 1.02
    first_starts: int = 1
    approaches: int = 2
    leads: int = 3
    found_distance: float = 0.05
    same_distance: float = 0.005
    close_distance: float = 0.015
    close_of_hand: float = 0.2
    column_approaches: int = 2
    far_distance: float = 0.3
    far_of_hand: float = 2.0
    farther: float = 0.2
    equal_ratio: float = 1.1
    same_side: float = 0.5
    hopeless: float = 3.0
    dense: int = 1000
    dense_in_x: int = 100
    beyond_share: float = 0.5


SETTINGS = SearchSettings()


def agree(misses: Iterable[tuple[float, float]], lever: float) -> bool:
    """Whether the nearest landing to a target and another agree, as evidence that no throw comes
    nearer.

    misses: of landings from the target, dx [m] and dtheta [rad]; lever [m]: as of `Pose.distance`.
    """
    ends = sorted((abs(dx) + lever * abs(turn), dx, lever * turn) for dx, turn in misses)
    if len(ends) < 2:
        return False
    (least, x, theta), *others = ends
    return any(
        missed <= SETTINGS.equal_ratio * least
        and abs(dx - x) + abs(turn - theta) <= SETTINGS.same_side * least
        for missed, dx, turn in others
    )


@dataclass(frozen=True)
class BeyondReach:
    """A target that was found to be out of reach, and the landing that was named as nearest."""

    target: Pose
    turns: Turns
    nearest: Pose

    def covers(self, task: Task) -> bool:
        """Whether a task's target is out of reach, too.

        No throw lands nearer to this target than the nearest landing, so none lands at targets
        within that distance: of one kind, in one plane, at one height. Up to `beyond_share` of it
        counts, as the landing may not be the very nearest.
        """
        target, lever = task.target, task.scene.object.half_length
        most = SETTINGS.beyond_share * self.target.distance(self.nearest, lever)
        if self.target.distance(target, lever) > most or self.turns != task.turns:
            return False
        aside = abs(self.target.plane.azimuth - target.plane.azimuth)
        alike = self.target.changed(x=target.x, y=target.y, theta=target.theta) == target
        return alike and aside < 1e-9 and self.target.kind == target.kind


@dataclass(frozen=True, eq=False)
class SearchContext:
    """Data that the searches of one scene share.

    table: gives the release table; keep: whether the library is in the cache, or stays empty.
    beyond: targets that were found to be out of reach.
    """

    problems: NlpCache
    table: Callable[[], Releases]
    keep: bool = True
    beyond: list[BeyondReach] = field(default_factory=list)

    def from_state(self, manipulator: Manipulator) -> SearchContext:
        """The context of a manipulator that begins in another state of motion.

        It shares NLPs and table, but has no library, whose throws begin at rest.
        """
        problems = self.problems.from_state(manipulator)
        return replace(self, problems=problems, keep=False, beyond=[])

    @cached_property
    def library(self) -> Library:
        """The scene's solved throws that the cache has."""
        return Library(self.problems.scene, self.problems.manipulator, keep=self.keep)

    @cached_property
    def found(self) -> Library:
        """Throws that plans have found, also at the reach's boundary; in memory only."""
        return Library(self.problems.scene, self.problems.manipulator, keep=False)

    def remember(self, attempt: Attempt) -> None:
        """Keeps a solver's throw for later plans, to start from.

        It keeps none that lands beside another of its kind.
        """
        throw, edge, found = attempt.throw, attempt.edge, self.found
        if throw is None or (attempt.goal.theta is not None) != found.angle:
            return
        landing = throw.deciding.landing
        pose = attempt.goal.nearest(landing.x, landing.theta) if edge is None else edge.pose
        optimum = fixed_optimum(found.controls, throw, () if edge is None else edge.names)
        beside = found.nearest_throws(pose, "exact", 2, SETTINGS.same_distance)
        if optimum is None or any(
            bool(one.optimum.binding) == (edge is not None) for one in beside
        ):
            return
        found.add([found.record(optimum, (pose.plane_x, pose.theta or 0.0), solved=True)])

    @cached_property
    def corrector(self) -> Corrector:
        """Moves solved throws."""
        return Corrector(self.library.controls, self.problems)
