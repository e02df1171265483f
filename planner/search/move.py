"""A solved throw moved to a target nearby, by the throw itself instead of a solver.

`Optimum.slope` says how the free numbers of an optimum move with its target while the active limits
stay active. Along these one or two directions `ThrowFamily` brings the exact throw to the
target. The throw is then checked as any other, since limits may break on the way.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...models import Array
from ...problems import Pose
from ..library import Neighbour
from ..ocp import CondensedQp, Layout, Margins, Optimum, ReducedVariables, Request, Solution
from ..result import PlannedThrow
from ..throw import Manipulator, Throw
from ..verdict import Verdict, verdict
from .attempt import Attempt, Start, accuracy
from .compiled_move import MovedThrow, ThrowFamily
from .guess import initial_guess_from
from .nlp_cache import CompiledNlp, NlpCache, Task

#: Most NLPs solved from an optimum, each refined by the check of the one before.
TRIES = 2
#: Name of the solver of an attempt by correction.
CORRECTOR = "corrector"


@dataclass(frozen=True)
class Corrector:
    """Moves optima of a scene to targets nearby."""

    controls: ReducedVariables
    problems: NlpCache

    def attempt(self, near: Neighbour, task: Task) -> Attempt:
        """An attempt to throw to the goal of an optimum near it, along its slope."""
        optimum = near.optimum
        start = optimum.u, optimum.slope, np.array(near.miss)
        return self.attempt_from(start, near, optimum, task)

    def attempt_from(
        self, start: tuple[Array, Array, Array], near: Neighbour, optimum: Optimum, task: Task
    ) -> Attempt:
        """An attempt at the goal of `near`; start: u, slope and miss that it moves from."""
        found: PlannedThrow | None = None
        judged: Verdict | None = None
        reason = "a solved throw nearby does not move to the target"
        with task.clock("smooth"):
            moved = self._family.moved(*start, near.nearest, accuracy(task.scene))
        if moved is not None:
            found = self._planned_throw(moved, optimum, task)
            with task.clock("check"):
                judged = verdict(found.deciding, near.goal)
            reason = judged.words
        return Attempt(near.goal, optimum.refinement, CORRECTOR, found, judged, reason, 0, 1)

    def _planned_throw(self, moved: MovedThrow, optimum: Optimum, task: Task) -> PlannedThrow:
        """The core's motion, samples and release as a planned throw."""
        controls, manipulator = self.controls, self.problems.manipulator
        opens = controls.opening_time(moved.u)
        thrown = Throw.sent(task.scene, manipulator, moved.planned, moved.samples, opens)
        final, effort = thrown.released(moved.release), controls.effort(moved.planned)
        size, refinement = optimum.nlp_size, optimum.refinement
        return PlannedThrow(moved.planned, final, effort, size, refinement, optimum=optimum)

    @cached_property
    def _family(self) -> ThrowFamily:
        """The throws that the free numbers give, for the compiled core."""
        return ThrowFamily(self.controls)


def throw_of(
    controls: ReducedVariables, manipulator: Manipulator, optimum: Optimum, task: Task
) -> PlannedThrow:
    """An optimum's throw."""
    planned, opening_time = controls.motion(optimum.u)
    final = Throw(task.scene, manipulator, planned, opening_time)
    return PlannedThrow(planned, final, optimum.effort, optimum.nlp_size, optimum.refinement)


def moved_start(
    controls: ReducedVariables, manipulator: Manipulator, optimum: Optimum, goal: Pose, task: Task
) -> Start:
    """A start for a solver from an optimum that lands near `goal`."""
    throw = throw_of(controls, manipulator, optimum, task)
    request = Request(task.scene, manipulator)
    return Start(
        goal,
        lambda nlp: initial_guess_from(nlp, throw, request),
        task.solvers[0],
        refinement=optimum.refinement,
        tries=TRIES,
        aim=optimum.smoothing,
    )


def optimum_of(
    controls: ReducedVariables,
    program: CompiledNlp,
    throw: PlannedThrow,
    names: tuple[str, ...] = (),
) -> Optimum | None:
    """The optimum of a throw; None without a solution of an NLP for a pose.

    names: of the limits that bind there.
    """
    solution, layout = throw.solution, throw.layout
    if solution is None or layout is None or any(layout.structure.ranges):
        # In a region the landing is chosen by the optimum.
        return throw.optimum
    aim = throw.deciding.target.shifted(*throw.aim)
    request = Request(throw.scene, throw.manipulator, aim, throw.refinement)
    try:
        slope = condensed_at(controls, program, request, solution).slope
    except np.linalg.LinAlgError:
        return None
    return _optimum(controls, layout, throw, slope, names)


def condensed_at(
    controls: ReducedVariables, program: CompiledNlp, request: Request, point: Solution
) -> CondensedQp:
    """The NLP of a request about a point, in the free numbers; LinAlgError where it is singular."""
    numbers, places = program.nlp.parameter_values(request), controls.places(program.nlp)
    return CondensedQp.about(program.solver, point, numbers, program.limits, places)


def fixed_optimum(
    controls: ReducedVariables, throw: PlannedThrow, names: tuple[str, ...]
) -> Optimum | None:
    """The optimum of a throw with a slope of zero, as a start; None without a solution of an NLP.

    It takes no derivatives. names: of the limits that bind there.
    """
    if throw.layout is None or throw.solution is None:
        return None
    errors = 1 if throw.deciding.target.theta is None else 2
    return _optimum(controls, throw.layout, throw, np.zeros((controls.size, errors)), names)


def _optimum(
    controls: ReducedVariables,
    layout: Layout,
    throw: PlannedThrow,
    slope: Array,
    names: tuple[str, ...],
) -> Optimum:
    assert throw.solution is not None
    lands, exact = throw.planned_landing, throw.exact.landing.pose
    margins = {name: max(value, 0.0) for name, value in throw.refinement.margins.values}
    return Optimum(
        throw.solution.x[controls.places(layout)],
        slope,
        throw.deciding.release.end,
        throw.effort,
        layout.size,
        (lands[0] - exact[0], lands[2] - exact[2]),
        replace(throw.refinement, margins=Margins(**margins)),
        names,
    )
