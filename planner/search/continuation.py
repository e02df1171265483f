"""Moves a solved throw to a target nearby, in steps within the limits.

Each step is the solution of the condensed NLP (`CondensedQp`), about the last one's point.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ...models import Array
from ..library import Neighbour
from ..ocp import CondensedQp, Optimum, Refinement, Request, Solution, Step, ThrowNlp
from ..throw import Throw
from .attempt import Attempt, accuracy, error_over
from .guess import guess_of
from .move import Corrector, condensed_at
from .nlp_cache import CompiledNlp, Task


@dataclass(frozen=True)
class StepSettings:
    """Settings of the continuation.

    max_steps, max_throws: most steps, and throws brought to the goal. max_error, always_accept:
    a step is accepted if the pose error of its predicted landing is below this share of the step's
    own length, or below this [m]; else it is shortened by `shrink`, and given up below
    `min_length`, a share of the longest step. min_gain [m]: ends when limits hold a step short of
    the goal and it leads nearer than the last one by less than this pose error.
    """

    max_steps: int = 12
    max_throws: int = 6
    max_error: float = 1.0
    always_accept: float = 0.05
    shrink: float = 0.5
    min_length: float = 0.002
    min_gain: float = 0.005


SETTINGS = StepSettings()


@dataclass(frozen=True, eq=False)
class _Point:
    """A point of the continuation.

    optimum: the throw there; off: its landing from the goal (dx [m], dtheta [rad]); nlp, x: a point
    of the NLP, whose states stay free between steps (lifted Newton), None before the first; trust:
    longest step, as a share; du: the first guess of the next step; missed [m]: pose error at which
    limits hold the step short of the goal, 0 where it reaches it.
    """

    optimum: Optimum
    off: Array
    du: Array
    nlp: ThrowNlp | None = None
    x: Array | None = None
    trust: float = 1.0
    missed: float = 0.0


@dataclass(frozen=True, eq=False)
class SqpContinuation:
    """Steps from an optimum near a goal towards it, within all limits.

    The throw of a step is brought to the goal along the limits that are active there.
    """

    corrector: Corrector
    near: Neighbour
    task: Task

    def attempts(self) -> Iterator[Attempt]:
        """Attempts to throw to the goal; none where limits end the way to it."""
        optimum, off = self.near.optimum, np.array(self.near.miss)
        refinement, slope = optimum.refinement, optimum.slope
        point = _Point(optimum, off, slope @ -off[: slope.shape[1]])
        throws, missed = 0, math.inf
        for _ in range(SETTINGS.max_steps):
            found = self._step(self._program(refinement), refinement, point)
            if found is None or throws == SETTINGS.max_throws:
                return
            point, step = found
            if not point.missed:
                beside = Neighbour.of(point.optimum, self.near.goal, self.task.scene)
                attempt = self.corrector.attempt(beside, self.task)
                throws, refinement = throws + 1, attempt.after
                yield attempt
                if attempt.solved:
                    return
            elif step.full:
                gain, missed = missed - point.missed, point.missed
                if gain < SETTINGS.min_gain:
                    return

    def _program(self, refinement: Refinement) -> CompiledNlp:
        problems, goal = self.corrector.problems, self.near.goal
        return problems.problem(goal, refinement, "fatrop", self.task.clock)

    def _step(
        self, program: CompiledNlp, refinement: Refinement, point: _Point
    ) -> tuple[_Point, Step] | None:
        """The point after a step, and the step; None without one."""
        task, nlp, controls = self.task, program.nlp, self.corrector.controls
        manipulator = self.corrector.problems.manipulator
        throw = self.corrector.throw_of(point.optimum, task)
        x = point.x
        if x is None or nlp is not point.nlp:
            with task.clock("guess"):
                x = guess_of(throw, task.scene)(nlp)
        near = throw.exact if nlp.linearised else None
        aim = self.near.goal.shifted(*self.near.optimum.smoothing)
        request = Request(task.scene, manipulator, aim, refinement, reference=near)
        places = controls.places(nlp)
        with task.clock("solve"), contextlib.suppress(np.linalg.LinAlgError):
            condensed = condensed_at(controls, program, request, Solution.none(x))
            found = self._accepted(condensed, places, point)
            if found is None:
                return None
            trust, step, x, exact, off = found
            dx, dtheta = map(float, step.residual)
            short = error_over(dx, dtheta, accuracy(task.scene)) > 1.0
            missed = task.scene.object.pose_error(dx, dtheta) if short else 0.0
            u = controls.within(x[places])
            optimum = replace(point.optimum, u=u, refinement=refinement)
            if not short:
                # This point is thrown next.
                detach, effort = exact.deciding.release.end, controls.effort(exact.path)
                optimum = replace(optimum, slope=step.slope, detach=detach, effort=effort)
            trust = min(2 * trust, 1.0)
            return _Point(optimum, off, 0 * point.du, nlp, x, trust, missed), step
        return None

    def _accepted(
        self, condensed: CondensedQp, places: list[int], point: _Point
    ) -> tuple[float, Step, Array, Throw, Array] | None:
        """The longest step whose landing is near its prediction, as in trust region methods.

        Returns its share of the full length, the step, its point, throw and landing off the goal.
        """
        task, controls, trust, du = self.task, self.corrector.controls, point.trust, point.du
        pose_error, manipulator = task.scene.object.pose_error, self.corrector.problems.manipulator
        while trust > SETTINGS.min_length and not task.clock.late:
            step = condensed.step(du, trust, task.scene.object.half_length)
            if step is None:
                return None
            x = condensed.point + condensed.dx_du @ step.du
            exact = Throw(task.scene, manipulator, *controls.motion(controls.within(x[places])))
            off = np.array(exact.miss(self.near.goal))
            error, length = (pose_error(*(v - step.residual)) for v in (off, point.off))
            if error <= max(SETTINGS.max_error * length, SETTINGS.always_accept):
                return trust, step, x, exact, off
            trust, du = SETTINGS.shrink * trust, 0 * du
        return None
