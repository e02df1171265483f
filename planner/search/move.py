"""A solved throw moved to a target nearby by Newton steps on the exact throw, without an NLP.

`Optimum.slope` says how the free numbers of an optimum move with its target while the active limits
stay active. Along these one or two directions the compiled core brings the exact throw to the
target. The throw is then checked as any other, since limits may break on the way.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ...core import Structure, array, library, out, sampled
from ...models import Array, Trajectory
from ...models.release import STEPPED_SURFACE, Release, compiled_release
from ..ocp import CondensedQp, Margins, Optimum, ReducedVariables, Request, Solution, effort_of
from ..result import PlannedThrow
from ..throw import TICK, Samples, SmoothingError, Throw, case_of, send
from ..verdict import verdict_on
from .attempts import Exact, Outcome, accuracy, error_over
from .decision_vectors import guess_of
from .library import Neighbour
from .nlp_cache import CompiledNlp, NlpCache, Task

#: Most exact throws of one move, the first included.
THROWS = 6
#: The next step is cut to half or less if a throw misses by over this share of the least miss.
MIN_PROGRESS = 0.9
#: Most nodes of a release besides those at kinks of the motion, as in core/release.c.
MAX_NODES = 800
#: Name of the solver of an attempt by correction.
CORRECTOR = "corrector"


@dataclass(frozen=True)
class Corrector:
    """Moves optima of a scene to targets nearby: controls, motion, samples, exact throw and Newton
    steps in C.

    Along the slope of `u` these bring the exact throw to the goal; their matrix is learnt from the
    throws themselves (Broyden's method). They know no constraints.
    """

    controls: ReducedVariables
    problems: NlpCache

    def throw_of(self, optimum: Optimum, task: Task) -> PlannedThrow:
        """An optimum's throw."""
        planned, opening_time = self.controls.motion(optimum.u)
        final = Throw(task.scene, self.problems.manipulator, planned, opening_time)
        return PlannedThrow(planned, final, optimum.effort, optimum.nlp_size, optimum.refinement)

    def start(self, near: Neighbour, task: Task) -> Exact:
        """A solver's start from an optimum that lands near its goal."""
        optimum = near.optimum
        guess = guess_of(self.throw_of(optimum, task))
        return Exact(near.goal, guess, optimum.refinement, optimum.smoothing)

    def attempt(self, near: Neighbour, task: Task) -> Outcome:
        """The throw to the goal of an optimum near it, along its slope."""
        return self.moved(near, task)[0]

    def moved(self, near: Neighbour, task: Task) -> tuple[Outcome, Array | None]:
        """The throw to the goal of an optimum near it, along its slope, and its `u`."""
        one = Outcome(near.goal, near.optimum.refinement, solver=CORRECTOR)
        task.budget.counts["solves"] += 1
        with task.budget("smooth"):
            throw, u = self._moved(near, task) or self._unmoved(near, task) or (None, None)
        if throw is None:
            return one, None
        with task.budget("check"):
            judged = verdict_on(throw.deciding, near.goal)
        return replace(one, throw=throw, verdict=judged, pose=near.goal, missed=0.0), u

    def _moved(self, near: Neighbour, task: Task) -> tuple[PlannedThrow, Array] | None:
        """The throw that lands at the goal, by the model that counts, and its `u`; None without."""
        move, (found, room), optimum = self._fixed, self._buffers, near.optimum
        manipulator, goal = self.problems.manipulator, near.nearest
        move.errors, move.aim = optimum.slope.shape[1], accuracy(task.scene)
        move.off = near.miss
        u, slope = (np.ascontiguousarray(v, float) for v in (optimum.u, optimum.slope))
        move.u, move.slope = array(u, move.size), array(slope, move.size, move.errors)
        # The core's landings are the release model's, without the bias of [calibration].
        dx, dtheta = self.problems.scene.flight.bias or (0.0, 0.0)
        theta = 0.0 if goal.theta is None else goal.theta
        move.goal = goal.plane_x - dx, goal.z, theta - dtheta
        if library().move_throw(move, found) <= 0:
            return None
        breaks, cubics = room["breaks"].copy(), room["cubics"].copy()
        nodes = room["nodes_at"][: found.nodes]
        planned, release = Trajectory(breaks, cubics, breaks), Release.from_nodes(nodes)
        if not move.surface:
            release = Release.from_nodes(nodes, list(found.onset), bool(found.lost))
        samples, u = self._sent(), room["u"].copy()
        opens = self.controls.opening_time(u)
        thrown = Throw.sent(task.scene, manipulator, samples, opens).released(release)
        effort, size = effort_of(self.controls.request, planned), optimum.nlp_size
        throw = PlannedThrow(planned, thrown, effort, size, optimum.refinement, optimum=optimum)
        return throw, u

    def _unmoved(self, near: Neighbour, task: Task) -> tuple[PlannedThrow, Array] | None:
        """The throw as it is where that lands at the goal, smoothed to the limits by Ruckig."""
        if error_over(*near.miss, accuracy(task.scene)) > 1.0:
            return None
        throw, manipulator = self.throw_of(near.optimum, task), self.problems.manipulator
        try:
            samples = send(manipulator, throw.planned)
        except SmoothingError:
            return None
        opens = throw.opening_time
        thrown = Throw.sent(task.scene, manipulator, samples, opens)
        return replace(throw, deciding=thrown, optimum=near.optimum), near.optimum.u

    @cached_property
    def _fixed(self) -> Structure:
        """The arguments that are equal for all moves."""
        scene, manipulator = self.problems.scene, self.problems.manipulator
        # Its motion and delay are those of each move.
        rest = Trajectory.accelerating(np.zeros(manipulator.size))
        release = compiled_release(case_of(scene, manipulator.hand(rest)))
        found = self.controls.core.copy()
        found.surface, found.throws = scene.tolerance.model == STEPPED_SURFACE, THROWS
        found.nearer, found.gravity = MIN_PROGRESS, scene.gravity
        found.attach(limits=manipulator.hard.core, release=release)
        return found

    @cached_property
    def _buffers(self) -> tuple[Structure, dict[str, Array]]:
        """Room for the largest result, and its arrays."""
        controls, manipulator = self.controls, self.problems.manipulator
        longest = controls.durations[1] + float(np.ptp(controls.request.nodes))
        room = math.ceil((longest + manipulator.hard.longest_brake) / TICK) + 4
        n, stages, size = manipulator.size, self._fixed.stages, controls.size
        rows = MAX_NODES + 4 * room
        shapes = {
            "u": (size,),
            "breaks": (stages + 1,),
            "cubics": (4, n, stages, 1),
            "times": (room,),
            "curves": (6 * n * room,),
            "kinks": (4 * room,),
            "nodes_at": (rows, 7),
        }
        arrays = {name: np.zeros(shape) for name, shape in shapes.items()}
        found = Structure("moved", room=room, stages=stages, size=size, release_room=rows)
        found.attach(**{name: out(arrays[name], *shape) for name, shape in shapes.items()})
        arrays["samples"] = np.zeros((3, room, n))
        found.sent = sampled(TICK, *arrays["samples"])
        return found, arrays

    def _sent(self) -> Samples:
        """The samples that are sent."""
        found, room = self._buffers
        rows, n = found.sent.rows, self.problems.manipulator.size
        samples = room["samples"][:, :rows]
        curves = room["curves"][: 6 * n * (rows - 1)].reshape(6, n, rows - 1, 1)
        arrays = samples, room["times"][:rows], curves, room["kinks"][: found.corners]
        return Samples.known(*(array.copy() for array in arrays))


def optimum_of(
    controls: ReducedVariables, program: CompiledNlp, throw: PlannedThrow
) -> Optimum | None:
    """The optimum of a throw; None without a solution of an NLP for a pose."""
    solution, layout = throw.solution, throw.layout
    if solution is None or layout is None or any(layout.structure.ranges):
        # In a region the landing is chosen by the optimum.
        return throw.optimum
    if not controls.fits(layout):
        return None
    aim = throw.deciding.target.shifted(*throw.aim)
    request = Request(throw.scene, throw.manipulator, aim, throw.refinement)
    try:
        slope = condensed_at(controls, program, request, solution).slope
    except np.linalg.LinAlgError:
        return None
    lands, exact = throw.planned_landing, throw.exact.landing.pose
    margins = {name: max(value, 0.0) for name, value in throw.refinement.margins.values}
    return Optimum(
        solution.x[controls.places(layout)],
        slope,
        throw.deciding.release.end,
        throw.effort,
        layout.size,
        (lands[0] - exact[0], lands[2] - exact[2]),
        replace(throw.refinement, margins=Margins(**margins)),
    )


def condensed_at(
    controls: ReducedVariables, program: CompiledNlp, request: Request, point: Solution
) -> CondensedQp:
    """The NLP of a request about a point, in the free numbers; LinAlgError where it is singular."""
    numbers, places = program.nlp.parameter_values(request), controls.places(program.nlp)
    return CondensedQp.about(program.solver, point, numbers, program.limits, places)
