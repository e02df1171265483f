"""What the search for one plan knows: solved throws near its target, samples, approaches, and
whether the target is out of reach."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from heapq import merge
from itertools import islice
from operator import attrgetter

from ...problems import Pose
from ..library import Library, Neighbour
from ..ocp import BASE, Optimum, Refinement
from ..result import PlannedThrow
from .attempt import Attempt, Start
from .candidates import MANY_STARTS, REGION_STARTS, Candidates, release_start
from .context import SETTINGS, BeyondReach, SearchContext, agree
from .feasibility import in_column
from .history import PRICES, Approach, History, Solve, Try
from .move import optimum_of
from .nlp_cache import Task


@dataclass(frozen=True, eq=False)
class Search:
    """The search for one plan; warm: a throw to a target near the task's.

    Where a solver is named, no throw is moved.
    """

    context: SearchContext
    task: Task
    warm: PlannedThrow | None = None

    def neighbours(self) -> Iterator[Neighbour]:
        """Solved throws near the target: the warm plan's and the library's, nearest first."""
        context = self.context
        near = self._nearest(context.library, self.moves)
        # For targets that an earlier plan named as the nearest possible: its throw lands there.
        same = SETTINGS.same_distance
        named = (one for one in self._nearest(context.found, 2, same) if one.optimum.binding)
        boundary = (one for one in self.boundary if one.distance < same)
        found = self._warm_neighbour, named, boundary, near
        return merge(*found, key=lambda one: one.distance)

    def _nearest(
        self, throws: Library, count: int, within: float = SETTINGS.max_distance
    ) -> Iterator[Neighbour]:
        """At most `count` solved throws with a pose error below `within` [m], nearest first."""
        return throws.nearest_throws(self.task.target, self.task.turns, count, within)

    @property
    def moves(self) -> int:
        """Most neighbours that are moved."""
        wanted = self.task.wanted
        return SETTINGS.moves if wanted == 1 else SETTINGS.moves_for_choice * wanted

    @property
    def earlier(self) -> Neighbour | None:
        """The nearest throw of an earlier plan, if it lands near the target."""
        return next(self._nearest(self.context.found, 1, SETTINGS.found_distance), None)

    @cached_property
    def _warm_neighbour(self) -> list[Neighbour]:
        """The warm plan's optimum, if it lands near enough."""
        warm, task = self.warm, self.task
        optimum = None if warm is None else self._optimum(warm)
        if optimum is None:
            return []
        near = Neighbour.of(optimum, task.target, task.scene)
        return [near] if near.distance < SETTINGS.warm_distance else []

    def _optimum(self, throw: PlannedThrow) -> Optimum | None:
        if throw.optimum is not None or throw.solution is None:
            return throw.optimum
        problems, target = self.context.problems, throw.deciding.target
        program = problems.problem(target, throw.refinement, "fatrop", self.task.clock)
        return optimum_of(self.context.library.controls, program, throw)

    def is_complete(self, history: History) -> bool:
        """Whether there are as many throws as the task wants.

        Of throws to a region the cheapest is wanted, unless a warm plan or the library leads there.
        """
        if len(history.found) < self.task.wanted or not self.task.target.is_region:
            return len(history.found) >= self.task.wanted
        warm, known = (len(history.solves_from(name)) for name in ("warm plan", "neighbour"))
        tries = len(history.tries)
        return warm > 0 or known >= SETTINGS.moves or tries >= REGION_STARTS

    def limited(self, step: Try, history: History) -> Try:
        """A try that ends early where it leads to no cheaper throw into a region, or no nearer."""
        if isinstance(step, Approach) and history.new_edges:
            step = replace(step, most=SETTINGS.hopeless * history.new_edges[0].missed)
            if step.drawn:
                ends = (
                    one.edge for one in history.attempts if one.is_edge and one.edge is not None
                )
                far = (one.pose for one in ends if one.missed > SETTINGS.same_distance)
                step = replace(step, known=tuple(far))
            return step
        is_compared = self.task.target.is_region and self.task.wanted == 1 and history.found
        if not isinstance(step, Solve) or not is_compared:
            return step
        assert history.found[0].throw is not None
        most = SETTINGS.comparable * history.found[0].throw.effort
        return replace(step, start=replace(step.start, below=most))

    def start(self, near: Neighbour) -> Start:
        """A solver's start from a solved throw near the target."""
        return self.context.corrector.start(near, self.task)

    @cached_property
    def candidates(self) -> Candidates:
        """The table's releases as starts."""
        with self.task.clock("build"):
            table = self.context.table()
        return Candidates(table, self.task, self.context.problems.manipulator)

    @cached_property
    def blocked(self) -> bool:
        """Whether the bar would be inside the base column at the target."""
        return in_column(self.task.scene, self.task.target)

    def refinement(self, history: History) -> Refinement:
        """Refinement of the next NLP from another motion."""
        return history.refinement(Refinement(frozenset({"passing"})) if self.blocked else BASE)

    def approaches(self) -> Iterator[Approach]:
        """Approaches, in order.

        From a large library; from throws of earlier plans and samples; from releases drawn towards
        the target; from a small library; last from its nearest throw with all that constraints
        cost.
        """
        if not self.is_sparse and not self.blocked:
            yield from self.stored
        yield from self.nearby
        if self.blocked:
            yield from self.stored
            return
        yield from self.drawn
        if self.is_sparse:
            yield from self.stored
        nearest = sorted(self.stored, key=attrgetter("away"))[: SETTINGS.first_starts]
        yield from (replace(one, light=False) for one in nearest)

    @cached_property
    def nearby(self) -> list[Approach]:
        """Approaches from throws of earlier plans and from sampled ones that break nothing where
        they land, nearest first."""
        task, context = self.task, self.context
        found = list[Approach]()
        if not task.names_solver:
            for near in self._nearest(context.found, SETTINGS.approaches, math.inf):
                found.append(Approach(near.goal, near, near.distance, found=True))
        table = self.candidates.arriving.releases
        for number, (index, goal, pose) in enumerate(self.candidates.judged):
            start = release_start(context.problems, task, table, index, goal)
            away = goal.distance(pose, task.scene.object.half_length)
            start = replace(start, goal=pose, again=True)
            found.append(Approach(goal, start, away, turns=number == 1))
        return sorted(found, key=attrgetter("away"))

    @cached_property
    def drawn(self) -> list[Approach]:
        """Approaches from releases drawn towards the target, those that are evidence first."""
        problems, task, least = self.context.problems, self.task, self._drawn_within
        most = least + SETTINGS.farther if self.is_far else math.inf
        found = [
            Approach(
                goal,
                release_start(problems, task, table, index, goal),
                math.inf,
                drawn=True,
                evident=away <= most,
            )
            for table, index, goal, away in self.candidates.drawn
        ]
        return sorted(found, key=lambda one: not one.evident)

    @property
    def is_far(self) -> bool:
        """Whether all releases drawn towards the target land far from it."""
        is_hand = self.task.scene.robot is None
        return self._drawn_within > (SETTINGS.far_of_hand if is_hand else SETTINGS.far_distance)

    @property
    def _drawn_within(self) -> float:
        """Pose error [m] of the nearest drawn release; 0 if there are none."""
        return min((away for *_, away in self.candidates.drawn), default=0.0)

    @property
    def is_sparse(self) -> bool:
        """Whether the library has too few throws to show how far the reach goes."""
        library = self.context.library
        if library.angle != (self.task.target.theta is not None):
            return True
        return len(library) < (SETTINGS.dense if library.angle else SETTINGS.dense_in_x)

    @cached_property
    def stored(self) -> list[Approach]:
        """Approaches from the library: from the boundary of the reach, then from other throws.

        They end before costly constraints: other starts may need none. From solved throws the first
        price gains nothing.
        """
        if self.task.names_solver:
            return []
        others = self._nearest(self.context.library, SETTINGS.approaches, math.inf)
        return [
            Approach(near.goal, near, near.distance, light=True, prices=PRICES[-1:])
            for near in (*self.boundary, *others)
        ]

    @cached_property
    def boundary(self) -> list[Neighbour]:
        """The nearest throw of the library's boundary, if there is one: even far from the target,
        as its motion is often of another kind."""
        task = self.task
        return list(self.context.library.nearest_of_boundary(task.target, task.turns, 1))

    @cached_property
    def ends(self) -> list[Neighbour]:
        """The nearest throws of the library, its boundary among them: those that are led to the
        target, and one more."""
        count = SETTINGS.leads + 1
        inside = self._nearest(self.context.library, count, math.inf)
        near = merge(self.boundary, inside, key=lambda one: one.distance)
        return list(islice(near, count))

    def is_settled(self, history: History) -> bool:
        """Whether the target is out of reach.

        The evidence counts only if no throw of the library that was not led, nor a sampled one that
        arrives as a throw to the target would, is nearer than the nearest landing.
        """
        if not history.edges:
            return False
        stored, least = self._stored(history), history.edges[0].missed
        is_evident = self._is_known(history, least) or self._is_evident(history, least)
        if not is_evident or self._may_pass(history):
            return False
        sampled = [away for _, _, away in self.candidates.arriving.nearest]
        return self._is_nearest(least, [one.distance for one in stored] + sampled)

    def is_short_cut(self, history: History) -> bool:
        """Whether an earlier plan shows that the target is out of reach, and no throw has been
        brought near it yet, which then suffices."""
        return bool(self._beyond) and not history.approaches

    @cached_property
    def _beyond(self) -> list[BeyondReach]:
        """Targets of earlier plans that show that this one is out of reach."""
        if self.task.names_solver or self.blocked:
            return []
        return [one for one in self.context.beyond if one.covers(self.task)]

    def _is_known(self, history: History, least: float) -> bool:
        """Whether an earlier plan shows that the target is out of reach, a throw was brought near
        it, and no throw of an earlier plan lands nearer than `least` [m]."""
        if not self._beyond or not history.is_approached or least < self.sure_distance:
            return False
        target, lever = self.task.target, self.task.scene.object.half_length
        named = [target.distance(one.nearest, lever) for one in self._beyond]
        known = [one.distance for one in self._nearest(self.context.found, 1, math.inf)]
        return self._is_nearest(least, named + known)

    def _is_evident(self, history: History, least: float) -> bool:
        """Whether many sampled throws lead nowhere, or with a dense library one does and the
        nearest landings agree.

        One of the landings is new, as throws of earlier plans may be alike. If the nearest, `least`
        [m] off, is close to the target, landings that agree are evidence only beside many samples,
        and millimetres from it nothing is.
        """
        if least < SETTINGS.same_distance:
            return False
        is_started = bool(history.solves_from("samples"))
        are_alike = is_started and not self.is_sparse and self.are_alike(history)
        is_hand = self.task.scene.robot is None
        close = SETTINGS.close_of_hand if is_hand else SETTINGS.close_distance
        if are_alike and least >= close:
            return True
        is_short = least >= self.sure_distance and self._are_two(history)
        is_short = is_short and (self._is_far(history) or self._is_new(history))
        return (are_alike or is_short) and self.are_starts_vain(history)

    @property
    def sure_distance(self) -> float:
        """Least pose error [m] of the nearest landing for which sampled throws that lead nowhere
        are evidence."""
        return SETTINGS.same_distance if self.task.scene.cup is None else SETTINGS.close_distance

    def are_starts_vain(self, history: History) -> bool:
        """Whether many sampled throws led nowhere: those drawn towards the target; of a hand near
        it, and among obstacles, many starts."""
        is_hand, is_far = self.task.scene.robot is None, self._is_far(history)
        if self.task.scene.obstacle or (is_hand and not is_far):
            starts = min(MANY_STARTS, len(self.candidates.different))
            return len(history.solves_from("samples")) >= starts
        if not history.drawn:
            return False
        return history.drawn >= sum(one.evident or not is_far for one in self.drawn)

    def are_alike(self, history: History) -> bool:
        """Whether the nearest landings agree, one of them new; or the nearest new ones do."""
        nearest: list[Attempt | Neighbour] = [*history.edges, *self._stored(history)]
        return self._is_new(history) and (self._agree(nearest) or self._agree(history.new_edges))

    def _is_new(self, history: History) -> bool:
        """Whether the nearest landing, or one about as near, is of a new throw."""
        new = history.new_edges
        return bool(new) and new[0].missed <= SETTINGS.equal_ratio * history.edges[0].missed

    def _are_two(self, history: History) -> bool:
        """Whether new throws land short of the target twice, one not much farther off than the
        other; far from it, any throws."""
        if self._is_far(history) and len(history.edges) > 1:
            return True
        missed = [one.missed for one in history.new_edges]
        return len(missed) > 1 and missed[1] <= SETTINGS.hopeless * missed[0]

    def _is_far(self, history: History) -> bool:
        """Whether the target is far, and a throw landed as near to it as any drawn release.

        Not before releases are drawn, which takes a tenth of a second.
        """
        if not history.drawn or not history.edges or self.task.scene.obstacle or not self.is_far:
            return False
        return self._is_nearest(history.edges[0].missed, [self._drawn_within])

    def _is_nearest(self, least: float, known: list[float]) -> bool:
        """Whether no known throw lands nearer to the target than `least` [m]."""
        most = SETTINGS.equal_ratio * min(known, default=math.inf)
        return least <= most + self.task.scene.tolerance.position

    def _stored(self, history: History) -> list[Neighbour]:
        """The library's nearest throws, but those that were led to the target."""
        return self.ends[history.leads :]

    def _agree(self, ends: Sequence[Attempt | Neighbour]) -> bool:
        """Whether the nearest landing and another agree (`agree`)."""
        return agree((one.miss for one in ends), self.task.scene.object.half_length)

    def is_nearest_possible(self, history: History) -> bool:
        """Whether the nearest landing, once no try is left, is the nearest possible.

        Millimetres from it another motion may still reach the target. Throws of earlier plans alone
        show nothing, nor does one landing where all other approaches found no motion. No throw of
        the library may land nearer.
        """
        least = history.edges[0].missed
        ended = least >= self.sure_distance and not self.task.clock.late
        ended = self.blocked or (ended and self._are_two(history))
        is_nearest = self._is_nearest(least, [one.distance for one in self._stored(history)])
        ends = ended and is_nearest and not self._may_pass(history)
        return ends or self.is_settled(history)

    def _may_pass(self, history: History) -> bool:
        """Whether another way past the scene's obstacles may lead to the target.

        A throw that lands there meets nothing but them, and no two landings short of it agree.
        """
        if not self.task.scene.obstacle or self._agree(history.new_edges):
            return False
        return any(one.meets_at < history.edges[0].missed for one in history.attempts)

    def remember(self, history: History) -> None:
        """Keeps the throws found, or the nearest landing, for later plans."""
        solved = (one for one in history.edges if one.throw is not None and one.throw.layout)
        for attempt in history.found or islice(solved, 1):
            self.context.remember(attempt)

    def remember_beyond(self, nearest: Pose) -> None:
        """Keeps that the target is out of reach, and the landing that is named as nearest.

        Not if an earlier plan shows it, so that errors do not add up.
        """
        task = self.task
        if not (self._beyond or self.blocked or task.target.is_region or task.names_solver):
            self.context.beyond.append(BeyondReach(task.target, task.turns, nearest))
